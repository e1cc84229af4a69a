"""Heights above the blade along its own normal: x = S(y₁, y₂) + y₃ N(y₁, y₂), and back by Newton's method.

Along `up` the thickness of the micro-structure shrinks with the cosine of the blade's slope; along the
normal it is kept. S is the macro surface, N its unit normal.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.macro import offset_loops
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap

OFFSETS = ("up", "normal")
BLOCK = 8192
MAX_STEPS = 30
TOLERANCE = 1e-13
"""Distance from a point, of the size of its coordinates, at which Newton's method is at rounding."""
MIN_ROOM = 1e-3
"""Least of 1 − y₃κ: what lies closer to the focal surface, or beyond it, has no height along the normal."""


@dataclass(frozen=True)
class NormalOffsets:
    """The map (along, across, height) ↦ S + height · N at n flat coordinates.

    Attributes
    ----------
    points : (n, 3) ndarray
        In the world.
    jacobian : (n, 3, 3) ndarray
        ∂(world)/∂(along, across, height).
    curvatures : (n, 2) ndarray
        Principal curvatures of S, positive where it bends towards N, least first.
    room : (n,) ndarray
        The least of 1 − height · κ: 1 on the blade, 0 at its focal surface, where the map folds.
    """

    points: FloatArray
    jacobian: FloatArray
    curvatures: FloatArray
    room: FloatArray

    @classmethod
    def at(cls, frame: LeafFrame, height_map: HeightMap, flat: FloatArray) -> "NormalOffsets":
        """Evaluate the map and its derivative at (n, 3) flat coordinates."""
        heights = height_map.jet(flat[:, :2])
        points, jacobian, curvatures = np.empty((len(flat), 3)), np.empty((len(flat), 3, 3)), np.empty((len(flat), 2))

        splines = frame.splines

        def task(start: int, stop: int) -> None:
            offset_loops.fill_offsets(start, stop, flat, heights, splines, points, jacobian, curvatures)

        run_blocks(task, len(flat), BLOCK)
        return cls(points, jacobian, curvatures, 1 - (flat[:, 2:] * curvatures).max(axis=1, initial=-np.inf))

    def reach(self, x: FloatArray, length: float) -> npt.NDArray[np.bool_]:
        """Return which of them are the world points x (n, 3), to the rounding of a frame of this length."""
        near = TOLERANCE * (np.linalg.norm(x, axis=1) + length)
        return np.asarray(np.linalg.norm(x - self.points, axis=1) <= near)


def lift_along_normal(frame: LeafFrame, height_map: HeightMap, flat: FloatArray) -> FloatArray:
    """Return the world points S + y₃ N of (n, 3) flat coordinates."""
    points = np.empty_like(flat)

    def task(start: int, stop: int) -> None:
        rows = flat[start:stop]
        height, *gradient = height_map.jet(rows[:, :2], 1).T
        leaf = np.column_stack([rows[:, :2], height])
        normal = unit_normals(frame.jacobian(leaf), np.stack(gradient, axis=1))
        points[start:stop] = frame.to_world(leaf) + rows[:, 2:] * normal

    run_blocks(task, len(flat), BLOCK)
    return points


def unit_normals(jacobian: FloatArray, gradient: FloatArray) -> FloatArray:
    """Return N (n, 3) from ∂x/∂y of the frame on the surface (n, 3, 3) and the gradient of H (n, 2)."""
    area = np.cross(*surface_tangents(jacobian, gradient))
    return np.asarray(area / np.linalg.norm(area, axis=1)[:, np.newaxis])


def surface_tangents(jacobian: FloatArray, gradient: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return S₁ and S₂, (n, 3) each: the frame's own derivatives and those of H along V."""
    up = jacobian[:, :, 2]
    return jacobian[:, :, 0] + gradient[:, :1] * up, jacobian[:, :, 1] + gradient[:, 1:] * up


def flatten_along_normal(frame: LeafFrame, height_map: HeightMap, x: FloatArray, upright: FloatArray) -> FloatArray:
    """Return the (n, 3) flat coordinates of world points, by Newton's method from those along `up`.

    Points that have none near the blade, because they lie beyond its focal surface, keep those along `up`.
    H goes on level outside its box, so that normals cross at the box's edge; where they do, the coordinates
    inside the box are taken.

    Parameters
    ----------
    x, upright : (n, 3) ndarrays
        World points, and their flat coordinates along `up`.
    """
    flat = upright.copy()

    def task(start: int, stop: int) -> None:
        points, block = x[start:stop], flat[start:stop]
        solved, rows = _newton(frame, height_map, points, block)
        block[rows] = solved
        rows, inner = _inside_the_edge(block, rows, height_map.bounds)
        solved, back = _newton(frame, height_map, points[rows], inner)
        inside = np.all(solved[:, :2] == np.clip(solved[:, :2], *height_map.bounds), axis=1)
        block[rows[back[inside]]] = solved[inside]

    run_blocks(task, len(x), BLOCK)
    return flat


def _inside_the_edge(flat: FloatArray, rows: IntArray, bounds: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the rows that lie outside a box by less than their height, and coordinates inside it to begin from."""
    plane, reach = flat[rows, :2], np.abs(flat[rows, 2:])
    nearest = np.clip(plane, *bounds)
    close = np.any(nearest != plane, axis=1) & np.all(np.abs(nearest - plane) <= reach, axis=1)
    rows, inset = rows[close], np.minimum(reach[close], np.ptp(bounds, axis=0) / 2)
    return rows, np.column_stack([np.clip(nearest[close], bounds[0] + inset, bounds[1] - inset), flat[rows, 2]])


def _newton(frame: LeafFrame, height_map: HeightMap, x: FloatArray, upright: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the flat coordinates of the points that have some, and the rows of these points."""
    flat, solved = upright.copy(), np.zeros(len(x), dtype=bool)
    rows = np.arange(len(x))
    for _ in range(MAX_STEPS):
        if not len(rows):
            break
        here = NormalOffsets.at(frame, height_map, flat[rows])
        faces, volume = _cofactors(here.jacobian)
        regular = volume > MIN_ROOM**2
        reached = here.reach(x[rows], frame.length)
        solved[rows[reached & regular]] = here.room[reached & regular] > MIN_ROOM
        step = np.einsum("nik,nk->ni", faces[regular], (x[rows] - here.points)[regular]) / volume[regular, np.newaxis]
        excess = np.maximum(np.linalg.norm(step, axis=1) / frame.length, 1.0)
        # Those that have been reached take a last step too: far from the origin it still wins digits.
        flat[rows[regular]] += step / excess[:, np.newaxis]
        rows = rows[regular & ~reached]
    return flat[solved], np.flatnonzero(solved)


def pull_back_along_normal(offsets: NormalOffsets, gradient: FloatArray) -> FloatArray:
    """Return J⁻ᵀ g (n, 3), by Cramer's rule; 0 where J is singular."""
    faces, volume = _cofactors(offsets.jacobian)
    inverse = np.where(volume != 0, 1 / np.where(volume != 0, volume, 1.0), 0.0)
    return np.asarray(np.einsum("nk,nki->ni", gradient, faces) * inverse[:, np.newaxis])


def _cofactors(jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows b × c, c × a, a × b (n, 3, 3) of matrices of columns a, b, c, and the determinants (n,)."""
    a, b, c = np.moveaxis(jacobian, 2, 0)
    faces = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    return faces, np.einsum("ni,ni->n", a, faces[:, 0])
