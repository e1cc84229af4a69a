"""The mirror image of the blade's other half in the place of a hidden stretch of the margin."""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import gaussian_filter1d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.parametric.fitted import SurfaceFit
from o3dleaf.leaf.parametric.mirror.halves import Halves, HiddenStretch
from o3dleaf.leaf.parametric.surface import ChartSurface

ALONG, ACROSS = 9, 6
"""Pairs of places along and across a window, on either half, by which their isometry is found."""
SEAM = 4.0
"""Spacings along the seam over which the images are shifted onto the surface that they go on from."""
PER_WINDOW = 4
"""Windows to a half width of the blade: the isometry changes smoothly from one to the next."""


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
