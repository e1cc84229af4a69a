"""What the data say for each vertex of a surface: how far, how many, and how well they agree."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d
from matplotlib import colormaps
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_points, require_choice, require_finite, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, mesh_arrays, tensor_mesh
from o3dleaf.core.parallel import Progress, blocks, finish, run_blocks, share_out
from o3dleaf.surface.mesh.deviation import nearest_on_mesh
from o3dleaf.surface.reconstruction.proximity import BATCH, local_spacing, nearest_of
from o3dleaf.surface.reconstruction.vertex_support_loops import sum_near

REACH = 3.0
"""Radius in spacings within which data speak for a vertex: four of them in effect, some 28 in all."""

FULL = np.pi / 7 * REACH**2
"""What the weights of points at one per spacing² add up to: 2π ∫ φ(r) r dr is π/7 for Wendland's φ."""

MEASURES = ("distance", "weight", "residual")
COLOUR_MAP = "viridis"
"""Perceptually uniform: equal steps of the measure look like equal steps."""

SHOWN = 0.99
"""Share of the vertices that the colours reach; the rest have the last colour."""

BLOCK = 1 << 13


@dataclass(frozen=True, eq=False)
class Support:
    """How the data support each of n vertices; lengths in their unit.

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


def support(
    mesh: MeshLike | npt.ArrayLike,
    points: CloudLike,
    field: Field | None = None,
    *,
    spacing: float | None = None,
    tree: cKDTree | None = None,
    progress: Progress | None = None,
) -> Support:
    r"""Return how a cloud supports each vertex of a surface.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh, (vertices, triangles) or (n, 3) array_like
        The surface, or its vertices alone, in the cloud's unit.
    points : (n, 3) array_like or Open3D point cloud
        The data that the surface was made from.
    field : Field, optional
        The surface's, whose zero it is: a point's foot is then :math:`x - F \nabla F/|\nabla F|^2`, to first order and
        at most 3 s away. Left out, it is the nearest place on the mesh's triangles.
    spacing : float, optional
        s; left out, the median of `local_spacing`.
    tree : scipy.spatial.cKDTree, optional
        Of the points, where there is one.
    progress : callable, optional
        ``progress(done, total)``, in shares of the work.

    Raises
    ------
    InputError
        If an argument cannot be meant, or there are neither triangles nor a field.

    References
    ----------
    Wendland (1995), Piecewise polynomial, positive definite and compactly supported radial functions.
    """
    vertices, triangles = _parts(mesh)
    data = points_of(points, least=1)
    step = float(np.median(local_spacing(data))) if spacing is None else require_positive(spacing, "spacing")
    if field is None and not len(triangles):
        raise InputError("support: vertices alone tell no distance of the data from the surface; give the field too")
    standing, finding, summing = share_out(progress, 3, 1, 2)
    reach = REACH * step
    known = cKDTree(data) if tree is None else tree
    feet = (
        _feet(field, data, known.indices, reach, standing)
        if field is not None
        else nearest_on_mesh(vertices, triangles, data)
    )
    finish(standing)
    distance = nearest_of(known, vertices, finding)[0]
    weight, moment = _sums(vertices, feet, ((data - feet) ** 2).sum(axis=1), reach, summing)
    spoken = weight > 0
    residual = np.full(len(vertices), np.nan)
    residual[spoken] = np.sqrt(moment[spoken] / weight[spoken])
    return Support(distance, weight / FULL, residual, step)


def attach_support(
    mesh: MeshLike,
    support: Support,
    *,
    measure: str = "distance",
    colour_map: str = COLOUR_MAP,
    limits: tuple[float, float] | None = None,
) -> o3d.t.geometry.TriangleMesh:
    """Return the mesh as a tensor mesh whose vertices carry their support, and the colours of one measure of it.

    `write_mesh` keeps all of it in a PLY file, as properties of the vertices.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    support : Support
        Of its vertices; kept as float64 attributes `distance`, `weight` and `residual` (n, 1).
    measure : {"distance", "weight", "residual"}
        What the colours show.
    colour_map : str
        A colour map of Matplotlib; the default is perceptually uniform.
    limits : (least, most), optional
        Values of the first and the last colour; left out, 0 and the measure's 99 % quantile. NaN gets the last.

    Raises
    ------
    InputError
        If the support is another mesh's, or there is no such measure or colour map.
    """
    colours = support_colours(support, measure=measure, colour_map=colour_map, limits=limits)
    result = tensor_mesh(*mesh_arrays(mesh))
    if len(result.vertex.positions) != len(support.distance):
        raise InputError(
            f"support: is of {len(support.distance)} vertices, the mesh has {len(result.vertex.positions)}; "
            "ask for the support of this mesh"
        )
    for name in MEASURES:
        result.vertex[name] = o3d.core.Tensor.from_numpy(getattr(support, name)[:, np.newaxis].copy())
    result.vertex.colors = o3d.core.Tensor.from_numpy(colours)
    return result


def support_colours(
    support: Support,
    *,
    measure: str = "distance",
    colour_map: str = COLOUR_MAP,
    limits: tuple[float, float] | None = None,
) -> npt.NDArray[np.float32]:
    """Return the (n, 3) colours, from 0 to 1, of one measure of vertices' support; arguments are `attach_support`'s."""
    require_choice(measure, MEASURES, "measure")
    require_choice(colour_map, colormaps, "colour_map")
    values = getattr(support, measure)
    known = values[np.isfinite(values)]
    low, high = limits or (0.0, float(np.quantile(known, SHOWN)) if len(known) else 1.0)
    require_positive(high - low, "limits: their difference")
    share = np.clip((np.where(np.isfinite(values), values, high) - low) / (high - low), 0.0, 1.0)
    steps = colormaps[colour_map].N
    table = np.ascontiguousarray(colormaps[colour_map](np.arange(steps))[:, :3], dtype=np.float32)
    return table[np.minimum((share * steps).astype(np.int64), steps - 1)]


def _parts(mesh: Any) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return vertices and triangles, of which an array of vertices has none."""
    is_mesh = isinstance(mesh, (o3d.geometry.TriangleMesh, o3d.t.geometry.TriangleMesh))
    if is_mesh or (isinstance(mesh, tuple) and len(mesh) == 2):
        return mesh_arrays(mesh)
    return as_points(mesh, "vertices", dim=3), np.empty((0, 3), dtype=np.int64)


def _feet(field: Field, data: FloatArray, order: IntArray, longest: float, progress: Progress | None) -> FloatArray:
    """Return x − F ∇F/|∇F|² at points, but no farther than `longest` from them, where it means little.

    Asked in the `order` of a tree, points that share balls are asked for at once.
    """
    feet = np.empty_like(data)
    for i, j in blocks(len(data), BATCH):
        rows = order[i:j]
        value, slope = values_and_gradients(field, data[rows])
        steep = np.maximum(np.linalg.norm(require_finite(slope, "field gradients"), axis=1), np.finfo(np.float64).tiny)
        far = require_finite(value, "field values") / np.maximum(steep, np.abs(value) / longest)
        feet[rows] = data[rows] - (far / steep)[:, np.newaxis] * slope
        if progress:
            progress(j, len(data))
    return feet


def _sums(
    vertices: FloatArray, data: FloatArray, squares: FloatArray, radius: float, progress: Progress | None
) -> tuple[FloatArray, FloatArray]:
    """Return Σ φ and Σ φ q of `sum_near` at the vertices, data and squares q in any order."""
    low = data.min(axis=0)
    cells = np.floor((data - low) / radius)
    shape = cells.max(axis=0).astype(np.int64) + 1
    if np.prod(shape, dtype=np.float64) > 2.0**62:
        raise InputError(f"spacing: {radius / REACH:g} is nothing beside the cloud's extent; check the unit")
    i, j, k = cells.astype(np.int64).T
    keys = (i * shape[1] + j) * shape[2] + k
    order = np.argsort(keys, kind="stable")
    grid, sites, moments = (keys[order], low, shape), data[order], squares[order]
    weight, moment = np.empty(len(vertices)), np.empty(len(vertices))

    def task(start: int, stop: int) -> None:
        sum_near(start, stop, vertices, sites, moments, grid, radius, weight, moment)

    run_blocks(task, len(vertices), BLOCK, progress)
    return weight, moment
