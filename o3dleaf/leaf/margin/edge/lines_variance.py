"""How well the area of a sample is known that lies on lines: the outermost may be anywhere beside the margin."""

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_metric import MAX_POINTS, own_metric

MIN_RATIO = 1.5
"""Distance of lines over that of points along them from which on they are lines: of independent points, and of even
lattices, it is 1.1 by chance."""
MIN_POINTS = 64
"""Points that show lines: two neighborhoods."""
HARMONICS = 16
"""Of the error of a sum over lines, whose share falls with their square."""


def lines_variance(points: FloatArray, polygon: shapely.Polygon) -> float:
    r"""Return the variance of an area by where the lines of a sample lie; 0 for one without lines of one direction.

    An area that is summed over lines at distances d, wherever the first one lies, has the variance

    .. math:: \sum_k \frac{1}{2 π^2 k^2} \Big| \oint d\, (n · ν)\, e^{2 π i k φ}\, dℓ \Big|^2, \qquad ∇φ = n / d,

    n the direction across the lines, ν that out of the margin: L² d²/12 for a stretch of length L along them, next to
    nothing where the margin crosses many. Directions are known to two deviations of 1/√n, and what lies along the
    lines but for that counts as along them. Of a margin that is itself found from the lines the phases on its two sides
    are not known, and stretches on which n · ν has one sign count each by itself.

    Parameters
    ----------
    points : (n, 2) ndarray
    polygon : shapely.Polygon
        The margin around them, with its holes.

    References
    ----------
    Kendall, D. G. (1948): On the number of lattice points inside a random oval. Q. J. Math. 19, 1-26.
    Matérn, B. (1989): Precision of area estimation: a numerical study. J. Microsc. 153, 269-284.
    """
    points = np.unique(points, axis=0)
    if len(points) < MIN_POINTS:
        return 0.0
    (low, high), axes = np.linalg.eigh(own_metric(points))
    if high < MIN_RATIO * low:
        return 0.0
    apart = float(np.sqrt(high / low * polygon.area / len(points)))
    astray = 2 / np.sqrt(min(len(points), MAX_POINTS))
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_parts(shapely.get_rings(polygon))]
    return float(sum(_of_ring(ring, axes[:, 0], apart, astray) for ring in rings))


def _of_ring(ring: FloatArray, across: FloatArray, apart: float, astray: float) -> float:
    """Return the variance by one ring, given the direction (2,) across lines, its deviation, and their distance."""
    side = np.diff(ring, axis=0)
    along, passed = across[0] * side[:, 1] - across[1] * side[:, 0], side @ across
    weight = apart * along
    passed = np.sign(passed) * np.maximum(np.abs(passed) - astray * np.abs(along), 0.0)
    phase = np.cumsum(passed / apart)
    begin = np.flatnonzero(np.diff(np.sign(weight), prepend=np.sign(weight[-1])))
    order = np.roll(np.arange(len(side)), -int(begin[0])) if len(begin) else np.arange(len(side))
    starts = begin - begin[0] if len(begin) else np.array([0])
    phase = phase[order] + np.where(order < order[0], phase[-1], 0.0)
    k = np.arange(1, HARMONICS + 1)[:, None]
    sums = np.add.reduceat(weight[order] * np.exp(2j * np.pi * k * phase), starts, axis=1)
    return float((np.abs(sums) ** 2 / (2 * np.pi**2 * k**2)).sum())
