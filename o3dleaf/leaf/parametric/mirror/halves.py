"""The two halves of a blade in its chart, and stretches of its margin that are hidden."""

from dataclasses import dataclass, replace

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.axis.sections import cut_across, normals_of, reached, resample, smooth_curve

STEP = 0.5
"""Spacings between sections across the blade."""
STATIONS = 3000
"""Sections at most: of longer blades they are farther apart."""
BLURRED, WINDOW = 1.5, 8.0
"""Spacings to either side of a step of the margin that are left out, and up to which lines are fitted to it: the
margin's own waves are three to four spacings long."""
FEWEST = 4
"""Sections within the window to either side at least; where they are fewer, or the blade is shorter, no step shows."""
HIGH, SHARP = 1.5, 4.0
"""Spacings that a step is high at least where something hides a margin, and times the median over the blade: chance
makes single ones of a spacing, teeth and lobes make many."""
ALIKE = 0.25
"""Share of the one step's height that the other has at least."""
LONGEST = 0.6
"""Of the midrib's length that a stretch takes at most: the midrib over it is known from what is before and behind."""
ROUNDS = 3
"""Times that the midrib is drawn anew: sections across it turn with it."""
LONGER = 1.1
"""Times its first length that the midrib may get: beyond, it winds about the end of a fold, and what was is kept."""
BRIDGE, ACROSS_WIDTH = 0.02, 0.125
"""Stiffness of the midrib over a hidden stretch, for stations as far apart as it is long; and the share of the width
over which it is smoothed elsewhere."""
UNLIKE = 3.0
"""Times what the halves differ elsewhere (root mean square) that they differ along a hidden stretch: beyond three
deviations it is not chance, and below, the one half doesn't tell where the other ends."""


@dataclass(frozen=True)
class HiddenStretch:
    """A stretch of the blade at whose ends one margin steps in and out again.

    Attributes
    ----------
    start, stop : float
        Lengths along the midrib from its base.
    side : int
        The narrower half: 1 to the left of the midrib, from base to tip, −1 to the right.
    depth, area : float
        The mean of the two steps, and the area that is missing.
    beyond, elsewhere : float
        How far the mirror image of the other half's margin lies beyond this one, on average, and the root mean square
        of the same along the rest of the margin.
    """

    start: float
    stop: float
    side: int
    depth: float
    area: float
    beyond: float = np.nan
    elsewhere: float = np.nan

    def shows_in(self, spacing: float) -> bool:
        """Return whether the halves differ there by more than chance and by more than they do elsewhere."""
        return self.beyond >= max(HIGH * spacing, UNLIKE * self.elsewhere)

    def __str__(self) -> str:
        half = "left" if self.side > 0 else "right"
        return (
            f"the {half} margin lies {tell_length(self.depth)} farther in from "
            f"{tell_length((self.start, self.stop), digits=4, join=' to ')} along the midrib"
        )


@dataclass(frozen=True, eq=False)
class Halves:
    """The two halves of a blade in its chart.

    Attributes
    ----------
    curve, normals : (k, 2) ndarrays
        The midrib from base to tip in equal steps, and its unit normals to the left.
    widths : (k, 2) ndarray
        Of the left and the right half, from the midrib to the outer margin.
    polygon : shapely.Polygon
        Inside the outer margin.
    spacing : float
        Of the scan's points.
    """

    curve: FloatArray
    normals: FloatArray
    widths: FloatArray
    polygon: shapely.Polygon
    spacing: float

    @classmethod
    def of(cls, polygon: shapely.Polygon, midline: FloatArray, spacing: float) -> "Halves":
        """Measure the halves of a polygon to both sides of a midline (m, 2)."""
        whole = shapely.Polygon(polygon.exterior)
        count = int(np.clip(reached(midline)[-1] / (STEP * spacing), 2, STATIONS))
        curve = resample(midline, count)
        normals = normals_of(curve)
        middles, lengths = cut_across(whole, curve, normals)
        shift = ((middles - curve) * normals).sum(axis=1)
        widths = np.stack([lengths / 2 + shift, lengths / 2 - shift], axis=1)
        return cls(curve, normals, np.maximum(widths, 0.0), whole, spacing)

    @property
    def at(self) -> FloatArray:
        """Lengths (k,) along the midrib."""
        return reached(self.curve)

    def hidden(self, length: float) -> tuple[HiddenStretch, ...]:
        """Return the stretches at least so long between a step of a margin in and one out, the largest first."""
        at, stretches = self.at, []
        for column, side in enumerate((1, -1)):
            rows, heights = _steps(self.widths[:, column], self.spacing, at[1])
            # Nearer to an end a section shows that end's own outline.
            inner = np.minimum(at, at[-1] - at)[rows] >= self.widths.sum(axis=1)[rows] / 2
            rows, heights = rows[inner], heights[inner]
            for first, last in _pairs(heights):
                start, stop = float(at[rows[first]]), float(at[rows[last]])
                if length <= stop - start <= LONGEST * at[-1]:
                    depth = float(heights[last] - heights[first]) / 2
                    stretches.append(HiddenStretch(start, stop, side, depth, depth * (stop - start)))
        return tuple(sorted(stretches, key=lambda each: -each.area))

    def bridged(self, length: float) -> tuple["Halves", tuple[HiddenStretch, ...]]:
        """Return the halves to both sides of the midrib as it goes on over hidden stretches at least so long; and them.

        There it is not mid-way between what is seen, but bent as it is before and behind.
        """
        halves, stretches = self, self.hidden(length)
        for _ in range(ROUNDS if stretches else 0):
            curve = halves._drawn_through(stretches)
            if reached(curve)[-1] > LONGER * self.at[-1] or not shapely.LineString(curve).is_simple:
                break
            halves = Halves.of(self.polygon, curve, self.spacing)
            stretches = halves.hidden(length)
        return halves, tuple(halves.compared(each, stretches) for each in stretches)

    def compared(self, stretch: HiddenStretch, stretches: tuple[HiddenStretch, ...]) -> HiddenStretch:
        """Return a stretch with how far the halves differ along it, and elsewhere: along none of this half's stretches.

        Those of the other half count as differences: lobes that alternate look like stretches hidden of both.

        The margin is taken at equal steps of its own length: it counts alike where it runs across the midrib.
        """
        ring = self.polygon.exterior
        margin = shapely.get_coordinates(shapely.line_interpolate_point(ring, np.arange(0, ring.length, self.spacing)))
        along, across, images = self.mirrored(margin)
        beyond = shapely.distance(ring, shapely.points(images))
        beyond[shapely.contains_xy(self.polygon, images)] *= -1
        other, blurred = stretch.side * across < 0, BLURRED * self.spacing
        inside = (along > stretch.start + blurred) & (along < stretch.stop - blurred)
        rest = np.ones(len(along), dtype=bool)
        for each in (each for each in stretches if each.side == stretch.side):
            rest &= (along < each.start - blurred) | (along > each.stop + blurred)
        along_it, apart = beyond[other & inside], beyond[other & rest]
        mean, square = along_it.sum() / max(len(along_it), 1), apart @ apart / max(len(apart), 1)
        return replace(stretch, beyond=float(mean), elsewhere=float(np.sqrt(square)))

    def _drawn_through(self, stretches: tuple[HiddenStretch, ...]) -> FloatArray:
        """Return the middles (k, 2) of the sections, where stretches are hidden bent as around them, smoothed."""
        at = self.at
        middles = self.places(at, (self.widths[:, 0] - self.widths[:, 1]) / 2)
        for each in stretches:
            inside = (at >= each.start - BLURRED * self.spacing) & (at <= each.stop + BLURRED * self.spacing)
            stiffness = BRIDGE * ((each.stop - each.start) / at[1]) ** 6
            middles[inside] = smooth_curve(middles, (~inside).astype(float), stiffness, 3)[inside]
        return smooth_curve(middles, np.ones(len(at)), (ACROSS_WIDTH * self.widths.sum(axis=1).max() / at[1]) ** 6, 3)

    def places(self, along: FloatArray, across: FloatArray) -> FloatArray:
        """Return the places (n, 2) at lengths along the midrib and across it, to the left of it if above 0."""
        middle, normal = (
            np.stack([np.interp(along, self.at, each[:, axis]) for axis in range(2)], axis=1)
            for each in (self.curve, self.normals)
        )
        return np.asarray(middle + across[:, np.newaxis] * normal)

    def mirrored(self, places: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return lengths along the midrib (n,) and across it (n,) of places (n, 2), and their mirror images (n, 2).

        Past its ends the midrib goes on straight.
        """
        line = shapely.LineString(self.curve)
        along = shapely.line_locate_point(line, shapely.points(places))
        foot = self.places(along, np.zeros(len(along)))
        normal = self.places(along, np.ones(len(along))) - foot
        across = ((places - foot) * normal).sum(axis=1)
        return along, across, places - 2 * across[:, np.newaxis] * normal


def _steps(width: FloatArray, spacing: float, station: float) -> tuple[IntArray, FloatArray]:
    """Return the rows (s,) at which a width (k,) steps up or down, in order, and the heights of the steps.

    A step is between the lines through what is before and behind, and higher than any other so near.
    """
    reach = np.floor(WINDOW * spacing / station)
    if not FEWEST <= reach < (len(width) - 1) / 2:
        return np.empty(0, np.int64), np.empty(0)
    away, reach = np.arange(np.ceil(BLURRED * spacing / station), reach + 1), int(reach)
    # The value at 0 of the line through values at `away`, by least squares.
    value = 1 / len(away) - away.mean() * (away - away.mean()) / ((away - away.mean()) ** 2).sum()
    kernel = np.zeros(2 * reach + 1)
    kernel[reach + away.astype(int)], kernel[reach - away.astype(int)] = value, -value
    jumps = np.pad(np.correlate(width, kernel, mode="valid"), reach)
    least = max(HIGH * spacing, SHARP * float(np.median(np.abs(jumps))))
    rows = find_peaks(np.abs(jumps), least, reach)
    return rows, jumps[rows]


def find_peaks(height: FloatArray, least: float, apart: int) -> IntArray:
    """Return the rows, rising, of peaks of heights (k,), `least` at least; of those less than `apart` the highest."""
    rows = 1 + np.flatnonzero((height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:]) & (height[1:-1] >= least))
    peaks: list[int] = []
    for row in rows[np.argsort(height[rows])[::-1]].tolist():
        if all(abs(row - other) >= apart for other in peaks):
            peaks.append(row)
    return np.array(sorted(peaks), dtype=np.int64)


def _pairs(heights: FloatArray) -> list[tuple[int, int]]:
    """Return the numbers of steps in and out that belong together, the highest pairs first; no two pairs overlap.

    Both are alike in height, and nothing between them is as high as either.
    """
    pairs: list[tuple[int, int]] = []
    tried = [(i, j) for i in np.flatnonzero(heights < 0) for j in i + 1 + np.flatnonzero(heights[i + 1 :] > 0)]
    for first, last in sorted(tried, key=lambda pair: heights[pair[0]] - heights[pair[1]]):
        low, high = sorted(np.abs(heights[[first, last]]))
        alone = (np.abs(heights[first + 1 : last]) < low).all()
        if low >= ALIKE * high and alone and all(last <= i or j <= first for i, j in pairs):
            pairs.append((int(first), int(last)))
    return pairs
