"""The sections of a leaf at equal distance from one of its ends: how wide they are, and how round."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray

BINS = (24, 240)
"""Stations, least and most; ten a blade's width, as far as that goes."""
NARROW_LEAF = 0.25
"""Width of a narrow blade over its length, at most, as of grasses."""
KERNEL = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16
"""Over the stations: a section has the points of two or three."""


class Sections(NamedTuple):
    """Sections of a leaf at equal distance from one end.

    Attributes
    ----------
    step : float
        Between stations; the k-th is in the middle of its own.
    width : (k,) ndarray
        √12 times the standard deviation of the points along the section, straight across: a strip's width, and 1.2
        times a tube's diameter; without the noise, which would keep a tip from tapering.
    depth : (k,) ndarray
        The same across it, without twice the noise's variance: of few points the lesser is off by as much.
    area : (k,) ndarray
        Up to the end of each station.
    free : (k,) ndarray
        Degrees of freedom of each station's scatter: its points but one, smoothed. Of a station without, as where
        single points follow each other, width and depth are those between its neighbors'.
    """

    step: float
    width: FloatArray
    depth: FloatArray
    area: FloatArray
    free: FloatArray

    def is_narrow_from(self, distance: float) -> bool:
        """Return whether the leaf beyond a stalk is narrow, so that it tapers over many widths of its tip."""
        return self.widest < NARROW_LEAF * (self.step * len(self.width) - distance)

    @property
    def widest(self) -> float:
        """Width of the blade where it is widest, single sections apart."""
        return float(np.quantile(self.width, 0.95))


def sections_along(points: FloatArray, cells: FloatArray, distance: FloatArray, noise: float) -> Sections:
    """Return the sections of points (n, 3) with cells (n,) at equal `distance` (n,) from an end.

    The scatter of a station is that about its middle, without its part along the way from middle to middle.
    """
    reach, area = float(distance.max()), float(cells.sum())
    count = int(np.clip(10 * reach * reach / area, *BINS))
    share = distance / max(reach, np.finfo(float).tiny)  # of a single point nothing is far
    station = np.minimum((share * count).astype(np.int64), count - 1)
    held = np.bincount(station, minlength=count)
    middle = _filled(_sums(station, points, count) / np.maximum(held, 1)[:, np.newaxis], held)
    way = np.gradient(np.stack([_smooth(column) for column in middle.T], axis=1), axis=0)
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), np.finfo(float).tiny)
    off = points - middle[station]
    off -= np.einsum("ij,ij->i", off, way[station])[:, np.newaxis] * way[station]
    products = (off[:, :, np.newaxis] * off[:, np.newaxis, :]).reshape(-1, 9)
    scatter = np.stack([_smooth(column) for column in _sums(station, products, count).T], axis=1).reshape(-1, 3, 3)
    # Each station's own middle takes one point's freedom.
    free = _smooth(np.maximum(held - 1, 0).astype(np.float64))
    variance = np.asarray(np.linalg.eigvalsh(scatter / np.maximum(free, 1e-3)[:, np.newaxis, np.newaxis]), np.float64)
    variance = _filled(variance, free) if free.any() else variance
    width = np.sqrt(12 * np.maximum(variance[:, 2] - noise**2, 0))
    depth = np.sqrt(12 * np.maximum(variance[:, 1] - 2 * noise**2, 0))
    return Sections(reach / count, width, depth, np.cumsum(np.bincount(station, cells, count)), free)


def _sums(station: IntArray, values: FloatArray, count: int) -> FloatArray:
    return np.stack([np.bincount(station, column, count) for column in values.T], axis=1)


def _filled(values: FloatArray, held: FloatArray | IntArray) -> FloatArray:
    """Return the values (k, 3) of stations, of those that hold nothing between their neighbors'."""
    known, at = np.flatnonzero(held), np.arange(len(held))
    return np.stack([np.interp(at, known, column) for column in values[known].T], axis=1)


def _smooth(values: FloatArray) -> FloatArray:
    return np.convolve(np.pad(values, 2, mode="edge"), KERNEL, mode="valid")
