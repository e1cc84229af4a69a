"""Support of the vertices of a surface by its data: distance, sampling density and residual."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d
from matplotlib import colormaps

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import MeshLike, mesh_arrays, tensor_mesh
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.deviation import nearest_on_mesh
from o3dleaf.surface.reconstruction.proximity import BATCH_SIZE, nearest_data
from o3dleaf.surface.reconstruction.vertex_support_loops import SortedCells, sum_kernel

REACH = 3.0
"""Radius in spacings within which data support a vertex: four of them in effect, some 28 in all."""

FULL = np.pi / 7 * REACH**2
"""What the weights of points at one per spacing² add up to: 2π ∫ φ(r) r dr is π/7 for Wendland's φ."""

MEASURES = ("distance", "weight", "residual")
COLOR_MAP = "viridis"
"""Perceptually uniform: equal steps of the measure look like equal steps."""

SHOWN = 0.99
"""Share of the vertices that the colors reach; the rest have the last color."""

BLOCK = 1 << 13


@dataclass(frozen=True, eq=False, repr=False)
class VertexSupport:
    """Support of each of n vertices by the data; lengths in their unit.

    Attributes
    ----------
    distance : (n,) ndarray
        To the nearest data point.
    weight : (n,) ndarray
        Density of the data around the vertex, Σ φ(|v − p_j|/3 s) over what it is at one point per s², p_j the foot of
        point j on the surface and φ Wendland's (1 − r)⁴ (4 r + 1): 1 where data lie as dense as the cloud's
        median, 0 where none is within 3 s.
    residual : (n,) ndarray
        How far those data lie off the surface: the root of their weighted mean square distance, NaN where there are
        none.
    spacing : float
        s, the cloud's median spacing.
    """

    distance: FloatArray
    weight: FloatArray
    residual: FloatArray
    spacing: float

    def __repr__(self) -> str:
        return f"VertexSupport({len(self.distance):,} vertices, spacing {self.spacing:.3g})"


@checked
def vertex_support(
    mesh: MeshLike | npt.ArrayLike,
    cloud: CloudLike,
    field: Field | None = None,
    *,
    measures: Sequence[str] = MEASURES,
) -> VertexSupport:
    r"""Return how a cloud supports each vertex of a surface.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh, (vertices, triangles) or (n, 3) array_like
        The surface, or its vertices alone, in the cloud's unit.
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        The data that the surface was made from.
    field : Field, optional
        The surface's, whose zero it is: a point's foot is then :math:`x - F \nabla F/|\nabla F|^2`, to first order and
        at most 3 s away. Left out, it is the nearest place on the mesh's triangles.
    measures : sequence of {"distance", "weight", "residual"}
        What is wanted. Of the distance alone, which takes a third of the time, weight and residual are NaN.

    Raises
    ------
    InputError
        If an argument cannot be meant, or there are neither triangles nor a field.

    References
    ----------
    Wendland (1995), Piecewise polynomial, positive definite and compactly supported radial functions.
    """
    for each in measures:
        require_choice(each, MEASURES, "measures")
    vertices, triangles = _parts(mesh)
    data = OrientedCloud.of(cloud)
    spacing = float(np.median(data.point_spacing))
    if field is None and not len(triangles):
        raise InputError("support: vertices alone have no surface to measure residuals from; give the field too")
    if set(measures) <= {MEASURES[0]}:
        unknown = np.broadcast_to(np.nan, len(vertices))
        return VertexSupport(nearest_data(data, vertices)[0], unknown, unknown, spacing)
    projecting, searching, summing = progress.split(3, 1, 2)
    reach = REACH * spacing
    with projecting:
        feet = _feet(field, data, reach) if field is not None else nearest_on_mesh(vertices, triangles, data.points)
    with searching:
        distance = nearest_data(data, vertices)[0]
    with summing:
        weight, moment = _sums(vertices, feet, ((data.points - feet) ** 2).sum(axis=1), reach)
    supported = weight > 0
    residual = np.full(len(vertices), np.nan)
    residual[supported] = np.sqrt(moment[supported] / weight[supported])
    return VertexSupport(distance, weight / FULL, residual, spacing)


@checked
def color_by_support(
    mesh: MeshLike,
    support: VertexSupport,
    *,
    measure: str = "distance",
    color_map: str = COLOR_MAP,
    limits: tuple[float, float] | None = None,
) -> o3d.t.geometry.TriangleMesh:
    """Return the mesh as a tensor mesh whose vertices carry their support, and the colors of one measure of it.

    `write_mesh` keeps all of it in a PLY file, as properties of the vertices.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    support : VertexSupport
        Of its vertices; kept as float64 attributes `distance`, `weight` and `residual` (n, 1).
    measure : {"distance", "weight", "residual"}
        What the colors show.
    color_map : str
        A color map of Matplotlib; the default is perceptually uniform.
    limits : (least, most), optional
        Values of the first and the last color; left out, 0 and the measure's 99 % quantile. NaN gets the last.

    Raises
    ------
    InputError
        If the support is another mesh's, or there is no such measure or color map.
    """
    colors = support_colors(support, measure=measure, color_map=color_map, limits=limits)
    result = tensor_mesh(*mesh_arrays(mesh))
    if len(result.vertex.positions) != len(support.distance):
        raise InputError(
            f"support: is of {len(support.distance)} vertices, the mesh has {len(result.vertex.positions)}; "
            "compute that of this mesh"
        )
    for name in MEASURES:
        result.vertex[name] = o3d.core.Tensor.from_numpy(getattr(support, name)[:, np.newaxis].copy())
    result.vertex.colors = o3d.core.Tensor.from_numpy(colors)
    return result


def support_colors(
    support: VertexSupport,
    *,
    measure: str = "distance",
    color_map: str = COLOR_MAP,
    limits: tuple[float, float] | None = None,
) -> npt.NDArray[np.float32]:
    """Return the (n, 3) colors, from 0 to 1, of one measure of a support; arguments are `color_by_support`'s."""
    require_choice(measure, MEASURES, "measure")
    require_choice(color_map, colormaps, "color_map")
    values = getattr(support, measure)
    known = values[np.isfinite(values)]
    low, high = limits or (0.0, float(np.quantile(known, SHOWN)) if len(known) else 1.0)
    require_positive(high - low, "limits: their difference")
    share = np.clip((np.where(np.isfinite(values), values, high) - low) / (high - low), 0.0, 1.0)
    steps = colormaps[color_map].N
    table = np.ascontiguousarray(colormaps[color_map](np.arange(steps))[:, :3], dtype=np.float32)
    return table[np.minimum((share * steps).astype(np.int64), steps - 1)]


def _parts(mesh: Any) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return vertices and triangles, of which an array of vertices has none."""
    is_mesh = isinstance(mesh, (o3d.geometry.TriangleMesh, o3d.t.geometry.TriangleMesh))
    if is_mesh or (isinstance(mesh, tuple) and len(mesh) == 2):
        return mesh_arrays(mesh)
    return as_points(mesh, "vertices", dim=3), np.empty((0, 3), dtype=np.int64)


def _feet(field: Field, data: OrientedCloud, longest: float) -> FloatArray:
    """Return x − F ∇F/|∇F|² at the data, but no farther than `longest` from them, where it means little."""
    points, order = data.points, data.tree.indices  # points in the order of a tree share balls with the next ones
    feet = np.empty_like(points)
    for i, j in blocks(len(points), BATCH_SIZE):
        rows = order[i:j]
        value, gradient = values_and_gradients(field, points[rows])
        length = np.linalg.norm(require_finite(gradient, "field gradients"), axis=1)
        steep = np.maximum(length, np.finfo(np.float64).tiny)
        far = require_finite(value, "field values") / np.maximum(steep, np.abs(value) / longest)
        feet[rows] = points[rows] - (far / steep)[:, np.newaxis] * gradient
        progress.report(j, len(points))
    return feet


def _sums(
    vertices: FloatArray, points: FloatArray, squares: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """Return Σ φ and Σ φ q of `sum_kernel` at the vertices, points and squares q in any order."""
    low = points.min(axis=0)
    steps = np.floor((points - low) / radius)
    shape = steps.max(axis=0).astype(np.int64) + 1
    if np.prod(shape, dtype=np.float64) > 2.0**62:
        raise InputError(f"spacing: {radius / REACH:g} is negligible for the cloud's extent; check the unit")
    i, j, k = steps.astype(np.int64).T
    keys = (i * shape[1] + j) * shape[2] + k
    order = np.argsort(keys, kind="stable")
    cells, sites, moments = SortedCells(keys[order], low, shape), points[order], squares[order]
    weight, moment = np.empty(len(vertices)), np.empty(len(vertices))

    def task(start: int, stop: int) -> None:
        sum_kernel(start, stop, vertices, sites, moments, cells, radius, weight, moment)

    run_blocks(task, len(vertices), BLOCK, reports=True)
    return weight, moment
