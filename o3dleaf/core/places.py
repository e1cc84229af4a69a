"""Places of the world as a message tells them: to a share of the size of what they lie in, wherever its origin is."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray

SHARE = 1e-3
"""Of the size of a cloud, to which its places are told at least: some tenths of the spacing of most scans."""
DECIMALS = 12
"""At most, and where there is no size."""


def extent(points: FloatArray) -> float:
    """Return the length of the longest side of the box around points (n, d)."""
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def tell_place(point: FloatArray, among: FloatArray) -> str:
    """Return a point (d,) as text, with as many decimals as tell a thousandth of the extent of points (n, d).

    Whatever the point's distance from the origin is: in a grid of the Earth a millimeter is the tenth digit.
    """
    size = extent(among)
    decimals = int(np.clip(np.ceil(-np.log10(SHARE * size)), 0, DECIMALS)) if 0 < size < np.inf else DECIMALS
    # Adding zero makes 0 of −0.
    return " ".join(f"{round(float(x), decimals) + 0.0:.{decimals}f}" for x in point)


def tell_middle(points: FloatArray, among: FloatArray) -> str:
    """Return the place of that of some points (k, d) that is nearest to their median, among others (n, d), as text."""
    return tell_place(middle_of(points), among)


def middle_of(points: FloatArray) -> FloatArray:
    """Return the one of some points (k, d) that is nearest to their median."""
    return np.asarray(points[np.linalg.norm(points - np.median(points, axis=0), axis=1).argmin()])
