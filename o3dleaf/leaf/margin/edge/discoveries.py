"""Stretches of a closed curve along which a softer curve is more likely than by chance: few gaps between points are."""

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import chdtrc

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray

FALSE = 0.05
"""Share of the windows found that chance has made, at most in the mean."""


def find_discoveries(twice: FloatArray, free: FloatArray, shortest: int) -> BoolArray:
    """Return the nodes (n,) of a closed curve in windows whose likelihood ratio is no chance's.

    By chance twice its logarithm is χ² of as many degrees of freedom as the softer curve has parameters more (Wilks
    1938). Windows are from the shortest one on up to half of the curve, each twice as long as the one before: teeth
    tell by their number, and of many windows some are unlikely by chance (Benjamini and Hochberg 1995).

    Parameters
    ----------
    twice : (n,) ndarray
        Twice the logarithm of how many times as likely the softer curve makes the points of each node.
    free : (n,) ndarray
        Its parameters more, of each node.
    shortest : int
        Nodes of the shortest window, an odd number.

    References
    ----------
    Benjamini, Y., Hochberg, Y. (1995): Controlling the false discovery rate. J. R. Stat. Soc. B 57, 289-300.
    Wilks, S. S. (1938): The large-sample distribution of the likelihood ratio. Ann. Math. Stat. 9, 60-62.
    """
    count, windows = len(twice), []
    while shortest <= count // 2:
        windows.append(shortest)
        shortest = 2 * shortest - 1
    if not windows:
        return np.zeros(count, dtype=bool)
    by_chance = np.array([_probability(twice, free, window) for window in windows])
    found = by_chance <= _largest_discovery(by_chance)
    spread = [maximum_filter1d(each, window, mode="wrap") for each, window in zip(found, windows, strict=True)]
    return np.asarray(np.any(spread, axis=0))


def _probability(twice: FloatArray, free: FloatArray, window: int) -> FloatArray:
    """Return the probability (n,) of what is found in the window around each node, or more; 1 where nothing is free."""
    more, freedom = (window * uniform_filter1d(each, window, mode="wrap") for each in (twice, free))
    least = np.finfo(float).tiny
    return np.where(freedom > 0, chdtrc(np.maximum(freedom, least), np.maximum(more, 0.0)), 1.0)


def _largest_discovery(probability: FloatArray) -> float:
    """Return the largest probability among those that are discoveries, or a negative number if none is."""
    ranked = np.sort(probability, axis=None)
    found = np.flatnonzero(ranked <= FALSE * np.arange(1, ranked.size + 1) / ranked.size)
    return float(ranked[found[-1]]) if len(found) else -1.0
