"""Creases of a field that its polygons cut off: edges from one sheet to another get a vertex where the two meet."""

import numpy as np
import open3d as o3d

from o3dleaf.checks import FloatArray, as_number
from o3dleaf.errors import InputError
from o3dleaf.field import Field
from o3dleaf.mesh.arrays import BoolArray, IntArray, MeshLike, build_mesh, require_triangles
from o3dleaf.mesh.topology import EdgeTable

ANGLE = 30.0
"""Degrees that the field's gradient turns by along an edge, at least, where it crosses a crease."""

ROUNDS = 3
"""Times that the sheets' tangent planes are taken, each time half as far from the crease."""

SAME = 0.8
"""Cosine between gradients of one sheet, at a vertex and nearer to the crease."""

FLAT = 1e-3
"""Share of the largest singular value below which planes are the same one."""

FARTHEST = 1.0
"""Lengths of the edge that its vertex may lie off its middle: creases as sharp as 53 degrees are met in full."""

NEARER = 0.5
"""Share of the field's value at the middle of an edge that may be left at its new vertex."""


def sharpen_creases(
    mesh: MeshLike, field: Field, *, angle: float = ANGLE, isovalue: float = 0.0
) -> o3d.geometry.TriangleMesh:
    r"""Return a mesh whose chamfers are filled up to the creases of the field that it was polygonised from.

    Marching cubes puts vertices on the two sheets beside a crease, never on it. Along an edge whose ends have
    gradients that differ by more than `angle` a vertex is put where the tangent planes at both ends meet, nearest
    to its middle,

    .. math:: x = m - J^+ (J m - b), \qquad J = (\nabla F(a), \nabla F(b))^T,

    the planes being taken again half way to it; a triangle with three such edges gets one where three planes
    meet. Triangles are cut along the new vertices, so that creases become edges, and a manifold mesh stays one. A
    vertex which does not halve the field's value, or lies far away, is not made. Of the others only those beside a
    crease move, onto the surface, which the parabolas of `extract_band` miss where the field has a kink.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        As extracted from the field, by `extract_band` for instance.
    field : Field
        With creases, such as a fit of `creases="auto"`.
    angle : float
        Degrees, between 0 and 180.
    isovalue : float
        That of the mesh.

    Returns
    -------
    open3d.geometry.TriangleMesh
        The vertices of `mesh` come first; the very mesh where nothing is sharp.

    Raises
    ------
    InputError
        If an argument cannot be meant.

    References
    ----------
    Attene, Falcidieno, Rossignac and Spagnuolo (2005), Sharpen&Bend; Kobbelt, Botsch, Schwanecke and Seidel
    (2001), Feature-sensitive surface extraction from volume data.
    """
    vertices, triangles = require_triangles(mesh)
    if not 0 < as_number(angle, "angle") < 180:
        raise InputError(f"angle: is {angle:g}; give degrees between 0 and 180, such as 30")
    level, cosine = as_number(isovalue, "isovalue"), float(np.cos(np.radians(angle)))
    facing = _unit(np.asarray(field.gradient(vertices)))
    table = EdgeTable.of(triangles)
    ends, of_triangle = table.ends.astype(np.int64), table.of_half.reshape(-1, 3)
    across = _turning(ends, facing, cosine)
    touched = np.zeros(len(vertices), dtype=bool)
    touched[ends[across]] = True
    beside = np.unique(triangles[touched[triangles].any(axis=1)])
    vertices = vertices.copy()
    vertices[beside] = _settle(vertices[beside], field, level)
    facing[beside] = _unit(np.asarray(field.gradient(vertices[beside]))) if len(beside) else 0.0
    across = _turning(ends, facing, cosine)
    places, kept = _meet(vertices[ends[across]], facing[ends[across]], field, level)
    number = np.full(len(ends), -1)
    number[across[kept]] = len(vertices) + np.arange(np.count_nonzero(kept))
    at = number[of_triangle]
    three = np.flatnonzero((at >= 0).all(axis=1))
    corners, found = _meet(vertices[triangles[three]], facing[triangles[three]], field, level)
    centre = np.full(len(triangles), -1)
    centre[three[found]] = len(vertices) + np.count_nonzero(kept) + np.arange(np.count_nonzero(found))
    vertices = np.concatenate([vertices, places[kept], corners[found]])
    return build_mesh(vertices, _cut(vertices, triangles, at, centre))


def _turning(ends: IntArray, facing: FloatArray, cosine: float) -> IntArray:
    """Return the edges between whose ends the gradient turns."""
    return np.flatnonzero((facing[ends[:, 0]] * facing[ends[:, 1]]).sum(axis=1) < cosine)


def _settle(places: FloatArray, field: Field, level: float) -> FloatArray:
    """Return vertices moved to the zero by Newton's method, where that brings them nearer: parabolas miss kinks."""
    for _ in range(ROUNDS if len(places) else 0):
        value, slope = _ask(field, places, level)
        step = value / np.maximum((slope * slope).sum(axis=-1), np.finfo(np.float64).tiny)
        moved = places - step[:, np.newaxis] * slope
        better = np.abs(np.asarray(field(moved)) - level) < np.abs(value)
        places = np.where(better[:, np.newaxis], moved, places)
    return places


def _meet(places: FloatArray, facing: FloatArray, field: Field, level: float) -> tuple[FloatArray, BoolArray]:
    """Return where the tangent planes at k places (n, k, 3) of sheets facing so meet, and whether that is good."""
    if not len(places):
        return np.empty((0, 3)), np.zeros(0, dtype=bool)
    middle = places.mean(axis=1)
    longest = np.linalg.norm(places - places[:, [1, *range(2, places.shape[1]), 0]], axis=2).max(axis=1)
    planes, heights = facing.copy(), np.zeros(places.shape[:2])
    found = middle
    for round_ in range(ROUNDS):
        at = places if round_ == 0 else found[:, np.newaxis] + (places - found[:, np.newaxis]) / 2**round_
        value, slope = _ask(field, at, level)
        # Near the crease's end a point may already be on another sheet: the plane before is kept.
        same = (_unit(slope) * facing).sum(axis=2) > SAME
        length = np.maximum(np.linalg.norm(slope, axis=2), np.finfo(np.float64).tiny)
        planes[same] = (slope / length[:, :, np.newaxis])[same]
        heights[same] = ((planes * at).sum(axis=2) - value / length)[same]
        away = heights - np.einsum("nka,na->nk", planes, middle)
        found = middle + np.einsum("nak,nk->na", np.linalg.pinv(planes, rcond=FLAT), away)
    near = np.linalg.norm(found - middle, axis=1) <= FARTHEST * longest
    values = np.abs(np.asarray(field(np.concatenate([middle, found]))) - level).reshape(2, -1)
    return found, near & (values[1] <= NEARER * values[0])


def _ask(field: Field, places: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Return the values less the level, and the gradients, at (..., 3) places."""
    flat = places.reshape(-1, 3)
    value, slope = np.asarray(field(flat)) - level, np.asarray(field.gradient(flat))
    return value.reshape(places.shape[:-1]), slope.reshape(places.shape)


def _unit(slopes: FloatArray) -> FloatArray:
    """Return directions; zero where there is no slope."""
    length = np.linalg.norm(slopes, axis=-1, keepdims=True)
    return slopes / np.where(length > 0, length, 1.0)


def _cut(vertices: FloatArray, triangles: IntArray, at: IntArray, centre: IntArray) -> IntArray:
    """Return the triangles cut at the vertices `at` (m, 3) on their edges and `centre` (m,) inside, −1 for none."""
    many = (at >= 0).sum(axis=1)
    # Turned so that two new vertices are on the first two edges, one on the first.
    turn = np.where(many == 2, (at < 0).argmax(axis=1) + 1, (at >= 0).argmax(axis=1))
    columns = (turn[:, np.newaxis] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, columns, axis=1).T
    ab, bc, ca = np.take_along_axis(at, columns, axis=1).T
    one, two, three = many == 1, many == 2, (many == 3) & (centre < 0)
    shorter = np.linalg.norm(vertices[bc] - vertices[a], axis=1) <= np.linalg.norm(vertices[ab] - vertices[c], axis=1)
    parts = [
        (many == 0, [(a, b, c)]),
        (one, [(a, ab, c), (ab, b, c)]),
        (two, [(ab, b, bc)]),
        (two & shorter, [(a, ab, bc), (a, bc, c)]),
        (two & ~shorter, [(a, ab, c), (ab, bc, c)]),
        (three, [(a, ab, ca), (ab, b, bc), (bc, c, ca), (ab, bc, ca)]),
        (centre >= 0, [(p, q, centre) for p, q in ((a, ab), (ab, b), (b, bc), (bc, c), (c, ca), (ca, a))]),
    ]
    return np.concatenate([np.column_stack(corners)[rows] for rows, drawn in parts for corners in drawn])
