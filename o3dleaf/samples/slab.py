"""A thin wavy sheet with two faces and a round rim: what a leaf is to a method of reconstruction."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import NotNegative, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.samples.meshed import Meshed
from o3dleaf.samples.solids import Feet

SEEDS = (121, 81)
"""Points of the mid-surface that start the search for the closest one."""
STEPS = 40
TOLERANCE = 1e-12
ROUNDING = 1e-15
"""Of squared distances: without it the last of Newton's steps, the best ones, would not seem to descend."""


@checked
@dataclass(frozen=True, eq=False)
class WavySheet(Meshed):
    r"""All points within half a thickness of a wavy rectangle: two faces, a round rim, one closed surface.

    .. math:: z = a \sin(2 \pi x / \ell) \cos(2 \pi y / \ell), \qquad |x| \le l / 2,\ |y| \le w / 2.

    The waves bend with radii of at least ℓ² / (4 π² a), more than half the thickness, so that the
    distance to the sheet's surface is that to the rectangle less half the thickness, inside as well.

    Attributes
    ----------
    length, width : float
        Of the rectangle before it is bent.
    thickness : float
        Three spacings of a cloud of 5,000 points, 3 √(area / 5000).
    amplitude, wave : float
        Height and length of the waves.
    """

    length: Positive = 1.0
    width: Positive = 0.7
    thickness: Positive = 0.0576
    amplitude: NotNegative = 0.05
    wave: Positive = 0.5

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of its box."""
        reach = np.array([self.length / 2, self.width / 2, self.amplitude]) + self.thickness / 2
        return np.array([[-1.0], [1.0]]) * reach

    @property
    def step(self) -> float:
        """Step of the lattice that samples are drawn with: a fifth of the rim's radius leaves 0.5 % of unevenness."""
        return self.thickness / 10

    @cached_property
    def _seeds(self) -> tuple[KDTree, FloatArray]:
        half = self.length / 2, self.width / 2
        axes = (np.linspace(-h, h, n) for h, n in zip(half, SEEDS, strict=True))
        sites = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        return KDTree(np.column_stack([sites, self._height(sites)])), sites

    def _height(self, sites: FloatArray) -> FloatArray:
        """Return the (n,) heights of the waves at (n, 2) sites."""
        k = 2 * np.pi / self.wave
        return np.asarray(self.amplitude * np.sin(k * sites[:, 0]) * np.cos(k * sites[:, 1]))

    def _slopes(self, sites: FloatArray) -> FloatArray:
        """Return the (n, 2) slopes of the waves."""
        k = 2 * np.pi / self.wave
        x, y = (k * sites).T
        return self.amplitude * k * np.column_stack([np.cos(x) * np.cos(y), -np.sin(x) * np.sin(y)])

    def _bends(self, sites: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the second derivatives of the waves, along either axis and mixed."""
        k = 2 * np.pi / self.wave
        x, y = (k * sites).T
        return -self.amplitude * k**2 * np.sin(x) * np.cos(y), -self.amplitude * k**2 * np.cos(x) * np.sin(y)

    def _level(self, points: FloatArray) -> FloatArray:
        tree, _ = self._seeds
        value = self.thickness / 2 - tree.query(points)[0]
        # Cells that the surface may cross are the only ones whose corners must be exact.
        near = np.abs(value) < 3 * self.step
        value[near] = -self._feet(points[near]).distance
        return np.asarray(value)

    def _feet(self, points: FloatArray) -> Feet:
        tree, stations = self._seeds
        sites = self._refine(points, stations[tree.query(points)[1]])
        middle = np.column_stack([sites, self._height(sites)])
        length = np.linalg.norm(points - middle, axis=1)
        up = np.column_stack([-self._slopes(sites), np.ones(len(points))])
        # A point of the mid-surface itself is as far from either face; it goes to the upper one.
        way = np.where(length[:, np.newaxis] > 0, points - middle, up)
        normals = way / np.linalg.norm(way, axis=1)[:, np.newaxis]
        return Feet(middle + self.thickness / 2 * normals, normals, length - self.thickness / 2)

    def _refine(self, points: FloatArray, sites: FloatArray) -> FloatArray:
        """Return sites (n, 2) of the least distance, by Newton's method kept to the rectangle and made to descend."""
        half = np.array([self.length / 2, self.width / 2])
        closest, rows = sites.copy(), np.arange(len(points))
        miss, damping = self._miss(points, sites), np.zeros(len(points))
        for _ in range(STEPS):
            trial = np.clip(sites + self._newton(points, sites, damping), -half, half)
            left = self._miss(points, trial)
            better = left <= miss + ROUNDING
            moving = np.abs(trial - sites).max(axis=1) > TOLERANCE
            sites, miss = np.where(better[:, np.newaxis], trial, sites), np.where(better, left, miss)
            damping = np.where(better, 0.1 * damping, np.maximum(10 * damping, 0.1))
            closest[rows] = sites
            rows, points, sites = rows[moving], points[moving], sites[moving]
            miss, damping = miss[moving], damping[moving]
            if not len(rows):
                break
        return closest

    def _miss(self, points: FloatArray, sites: FloatArray) -> FloatArray:
        """Return the (n,) squared distances to the waves at (n, 2) sites."""
        flat, up = points[:, :2] - sites, points[:, 2] - self._height(sites)
        return np.asarray(flat[:, 0] ** 2 + flat[:, 1] ** 2 + up**2)

    def _newton(self, points: FloatArray, sites: FloatArray, damping: FloatArray) -> FloatArray:
        """Return a damped Newton step (n, 2); a coordinate at its bound stays."""
        half = np.array([self.length / 2, self.width / 2])
        slopes, (same, mixed) = self._slopes(sites), self._bends(sites)
        up = points[:, 2] - self._height(sites)
        fall = points[:, :2] - sites + up[:, np.newaxis] * slopes
        metric = np.column_stack([1 + slopes**2, slopes.prod(axis=1)])
        curved = metric - up[:, np.newaxis] * np.column_stack([same, same, mixed])
        # Where the distance is not convex, Gauss and Newton's matrix is.
        convex = (curved[:, 0] > 0) & (curved[:, 0] * curved[:, 1] > curved[:, 2] ** 2)
        a, b, c = (np.where(convex[:, np.newaxis], curved, metric) + damping[:, np.newaxis] * metric).T
        at_bound = ((sites <= -half) & (fall < 0)) | ((sites >= half) & (fall > 0))
        (p, q), c = np.where(at_bound, 0.0, fall).T, np.where(at_bound.any(axis=1), 0.0, c)
        return np.asarray(np.column_stack([b * p - c * q, a * q - c * p]) / (a * b - c**2)[:, np.newaxis])
