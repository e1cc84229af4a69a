"""Cutting a surface off where it goes on past its data: no invented surface, and no hole in a random cloud."""

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core import journal, progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import NotNegative, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import as_number, require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import CloudWarning, InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import (
    BoolArray,
    IntArray,
    MeshLike,
    build_mesh,
    drop_unused_vertices,
    require_triangles,
    triangle_areas,
)
from o3dleaf.core.places import tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import label_nodes
from o3dleaf.surface.reconstruction.along_mesh import MeshNearData, VertexNeighbors, distance_along
from o3dleaf.surface.reconstruction.proximity import nearest_data
from o3dleaf.surface.reconstruction.vertex_support_loops import find_front, propagate_lines, seed_front

FACTOR = 3.0
"""Radius of the largest empty circle that is closed, in spacings: of five million random points, one in ten thousand
clouds holds a larger one, N π r² exp(−π r²) of them."""

MARGIN = 0.5
"""How far the surface goes on past its outermost data, in spacings: the mean distance of an edge from random points."""

NOISE = 3.0
"""Standard deviations of the data off the surface that do not count."""

SAMPLE_SIZE = 20_000
"""Points by whose distance from the mesh the noise is measured."""

MIN_SHARE = 0.05
"""A vertex on the rim keeps this share of its edge from both ends: no slivers, no vertex on another."""

MIN_DENSITY = 0.25
"""A piece goes if fewer points than this share of its area over spacing² are nearest to it."""

MIN_POINTS = 24
"""A piece also goes if fewer points are nearest to it: so few are strays, no surface."""


@checked
def trim_to_data(
    mesh: MeshLike,
    cloud: CloudLike,
    *,
    factor: Positive = FACTOR,
    margin: NotNegative = MARGIN,
    noise: NotNegative | None = None,
) -> o3d.geometry.TriangleMesh:
    r"""Return a mesh without what no data support: cut off past the rim of open data, untouched where they are closed.

    A ball of `factor` spacings rolls over the mesh, outside the data: where it can stand without touching a point,
    there is a hole or an end of the data, and what comes within `factor` − `margin` of its centers, along the mesh,
    goes. The rim is then `margin` spacings past the outermost points, as smooth as the ball's path, and no gap
    narrower than the ball makes a hole: a closing of the data, or an α-shape of the surface, with α = `factor`.
    Farther than a spacing from the data distances are measured along the mesh, and where the cloud has normals, data
    that face the other way support nothing: a flap that curls back over the data goes, and so does what runs beside
    the data of another sheet.

    Triangles are cut along the rim, which runs in straight lines between their edges; vertices that stay do not
    move. Of several pieces those go to which fewer than 24 points are nearest, or less than a quarter of
    those that their area ought to have.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Manifold; it must reach `factor` + 1 spacings past the data's rim (`distance_mask`), for the ball to stand
        there.
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        The data, in the mesh's unit; with outward normals, if any.
    factor : float
        Radius of the ball in spacings: wider gaps are holes.
    margin : float
        Distance of the rim from the outermost data in spacings, below `factor`.
    noise : float, optional
        Distance along the normal that does not count; left out, three standard deviations of the data off the mesh.

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
    data = OrientedCloud.of(cloud)
    if not 0 <= as_number(margin, "margin") < require_positive(factor, "factor"):
        raise InputError(f"margin: is {margin:g}; give 0 or more, and less than the factor, {factor:g}")
    allowed = None if noise is None else as_number(noise, "noise")
    cutting, dropping = progress.split(3, 1)
    with cutting:
        vertices, triangles = _cut_off(vertices, triangles, data, factor, factor - margin, allowed)
    with dropping:
        return build_mesh(*_drop_unsupported(vertices, triangles, data))


def drop_unsupported(mesh: MeshLike, cloud: CloudLike) -> o3d.geometry.TriangleMesh:
    """Return a mesh without its unsupported pieces, as `trim_to_data` does after cutting; all else stays.

    Parameters
    ----------
    mesh, cloud
        As of `trim_to_data`.

    Raises
    ------
    InputError, ReconstructionError
        As `trim_to_data` does.
    """
    return build_mesh(*_drop_unsupported(*require_triangles(mesh), OrientedCloud.of(cloud)))


def _cut_off(
    vertices: FloatArray, triangles: IntArray, data: OrientedCloud, factor: float, clearance: float, noise: float | None
) -> tuple[FloatArray, IntArray]:
    """Return the mesh without what comes within `clearance` spacings of the center of a ball of `factor` spacings."""
    searching, measuring, again = progress.split(3, 1, 2)
    with searching:
        mesh = MeshNearData.of(vertices, triangles, data)
    with measuring:
        ratio = distance_along(mesh, data, noise or 0.0, 2 * factor)
    with again:
        if noise is None and ratio.max() > factor:
            ratio = distance_along(mesh, data, _measure_noise(mesh, data.points), 2 * factor)
    if not ratio.max() > factor:
        return vertices, triangles
    return cut_below(vertices, triangles, _roll(mesh, ratio, data.point_spacing[mesh.nearest], factor, clearance))


def _measure_noise(mesh: MeshNearData, points: FloatArray) -> float:
    """Return three standard deviations of points off the mesh, from their median as if they were normal."""
    some = points[:: -(-len(points) // SAMPLE_SIZE)]
    return float(NOISE * 1.4826 * np.median(distance_to_mesh(mesh.vertices, mesh.triangles, some)))


def _roll(mesh: MeshNearData, ratio: FloatArray, spacing: FloatArray, factor: float, clearance: float) -> FloatArray:
    """Return (n,) how far each vertex is beyond what the ball takes away, in spacings; below 0 it goes."""
    vertices, triangles = mesh.vertices, mesh.triangles
    front, of_triangle = np.empty((len(triangles), 2, 3)), np.empty(len(triangles), dtype=np.int64)
    lines = find_front(triangles, vertices, ratio, factor, front, of_triangle)
    front, of_triangle = front[:lines], of_triangle[:lines]
    line, distance = np.full(len(vertices), -1), np.full(len(vertices), np.inf)
    seed_front(vertices, triangles, front, of_triangle, line, distance)
    neighbors = VertexNeighbors.of(triangles, len(vertices))
    propagate_lines(vertices, *neighbors, clearance * spacing, front, line, distance)
    # Vertices farther than the ball reaches are all alike.
    signed = np.minimum(distance / spacing, 2 * factor)
    return np.where(ratio > factor, -signed, signed) - clearance


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
    share = np.clip(values[low] / (values[low] - values[high]), MIN_SHARE, 1 - MIN_SHARE)
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


def _drop_unsupported(vertices: FloatArray, triangles: IntArray, data: OrientedCloud) -> tuple[FloatArray, IntArray]:
    """Return the mesh without the pieces that too few data are nearest to."""
    if not len(triangles):
        raise ReconstructionError("trim_to_data: no part of the mesh is near the points; are they in one unit?")
    # Of a manifold pieces share no vertex, so that no table of edges is needed.
    of_vertex = label_nodes(triangles[:, [0, 0]].ravel(), triangles[:, 1:].ravel(), len(vertices))
    piece, pieces = of_vertex[triangles[:, 0]], int(of_vertex.max()) + 1
    if (piece == piece[0]).all():
        return vertices, triangles
    tree = cKDTree(vertices, balanced_tree=False, compact_nodes=False)
    nearest = _nearest_pieces(tree, of_vertex, data)
    sampled, count = (np.bincount(nearest, some, pieces) for some in (data.point_spacing**2, None))
    area = np.bincount(piece, weights=triangle_areas(vertices, triangles))
    keep: BoolArray = (sampled > MIN_DENSITY * area) & (count >= MIN_POINTS)
    if not keep.any():
        raise ReconstructionError("trim_to_data: no component of the mesh has enough data; is the spacing too small?")
    if not keep.all():
        _tell_of_lost(data, nearest, keep, tree, keep[of_vertex])
    return drop_unused_vertices(vertices, triangles[keep[piece]]) if not keep.all() else (vertices, triangles)


def _nearest_pieces(tree: cKDTree, of_vertex: IntArray, data: OrientedCloud) -> IntArray:
    """Return the piece (n,) of the vertex that is nearest to each point; the largest one's where no other is near.

    The vertices of that which are nearest to a point bound how far its own nearest one is, and are known.
    """
    vertices, largest = tree.data, np.bincount(of_vertex).argmax()
    within, (distance, point) = of_vertex == largest, nearest_data(data, vertices)
    bound = np.full(len(data), np.inf)
    np.minimum.at(bound, point[within], distance[within])
    rows = np.flatnonzero(query(cKDTree(vertices[~within]), data.points)[0] <= bound)
    nearest = np.full(len(data), largest)
    nearest[rows] = of_vertex[query(tree, data.points[rows])[1]]
    return nearest


def _tell_of_lost(data: OrientedCloud, piece: IntArray, keep: BoolArray, tree: cKDTree, stays: BoolArray) -> None:
    """Say how many data, each with its piece (n,), are left without a surface as pieces go, and where most of them.

    `tree` is one of all vertices, of which those of a mask stay.
    """
    lost = np.flatnonzero(~keep[piece])
    around = tree.query_ball_point(data.points[lost], data.point_spacing[lost])
    lost = lost[[not stays[each].any() for each in around]]
    if not len(lost):
        return
    names, counts = np.unique(piece[lost], return_counts=True)
    place = data.points[lost[piece[lost] == names[counts.argmax()]]].mean(axis=0)
    pieces, at = tell_count(len(names), "piece"), tell_place(place, data.points)
    have = "point has" if len(lost) == 1 else "points have"
    text = f"{len(lost):,} {have} no surface: {pieces} of too few, the largest of {counts.max()} at {at}"
    journal.tell(text, CloudWarning)
