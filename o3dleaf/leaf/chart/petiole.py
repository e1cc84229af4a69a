"""The petiole or stem stub of a leaf, found among its points by its cross-section, and where the blade begins."""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.places import tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.stalk.attachment import attachment_of
from o3dleaf.leaf.chart.stalk.junction import Junction, find_junction
from o3dleaf.leaf.chart.stalk.lobes import is_one_of_several
from o3dleaf.leaf.chart.stalk.point_ways import PointWays
from o3dleaf.leaf.chart.stalk.sections import sections_along
from o3dleaf.leaf.chart.stalk.stretches import StalkStretch, find_stretches
from o3dleaf.surface.cloud.outliers import detect_outliers
from o3dleaf.surface.cloud.usable_points import usable_rows

MAX_POINTS = 20_000
"""Points among which a petiole is looked for, at most; the junction is found among all."""
FEWEST = 24
"""Points of a leaf at least, as of a sheet."""
OUTLIERS = partial(detect_outliers, max_ratio=np.inf)
"""Points that lie apart; those of a leaf's tip are sparser than their neighbors."""
RESOLVED = 2.0
"""Spacings that a petiole is wide at least: of what is narrower the scan shows no cross-section."""
ROW = 1.0
"""Spacings that one is wide at least where it is cut off: what is narrower is a single row of points, as the outermost
line of a scan whose lines lie far apart is."""
COMMON = 0.25
"""Of its distance from the middle of the leaf, that an end has its way in common with others, at most."""
LARGEST = 3.0
"""Area of what is cut off over that of a tube as long and as wide, at most: a stub of the stem is as large again."""
FEW = "too few points tell a petiole from a shred of the margin"
"""Why a narrow part is kept that is too short, flat or narrow."""
NO_JUNCTION = "nothing shows where the blade begins"
"""Why one is kept that is long and steady enough, of a blade that narrows into it little by little."""


@dataclass(frozen=True)
class Petiole:
    """A petiole or stem stub that was found on a scan; lengths in the scan's unit.

    Attributes
    ----------
    length : float
        From its end to the junction with the blade, along the surface.
    width : float
        Straight across what was scanned of it, the median: less than the diameter where one side was.
    area : float
        Of what was scanned of it, its stub included.
    end, junction : (3,) tuple of float
        Its outer end, and the middle of the section where the blade begins, in world coordinates.
    along : (3,) tuple of float
        Unit direction towards the blade there.
    """

    length: float
    width: float
    area: float
    end: tuple[float, float, float]
    junction: tuple[float, float, float]
    along: tuple[float, float, float]

    def may_hold(self, points: FloatArray) -> BoolArray:
        """Return which of (n, 3) points lie where it was cut off: before the plane across it, and no farther than it.

        A lobe of the blade that reaches back beside it lies there too.
        """
        off = points - np.array(self.junction)
        return np.asarray((off @ np.array(self.along) < 0) & (np.linalg.norm(off, axis=1) <= self.length + self.width))

    def __str__(self) -> str:
        ends = np.array([self.end, self.junction])
        end, junction = (tell_place(place, ends) for place in ends)
        size = f"{tell_length(self.length)} long and {tell_length(self.width)} wide as scanned"
        return f"petiole: {size}, from {end} to the blade at {junction}"


class NarrowPart(NamedTuple):
    """A narrow part of a leaf that may be its petiole, and is kept as blade.

    Attributes
    ----------
    stretch : StalkStretch
    end : (3,) ndarray
        Its outer end, in world coordinates.
    around : (n, 3) ndarray
        Points of the leaf, by which places are told.
    why : str
        Why it is kept.
    """

    stretch: StalkStretch
    end: FloatArray
    around: FloatArray
    why: str

    @property
    def base(self) -> FloatArray | None:
        """Its end, which is the base if the part is so long, slender or curled that it is no shred of a margin."""
        return self.end if self.stretch.is_sure else None

    def __str__(self) -> str:
        size = f"about {tell_length(self.stretch.length)} long and {tell_length(self.stretch.width)} wide"
        said = f"a narrow part, {size}, is kept as blade, its end at {tell_place(self.end, self.around)}"
        return f"{said}: {self.why}; cut it off if it is one"


def find_petiole(points: FloatArray, noise: float = 0.0) -> tuple[BoolArray, Petiole | None, NarrowPart | None]:
    """Return which (n,) points are not petiole, the petiole or None, and what may be one and is kept.

    The leaf is cut into sections at equal distance from one of its ends; a petiole is a stretch of them that is
    narrow against the widest, long against itself, and does not taper to the end as a tip does; and no two other ends
    of the leaf look like it, as lobes do. It ends at the plane across it from which on its sections widen. One that is
    too short or flat, or too few points wide, or with which more would be cut off than a stalk and a stub, is kept and
    told, but for the tips of narrow leaves; one that does not taper, and whose junction nothing shows, is of these too.

    Parameters
    ----------
    points : (n, 3) ndarray
        Of one leaf, both sides of the petiole or one.
    noise : float
        Standard deviation of the points across the surface.
    """
    blade, found = np.ones(len(points), dtype=bool), None
    unsure: list[NarrowPart] = []
    if len(points) < FEWEST:
        return blade, None, None
    leaf = _Leaf(points, noise)
    ways = leaf.ways
    for end in _ends(ways):
        distance = ways.from_point(end)
        stalk = _stalk_from(leaf, distance)
        if stalk is None:
            continue
        if stalk.junction is None:
            if stalk.is_told and not is_one_of_several(ways, distance <= stalk.stretch.last, distance, noise):
                unsure.append(NarrowPart(stalk.stretch, ways.points[end], ways.points, stalk.why))
            continue
        outside = stalk.junction.outside(points, leaf.of_each(distance))
        cut = outside[leaf.rows]
        if is_one_of_several(ways, cut, distance, noise):
            continue
        petiole = _measure(ways, cut, distance, stalk.junction, end)
        kept = _why_too_large(petiole) or attachment_of(ways, cut, stalk.junction).why_kept()
        if kept is not None and stalk.is_told:
            unsure.append(NarrowPart(stalk.stretch, ways.points[end], ways.points, kept))
        elif kept is None and (found is None or petiole.length / petiole.width > found.length / found.width):
            blade, found = ~outside, petiole
    longest = max(unsure, key=lambda part: part.stretch.length, default=None)
    return blade, found, longest if found is None else None


def _why_too_large(petiole: Petiole) -> str | None:
    """Return why what would be cut off is too large for a petiole, or None if it is not."""
    tube = np.pi * petiole.width * petiole.length
    if petiole.area <= LARGEST * tube:
        return None
    return f"what would be cut off has {petiole.area / tube:.2g} times the area of a tube of that size"


class _Leaf:
    """The points of a leaf and their noise, and the ways along those of them among which a petiole is looked for.

    `rows` are these points' (k,), `coarse` their spacing and `spacing` that of all of them.
    """

    def __init__(self, points: FloatArray, noise: float) -> None:
        some = _rows_looked_at(points)
        self.points, self.noise, self.ways = points, noise, PointWays(points[some])
        self.rows: IntArray = some[self.ways.rows]
        self.coarse = float(np.sqrt(np.median(self.ways.cells)))
        self.spacing = self.coarse * float(np.sqrt(len(some) / len(points)))
        number = np.full(len(points), -1, dtype=np.int64)
        number[self.rows] = np.arange(len(self.rows))
        # Each point's among the ways: its own, or the nearest one's if it hangs together with them.
        self._own = number if len(some) == len(points) else number[some[query(cKDTree(points[some]), points)[1]]]

    def of_each(self, distance: FloatArray) -> FloatArray:
        """Return for each point (n,) what is known for those of the ways (k,); where there is no way it is infinite."""
        return np.where(self._own >= 0, distance[np.maximum(self._own, 0)], np.inf)


class _Stalk(NamedTuple):
    """What may be a petiole, its junction if it shows one, why it is kept if not, and whether that is told."""

    stretch: StalkStretch
    junction: Junction | None
    why: str
    is_told: bool


def _stalk_from(leaf: _Leaf, distance: FloatArray) -> _Stalk | None:
    """Return the stalk of sections at equal `distance` (k,) from an end, up to where a junction shows; or None."""
    sections = sections_along(leaf.ways.points, leaf.ways.cells, distance, leaf.noise)
    stalk = None
    for stretch in find_stretches(sections):
        shows = stretch.is_sure and stretch.width >= RESOLVED * leaf.coarse
        each = leaf.of_each(distance)
        junction = find_junction(leaf.points, each, stretch, leaf.spacing, leaf.noise) if shows else None
        why = NO_JUNCTION if shows and junction is None else FEW
        # A tip tapers over many of its widths, most of them beyond what few points show to be straight.
        is_narrow = sections.is_narrow_from(stretch.last)
        is_told = why == NO_JUNCTION or not is_narrow or (stalk is not None and stalk.is_told)
        if junction is not None and junction.width >= (RESOLVED if is_narrow else ROW) * leaf.spacing:
            return _Stalk(stretch, junction, why, is_told)
        stalk = _Stalk(stretch, None, why, is_told)
    return stalk


def _rows_looked_at(points: FloatArray) -> IntArray:
    """Return the rows, rising, of the points among which a petiole is looked for.

    None that lie apart: a stray beside a petiole widens its sections, and may be an end itself.
    """
    some = usable_rows(points, OUTLIERS)
    if len(some) <= MAX_POINTS:
        return some
    return np.sort(np.random.default_rng(0).permutation(some)[:MAX_POINTS])


def _ends(ways: PointWays) -> list[int]:
    """Return the ends at which a petiole may begin: the two farthest apart, and those about the middle of the leaf.

    Beside lobes as long as it is the petiole is none of the two.
    """
    ends = list(ways.far_ends())
    middle = int(np.argmin(np.maximum(*map(ways.from_point, ends))))
    others = [end for end, _ in ways.ends_from(middle, COMMON)]
    return ends + [end for end in others if end not in ends]


def _measure(ways: PointWays, outside: BoolArray, distance: FloatArray, junction: Junction, end: int) -> Petiole:
    """Return the record of a petiole whose points, among those of the ways, are known."""
    x, y, z = junction.place
    a, b, c = ways.points[end]
    length = junction.reach(ways.points, distance)
    area = float(ways.cells[outside].sum())
    i, j, k = junction.along.tolist()
    return Petiole(
        length, junction.width, area, (float(a), float(b), float(c)), (float(x), float(y), float(z)), (i, j, k)
    )
