"""Caps: what a solid has in common with the faces of its lattice, so that a surface which they cut is closed there."""

import itertools

import numpy as np

from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.isosurface.cell_loops import CUBES
from o3dleaf.surface.isosurface.polygonize import Crossings

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
"""Corners of a square of a face, counter-clockwise."""

HALVES = ((0, 1, 2), (0, 2, 3))
"""The two triangles that Kuhn's subdivision leaves of a square, whose diagonal rises along both axes."""


def square_triangles(code: int) -> list[tuple[int, int, int]]:
    """Return the triangles inside a square: 0 to 3 its corners, 4 + k the vertex between corners k and k + 1."""
    inside = [code >> k & 1 for k in range(4)]
    if code in {5, 10}:
        # As on the faces of a cell, inside corners that are not neighbors stay apart.
        return [(4 + (k - 1) % 4, k, 4 + k) for k in range(4) if inside[k]]
    return fan_inside(inside)


def fan_inside(inside: list[int]) -> list[tuple[int, int, int]]:
    """Return the triangles inside a polygon of n corners: n + k is the vertex between corners k and k + 1."""
    many, polygon = len(inside), []
    for k in range(many):
        polygon += [k] if inside[k] else []
        polygon += [many + k] if inside[k] != inside[(k + 1) % many] else []
    return [(polygon[0], polygon[n], polygon[n + 1]) for n in range(1, len(polygon) - 1)]


def close_faces(crossings: Crossings, inside: BoolArray, method: int, faces: BoolArray) -> tuple[IntArray, IntArray]:
    """Return triangles that close a surface on faces of its lattice.

    Parameters
    ----------
    crossings : Crossings
        The surface.
    inside : (nx, ny, nz) ndarray of bool
    method : int
        Place in `METHODS`, by which the surface was made.
    faces : (2, 3) ndarray of bool
        Which faces, lower, then upper ones.

    Returns
    -------
    points : (p, 3) ndarray of int64
        Lattice points that become vertices, after those of the surface.
    triangles : (m, 3) ndarray of int64
        Counter-clockwise seen from outside.
    """
    parts = [_cap(inside, method, axis, far) for far, axis in itertools.product(range(2), range(3)) if faces[far, axis]]
    names = np.concatenate([np.empty((0, 3), dtype=np.int64), *parts])
    corners, count = np.unique(names[names & 7 == 0]), len(crossings.edges)
    triangles = np.where(
        names & 7 == 0, count + np.searchsorted(corners, names), np.searchsorted(crossings.edges, names)
    )
    return np.stack(np.unravel_index(corners >> 3, inside.shape), axis=1), triangles


def _cap(inside: BoolArray, method: int, axis: int, far: int) -> IntArray:
    """Return the triangles (m, 3) on one face, by names: 8 · (number of a point) + direction, 0 for the point."""
    along = [other for other in range(3) if other != axis]
    face = np.moveaxis(inside, axis, 0)[-1 if far else 0]
    strides = np.array([inside.shape[1] * inside.shape[2], inside.shape[2], 1])
    # Squares that lie outside whole are most; they are left out before anything is numbered.
    u, v = np.nonzero(face[:-1, :-1] | face[1:, :-1] | face[:-1, 1:] | face[1:, 1:])
    lower = far * (inside.shape[axis] - 1) * strides[axis] + u * strides[along[0]] + v * strides[along[1]]
    steps = [np.array(corner) @ strides[along] for corner in CORNERS]
    parts = []
    for polygon in (range(4),) if method == CUBES else HALVES:
        names = [8 * (lower + steps[k]) for k in polygon]
        for k, following in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
            near, there = sorted((CORNERS[k], CORNERS[following]))
            direction = sum((b - a) << each for a, b, each in zip(near, there, along, strict=True))
            names.append(8 * (lower + np.array(near) @ strides[along]) + direction)
        vertices = np.stack(names, axis=-1)
        code = sum(face[u + CORNERS[k][0], v + CORNERS[k][1]].astype(np.int64) << n for n, k in enumerate(polygon))
        for kind in range(1, 1 << len(polygon)):
            drawn = square_triangles(kind) if method == CUBES else fan_inside([kind >> n & 1 for n in range(3)])
            parts += [vertices[code == kind][:, list(triangle)] for triangle in drawn]
    triangles = np.concatenate(parts)
    # (x, z) turns about −y, (y, z) and (x, y) about x and z.
    outward = bool(far) != (axis == 1)
    return triangles if outward else triangles[:, ::-1]
