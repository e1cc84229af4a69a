"""Values and parameters of a sheet at points near it."""

import igl
import numpy as np
import scipy.sparse

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray

INSIDE = 1e-6
"""Barycentric coordinate above which a closest point is inside a triangle, not on its edge but for rounding."""


def carry(vertices: FloatArray, triangles: IntArray, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return the (k, c) values at the closest points of a mesh to (k, 3) points, linear in each triangle."""
    _, face, foot = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, triangles)
    return np.asarray(np.einsum("ij,ijc->ic", _weights(vertices, triangles[face], foot), values[triangles[face]]))


def carry_chart(vertices: FloatArray, triangles: IntArray, chart: FloatArray, points: FloatArray) -> FloatArray:
    r"""Return the (k, 2) parameters of points as if the sheet went on past its rim without stretch.

    .. math:: (u, v) = c(f) + R\,P\,(x - f)

    c(f) are the parameters of the closest point f, P projects onto the plane of its triangle, and R is the rotation
    nearest to the triangle's own map to the chart; on an edge or a vertex both are those of the mean of the triangles
    there by their area, as a rounding would choose one of them. Parameters of the closest point alone would gather on
    the rim all that lies past it, and a surface through them would be stretched there.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        Counter-clockwise as seen from one side, and in the chart.
    chart : (n, 2) ndarray
    points : (k, 3) ndarray
    """
    _, face, foot = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, triangles)
    corners = triangles[face]
    weights = _weights(vertices, corners, foot)
    carried = np.einsum("ij,ijc->ic", weights, chart[corners])
    # Inside a triangle what is left is along its normal.
    rows = np.flatnonzero((weights <= INSIDE).any(axis=1))
    around = _triangles_around(triangles, corners[rows], weights[rows] > INSIDE)
    turn, normal = (around @ each for each in _frames(vertices, triangles, chart))
    away, normal = (points - foot)[rows], _unit(normal)
    along = away - _dot(away, normal)[:, np.newaxis] * normal
    moved = _unit(np.column_stack([_dot(away, turn[:, :3]), _dot(away, turn[:, 3:])]))
    carried[rows] += np.linalg.norm(along, axis=1)[:, np.newaxis] * moved
    return np.asarray(carried)


def _frames(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the triangles' rotations to the chart, rows of (2, 3) matrices (m, 6), and normals (m, 3), times areas."""
    first, second = (vertices[triangles[:, k]] - vertices[triangles[:, 0]] for k in (1, 2))
    # In the plane as complex numbers, with its axes along the first side and across.
    product = np.cross(first, second)
    along, area = _unit(first), np.linalg.norm(product, axis=1)[:, np.newaxis]
    across = np.cross(_unit(product), along)
    here = [_dot(vector, along) + 1j * _dot(vector, across) for vector in (first, second)]
    there = [(chart[triangles[:, k]] - chart[triangles[:, 0]]) @ [1, 1j] for k in (1, 2)]
    # A linear map z -> a z + b conj(z) is nearest to the rotation by a's angle.
    turn = 1j * (there[0] * here[1].conj() - there[1] * here[0].conj())
    turn = (turn / np.where(turn == 0, 1, np.abs(turn)))[:, np.newaxis]
    rows = [turn.real * along - turn.imag * across, turn.imag * along + turn.real * across]
    return area * np.concatenate(rows, axis=1), product


def _triangles_around(triangles: IntArray, corners: IntArray, on: BoolArray) -> scipy.sparse.csr_array:
    """Return which (k, m) triangles have all of those corners (k, 3) that a place lies on: an edge's, or a vertex'."""
    count, number = len(corners), int(triangles.max()) + 1
    row = np.repeat(np.arange(len(triangles)), 3)
    of_vertex = scipy.sparse.csr_array((np.ones(triangles.size), (triangles.ravel(), row)), shape=(number, row[-1] + 1))
    place = np.nonzero(on)[0]
    around = scipy.sparse.csr_array((np.ones(len(place)), (place, corners[on])), shape=(count, number)) @ of_vertex
    around.data = (around.data == np.repeat(on.sum(axis=1), np.diff(around.indptr))).astype(np.float64)
    return around


def _weights(vertices: FloatArray, corners: IntArray, foot: FloatArray) -> FloatArray:
    """Return the barycentric coordinates (k, 3) of points (k, 3) of triangles with given corners (k, 3)."""
    first, second, third = (vertices[corners[:, k]] for k in range(3))
    a, b, c = second - first, third - first, foot - first
    aa, ab, bb, ac, bc = (_dot(*pair) for pair in ((a, a), (a, b), (b, b), (a, c), (b, c)))
    whole = aa * bb - ab * ab
    whole[whole <= 0] = np.inf
    s, t = (bb * ac - ab * bc) / whole, (aa * bc - ab * ac) / whole
    return np.stack([1 - s - t, s, t], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 3), 0 of those without length."""
    length = np.linalg.norm(vectors, axis=1)[:, np.newaxis]
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", first, second))
