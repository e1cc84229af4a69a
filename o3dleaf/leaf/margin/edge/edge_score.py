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
from scipy.interpolate import RegularGridInterpolator
from scipy.special import log_ndtr, ndtr

from o3dleaf.core.checks.arrays import FloatArray

BLUR = 0.35
"""Spacings that an edge without noise is blurred by: a window of six spacings then has two points in the strip that
counts, fewer make the estimate biased; more of it leaves less information, 1.7/s for each length."""
CUT = 0.5
"""Spacings to which voxels that an edge cuts have their averages: in the middle of up to a whole one."""
SHUT_OUT = 0.125
"""Spacings within which a sample thinned to a least distance has more points along its edge: twice their mean depth."""
MAX_EXCESS = 2 / np.pi
"""Points more for each spacing of an edge: an edge of any direction across squares cuts 2/π of them for each of their
sides, where it would end as many if each counted by its share."""
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


def blurred(noise: FloatArray, excess: FloatArray | float = 0.0, depth: float = CUT) -> BlurredEdge:
    """Return what an edge with noise (n,), in spacings, is seen through, with more points along it (`crowded`)."""
    blur = np.hypot(BLUR, noise)
    ratios, table = _tables()
    offset, information, fitted, curved = (np.interp(noise / blur, ratios, column) for column in table.T)
    off = blur * offset + crowded(noise, excess, depth)
    return BlurredEdge(blur, off, information / blur, fitted, blur**2 * curved)


def crowded(noise: FloatArray, excess: FloatArray | float, depth: float = CUT) -> FloatArray:
    """Return how much farther out (n,) an edge is found that has `excess` (n,) points more for each spacing of it.

    They lie within so many spacings of it, and are moved by noise (n,), in spacings.
    """
    excess = np.broadcast_to(excess, noise.shape)
    if not excess.any():
        return np.zeros(len(noise))
    some = np.linspace(0.0, max(float(noise.max()), BLUR), 5)
    more = np.linspace(0.0, float(excess.max()), 5)
    off = [_roots(one, more, depth) - _roots(one, np.zeros(1), depth) for one in some]
    return np.asarray(RegularGridInterpolator((some, more), off)(np.stack([noise, excess], axis=1)))


def _roots(noise: float, excess: FloatArray, depth: float) -> FloatArray:
    """Return where an edge at 0 is found by single points of some noise, in spacings: where their scores are 1."""
    edges, whole, strip = _sums(noise, depth)
    return np.array([np.interp(-1.0, -(whole + each / depth * strip), edges) for each in excess])


@cache
def _sums(noise: float, depth: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return places of an edge (k,), and sums of scores there of points of a density inside it and of those as deep."""
    blur, sharp = float(np.hypot(BLUR, noise)), max(noise, 1e-9)
    edges, x = np.linspace(-1.0, 1.0, 101), np.linspace(-TABLE_END * blur, TABLE_END * blur, 4001)
    whole = ndtr(-x / sharp)
    scores = score((edges[:, None] - x) / blur) / blur
    strip = whole - ndtr(-(x + depth) / sharp)
    return edges, *(np.trapezoid(density * scores, x, axis=1) for density in (whole, strip))
