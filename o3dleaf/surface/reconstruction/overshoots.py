"""Overshoots: where a field's surface runs on past data that close around, such as the tip of a thin part.

A field knows its data alone. Beyond a tip whose points have normals to both sides only, two sheets go on side by side,
as they would past the rim of an open sheet, for nothing says that there is no matter. The winding number does: it sees
where all data lie. Past a rim it does not see how wide the gap is, narrow tubes' ends being like blunt tips; what is
between the data in front of such a place does.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.proximity import data_around, distance_mask, nearest_points
from o3dleaf.surface.reconstruction.solid_angle import WindingNumber
from o3dleaf.surface.reconstruction.trim import FACTOR

FAR = 1.5
"""Spacings from the data beyond which a surface is looked at: of random points one in a thousand leaves such a gap."""

FAR_OF_NOISY = 1.0
"""The same of noisy data, and there also where matter is denied or asserted: smoothed thin parts bulge past their ends.
At six of seven places so far out that are no gap the surface is outside the truth, by 0.3 spacings on the mean."""

PAST = 0.5
"""Spacings that the truth is nearer to such places than noisy data are, on the mean."""

WIDE = 2.0
"""Spacings from the data within which nothing is trimmed: of random points a few in a million leave such a gap."""

OUTSIDE, INSIDE = -0.5, 0.5
"""Share by which data must close around a place, 2 w − 1, for it to be no gap, unless it is beside one. Past the rim of
a bowl it is −1/2 where that is a hemisphere, and nearer −1 the flatter it is. No open sheet has w above 1/2 there."""

MIDDLE = 0.4
"""Share up to which a place `FACTOR` spacings from the data, where the ball of `trim_to_data` can stand, is in the
middle of a gap that stays open: in a slit five spacings wide it is there."""

ASIDE = 2 * FACTOR
"""Spacings from such a place, the width of a gap, within which nothing is corrected."""

CLOSING = 0.25
"""Level of a cloud, half way between a sheet's and a closed surface's, above which its data close around."""

LOCAL = 0.125
"""The same of the data nearest to a place: a thin part of a closed surface is short of the level, a sheet has none."""

NEAREST, FARTHEST = 1.2, 4.5
"""Spacings from clean data where matter is denied or asserted: nearer they speak, farther nothing is followed."""

BAND = 2.0
"""Spacings on both sides of the level along which a gap is closed."""

MAX_SITES = 200_000
"""Sites at which a gap is not followed any farther."""

STEPS = np.concatenate([np.eye(3, dtype=np.int64), -np.eye(3, dtype=np.int64)])


class FreeSites(NamedTuple):
    """Places (n, 3) about which the winding number is sure, and the signed distances (n,) there, larger inside."""

    sites: FloatArray
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What data say of the space around them.

    Attributes
    ----------
    data : OrientedCloud
    everywhere : bool
        Whether gaps are closed too, however wide, along the level of the winding number.
    """

    data: OrientedCloud
    everywhere: bool = False

    def __repr__(self) -> str:
        return f"Surroundings({self.data!r})"

    @cached_property
    def winding(self) -> WindingNumber:
        """The winding number of the data."""
        return WindingNumber.of(self.data)

    @cached_property
    def level(self) -> float:
        """The winding number on the data: 1/2 where they are closed, −1/2 with normals inward, 0 of a sheet."""
        return self.winding.level

    @property
    def closing(self) -> bool:
        """Whether the data as a whole close around: if not they are a sheet."""
        return self.everywhere or abs(self.level) > CLOSING

    @cached_property
    def noisy(self) -> bool:
        """Whether the data are known to be noisy."""
        return self.data.is_measurable and not self.data.is_clean

    def depth(self, places: FloatArray) -> FloatArray:
        """Return how far (n,) the data close around places (n, 3): 1 inside, −1 outside, 0 in the middle of a gap."""
        share = 2 * self.winding(places) - np.sign(self.level)
        return np.asarray(np.clip(share, -1.0, 1.0))

    def is_far(self, places: FloatArray, than: float | None = None) -> BoolArray:
        """Return which places (n, 3) are farther from the data than so many of their spacings, or to be looked at."""
        usual = FAR_OF_NOISY if self.noisy else FAR
        return ~distance_mask(self.data, factor=usual if than is None else than)(places)

    def overshoots(self, field: Field, places: FloatArray) -> "Overshoots":
        """Return which places (n, 3) of a surface far from the data are no gap in them, or in a gap to be closed."""
        if not len(places) or not self.closing:
            return Overshoots(places[:0], places[:0])
        if self.everywhere:
            return Overshoots(places[self.is_far(places, WIDE)], places[:0])
        sure = places[self.decisive(self.depth(places))]
        near, place = np.unique(nearest_points(self.data.tree, sure)[1], return_inverse=True)
        if len(near):
            sure = sure[(self.winding.levels(near) * np.sign(self.level) > LOCAL)[place]]
        gaps = [
            part for start, pitch in self._lattices(sure) for part in _flood(partial(self._gap, field, pitch), start)
        ]
        found = Overshoots(sure, np.concatenate([places[:0], *gaps]))
        return Overshoots(sure[~found.beside_gaps(sure, self._spacing_at(sure))], found.gaps)

    def decisive(self, depth: FloatArray) -> BoolArray:
        """Return at which depths (n,) a place is no gap."""
        share = depth * self._facing
        return np.asarray((share < OUTSIDE) | (share > INSIDE))

    def sites(self, field: Field, over: "Overshoots") -> FreeSites:
        """Return where a field is wrong around overshoots, on lattices as fine as the data there."""
        found = [np.empty((0, 4))]
        for start, pitch in self._lattices(over.places):
            found += _flood(partial(self._correction, field, over, pitch), start)
        sites, value = np.split(np.concatenate(found), [3], axis=1)
        return FreeSites(np.ascontiguousarray(sites), value.ravel())

    @property
    def _facing(self) -> float:
        """1, or −1 where normals point into what is closed, which has a field below 0."""
        return 1.0 if self.level >= 0 else -1.0

    @property
    def _nearest(self) -> float:
        """Spacings within which the data speak."""
        return FAR_OF_NOISY if self.noisy else NEAREST

    def _spacing_at(self, places: FloatArray) -> FloatArray:
        return self.data.point_spacing[data_around(self.data, places)[1]]

    def _lattices(self, places: FloatArray) -> Iterator[tuple[IntArray, float]]:
        """Yield cells (n, 3) at places, each once, of lattices as fine as the data there, and the lattice's pitch."""
        spacing = self._spacing_at(places)
        octave = np.floor(np.log2(spacing / spacing.min(initial=np.inf))).astype(np.int64)
        for each in np.unique(octave):
            pitch = float(np.median(spacing[octave == each]))
            yield np.unique(np.round(places[octave == each] / pitch).astype(np.int64), axis=0), pitch

    def _gap(self, field: Field, pitch: float, cells: IntArray) -> tuple[IntArray, FloatArray]:
        """Return which cells (n, 3) of a lattice lead on from a place past a rim, and the middles of gaps among them.

        They are what a field takes for matter although it is off the data, but not enclosed.
        """
        places = np.asarray(cells * pitch, dtype=np.float64)
        rows = np.flatnonzero(self._facing * field(places) > 0)
        around, nearest = data_around(self.data, places[rows])
        ratio = around / self.data.point_spacing[nearest]
        between = (ratio > self._nearest) & (ratio < FARTHEST)
        rows, ratio = rows[between], ratio[between]
        share = self._facing * self.depth(places[rows])
        return rows[share < INSIDE], places[rows[(ratio > FACTOR) & (np.abs(share) < MIDDLE)]]

    def _correction(
        self, field: Field, over: "Overshoots", pitch: float, cells: IntArray
    ) -> tuple[IntArray, FloatArray]:
        """Return which cells (n, 3) of a lattice a field is wrong about, and sites (m, 4) there with what is right.

        Where a gap leads from close data to sparse ones, only every second, fourth, ... place of the lattice is a site:
        a ball there, as wide as its data need, would have thousands of others.
        """
        places = np.asarray(cells * pitch, dtype=np.float64)
        close = nearest_points(self.data.tree, places)
        around, nearest = data_around(self.data, places, close)
        spacing, distance = self.data.point_spacing[nearest], close[0]
        ratio = around / spacing
        rows = np.flatnonzero((ratio > self._nearest) & (self.everywhere | (ratio < FARTHEST)))
        depth = self.depth(places[rows])
        value = depth * (distance - PAST * spacing if self.noisy else distance)[rows]
        wrong = (np.sign(field(places[rows])) != np.sign(depth)) & self.decisive(depth) & (ratio[rows] < FARTHEST)
        wrong &= ~over.beside_gaps(places[rows], spacing[rows])
        if self.everywhere:
            wrong |= (np.abs(value) < BAND * pitch) & ~self.decisive(depth)
        coarser = np.exp2(np.floor(np.log2(spacing[rows] / pitch)).clip(0)).astype(np.int64)
        site = wrong & (cells[rows] % coarser[:, np.newaxis] == 0).all(axis=1)
        return rows[wrong], np.column_stack([places[rows[site]], value[site]])


class Overshoots(NamedTuple):
    """Places (n, 3) of a surface past data that close around them, and middles (m, 3) of gaps that stay open."""

    places: FloatArray
    gaps: FloatArray

    def beside_gaps(self, places: FloatArray, spacing: FloatArray) -> BoolArray:
        """Return which places (n, 3) are beside such gaps, where the data have a spacing (n,)."""
        if not len(self.gaps):
            return np.zeros(len(places), dtype=bool)
        return np.asarray(query(cKDTree(self.gaps), places)[0] < ASIDE * spacing)


NO_SITES = FreeSites(np.empty((0, 3)), np.empty(0))


def _flood(judge: Callable[[IntArray], tuple[IntArray, FloatArray]], cells: IntArray) -> Iterator[FloatArray]:
    """Yield what is found from cells (n, 3) of a lattice on, neighbor by neighbor, a row of each.

    ``judge(cells) -> rows, found`` says from which to go on. A cell around a front that is one of those was met with
    that front or the one before, else its own neighbors would have been met earlier; another may be met again, and
    nothing is found there.
    """
    before, count = np.empty((0, 3), dtype=np.int64), 0
    while len(cells) and count < MAX_SITES:
        onward, found = judge(cells)
        yield found
        count += len(found)
        around = (cells[onward][:, np.newaxis] + STEPS).reshape(-1, 3)
        cells, before = _without(around, np.concatenate([before, cells])), cells


def _without(cells: IntArray, seen: IntArray) -> IntArray:
    """Return the cells (n, 3), each once and in order, that are not among those seen."""
    both = np.concatenate([seen, cells])
    cell, first = np.unique(both, axis=0, return_index=True)
    return np.asarray(cell[first >= len(seen)])
