"""Cutting a surface off where it goes on past its data: no invented surface, and no hole in a random cloud."""

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_normals, as_number, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import (
    BoolArray,
    IntArray,
    MeshLike,
    build_mesh,
    drop_unused_vertices,
    require_triangles,
    triangle_areas,
)
from o3dleaf.core.parallel import Progress, finish, share_out
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import label_nodes, label_triangles
from o3dleaf.surface.reconstruction.along_mesh import Surface, Surroundings, distance_along, vertex_normals
from o3dleaf.surface.reconstruction.proximity import NEIGHBOURS, Data, nearest_of, spacings_of
from o3dleaf.surface.reconstruction.vertex_support_loops import find_front, seed_front, spread_lines

FACTOR = 3.0
"""Radius of the largest empty circle that is closed, in spacings: of five million random points, one in ten thousand
clouds holds a larger one, N π r² exp(−π r²) of them."""

MARGIN = 0.5
"""How far the surface goes on past its outermost data, in spacings: the mean distance of an edge from random points."""

NOISE = 3.0
"""Standard deviations of the data off the surface that do not count."""

SAMPLED = 20_000
"""Points whose distance from the mesh tells the noise."""

LEAST_SHARE = 0.05
"""A vertex on the rim keeps this share of its edge from both ends: no slivers, no vertex on another."""

LEAST_DENSITY = 0.25
"""A piece goes if fewer points than this share of its area over spacing² are nearest to it."""

LEAST_POINTS = 24
"""A piece also goes if fewer points are nearest to it: so few are strays, no surface."""


def trim_to_support(
    mesh: MeshLike,
    points: CloudLike,
    spacing: float | npt.ArrayLike | None = None,
    *,
    factor: float = FACTOR,
    margin: float = MARGIN,
    noise: float | None = None,
    normals: npt.ArrayLike | None = None,
    tree: cKDTree | None = None,
    progress: Progress | None = None,
) -> o3d.geometry.TriangleMesh:
    r"""Return a mesh without what no data support: cut off past the rim of open data, untouched where they are closed.

    A ball of `factor` spacings rolls over the mesh, outside the data: where it can stand without touching a point,
    there is a hole or an end of the data, and what comes within `factor` − `margin` of its centres, along the mesh,
    goes. The rim is then `margin` spacings past the outermost points, as smooth as the ball's path, and no gap
    narrower than the ball makes a hole: a closing of the data, or an α-shape of the surface, with α = `factor`.
    Farther than a spacing from the data it is the way along the mesh that counts, and where normals are given, data
    that face the other way hold nothing: a flap that curls back over the data goes, and so does what runs beside the
    data of another sheet.

    Triangles are cut along the rim, which runs in straight lines between their edges; vertices that stay do not
    move. Of several pieces those go to which fewer than 24 points are nearest, or less than a quarter of
    those that their area ought to have.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Manifold; it must reach `factor` + 1 spacings past the data's rim (`near_data`), for the ball to stand there.
    points : (n, 3) array_like or Open3D point cloud
        The data, in the mesh's unit.
    spacing : float or (n,) array_like, optional
        1/√(points per unit area), of all or of each point; left out, of each point, from its neighbours.
    factor : float
        Radius of the ball in spacings: wider gaps are holes.
    margin : float
        Distance of the rim from the outermost data in spacings, below `factor`.
    noise : float, optional
        Distance along the normal that does not count; left out, three standard deviations of the data off the mesh.
    normals : (n, 3) array_like, optional
        Outward normals of the points.
    tree : scipy.spatial.cKDTree, optional
        Of the points, where there is one.
    progress : callable, optional
        ``progress(done, total)`` of the work.

    Returns
    -------
    open3d.geometry.TriangleMesh
        With the very vertices and triangles of `mesh` where nothing was cut.

    Raises
    ------
    InputError
        If an argument cannot be meant.
    ReconstructionError
        If nothing is left.

    References
    ----------
    Edelsbrunner and Mücke (1994), Three-dimensional alpha shapes.
    """
    vertices, triangles = require_triangles(mesh)
    data = points_of(points, least=NEIGHBOURS + 1 if spacing is None else 1)
    if not 0 <= as_number(margin, "margin") < require_positive(factor, "factor"):
        raise InputError(f"margin: is {margin:g}; give 0 or more, and less than the factor, {factor:g}")
    tree = cKDTree(data) if tree is None else tree
    facing = None if normals is None else as_normals(normals, data)
    cloud = Data(data, spacings_of(data, spacing, tree), tree, facing)
    allowed = None if noise is None else as_number(noise, "noise")
    cutting, dropping = share_out(progress, 3, 1)
    vertices, triangles = _cut_off(vertices, triangles, cloud, (factor, factor - margin), allowed, cutting)
    vertices, triangles = _drop_unsupported(vertices, triangles, data, cloud.steps)
    finish(dropping)
    return build_mesh(vertices, triangles)


def _cut_off(
    vertices: FloatArray,
    triangles: IntArray,
    data: Data,
    reach: tuple[float, float],
    noise: float | None,
    progress: Progress | None,
) -> tuple[FloatArray, IntArray]:
    """Return the mesh without what comes within `reach[1]` spacings of a ball's centre, its radius `reach[0]`."""
    factor = reach[0]
    asking, holding, again = share_out(progress, 3, 1, 2)
    far, nearest = nearest_of(data.tree, vertices, asking)
    surface = Surface(vertices, triangles, vertex_normals(vertices, triangles), far, nearest)
    ratio = distance_along(surface, data, noise or 0.0, 2 * factor)
    finish(holding)
    if noise is None and ratio.max() > factor:
        ratio = distance_along(surface, data, _measure_noise(vertices, triangles, data.points), 2 * factor)
    finish(again)
    if not ratio.max() > factor:
        return vertices, triangles
    return cut_below(vertices, triangles, _roll(vertices, triangles, ratio, data.steps[nearest], *reach))


def _measure_noise(vertices: FloatArray, triangles: IntArray, data: FloatArray) -> float:
    """Return three standard deviations of the data off the mesh, from their median as if they were normal."""
    some = data[:: -(-len(data) // SAMPLED)]
    return float(NOISE * 1.4826 * np.median(distance_to_mesh(vertices, triangles, some)))


def _roll(
    vertices: FloatArray, triangles: IntArray, ratio: FloatArray, local: FloatArray, factor: float, reach: float
) -> FloatArray:
    """Return (n,) how far each vertex is beyond what the ball takes away, in spacings; below 0 it goes."""
    front, of_triangle = np.empty((len(triangles), 2, 3)), np.empty(len(triangles), dtype=np.int64)
    lines = find_front(triangles, vertices, ratio, factor, front, of_triangle)
    front, of_triangle = front[:lines], of_triangle[:lines]
    line, distance = np.full(len(vertices), -1), np.full(len(vertices), np.inf)
    seed_front(vertices, triangles, front, of_triangle, line, distance)
    spread_lines(vertices, *Surroundings.of(triangles, len(vertices)), reach * local, front, line, distance)
    # Vertices farther than the ball was asked to look are all alike.
    signed = np.minimum(distance / local, 2 * factor)
    return np.where(ratio > factor, -signed, signed) - reach


def cut_below(vertices: FloatArray, triangles: IntArray, values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the part of a mesh where the values at its vertices, linear between them, are above 0.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    values : (n,) ndarray

    Returns
    -------
    vertices, triangles : ndarrays
        Manifold if the mesh was; on each cut edge one vertex, a twentieth of it or more from both ends.
    """
    inside = values > 0
    count = inside[triangles].sum(axis=1)
    cut = triangles[(count > 0) & (count < 3)]
    # Turned so that the one corner on its side comes first.
    alone = np.where(inside[cut].sum(axis=1) == 1, inside[cut].argmax(axis=1), inside[cut].argmin(axis=1))
    cut = np.take_along_axis(cut, (alone[:, np.newaxis] + np.arange(3)) % 3, axis=1)
    pairs = np.sort(np.concatenate([cut[:, :2], cut[:, [0, 2]]]), axis=1)
    edges, number = np.unique(pairs[:, 0] * np.int64(len(vertices)) + pairs[:, 1], return_inverse=True)
    low, high = edges // len(vertices), edges % len(vertices)
    share = np.clip(values[low] / (values[low] - values[high]), LEAST_SHARE, 1 - LEAST_SHARE)
    added = vertices[low] + share[:, np.newaxis] * (vertices[high] - vertices[low])
    number += len(vertices)
    a, b = number[: len(cut)], number[len(cut) :]
    small = inside[cut[:, 0]]
    first, second, third = cut.T
    parts = [
        triangles[count == 3],
        np.column_stack([first, a, b])[small],
        np.column_stack([a, second, third])[~small],
        np.column_stack([a, third, b])[~small],
    ]
    return drop_unused_vertices(np.concatenate([vertices, added]), np.concatenate(parts))


def _drop_unsupported(
    vertices: FloatArray, triangles: IntArray, data: FloatArray, steps: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Return the mesh without the pieces that too few data are nearest to."""
    if not len(triangles):
        raise ReconstructionError("trim_to_support: no part of the mesh is near the points; are they in one unit?")
    # Of a manifold pieces share no vertex; to see that there is but one, no table of edges is needed.
    joined = label_nodes(triangles[:, [0, 0]].ravel(), triangles[:, 1:].ravel(), len(vertices))[triangles[:, 0]]
    if (joined == joined[0]).all():
        return vertices, triangles
    piece = label_triangles(triangles)
    pieces = int(piece.max()) + 1
    of_vertex = np.empty(len(vertices), dtype=np.int64)
    of_vertex[triangles.ravel()] = np.repeat(piece, 3)
    nearest = cKDTree(vertices).query(data, workers=-1)[1]
    found, count = (np.bincount(of_vertex[nearest], some, pieces) for some in (steps**2, None))
    area = np.bincount(piece, weights=triangle_areas(vertices, triangles))
    keep: BoolArray = (found > LEAST_DENSITY * area) & (count >= LEAST_POINTS)
    if not keep.any():
        raise ReconstructionError("trim_to_support: no piece of the mesh has data enough; is the spacing too small?")
    return drop_unused_vertices(vertices, triangles[keep[piece]]) if not keep.all() else (vertices, triangles)
