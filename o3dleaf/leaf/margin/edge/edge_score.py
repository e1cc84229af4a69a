"""The likelihood of a straight edge given single points near it: that of a uniform sample that ends there, blurred.

Points of density ρ inside an edge at e, moved by noise of deviation s, have the density ρ Φ((e − x)/s) at a place x
across it (Φ the normal distribution's). Moving the edge out by de gains d log Φ for every point, and costs the points
that the strip would have held, ρ de for each length. So the edge is where the sum of the scores φ/(s Φ) is ρ for each
length. A sharp edge is seen through a blur too, `BLUR`: where it then comes out, and the information of each length of
it, follow from the means over a sample.
"""

from functools import cache

import numpy as np
from scipy.special import log_ndtr, ndtr

from o3dleaf.core.checks.arrays import FloatArray

BLUR = 0.35
"""Spacings that an edge without noise is blurred by: a window of six spacings then has two points in the strip that
counts, fewer make the estimate biased; more of it leaves less information, 1.7/s for each length."""
TABLE_END = 12.0
"""Deviations from the edge beyond which the tables end."""


def score(z: FloatArray) -> FloatArray:
    """Return φ(z)/Φ(z), the derivative of log Φ."""
    mills: FloatArray = np.exp(-(z**2) / 2 - log_ndtr(z)) / np.sqrt(2 * np.pi)
    return mills


@cache
def _tables() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ratios of the noise to the blur (q,), and for each the edge found and the information, of a blur of 1."""
    ratios, edges = np.linspace(0.0, 1.0, 11), np.linspace(-0.6, 0.2, 81)
    x = np.linspace(-TABLE_END, TABLE_END, 2001)
    scores = score(edges[:, None] - x)
    slopes = scores * (scores + edges[:, None] - x)
    offsets, known = np.empty_like(ratios), np.empty_like(ratios)
    for i, ratio in enumerate(ratios):
        density = ndtr(-x / max(ratio, 1e-9))
        offsets[i] = np.interp(-1.0, -np.trapezoid(density * scores, x, axis=1), edges)
        slope, square = (np.trapezoid(density * each, x, axis=1) for each in (slopes, scores**2))
        known[i] = np.interp(offsets[i], edges, slope**2 / square)
    return ratios, offsets, known


def blurred(noise: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what an edge with noise (n,), in spacings, is seen through.

    Returns
    -------
    blur, offset, information : (n,) ndarray
        The deviation s assumed; how far from the true edge the edge so found lies in the mean; the inverse variance
        of a length of one spacing.
    """
    blur = np.hypot(BLUR, noise)
    ratios, offsets, known = _tables()
    return blur, blur * np.interp(noise / blur, ratios, offsets), np.interp(noise / blur, ratios, known) / blur
