"""The sheets that leave a line: arms of the points in the plane across it, counted and told from what only looks so."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.surface.cloud.branchings.axes import Axes
from o3dleaf.surface.cloud.neighbors import IndexArray

INNER, OUTER, ALONG = 1.5, 4.5, 4.0
"""Spacings off the line between which arms are sought, and on both sides along it: nearer they run into one another,
and three shells of a spacing tell arms that start at the line from sheets that pass it."""
SHELLS = 3
BINS = 36
"""Directions in the plane across: of 10°, as far as noise of a quarter of a spacing turns a point half way out."""
EMPTY = 0.04
"""Share of the points up to which a direction holds none: an even share is 0.028, a fourth of three arms' 0.08."""
MIN_SHARE = 0.25
"""Points of an arm in a shell at least, over those of the arm that has most there: arms of unlike density count too."""
FEWEST = 2
"""Points of an arm in a shell at least."""
EXPLAINED = 0.9
"""Share of the points that belongs to arms at least."""
THICK, NOISES = 0.15, 2.0
"""Spacings, and deviations of the noise, that points may lie off an arm's curve: a double layer lies farther off."""
MIN_ANGLE = np.radians(35.0)
"""Between two arms: sheets that meet at less touch, and their planes turn into one another."""
TWO_SIDED = 0.25
"""Share of an arm's normals that point to its other side from which on it is a thin solid's, two sheets."""
MAX_ARMS = 8
"""Arms counted at most."""


class Arms(NamedTuple):
    """Number of sheets that leave each of (m,) lines, 0 where they are not arms, and least angle (m,) between two.

    `sure` (m,) is False where an arm has few points in one of the shells: by chance, or because it begins elsewhere.
    """

    sheets: IndexArray
    angle: FloatArray
    sure: npt.NDArray[np.bool_]

    def take(self, rows: IndexArray) -> "Arms":
        """Return those of some of the lines."""
        return Arms(self.sheets[rows], self.angle[rows], self.sure[rows])


class _Ring(NamedTuple):
    """The points around lines: whose they are, their rows, place (p, 2) across, in spacings, radius, direction (p,)."""

    owner: IndexArray
    row: IndexArray
    place: FloatArray
    radius: FloatArray
    bin: IndexArray
    lines: int

    @classmethod
    def of(cls, axes: Axes, tree: cKDTree) -> "_Ring":
        points = tree.data.copy()  # since SciPy 1.18 it is read-only, and compiled code takes such for others
        owner, row = _pairs_within(points, axes.point, np.hypot(OUTER, ALONG) * axes.spacing)
        arm = (points[row] - axes.point[owner]) / axes.spacing[owner, np.newaxis]
        along = np.einsum("pi,pi->p", arm, axes.direction[owner])
        place = np.einsum("pi,pij->pj", arm, axes.across[owner])
        radius = np.linalg.norm(place, axis=1)
        kept = (np.abs(along) <= ALONG) & (radius >= INNER) & (radius <= OUTER)
        owner, row, place, radius = owner[kept], row[kept], place[kept], radius[kept]
        turn = (np.arctan2(place[:, 1], place[:, 0]) / (2 * np.pi)) % 1.0
        return cls(owner, row, place, radius, np.minimum((turn * BINS).astype(np.int64), BINS - 1), len(axes))


def count_arms(axes: Axes, tree: cKDTree, noise: FloatArray, normals: FloatArray | None = None) -> Arms:
    """Return how many sheets leave each line, by the points of a tree around it.

    Every arm begins at the line, reaches out as far as is looked, is a thin curve, and stands apart from the others;
    nearly all points lie on one. A crease has two, a corner none, as faces fill the plane across; a sheet that passes
    the line is parallel to another arm, or does not begin there. Where normals are known, an arm with normals to both
    sides is a thin part of a solid and counts as two.

    Parameters
    ----------
    axes : Axes
    tree : scipy.spatial.cKDTree
        Of the cloud.
    noise : (m,) ndarray
        Standard deviation of the points off their planes.
    normals : (n, 3) ndarray, optional
        Outward ones.
    """
    ring = _Ring.of(axes, tree)
    arm = _label(ring)
    most = np.zeros(ring.lines, np.int64)
    np.maximum.at(most, ring.owner, arm)
    good = (most >= 3) & (most <= MAX_ARMS)
    whole = np.bincount(ring.owner, minlength=ring.lines)
    good &= np.bincount(ring.owner, arm > 0, ring.lines) >= EXPLAINED * whole
    on = (arm > 0) & good[ring.owner]
    key = ring.owner[on] * MAX_ARMS + arm[on] - 1
    real = np.arange(MAX_ARMS) < most[:, np.newaxis]
    shell = np.minimum(((ring.radius[on] - INNER) / (OUTER - INNER) * SHELLS).astype(np.int64), SHELLS - 1)
    held = np.bincount(key * SHELLS + shell, minlength=ring.lines * MAX_ARMS * SHELLS).reshape(-1, MAX_ARMS, SHELLS)
    enough = held >= np.maximum(FEWEST, MIN_SHARE * held.max(axis=1, keepdims=True))
    off, heading = _fit(key, ring.place[on], ring.radius[on], ring.lines * MAX_ARMS)
    thin = off.reshape(-1, MAX_ARMS) <= (NOISES * noise / axes.spacing + THICK)[:, np.newaxis]
    good &= (thin & (held.sum(axis=2) >= SHELLS * FEWEST) | ~real).all(axis=1)
    angle = _least_angle(np.where(real, heading.reshape(-1, MAX_ARMS), np.nan))
    good &= angle >= MIN_ANGLE
    if normals is not None:
        most = most + _two_sided(ring, on, key, axes, normals).reshape(-1, MAX_ARMS).sum(axis=1)
    return Arms(np.where(good, most, 0), angle, (enough.all(axis=2) | ~real).all(axis=1))


def _label(ring: _Ring) -> IndexArray:
    """Return the arm (p,) of each point, from 1 on, 0 for none: a run of directions with points, and one beside."""
    held = np.bincount(ring.owner * BINS + ring.bin, minlength=ring.lines * BINS).reshape(-1, BINS)
    full = held >= EMPTY * np.maximum(held.sum(axis=1, keepdims=True), 1 / EMPTY)
    turned = (np.argmin(full, axis=1)[:, np.newaxis] + np.arange(BINS)) % BINS  # begins in a gap, if there is one
    rolled = np.take_along_axis(full, turned, axis=1)
    starts = rolled & ~np.column_stack([np.zeros(len(rolled), bool), rolled[:, :-1]])
    label = np.empty_like(held)
    np.put_along_axis(label, turned, np.where(rolled, np.cumsum(starts, axis=1), 0), axis=1)
    label[full.all(axis=1)] = 0
    beside = np.maximum(np.roll(label, 1, axis=1), np.roll(label, -1, axis=1))
    return np.asarray(np.where(label == 0, beside, label)[ring.owner, ring.bin], np.int64)


def _two_sided(
    ring: _Ring, on: npt.NDArray[np.bool_], key: IndexArray, axes: Axes, normals: FloatArray
) -> npt.NDArray[np.bool_]:
    """Return which arms (m * MAX_ARMS,) have normals to both of their sides."""
    place, count = ring.place[on], ring.lines * MAX_ARMS
    normal = np.einsum("pi,pij->pj", normals[ring.row[on]], axes.across[ring.owner[on]])
    mean = np.column_stack([np.bincount(key, place[:, axis], count) for axis in range(2)])
    left = mean[key, 0] * normal[:, 1] > mean[key, 1] * normal[:, 0]
    share = np.bincount(key, left, count) / np.maximum(np.bincount(key, minlength=count), 1)
    return np.asarray(np.minimum(share, 1 - share) >= TWO_SIDED)


def _fit(key: IndexArray, place: FloatArray, radius: FloatArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return how far points lie off their arm's curve (count,), root mean square, and its heading at the line.

    The curve leaves the line: its distance from the arm's mean direction is a r + b r².
    """
    held = np.maximum(np.bincount(key, minlength=count), 1)
    mean = np.column_stack([np.bincount(key, place[:, axis], count) for axis in range(2)]).astype(np.float64)
    mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-12)[:, np.newaxis]
    side = mean[key, 0] * place[:, 1] - mean[key, 1] * place[:, 0]

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(key, values, count), np.float64)

    matrix = np.stack([total(radius**2), total(radius**3), total(radius**3), total(radius**4)], axis=1)
    matrix = matrix.reshape(-1, 2, 2) + 1e-9 * np.eye(2)
    right = np.stack([total(radius * side), total(radius**2 * side)], axis=1)
    slope, bend = np.linalg.solve(matrix, right[:, :, np.newaxis])[:, :, 0].T
    miss = side - slope[key] * radius - bend[key] * radius**2
    heading = np.arctan2(mean[:, 1], mean[:, 0]) + np.arctan(slope)
    return np.sqrt(total(miss**2) / held), heading


def _least_angle(heading: npt.NDArray[np.float64]) -> FloatArray:
    """Return the least angle (m,) between two of the headings (m, MAX_ARMS) of each row, NaN aside."""
    ordered = np.sort(np.mod(heading, 2 * np.pi), axis=1)
    last = np.nanmax(np.where(np.isnan(ordered).all(axis=1, keepdims=True), 0.0, ordered), axis=1)
    around = ordered[:, 0] + 2 * np.pi - last
    gaps = np.column_stack([np.diff(ordered, axis=1), around])
    return np.asarray(np.min(np.where(np.isnan(gaps), np.inf, gaps), axis=1))


def _pairs_within(points: FloatArray, places: FloatArray, reach: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return for all of the points (n, 3) within the `reach` (m,) of places (m, 3) the place's row and the point's."""
    offsets, inside = BallIndex.build(places, reach, box_of(points)).members(points)
    return np.repeat(np.arange(len(places)), np.diff(offsets)), inside
