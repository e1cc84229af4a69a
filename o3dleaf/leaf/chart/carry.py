"""Values and parameters of a sheet at points near it."""

import igl
import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray


def carry(vertices: FloatArray, triangles: IntArray, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return the (k, c) values at the closest points of a mesh to (k, 3) points, linear in each triangle."""
    _, face, foot = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, triangles)
    return _interpolated(vertices, triangles[face], values, foot)


def carry_chart(vertices: FloatArray, triangles: IntArray, chart: FloatArray, points: FloatArray) -> FloatArray:
    r"""Return the (k, 2) parameters of points as if the sheet went on past its rim without stretch.

    .. math:: (u, v) = c(f) + R\,P\,(x - f)

    c(f) are the parameters of the closest point f, P projects onto the plane of its triangle, and R is the rotation
    nearest to the triangle's own map to the chart. Parameters of the closest point alone would gather on the rim all
    that lies past it, and a surface through them would be stretched there.

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
    first, second = (vertices[corners[:, k]] - vertices[corners[:, 0]] for k in (1, 2))
    # In the plane as complex numbers, with its axes along the first side and across.
    along, normal = _unit(first), _unit(np.cross(first, second))
    across = np.cross(normal, along)
    here = [_dot(vector, along) + 1j * _dot(vector, across) for vector in (first, second, points - foot)]
    there = [(chart[corners[:, k]] - chart[corners[:, 0]]) @ [1, 1j] for k in (1, 2)]
    # A linear map z -> a z + b conj(z) is nearest to the rotation by a's angle.
    turn = 1j * (there[0] * here[1].conj() - there[1] * here[0].conj())
    moved = here[2] * turn / np.where(turn == 0, 1, np.abs(turn))
    return np.asarray(_interpolated(vertices, corners, chart, foot) + np.column_stack([moved.real, moved.imag]))


def _interpolated(vertices: FloatArray, corners: IntArray, values: FloatArray, foot: FloatArray) -> FloatArray:
    """Return the values (k, c) at points (k, 3) of triangles with given corners (k, 3)."""
    first, second, third = (vertices[corners[:, k]] for k in range(3))
    a, b, c = second - first, third - first, foot - first
    aa, ab, bb, ac, bc = (_dot(*pair) for pair in ((a, a), (a, b), (b, b), (a, c), (b, c)))
    whole = aa * bb - ab * ab
    whole[whole <= 0] = np.inf
    s, t = (bb * ac - ab * bc) / whole, (aa * bc - ab * ac) / whole
    weights = np.stack([1 - s - t, s, t], axis=1)
    return np.asarray(np.einsum("ij,ijc->ic", weights, values[corners]))


def _unit(vectors: FloatArray) -> FloatArray:
    """Return the unit vectors (n, 3), 0 of those without length."""
    length = np.linalg.norm(vectors, axis=1)[:, np.newaxis]
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def _dot(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", first, second))
