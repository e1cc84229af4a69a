"""Stretches of the margin that are hidden, and the mirror image of the blade's other half in their place."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.chart.axis.sections import cut_across, normals_of, reached, resample, smooth_curve
from o3dleaf.leaf.parametric.fitted import SurfaceFit
from o3dleaf.leaf.parametric.surface import ChartSurface

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
ALONG, ACROSS = 9, 6
"""Pairs of places along and across a window, on either half, by which their isometry is found."""
SEAM = 4.0
"""Spacings along the seam over which the images are shifted onto the surface that they go on from."""
PER_WINDOW = 4
"""Windows to a half width of the blade: the isometry changes smoothly from one to the next."""


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
    """

    start: float
    stop: float
    side: int
    depth: float
    area: float

    def __str__(self) -> str:
        half = "left" if self.side > 0 else "right"
        return (
            f"the {half} margin lies {self.depth:.3g} farther in from {self.start:.4g} to {self.stop:.4g} along the "
            "midrib"
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
        return halves, stretches

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
        """Return lengths along the midrib (n,) and across it (n,) of places (n, 2), and their mirror images (n, 2)."""
        line = shapely.LineString(self.curve)
        along = shapely.line_locate_point(line, shapely.points(places))
        foot, normal = self.places(along, np.zeros(len(along))), self.places(along, np.ones(len(along)))
        across = ((places - foot) * (normal - foot)).sum(axis=1)
        return along, across, self.places(along, -across)


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


def mirror_points(fit: SurfaceFit, halves: Halves, stretch: HiddenStretch) -> tuple[FloatArray, FloatArray, float]:
    """Return the mirror images of the points whose counterparts are hidden, and how well the two halves match.

    In the chart a place goes over to the other side of the midrib. In the world it goes with the isometry that carries
    the visible part of the one half about it onto the other, in windows along the midrib: a leaf that is curled comes
    out curled, and one that is twisted, twisted. Points keep their noise.

    Returns
    -------
    points : (m, 3) ndarray
    places : (m, 2) ndarray
        Their parameters in the chart.
    misfit : float
        Root mean square of what is left between the visible halves, in the unit of the world.

    References
    ----------
    Schönemann, P. H. (1966): A generalized solution of the orthogonal Procrustes problem. Psychometrika 31, 1-10.
    """
    along, across, images = halves.mirrored(fit.feet)
    lies_there = (along >= stretch.start - halves.spacing) & (along <= stretch.stop + halves.spacing)
    chosen = lies_there & (np.sign(across) == -stretch.side)
    chosen[chosen] = ~shapely.contains_xy(halves.polygon, images[chosen])
    carried = _Carried.along(fit.surface, halves, stretch)
    points = carried.of(fit.points[chosen], along[chosen])
    # Where the visible part ends its image goes on from the surface that is there.
    way = np.linspace(stretch.start, stretch.stop, 2 + int((stretch.stop - stretch.start) / halves.spacing))
    edge = np.interp(way, halves.at, halves.widths[:, int(stretch.side < 0)]) - halves.spacing
    own, other = (fit.surface.jet(halves.places(way, s * edge), 0)[0] for s in (stretch.side, -stretch.side))
    apart = gaussian_filter1d(own - carried.of(other, way), SEAM, axis=0, mode="nearest")
    points += np.stack([np.interp(along[chosen], way, apart[:, axis]) for axis in range(3)], axis=1)
    return points, images[chosen], carried.misfit


@dataclass(frozen=True, eq=False)
class _Carried:
    """Isometries x ↦ (x − c) R + d in windows about some lengths (m,) along the midrib, blended linearly between.

    `starts`, `ends` (m, 3), `turns` (m, 3, 3); `misfit` is the root mean square of what they leave.
    """

    middles: FloatArray
    starts: FloatArray
    turns: FloatArray
    ends: FloatArray
    misfit: float

    @classmethod
    def along(cls, surface: ChartSurface, halves: Halves, stretch: HiddenStretch) -> "_Carried":
        """Return those from the other half onto the narrower one, nearest on places that both have."""
        half = float(halves.widths.max())
        count = max(2, 1 + int(np.ceil(PER_WINDOW * (stretch.stop - stretch.start) / half)))
        middles = np.linspace(stretch.start, stretch.stop, count)
        parts = [_isometry(surface, halves, middle, half, stretch.side) for middle in middles]
        starts, turns, ends, squares = (np.array(each) for each in zip(*parts, strict=True))
        return cls(middles, starts, turns, ends, float(np.sqrt(squares.mean())))

    def of(self, points: FloatArray, along: FloatArray) -> FloatArray:
        """Return the images of points (n, 3) at lengths (n,) along the midrib."""
        part = np.clip((along - self.middles[0]) / (self.middles[1] - self.middles[0]), 0, len(self.middles) - 1)
        below = np.minimum(part.astype(np.int64), len(self.middles) - 2)
        share = (part - below)[:, np.newaxis]
        first, second = (
            np.einsum("ni,nij->nj", points - self.starts[rows], self.turns[rows]) + self.ends[rows]
            for rows in (below, below + 1)
        )
        return np.asarray((1 - share) * first + share * second)


def _isometry(
    surface: ChartSurface, halves: Halves, middle: float, half: float, side: int
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return center, orthogonal matrix, image of the center and mean square left, for a window about one length."""
    way = np.linspace(max(middle - half, 0.0), min(middle + half, halves.at[-1]), ALONG)
    common = np.interp(way, halves.at, halves.widths.min(axis=1))
    along = np.repeat(way, ACROSS)
    across = side * np.outer(common, (np.arange(ACROSS) + 0.5) / ACROSS).ravel()
    other, own = (surface.jet(halves.places(along, each), 0)[0] for each in (-across, across))
    start, end = other.mean(axis=0), own.mean(axis=0)
    left, _, right = np.linalg.svd((other - start).T @ (own - end))
    turn = left @ right
    left_over = (other - start) @ turn + end - own
    return start, turn, end, float((left_over**2).sum(axis=1).mean())
