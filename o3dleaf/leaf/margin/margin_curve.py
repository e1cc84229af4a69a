"""Rings of a covered region as curves: smoothed without shrinking, and grown to where the leaf ends."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree
from scipy.special import erfc

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_lines import SampleLines

STEP = 0.2
"""Step of a curve, in local spacings."""
WIDTH = 1.5
"""Width of the Gaussian that rings are smoothed by, in local spacings: jags of a sample are about one long."""
COUNT_WIDTH = 4.0
"""The same for the number of points along a ring, which is noisier than their places."""
CREASE_WIDTH = 0.5
"""The same for creases where growth has met itself."""
MAX_NOISE = 0.75
"""Spacings of noise that growth is corrected for; more is taken for passes that disagree, which do not blur an edge."""
MAX_GROWTH = 1.5
"""How far the leaf goes on at most, in spacings or distances of lines: three times what it does in a lattice."""
EQUAL = 1 + 1e-6
"""Ratio of distances up to which they differ by roundings."""
MAX_PIECES = 64
"""Pieces of a ring for each of its corners, at most, in which spacings are looked up."""


@dataclass(frozen=True)
class Spacing:
    """The local spacing of a sample, at any place of the plane."""

    tree: cKDTree
    values: FloatArray

    def __call__(self, places: FloatArray) -> FloatArray:
        """Return the spacing (k,) at (k, 2) places: the mean of the four nearest points'."""
        near = self.tree.query(places, k=min(4, len(self.values)))[1]
        spacing: FloatArray = self.values[near].mean(axis=1)
        return spacing


def resample(ring: FloatArray, spacing: Spacing, step: float = STEP) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a closed curve (k, 2) in steps of `step` local spacings, its (k,) spacings, and where it was taken.

    The last are lengths (k,) along the ring. None depends on its corners, of which a union may have more by a rounding.
    """
    lengths = _lengths_along(ring)
    most = MAX_PIECES * len(ring)
    pieces = int(np.clip(np.ceil(lengths[-1] / (2 * step * spacing.values.min())), 1, most))
    ends = np.linspace(0, lengths[-1], pieces + 1)
    local = spacing(_at(ring, lengths, (ends[1:] + ends[:-1]) / 2))
    along = np.concatenate([[0], np.cumsum(np.diff(ends) / local)])
    count = max(12, round(along[-1] / step))
    taken = np.interp(np.arange(count) * (along[-1] / count), along, ends)
    places = _at(ring, lengths, taken)
    return places, spacing(places), taken


def _lengths_along(ring: FloatArray) -> FloatArray:
    """Return the lengths (r + 1,) along a ring (r, 2) up to its corners, the first one again at the end."""
    sides = np.roll(ring, -1, axis=0) - ring
    return np.concatenate([[0.0], np.cumsum(np.hypot(*sides.T))])


def _at(ring: FloatArray, lengths: FloatArray, taken: FloatArray) -> FloatArray:
    """Return the places (k, 2) at lengths along a ring."""
    closed = np.vstack([ring, ring[:1]])
    return np.stack([np.interp(taken, lengths, column) for column in closed.T], axis=1)


def smooth(values: FloatArray, width: float) -> FloatArray:
    """Return periodic values smoothed by twice a Gaussian less its square: of fourth order, so that circles stay."""
    once = gaussian_filter1d(values, width, axis=0, mode="wrap")
    twice: FloatArray = 2 * once - gaussian_filter1d(once, width, axis=0, mode="wrap")
    return twice


def margin_ring(
    ring: FloatArray,
    beside: FloatArray,
    missing: FloatArray,
    spacing: Spacing,
    noise: float = 0.0,
    lines: SampleLines | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed ring (k, 2) and how far (k,) the leaf goes on beyond it, to its right.

    Parameters
    ----------
    ring : (r, 2) ndarray
        The border of the covered region, which lies on the left.
    beside : (b, 2) ndarray
        The points at which area is missing beyond it.
    missing : (b,) ndarray
        That area.
    spacing : Spacing
    noise : float
        Deviation of the points in the plane; it counts up to `MAX_NOISE` spacings.
    lines : SampleLines, optional
        Those that the points lie on: the leaf goes on half their distance in the mean.
    """
    places, local, taken = resample(ring, spacing)
    curve = smooth(places, WIDTH / STEP)
    away, corner = cKDTree(ring).query(beside, k=2)
    # A sharp corner was cut off when the region was grown, and both of what it became are as near.
    second = np.where(away[:, 1] <= EQUAL * away[:, 0], 0.5, 0.0)
    shares = missing[:, None] * np.stack([1 - second, second], axis=1)
    lengths, count = _lengths_along(ring), len(taken)
    number = np.interp(lengths[corner].ravel(), np.append(taken, lengths[-1]), np.arange(count + 1))
    sums = np.bincount(np.rint(number).astype(np.int64) % count, shares.ravel(), count)
    points = gaussian_filter1d(sums, COUNT_WIDTH / STEP, mode="wrap")
    sides = np.hypot(*(np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)).T) / 2
    run = gaussian_filter1d(sides, COUNT_WIDTH / STEP, mode="wrap")
    growth = without_noise(points / np.maximum(run, 1e-3 * local), np.minimum(noise, MAX_NOISE * local))
    apart = local if lines is None else np.maximum(local, lines.apart_at(curve))
    return curve, np.clip(growth, 0, MAX_GROWTH * apart)


def without_noise(growth: FloatArray, noise: FloatArray) -> FloatArray:
    """Return how far (k,) the leaf goes on, where noise has moved points over its edge.

    Gaussian noise carries points beyond a curve at a distance e outside of the edge. Were they no sparser than those
    inside, they would fill a strip g = s (φ(z) − z (1 − Φ(z))), z = e / s. So of a growth g the edge lies at −e, which
    is g itself where e is far inside, and less than 0 where g < 0.4 s. The curve follows points with noise of their
    own, σ, so that s² = 2 σ².

    Parameters
    ----------
    growth : (k,) ndarray
        The strip g: area that is missing, over length.
    noise : (k,) ndarray
        The deviation σ in the chart's plane.
    """
    spread = np.sqrt(2.0) * noise
    z = np.linspace(3.0, -6.0, 181)
    filled = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) - z * erfc(z / np.sqrt(2)) / 2
    with np.errstate(over="ignore"):  # beside next to no noise a growth is infinite, as beside none
        share = np.divide(growth, spread, out=np.full(len(growth), np.inf), where=spread > 0)
    edge: FloatArray = np.where(share < filled[-1], -spread * np.interp(share, filled, z), growth)
    return edge


def grown(curve: FloatArray, growth: FloatArray) -> shapely.Geometry:
    """Return the area between a closed curve and itself moved to its right."""
    tangent = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    normal /= np.maximum(np.hypot(*normal.T), 1e-300)[:, None]
    moved = curve + growth[:, None] * normal
    quads = np.stack([curve, np.roll(curve, -1, axis=0), np.roll(moved, -1, axis=0), moved], axis=1)
    return shapely.union_all(shapely.convex_hull(shapely.linestrings(quads)))


def polygon_of(curve: FloatArray) -> shapely.Geometry:
    """Return the area inside a closed curve, valid where the curve crosses itself."""
    polygon = shapely.Polygon(curve)
    return polygon if polygon.is_valid else shapely.make_valid(polygon)


def largest(area: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of an area; an empty one if there is none."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    parts += [p for part in shapely.get_parts(area) if part.geom_type == "MultiPolygon" for p in part.geoms]
    return max(parts, key=lambda part: part.area, default=shapely.Polygon())
