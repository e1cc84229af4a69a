"""A bumpy figure, round parts run together: limbs, ears, a snout, and the creases where they join."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.samples.meshed import Meshed
from o3dleaf.samples.solids import Feet

STEPS = 25
TOLERANCE = 1e-12
DEFAULT_PARTS = (
    # Two ends and a radius each: trunk, head, snout, ears, arms, legs, tail; the figure sits and looks along +y.
    (0.0, 0.0, -0.10, 0.0, 0.0, 0.12, 0.30),
    (0.0, 0.04, 0.56, 0.0, 0.04, 0.56, 0.22),
    (0.0, 0.22, 0.52, 0.0, 0.29, 0.51, 0.09),
    (-0.19, 0.03, 0.75, -0.19, 0.03, 0.75, 0.085),
    (0.19, 0.03, 0.75, 0.19, 0.03, 0.75, 0.085),
    (-0.25, 0.05, 0.20, -0.50, 0.24, 0.10, 0.085),
    (0.25, 0.05, 0.20, 0.50, 0.24, 0.30, 0.085),
    (-0.17, 0.10, -0.32, -0.26, 0.48, -0.36, 0.115),
    (0.17, 0.10, -0.32, 0.26, 0.48, -0.36, 0.115),
    (0.0, -0.28, -0.24, 0.0, -0.38, -0.19, 0.065),
)


class Jet(NamedTuple):
    """Values (n,), slopes (n, 3) and second derivatives (n, 3, 3)."""

    value: FloatArray
    slope: FloatArray
    bend: FloatArray


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Figure(Meshed):
    r"""A figure of one piece without a handle: the zero set of capsules that run together.

    .. math:: g(x) = -k \log \sum_i e^{-d_i(x) / k},

    d_i the signed distance to capsule i. Where parts meet the surface is a crease, rounded with a
    radius of about k. Closest points are found by Newton's method, from the nearest of a fine mesh's
    vertices, for x + λ ∇g(x) = p, g(x) = 0.

    Attributes
    ----------
    parts : tuple of (7,) tuples
        Two ends, (x, y, z) each, and the radius of each capsule.
    blend : float
        k.
    """

    parts: tuple[tuple[float, ...], ...] = DEFAULT_PARTS
    blend: Positive = 0.012

    def __repr__(self) -> str:
        return f"Figure({len(self.parts)} parts, blend={self.blend:g})"

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of its box."""
        a, b, radius = self._capsules
        reach = (radius + self.blend * np.log(len(radius)))[:, np.newaxis]
        return np.stack([(np.minimum(a, b) - reach).min(axis=0), (np.maximum(a, b) + reach).max(axis=0)])

    @property
    def step(self) -> float:
        """Step of the lattice of the mesh: a seventh of the thinnest part's radius."""
        return float(self._capsules[2].min() / 7)

    @cached_property
    def _capsules(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        numbers = np.array(self.parts)
        return numbers[:, :3], numbers[:, 3:6], numbers[:, 6]

    def _level(self, points: FloatArray) -> FloatArray:
        distance = np.stack([length - r for _, length, r in self._ways(points)])
        least = distance.min(axis=0)
        return np.asarray(self.blend * np.log(np.exp((least - distance) / self.blend).sum(axis=0)) - least)

    def _ways(self, points: FloatArray) -> list[tuple[FloatArray, FloatArray, float]]:
        """Return for each capsule the way (n, 3) from its axis, the way's length (n,), and the radius."""
        ways = []
        for a, b, radius in zip(*self._capsules, strict=True):
            axis = b - a
            share = np.clip((points - a) @ axis / max(axis @ axis, np.finfo(float).tiny), 0.0, 1.0)
            way = points - a - share[:, np.newaxis] * axis
            ways.append((way, np.linalg.norm(way, axis=1), float(radius)))
        return ways

    def _jet(self, points: FloatArray) -> Jet:
        """Return g, its gradient and its Hessian."""
        ways = self._ways(points)
        distance = np.stack([length - radius for _, length, radius in ways])
        least = distance.min(axis=0)
        weight = np.exp((least - distance) / self.blend)
        total = weight.sum(axis=0)
        weight /= total
        slope, bend = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
        for share, (way, length, _), axis in zip(weight, ways, self._axes, strict=True):
            safe = np.maximum(length, np.finfo(float).tiny)[:, np.newaxis]
            unit = way / safe
            slope += share[:, np.newaxis] * unit
            # Beside the shaft the distance does not change along it; round the ends it bends both ways.
            along = np.abs(way @ axis) <= TOLERANCE * safe[:, 0]
            flat = np.eye(3) - along[:, np.newaxis, np.newaxis] * np.outer(axis, axis)
            square = unit[:, :, np.newaxis] * unit[:, np.newaxis, :]
            bend += share[:, np.newaxis, np.newaxis] * ((flat - square) / safe[:, :, np.newaxis] - square / self.blend)
        bend += slope[:, :, np.newaxis] * slope[:, np.newaxis, :] / self.blend
        return Jet(least - self.blend * np.log(total), slope, bend)

    @cached_property
    def _axes(self) -> FloatArray:
        """Unit vectors (k, 3) along the capsules, 0 for balls."""
        axes = self._capsules[1] - self._capsules[0]
        return np.asarray(axes / np.maximum(np.linalg.norm(axes, axis=1), np.finfo(float).tiny)[:, np.newaxis])

    @cached_property
    def _seeds(self) -> tuple[KDTree, FloatArray]:
        vertices = self.mesh[0]
        for _ in range(3):
            value, slope, _ = self._jet(vertices)
            vertices = vertices - (value / (slope**2).sum(axis=1))[:, np.newaxis] * slope
        return KDTree(vertices), vertices

    def _feet(self, points: FloatArray) -> Feet:
        tree, vertices = self._seeds
        far, row = tree.query(points)
        feet = self._refine(points, vertices[row])
        # A step that has gone astray is a farther place than the vertex that it began at.
        length = np.linalg.norm(points - feet, axis=1)
        astray = ~(length <= far * (1 + TOLERANCE)) | (np.abs(self._level(feet)) > TOLERANCE)
        feet = np.where(astray[:, np.newaxis], vertices[row], feet)
        slope = self._jet(feet).slope
        distance = np.where(self._level(points) > 0, -1.0, 1.0) * np.where(astray, far, length)
        return Feet(feet, slope / np.linalg.norm(slope, axis=1)[:, np.newaxis], distance)

    def _refine(self, points: FloatArray, feet: FloatArray) -> FloatArray:
        """Return the places (n, 3) of the least distance on the surface near `feet`."""
        slope = self._jet(feet).slope
        along = ((points - feet) * slope).sum(axis=1) / (slope**2).sum(axis=1)
        rows, feet = np.arange(len(points)), feet.copy()
        for _ in range(STEPS):
            jet = self._jet(feet[rows])
            A = np.zeros((len(rows), 4, 4))
            A[:, :3, :3] = np.eye(3) + along[rows, np.newaxis, np.newaxis] * jet.bend
            A[:, :3, 3] = A[:, 3, :3] = jet.slope
            left = points[rows] - feet[rows] - along[rows, np.newaxis] * jet.slope
            move = np.linalg.solve(A, np.column_stack([left, -jet.value])[:, :, np.newaxis])[:, :, 0]
            size = np.linalg.norm(move[:, :3], axis=1)
            # Never farther than the seeds are apart: the closest point is near the nearest of them.
            move *= np.minimum(1.0, self.step / np.maximum(size, TOLERANCE))[:, np.newaxis]
            feet[rows] += move[:, :3]
            along[rows] += move[:, 3]
            rows = rows[size > TOLERANCE]
            if not len(rows):
                break
        return feet
