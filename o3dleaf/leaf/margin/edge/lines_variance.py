"""How well the area of a sample is known that lies on lines: the outermost may be anywhere beside the margin."""

import numpy as np
import shapely
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.core.trees import query
from o3dleaf.leaf.margin.sample_lines import SampleLines, sample_lines
from o3dleaf.leaf.margin.sample_region import DEEP
from o3dleaf.leaf.margin.sample_spacing import NEIGHBORS, BoolArray, SampleNeighbors

HARMONICS = 16
"""Of the error of a sum over lines, whose share falls with their square."""


def lines_variance(points: FloatArray, polygon: shapely.Polygon) -> float:
    r"""Return the variance of an area by where the lines of a sample lie; 0 for one without lines.

    An area that is summed over lines at distances d, wherever the first one lies, has the variance

    .. math:: \sum_k \frac{1}{2 π^2 k^2} \Big| \oint d\, (n · ν)\, e^{2 π i k φ}\, dℓ \Big|^2, \qquad ∇φ = n / d,

    n the direction across the lines, ν that out of the margin: L² d²/12 for a stretch of length L along them, next to
    nothing where the margin crosses many. What lies along the lines but for two deviations of their directions counts
    as along them. Of a margin that is itself found from the lines the phases on its two sides are not known, and
    stretches on which n · ν has one sign count each by itself.

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
    points = UniqueRows.of(points).rows
    if not len(points):
        return 0.0
    spacing = np.sqrt(polygon.area / len(points))
    lines = sample_lines(SampleNeighbors.of(points), np.full(len(points), spacing))
    if lines is None or not lines.inside(_deep(points, polygon, spacing)):
        return 0.0
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_parts(shapely.get_rings(polygon))]
    return float(sum(_of_ring(ring, lines) for ring in rings))


def _deep(points: FloatArray, polygon: shapely.Polygon, spacing: float) -> BoolArray:
    """Return which points (n,) lie `DEEP` spacings inside, or in a narrow leaf less: all, if no more than a few do."""
    border = shapely.get_coordinates(shapely.segmentize(polygon.boundary, spacing / 2))
    away = query(cKDTree(border), points)[0]
    tries = (away > share * DEEP * spacing for share in (1.0, 0.5))
    return next((deep for deep in tries if deep.sum() > NEIGHBORS), np.ones(len(points), dtype=bool))


def _of_ring(ring: FloatArray, lines: SampleLines) -> float:
    """Return the variance by one ring."""
    side = np.diff(ring, axis=0)
    near = lines.nearest((ring[1:] + ring[:-1]) / 2)
    x, y = lines.along[near].T
    turned = np.cumprod(np.where(x[1:] * x[:-1] + y[1:] * y[:-1] < 0, -1.0, 1.0))
    x, y = x * np.append(1.0, turned), y * np.append(1.0, turned)
    along, passed = x * side[:, 0] + y * side[:, 1], x * side[:, 1] - y * side[:, 0]
    weight = np.where(lines.clear[near], lines.apart[near] * along, 0.0)
    passed = np.sign(passed) * np.maximum(np.abs(passed) - 2 * lines.astray[near] * np.abs(along), 0.0)
    phase = np.cumsum(passed / lines.apart[near])
    begin = np.flatnonzero(np.diff(np.sign(weight), prepend=np.sign(weight[-1])))
    order = np.roll(np.arange(len(side)), -int(begin[0])) if len(begin) else np.arange(len(side))
    starts = begin - begin[0] if len(begin) else np.array([0])
    phase = phase[order] + np.where(order < order[0], phase[-1], 0.0)
    k = np.arange(1, HARMONICS + 1)[:, None]
    sums = np.add.reduceat(weight[order] * np.exp(2j * np.pi * k * phase), starts, axis=1)
    return float((np.abs(sums) ** 2 / (2 * np.pi**2 * k**2)).sum())
