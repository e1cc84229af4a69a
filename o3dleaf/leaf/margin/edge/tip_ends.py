"""The ends of sharp tips: where their width falls to nothing, by the likelihood of the points in them."""

from typing import NamedTuple

import numpy as np
from scipy.special import expit, ndtr

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.edge.edge_fit import EdgeFit
from o3dleaf.leaf.margin.edge.edge_frame import NODE_STEP, EdgeSample
from o3dleaf.leaf.margin.edge.edge_score import KERNEL

WIDE, LONG, LONGEST = 5.0, 10.0, 20.0
"""Spacings of width, and from the end, up to which at least a tip is fitted, and at most: farther leaves bend."""
FEWEST_NODES = 6
"""Nodes to each side at least that a tip has."""
FEWEST_POINTS = 6
"""Points of a tip at least: as many as it has parameters."""
BEYOND = 8.0
"""Spacings beyond the curve up to which a tip may end, and its points are looked for."""
BESIDE = 2.0
"""Spacings beside its base up to which its points are looked for."""
BEGINS = 0.15
"""Spacings by which the curve is off, in the mean, where a tip begins: the deviation of a random sample's margin."""
BENT = 1 / 30
"""Deviation of half the curvature, over spacings, of a tip's middle line and of each flank's distance to it: both bend
little over the ten spacings of a tip."""
NOISY = 2.0
"""Deviations of the noise by which a point may lie beyond the end."""
STRAY = 0.02
"""Density of points that are of no tip, over the sample's: one that lies far off moves no flank."""
SOFT = 0.1
"""Spacings over which a width that falls below 0 becomes 0, so that the likelihood has a derivative at the end."""
STEP = 0.1
"""Spacings from one width to the next of those that an area is the sum of."""
SCORING_STEPS, CONVERGED = 60, 1e-5
"""At most as many steps, until one gains no more log likelihood."""
SUFFICIENT, SHORTEST = 1e-4, 1e-3
"""Share of what a step promises that it must gain (Armijo 1966), and the shortest share of a step that is tried."""


class _Tip(NamedTuple):
    """A tip in its own axes: from the middle `origin` of its base along `axis`, with `side` to its left.

    `spacing` is the sample's; the base is `steps` nodes from the tip to both sides, `half_width` and `length` are the
    curve's, in spacings.
    """

    origin: FloatArray
    axis: FloatArray
    side: FloatArray
    spacing: float
    steps: int
    half_width: float
    length: float


def with_ends(edge: EdgeFit, sample: EdgeSample) -> FloatArray:
    r"""Return the curve (k, 2) of an edge whose sharp tips end where their points say.

    A tip is a half width and a middle line, at distances u along its axis from its base, in spacings,

    .. math:: h(u) = h_0 - t u + b u^2, \qquad c(u) = c_0 + c_1 u + c_2 u^2,

    of greatest likelihood of its points (u, v), which have the density Φ((c + h − v)/s) − Φ((c − h − v)/s) where h is
    above 0, seen through the blur s of the edge; it begins at the curve, and bends little. Flanks are moved by what an
    edge so found is off, and meet where the width is 0. So both flanks are known by all points of the tip, while each
    for itself has few there and the curve ends bluntly: the last point of a sample is some spacings short of the end.

    Parameters
    ----------
    edge : EdgeFit
    sample : EdgeSample
    """
    curve, count = edge.curve.copy(), len(edge.curve)
    for apex in edge.apexes:
        tip = _tip(edge, apex)
        if tip is None:
            continue
        flanks = _flanks(tip, sample)
        if flanks is not None:
            rows = (apex + np.arange(1 - tip.steps, tip.steps)) % count
            curve[rows] += sample.randomness * (flanks - curve[rows])
    return curve


def _tip(edge: EdgeFit, apex: int) -> _Tip | None:
    """Return the tip at a row of the curve; None where its flanks do not run together, or over a gap."""
    count = len(edge.curve)
    others = [abs((other - apex + count // 2) % count - count // 2) for other in edge.apexes if other != apex]
    steps = np.arange(1, min([count // 4, *(away // 2 for away in others)]))
    if len(steps) < FEWEST_NODES:
        return None
    one, other = edge.curve[(apex - steps) % count], edge.curve[(apex + steps) % count]
    spacing = float(edge.spacing[(apex + np.arange(-steps[-1], steps[-1] + 1)) % count].mean())
    width = np.hypot(*(one - other).T) / spacing
    away = steps * NODE_STEP
    wide = np.flatnonzero((width > WIDE) & (away > LONG) | (away > LONGEST))
    last = int(wide[0]) if len(wide) else len(steps) - 1
    if edge.gap[(apex + np.arange(-steps[last], steps[last] + 1)) % count].any():
        return None
    origin, middle = ((one[row] + other[row]) / 2 for row in (last, last // 2))
    axis = middle - origin
    axis /= max(float(np.hypot(*axis)), 1e-300)
    side = np.array([-axis[1], axis[0]])
    half = float((other[last] - one[last]) @ side) / 2 / spacing
    length = float((edge.curve[apex] - origin) @ axis) / spacing
    if half <= 0 or length <= 0:
        return None  # the leaf lies around the flanks and not between them: a notch, whatever made it pass for a tip
    return _Tip(origin, axis, side, spacing, int(steps[last]), half, length)


def _flanks(tip: _Tip, sample: EdgeSample) -> FloatArray | None:
    """Return both flanks (2 steps - 1, 2) of a tip, to put between the ends of its base; None for no end in reach."""
    seen = sample.seen(np.array([tip.spacing]))
    way = (np.asarray(sample.local.tree.data) - tip.origin) / tip.spacing
    u, v = way @ tip.axis, way @ tip.side
    near = (u > 0) & (u < tip.length + BEYOND) & (np.abs(v) < tip.half_width + BESIDE)
    if near.sum() < FEWEST_POINTS:
        return None
    likelihood = TipLikelihood(u[near], v[near], float(seen.blur[0]), tip.half_width, tip.length)
    start = np.array([tip.half_width, tip.half_width / tip.length, 0.0, 0.0, 0.0, 0.0])
    h0, taper, bulge, *middle = shape = likelihood.least(start)
    # A curve of a bandwidth has 1/3 of a parameter for each bandwidth of it: so much is fitted to its points.
    bandwidth = KERNEL * 2 * tip.length / likelihood.parameters(shape)
    bias = seen.bias(np.array([bandwidth]), np.zeros(1), sample.randomness)[0]
    half_widths = np.polynomial.Polynomial([h0 - bias, -taper, bulge])
    ends = half_widths.roots()
    ends = ends[np.isreal(ends) & (ends.real > 0)].real
    if not len(ends) or ends.min() > tip.length + BEYOND:
        return None
    # Not before its last point: strays lie beside a tip, not on its middle line.
    on_it = near & (np.abs(v - np.polynomial.polynomial.polyval(u, middle)) < WIDE / 2) & (u < ends.min() + WIDE)
    end = max(ends.min(), u[on_it].max(initial=0.0) - NOISY * sample.noise / tip.spacing)
    share = np.arange(1, tip.steps + 1) / tip.steps
    half, u = np.maximum(half_widths(share * ends.min()), 0.0), share * end
    line = tip.origin + tip.spacing * u[:, None] * tip.axis
    before, after = (
        line + tip.spacing * (np.polynomial.polynomial.polyval(u, middle) + each)[:, None] * tip.side
        for each in (-half, half)
    )
    return np.vstack([before, after[-2::-1]])


class TipLikelihood:
    """The penalized likelihood of the points of a tip, as what is to be least.

    Parameters
    ----------
    u, v : (n,) ndarrays
        Along the axis and across it, in spacings.
    blur : float
    half_width, length : float
        Of the curve, from its base.
    """

    def __init__(self, u: FloatArray, v: FloatArray, blur: float, half_width: float, length: float) -> None:
        self.across, self.blur = v, blur
        zeros, places = np.zeros((3, len(u))), np.arange(0.0, length + 2 * BEYOND, STEP)
        self.widths = np.concatenate([[np.ones_like(u), -u, u**2], zeros])
        self.middles = np.concatenate([zeros, [np.ones_like(u), u, u**2]])
        self.area_widths = np.stack([np.ones_like(places), -places, places**2])
        self.expected = np.array([half_width, 0.0, 0.0, 0.0, 0.0, 0.0])
        self.known = np.array([BEGINS, np.inf, BENT, BEGINS, np.inf, BENT]) ** -2.0

    def __call__(self, shape: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return the value of h0, t, b, c0, c1, c2, its gradient (6,), and their information (6, 6)."""
        width, middle, width_there = shape @ self.widths, shape @ self.middles, shape[:3] @ self.area_widths
        half = _above_zero(width)
        left, right = (middle + half - self.across) / self.blur, (middle - half - self.across) / self.blur
        density = ndtr(left) - ndtr(right) + STRAY
        at_left, at_right = (np.exp(-(side**2) / 2) / np.sqrt(2 * np.pi) / self.blur for side in (left, right))
        rises = expit(width / SOFT)
        scores = (self.middles * (at_left - at_right) + self.widths * ((at_left + at_right) * rises)) / density
        off = shape - self.expected
        value = 2 * STEP * _above_zero(width_there).sum() - np.log(density).sum() + self.known @ off**2 / 2
        slope = self.known * off - scores.sum(axis=1)
        slope[:3] += 2 * STEP * self.area_widths @ expit(width_there / SOFT)
        return float(value), slope, scores @ scores.T + np.diag(self.known)

    def parameters(self, shape: FloatArray) -> float:
        """Return how many parameters the points tell: the trace of what they add to the inverse of the information."""
        return float(len(shape) - self.known @ np.linalg.pinv(self(shape)[2], hermitian=True).diagonal())

    def least(self, shape: FloatArray) -> FloatArray:
        """Return what it is least for, from a start (6,), by Fisher's scoring."""
        value, slope, information = self(shape)
        for _ in range(SCORING_STEPS):
            step, share = -np.linalg.lstsq(information, slope, rcond=None)[0], 1.0
            while (moved := self(shape + share * step))[0] > value + SUFFICIENT * share * (slope @ step):
                share /= 2
                if share < SHORTEST:
                    return shape
            gain, shape = value - moved[0], shape + share * step
            value, slope, information = moved
            if gain < CONVERGED:
                break
        return shape


def _above_zero(width: FloatArray) -> FloatArray:
    """Return widths, and about 0 where they are below it."""
    return np.asarray(SOFT * np.logaddexp(0.0, width / SOFT))
