"""Faces of any number of corners as triangles: by a fan where it is convex, else ear by ear."""

from pathlib import Path

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray

MAX_EARS = 1000
"""Corners of a face that ears are looked for at, whose work grows with their square; larger ones are fans."""


def triangulate(vertices: FloatArray, counts: IntArray, corners: IntArray, file: Path) -> tuple[IntArray, IntArray]:
    """Return faces as triangles.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    counts : (f,) ndarray of int
        Corners of each face.
    corners : (counts.sum(),) ndarray of int
        Vertex numbers of all faces, one face after another.
    file : Path
        For errors.

    Returns
    -------
    triangles : (m, 3) ndarray of int64
        A face of k corners as k − 2 triangles.
    faces : (m,) ndarray of int64
        The face that each is of.

    Raises
    ------
    InputError
        If a face has fewer than three corners, or one that is no vertex.
    """
    if len(counts) and counts.min() < 3:
        raise InputError(f"{file}: a face has {counts.min()} corners, not three; it is damaged, export it again")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(vertices):
        raise InputError(
            f"{file}: a face names vertex {corners.min() if corners.min() < 0 else corners.max()} of "
            f"{len(vertices):,}; it is damaged, export it again"
        )
    starts = np.cumsum(counts) - counts
    faces = np.repeat(np.arange(len(counts)), counts - 2)
    first = starts[faces]
    second = first + 1 + np.arange(len(faces)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    triangles = np.stack([corners[first], corners[second], corners[second + 1]], axis=1).reshape(-1, 3)
    for face in _not_convex(vertices, triangles, faces, counts):
        ring = corners[starts[face] : starts[face] + counts[face]]
        triangles[faces == face] = _ears(vertices, ring)
    return triangles, faces


def _not_convex(vertices: FloatArray, triangles: IntArray, faces: IntArray, counts: IntArray) -> IntArray:
    """Return the faces whose fan has triangles that look the other way than the face."""
    many = counts[faces] > 3
    if not many.any():
        return np.empty(0, dtype=np.int64)
    triangles, faces = triangles[many], faces[many]
    corners = vertices[triangles]
    with np.errstate(all="ignore"):  # coordinates may be anything
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        wholes = np.stack([np.bincount(faces, axis, len(counts)) for axis in normals.T], axis=1)
        turned = np.einsum("ij,ij->i", normals, wholes[faces]) < 0
    found: IntArray = np.unique(faces[turned])
    return np.asarray(found[counts[found] <= MAX_EARS])


def _ears(vertices: FloatArray, ring: IntArray) -> IntArray:
    """Return the triangles of one face, cut off where no other corner lies inside, seen along its normal."""
    points = vertices[ring]
    with np.errstate(all="ignore"):
        normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
        axis = int(np.argmax(np.abs(normal)))
        flat = np.delete(points, axis, axis=1) * ([1.0, 1.0] if (normal[axis] > 0) == (axis != 1) else [-1.0, 1.0])
        left, triangles = list(range(len(ring))), []
        while len(left) > 3:
            place = next((k for k in range(len(left)) if _is_ear(flat, left, k)), 0)
            triangles.append([left[place - 1], left[place], left[(place + 1) % len(left)]])
            del left[place]
    return np.asarray(ring[np.array([*triangles, left])])


def _is_ear(flat: FloatArray, left: list[int], place: int) -> bool:
    a, b, c = flat[left[place - 1]], flat[left[place]], flat[left[(place + 1) % len(left)]]
    if _turn(a, b, c) <= 0:
        return False
    rest = flat[[k for k in left if k not in {left[place - 1], left[place], left[(place + 1) % len(left)]}]]
    inside = (_turn(a, b, rest) > 0) & (_turn(b, c, rest) > 0) & (_turn(c, a, rest) > 0)
    return not np.any(inside)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the signed area of a, b, c, for one or many c."""
    return np.asarray((b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0]))
