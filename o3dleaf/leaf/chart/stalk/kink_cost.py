"""Likelihood of points under a stalk that widens into a blade at a place, as logarithms.

The points are taken for a sample of the surface with a known density. Beside the stalk's silhouette the blade's
margins leave it straight, at once or after a jump; there are points inside them, and none before. Within it the points
are spread across and above as on the stalk, up to the place, and lie on the blade's surface from there on.
"""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.chart.stalk.kink_loops import add_margin_costs
from o3dleaf.leaf.chart.stalk.stalk_points import StalkLine, StalkPoints

REACH = 2.0
"""Widths past the place that are looked at."""
BESIDE = 1.5
"""Widths beside the silhouette that are looked at; so far margins count as straight."""
CLEAR_OFF = 0.15
"""Spacings beside the silhouette from which a point is outside it."""
SOFT = 0.2
"""Spacings over which margins are blurred besides the noise: they are not quite straight."""
SLOPES = np.tan(np.radians(np.arange(8.0, 88.0, 4.0)))
"""Of the margins against the stalk that are tried."""
JUMPS = np.concatenate([[0.0], np.geomspace(0.25, BESIDE, 8)])
"""Widths by which a margin leaves the silhouette at once, that are tried."""
STRIPS = 40
"""Of the quadrature of the area within a margin."""
STRAY = 0.002
"""Of the density: points that fit nothing."""
STRAY_INSIDE = 0.02
"""Share of the points within the silhouette that lie anywhere."""
KERNEL = 0.4
"""Spacings: deviation of the kernels by which the spread of the stalk's points is known."""
BENT = 0.1
"""Of the width, that the blade is off the quadric through its points where that goes on to the stalk."""
PATCH = (0.5, 3.5, 2.0)
"""Widths past the place from and up to which, and on either side, the quadric is fitted."""
ROUNDS = 5
"""Of reweighting that fit, so that points off the blade do not bend it."""


def outside_cost(points: StalkPoints, line: StalkLine, places: FloatArray, end: float, *, left: bool) -> FloatArray:
    """Return −log likelihoods (k,) of the points beside one side of the silhouette, for an end at each of `places`.

    Of all slopes and jumps of the margin the likeliest; a jump costs what its freedom is worth (Schwarz 1978, Ann.
    Statist. 6:461).

    Parameters
    ----------
    points : StalkPoints
        Straightened, those that may be the blade's.
    line : StalkLine
    places : (k,) ndarray
    end : float
        Where what is looked at ends.
    left : bool
    """
    nearest, farthest = CLEAR_OFF * points.spacing, BESIDE * line.width
    beside = (points.aside if left else -points.aside) - line.width / 2
    taken = (beside > nearest) & (beside < farthest)
    at, beside = points.at[taken], beside[taken]
    K, M, A = np.meshgrid(places, SLOPES, line.width * JUMPS, indexing="ij")
    strips = np.linspace(nearest, farthest, STRIPS, endpoint=False) + (farthest - nearest) / (2 * STRIPS)
    area = sum(np.maximum(end - K - np.maximum(strip - A, 0) / M, 0) for strip in strips) * (strips[1] - strips[0])
    density, soft = 1 / points.spacing**2, np.hypot(points.noise, SOFT * points.spacing)
    fringe = _fringe(points, line, nearest, beside)
    cost = density * area + np.log(max(2, len(at))) * (A > 0)
    add_margin_costs(at, beside, fringe, places, SLOPES, line.width * JUMPS, density, float(soft), STRAY, cost)
    return np.asarray(cost.reshape(len(places), -1).min(axis=1))


def _fringe(points: StalkPoints, line: StalkLine, nearest: float, beside: FloatArray) -> FloatArray:
    """Return the density (n,) at distances (n,) beside the silhouette of the stalk's own points: it falls off.

    As an exponential of the mean that the points of the stalk's piece have, and one point more.
    """
    own = np.abs(points.aside[line.piece]) - line.width / 2
    own = own[own > nearest] - nearest
    decay = (own.sum() + CLEAR_OFF * points.spacing) / (len(own) + 1)
    length = float(np.ptp(points.at[line.piece]))
    return np.asarray((len(own) + 1) / (2 * length * decay) * np.exp(-(beside - nearest) / decay))


def inside_cost(
    points: StalkPoints, line: StalkLine, places: FloatArray, limits: tuple[float, float], taken: BoolArray
) -> FloatArray:
    """Return −log likelihoods (k,) of the points within the silhouette, for an end at each of `places`.

    Parameters
    ----------
    points : StalkPoints
        Straightened.
    line : StalkLine
    places : (k,) ndarray
    limits : tuple of two floats
        Between which they are looked at.
    taken : (n,) ndarray of bool
        Which points may be the stalk's or the blade's beside it.
    """
    middle = float(places[len(places) // 2])
    density, soft = 1 / points.spacing**2, np.hypot(points.noise, SOFT * points.spacing)
    heights = _heights(points.of(taken), middle, line.width, float(soft))
    if heights is None:
        return np.zeros(len(places))
    rows = np.flatnonzero(taken & (np.abs(points.aside) < line.width / 2 + CLEAR_OFF * points.spacing))
    rows = rows[np.argsort(points.at[rows], kind="stable")]
    rows = rows[(points.at[rows] > limits[0]) & (points.at[rows] < limits[1])]
    at, spread = points.at[rows], np.hypot(soft, BENT * line.width)
    off = (points.above[rows] - _quadric(at - middle, points.aside[rows]) @ heights) / spread
    blade = density * (np.exp(-0.5 * off * off) / (spread * np.sqrt(2 * np.pi)) + STRAY_INSIDE / line.width)
    per_length = float(line.piece.sum() / np.ptp(points.at[line.piece]))
    stalk = per_length * (_spread(points, line, rows) + STRAY_INSIDE / line.width**2)
    before = np.concatenate([[0.0], np.cumsum(np.log(stalk))])
    after = np.concatenate([[0.0], np.cumsum(np.log(blade))])
    last = np.searchsorted(at, places)
    seen = before[last] + after[-1] - after[last]
    expected = per_length * (places - limits[0]) + density * line.width * (limits[1] - places)
    return np.asarray(expected - seen)


def _heights(points: StalkPoints, middle: float, width: float, soft: float) -> FloatArray | None:
    """Return the (6,) coefficients of the blade's height above the plane past the end of a stalk."""
    first, last, aside = (width * share for share in PATCH)
    ahead = points.at - middle
    patch = (ahead > first) & (ahead < last) & (np.abs(points.aside) < aside)
    if patch.sum() < 12:
        return None
    terms, height = _quadric(ahead[patch], points.aside[patch]), points.above[patch]
    weight = np.ones(len(height))
    for _ in range(ROUNDS):
        fit = np.linalg.lstsq(terms * weight[:, np.newaxis], height * weight, rcond=None)[0]
        weight = 1 / np.sqrt(1 + ((height - terms @ fit) / soft) ** 2)
    return np.asarray(fit)


def _quadric(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _spread(points: StalkPoints, line: StalkLine, rows: IntArray) -> FloatArray:
    """Return the density (k,) of a stalk's points across it, at some of the points: kernels about the other ones."""
    section = np.column_stack([points.aside, points.above])
    deviation = KERNEL * points.spacing
    peak = 1 / (2 * np.pi * deviation**2)
    square = ((section[rows, np.newaxis] - section[line.piece]) ** 2).sum(axis=2)
    own = line.piece[rows]
    density = peak * (np.exp(-0.5 * square / deviation**2).sum(axis=1) - own)
    return np.asarray(density / np.maximum(line.piece.sum() - own, 1))
