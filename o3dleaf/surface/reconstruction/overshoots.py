"""Overshoots: where a field's surface runs on past data that close around, such as the tip of a thin part.

A field knows its data alone. Beyond a tip whose points have normals to both sides only, two sheets go on side by side,
as they would past the rim of an open sheet, for nothing says that there is no matter. The winding number does: it sees
where all data lie.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.proximity import data_around, distance_mask, nearest_points
from o3dleaf.surface.reconstruction.solid_angle import WindingNumber

FAR = 1.5
"""Spacings from the data beyond which a surface is looked at: of random points one in a thousand leaves such a gap."""

WIDE = 2.0
"""Spacings from the data within which nothing is trimmed: of random points a few in a million leave such a gap."""

OUTSIDE, INSIDE = -0.7, 0.5
"""Share by which data must close around a place, 2 w − 1, for it to be no gap. Past the rim of a bowl it is −1/2 where
that is a hemisphere, and nearer −1 the flatter it is; the middle of a gap is 0. No open sheet has w above 1/2 there."""

CLOSING = 0.25
"""Level of a cloud, half way between a sheet's and a closed surface's, above which its data close around."""

LOCAL = 0.125
"""The same of the data nearest to a place: a thin part of a closed surface is short of the level, a sheet has none."""

NEAREST, FARTHEST = 1.2, 4.5
"""Spacings from the data where matter is denied or asserted: nearer the data speak, farther nothing is followed."""

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

    def depth(self, places: FloatArray) -> FloatArray:
        """Return how far (n,) the data close around places (n, 3): 1 inside, −1 outside, 0 in the middle of a gap."""
        share = 2 * self.winding(places) - np.sign(self.level)
        return np.asarray(np.clip(share, -1.0, 1.0))

    def is_far(self, places: FloatArray, than: float = FAR) -> BoolArray:
        """Return which places (n, 3) are farther from the data than so many of their spacings."""
        return ~distance_mask(self.data, factor=than)(places)

    def overshooting(self, places: FloatArray) -> BoolArray:
        """Return which places (n,) of a surface far from the data are no gap in them, or in a wide gap to be closed."""
        if not len(places) or not self.closing:
            return np.zeros(len(places), dtype=bool)
        if self.everywhere:
            return self.is_far(places, WIDE)
        sure = self.decisive(self.depth(places))
        near, place = np.unique(nearest_points(self.data.tree, places[sure])[1], return_inverse=True)
        if len(near):
            sure[sure] = (self.winding.levels(near) * np.sign(self.level) > LOCAL)[place]
        return sure

    def decisive(self, depth: FloatArray) -> BoolArray:
        """Return at which depths (n,) a place is no gap."""
        share = depth * (1.0 if self.level >= 0 else -1.0)
        return np.asarray((share < OUTSIDE) | (share > INSIDE))

    def sites(self, field: Field, places: FloatArray) -> FreeSites:
        """Return where a field is wrong around such places, on lattices as fine as the data there."""
        spacing = self.data.point_spacing[data_around(self.data, places)[1]]
        octave = np.floor(np.log2(spacing / spacing.min())).astype(np.int64)
        found = []
        for each in np.unique(octave):
            pitch = float(np.median(spacing[octave == each]))
            found += list(self._flood(field, np.round(places[octave == each] / pitch).astype(np.int64), pitch))
        return FreeSites(*(np.concatenate(part) for part in zip(*found, strict=True))) if found else NO_SITES

    def _flood(self, field: Field, start: IntArray, pitch: float) -> Iterator[FreeSites]:
        """Yield the sites of a lattice from cells (n, 3) on, neighbor by neighbor, as far as the field is wrong.

        A cell around a front that is wrong too was met with that front or the one before, else its own neighbors would
        have been met earlier; one that is right may be met again, and has no site.
        """
        cells, before, count = np.unique(start, axis=0), np.empty((0, 3), dtype=np.int64), 0
        while len(cells) and count < MAX_SITES:
            wrong, found = self._judge(field, cells, pitch)
            yield found
            count += len(found.sites)
            around = (cells[wrong][:, np.newaxis] + STEPS).reshape(-1, 3)
            cells, before = _without(around, np.concatenate([before, cells])), cells

    def _judge(self, field: Field, cells: IntArray, pitch: float) -> tuple[IntArray, FreeSites]:
        """Return which cells (n, 3) of a lattice a field is wrong about, and what is right there, as dense as the data.

        Where a gap leads from close data to sparse ones, only every second, fourth, ... place of the lattice is a site:
        a ball there, as wide as its data need, would have thousands of others.
        """
        places = np.asarray(cells * pitch, dtype=np.float64)
        close = nearest_points(self.data.tree, places)
        around, nearest = data_around(self.data, places, close)
        ratio, distance = around / self.data.point_spacing[nearest], close[0]
        rows = np.flatnonzero((ratio > NEAREST) & (self.everywhere | (ratio < FARTHEST)))
        depth = self.depth(places[rows])
        value = depth * distance[rows]
        wrong = (np.sign(field(places[rows])) != np.sign(depth)) & self.decisive(depth) & (ratio[rows] < FARTHEST)
        if self.everywhere:
            wrong |= (np.abs(value) < BAND * pitch) & ~self.decisive(depth)
        coarser = np.exp2(np.floor(np.log2(self.data.point_spacing[nearest[rows]] / pitch)).clip(0)).astype(np.int64)
        site = wrong & (cells[rows] % coarser[:, np.newaxis] == 0).all(axis=1)
        return rows[wrong], FreeSites(places[rows[site]], value[site])


NO_SITES = FreeSites(np.empty((0, 3)), np.empty(0))


def _without(cells: IntArray, seen: IntArray) -> IntArray:
    """Return the cells (n, 3), each once and in order, that are not among those seen."""
    both = np.concatenate([seen, cells])
    cell, first = np.unique(both, axis=0, return_index=True)
    return np.asarray(cell[first >= len(seen)])
