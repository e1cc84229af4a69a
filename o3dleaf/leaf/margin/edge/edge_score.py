"""The likelihood of a straight edge given single points near it: that of a uniform sample that ends there, blurred.

Points of density ρ inside an edge at e, moved by noise of deviation s, have the density ρ Φ((e − x)/s) at a place x
across it (Φ the normal distribution's). Moving the edge out by de gains d log Φ for every point, and costs the points
that the strip would have held, ρ de for each length. So the edge is where the sum of the scores φ/(s Φ) is ρ for each
length. A sharp edge is seen through a blur too, `BLUR`: where it then comes out, and the information of each length of
it, follow from the means over a sample.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtr

from o3dleaf.core.checks.arrays import FloatArray

BLUR = 0.35
"""Spacings that an edge without noise is blurred by: a window of six spacings then has two points in the strip that
counts, fewer make the estimate biased; more of it leaves less information, 1.7/s for each length."""
TABLE_END = 12.0
"""Deviations from the edge beyond which the tables end."""
KERNEL, KERNEL_SQUARE = 1 / 3, 5 / 18
"""Times a bandwidth h, the value at 0 of the kernels 1/(1 + h⁶ω⁶) by which a curve with a stiff third derivative
averages, and of their square."""


class BlurredEdge(NamedTuple):
    """What an edge of some noise is seen through, and how far the edge so found lies from the true one in the mean.

    Each is an array (n,), in spacings: the deviation `blur` that is assumed; the `offset` of a straight edge; the
    `information`, the inverse variance of a length of one spacing; `fitted`, over the bandwidth, how far a curve lies
    off that is fitted to the points; `curved`, times the curvature, how far one that bends.
    """

    blur: FloatArray
    offset: FloatArray
    information: FloatArray
    fitted: FloatArray
    curved: FloatArray

    def bias(self, bandwidth: FloatArray, curvature: FloatArray, randomness: float) -> FloatArray:
        """Return how far (n,) a curve of greatest likelihood lies from the true one in the mean.

        Offset and curvature are of the mean density alone; fitted to is what varies, as much less as it is random.
        """
        return np.asarray(self.offset + randomness * self.fitted / bandwidth + self.curved * curvature)


def score(z: FloatArray) -> FloatArray:
    """Return φ(z)/Φ(z), the derivative of log Φ."""
    mills: FloatArray = np.exp(-(z**2) / 2 - log_ndtr(z)) / np.sqrt(2 * np.pi)
    return mills


@cache
def _tables() -> tuple[FloatArray, FloatArray]:
    """Return ratios of the noise to the blur (q,), and what `BlurredEdge` has of each besides a blur of 1 (q, 4)."""
    ratios = np.linspace(0.0, 1.0, 11)
    return ratios, np.array([_of_unit_blur(ratio) for ratio in ratios])


def _of_unit_blur(noise: float) -> tuple[float, float, float, float]:
    """Return offset, information and the biases of a fitted and of a bent curve, of an edge seen through a blur of 1.

    With λ(x) the density of the points and g = φ/Φ the score, M(d) = ∫ λ g(d − x) dx, the edge is found where M is 1.
    A curve that is fitted is moved by each point, so that the point's score is less by g' g K(0)/|M'|, and the mean of
    scores of a curve that strays is more by M'' V K²(0)/2 M'², V = ∫ λ g². Along a curve of curvature κ points at x
    are 1 + κ x as many, and noise draws in their density by κ σ²/2.
    """
    edges, x = np.linspace(-0.6, 0.2, 81), np.linspace(-TABLE_END, TABLE_END, 4001)
    density = ndtr(-x / max(noise, 1e-9))
    sums = np.trapezoid(density * score(edges[:, None] - x), x, axis=1)
    offset = float(np.interp(-1.0, -sums, edges))
    z = offset - x
    scores = score(z)
    slopes = -scores * (scores + z)
    bends = scores * ((scores + z) * (2 * scores + z) - 1)
    slope, square, bend, own, first = np.trapezoid(density * [slopes, scores**2, bends, scores * slopes, z * scores], x)
    information = slope**2 / square
    stiffness = (-information / slope) ** (1 / 6)  # bandwidths are those of the information, not of the curvature
    fitted = (own * KERNEL - bend * square * KERNEL_SQUARE / (2 * slope)) / (slope**2 * stiffness)
    return offset, float(information), float(fitted), float(first / slope - noise**2 / 2)


def blurred(noise: FloatArray) -> BlurredEdge:
    """Return what an edge with noise (n,), in spacings, is seen through."""
    blur = np.hypot(BLUR, noise)
    ratios, table = _tables()
    offset, information, fitted, curved = (np.interp(noise / blur, ratios, column) for column in table.T)
    return BlurredEdge(blur, blur * offset, information / blur, fitted, blur**2 * curved)
