"""Noise and spacing of a cloud at some places: how its points spread across their surface, and along it."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud import parity_loops

CLEAN = 0.1
"""Noise in spacings up to which a cloud is clean. Of others creases are not sought: of normals that turn, some only
seem to."""
SAMPLE = 400
"""Places at which the noise is measured; their median is off by about a twentieth."""
PATCHES = tuple(16 * 2**step for step in range(13))
"""Points of a patch: the smallest patch that is wide enough for its noise counts. The largest, of 65,536, is for
noise of 32 spacings."""
MAX_POINTS = 256
"""Points that the residual of a patch is found from: of larger ones those among every second, fourth, ... of the cloud.
They tell σ at a place to 4 %; the median of all places is off by as much."""
WIDE = 4.5
"""Standard deviations of the noise that the radius of a patch must have: in narrower ones the plane follows noise."""
MIN_POINTS = 12
"""Points of a patch on the side of its middle, of fewer a larger one is taken: twice what a quadric takes."""
NARROW, WIDER = 10, 16
"""Points of two patches at a place, by which noise is told from shape."""
FALL = 0.66
"""Deviation of the narrow patches over that of the wider ones below which it is the shape's: what quadrics leave of a
shape falls with the third power of the radius, to 0.49, and of noise to 0.75 to 0.99, as far as ten points tell."""
NARROWEST = 8
"""Points of a narrow patch on the side of its middle, of fewer it is left out."""
BLOCK = 64
"""Patches that one thread measures at a time."""


class Places(NamedTuple):
    """What was measured at some places of a cloud, NaN where nothing could be.

    Attributes
    ----------
    points : (m, 3) ndarray
    noise : (m,) ndarray
        Standard deviation of the points around each place across their surface.
    spacing : (m,) ndarray
        1/sqrt(points per unit area) around it, on its own side.
    """

    points: FloatArray
    noise: FloatArray
    spacing: FloatArray

    @property
    def known(self) -> bool:
        """Whether most places lie on a surface."""
        return bool(2 * np.sum(~np.isnan(self.noise)) >= len(self.noise))


class Patches:
    """The nearest points of some hundred places of a cloud, searched once: by other normals they are measured again.

    Parameters
    ----------
    points : (n, 3) ndarray
    tree : scipy.spatial.cKDTree
        Of the points.
    """

    def __init__(self, points: FloatArray, tree: cKDTree) -> None:
        self.points, self.tree = points, tree
        self.rows = even_rows(len(points), SAMPLE)
        self._known: dict[int, tuple[FloatArray, IntArray]] = {}

    def nearest(self, count: int, places: IntArray) -> tuple[FloatArray, IntArray]:
        """Return distances and rows (m, ·) of so many points nearest to some of the places (m,), by their numbers.

        Of more than 256 points they are every second, fourth, ... of the cloud.
        """
        every = max(1, count // MAX_POINTS)
        if count not in self._known:
            shape = len(self.rows), count // every
            self._known[count] = np.full(shape, np.nan), np.empty(shape, dtype=np.int64)
        distance, row = self._known[count]
        new = places[np.isnan(distance[places, 0])]
        if len(new):
            some = self.tree if every == 1 else cKDTree(self.points[::every])
            distance[new], row[new] = query(some, self.points[self.rows[new]], k=count // every)
            row[new] *= every
        return distance[places], row[places]


def measure_places(patches: Patches, normals: FloatArray | None = None) -> Places:
    """Measure the noise and the spacing of a cloud at some hundred of its points.

    Of points with outward `normals` (n, 3) only those on the side of the place count: those of another sheet, however
    near, say nothing of this one.
    """
    points, rows = patches.points, patches.rows
    noise, spacing = np.full(len(rows), np.nan), np.full(len(rows), np.nan)
    for count in PATCHES:
        unknown = np.flatnonzero(np.isnan(noise))
        if count > len(points) or not len(unknown):
            break
        distance, used = patches.nearest(count, unknown)
        residual, area, inside = _measure(points, normals, rows[unknown], used, MIN_POINTS)
        wide = distance[:, -1] >= WIDE * residual
        noise[unknown[wide]] = residual[wide]
        counted = max(1, count // MAX_POINTS) * inside[wide]
        spacing[unknown[wide]] = np.sqrt(area[wide] * counted) / (counted - 1)
    return Places(points[rows], noise, spacing)


def is_shape(patches: Patches, normals: FloatArray | None = None) -> bool:
    """Return whether what quadrics leave of a cloud, as in `measure_places`, is its shape's and not noise."""
    points, rows = patches.points, patches.rows
    near = patches.nearest(WIDER, np.arange(len(rows)))[1]
    narrow, wider = (_measure(points, normals, rows, near[:, :count].copy(), NARROWEST)[0] for count in (NARROW, WIDER))
    known = ~np.isnan(narrow + wider)
    return bool(known.any() and np.median(narrow[known]) < FALL * np.median(wider[known]))


def _measure(
    points: FloatArray, normals: FloatArray | None, places: IntArray, rows: IntArray, least: int
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return deviation and area (m,) of the patches `rows` (m, k) around `places` (m,), and how many points count."""
    noise, area, counts = np.empty(len(rows)), np.empty(len(rows)), np.empty(len(rows), dtype=np.int64)
    sides = points[:0] if normals is None else normals

    def task(start: int, stop: int) -> None:
        parity_loops.measure_patches(points, sides, places, rows, least, start, stop, noise, area, counts)

    run_blocks(task, len(rows), BLOCK)
    return noise, area, counts
