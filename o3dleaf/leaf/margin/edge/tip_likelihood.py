"""The likelihood of the points of a tip, by its half width and its middle line."""

import numpy as np
from scipy.special import expit, ndtr

from o3dleaf.core.checks.arrays import FloatArray

BEYOND = 8.0
"""Spacings beyond the curve up to which a tip may end, and its points are looked for."""
BEGINS = 0.15
"""Spacings by which the curve is off, in the mean, where a tip begins: the deviation of a random sample's margin."""
BENT = 1 / 30
"""Deviation of half the curvature, over spacings, of a tip's middle line and of each flank's distance to it: both bend
little over the length of a tip."""
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


class TipLikelihood:
    r"""What is to be least: the negative penalized log likelihood of the points of a tip.

    A tip is a half width and a middle line, at distances u along its axis from its base, in spacings,

    .. math:: h(u) = h_0 - t u + b u^2, \qquad c(u) = c_0 + c_1 u + c_2 u^2,

    and its points (u, v) are a Poisson process of density Φ((c + h − v)/s) − Φ((c − h − v)/s) where h is above 0, which
    is 1 between the flanks, seen through the blur s, and of `STRAY` anywhere. It begins at the curve, and bends little.

    Parameters
    ----------
    u, v : (n,) ndarrays
        Along the axis and across it, in spacings.
    blur : float
        The deviation s, in spacings.
    half_width, length : float
        Of the curve at its base, and from there to its end, in spacings.
    """

    def __init__(self, u: FloatArray, v: FloatArray, blur: float, half_width: float, length: float) -> None:
        self.across, self.blur = v, blur
        zeros, places = np.zeros((3, len(u))), np.arange(0.0, length + 2 * BEYOND, STEP)
        self.widths = np.concatenate([[np.ones_like(u), -u, u**2], zeros])
        self.middles = np.concatenate([zeros, [np.ones_like(u), u, u**2]])
        self.area_widths = np.stack([np.ones_like(places), -places, places**2])
        self.expected = np.array([half_width, 0.0, 0.0, 0.0, 0.0, 0.0])
        self.precision = np.array([BEGINS, np.inf, BENT, BEGINS, np.inf, BENT]) ** -2.0

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
        value = 2 * STEP * _above_zero(width_there).sum() - np.log(density).sum() + self.precision @ off**2 / 2
        slope = self.precision * off - scores.sum(axis=1)
        slope[:3] += 2 * STEP * self.area_widths @ expit(width_there / SOFT)
        return float(value), slope, scores @ scores.T + np.diag(self.precision)

    def parameters(self, shape: FloatArray) -> float:
        """Return the effective number of parameters: tr(I⁻¹ (I − P)), P the precision that is known before."""
        return float(len(shape) - self.precision @ np.linalg.pinv(self(shape)[2], hermitian=True).diagonal())

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
