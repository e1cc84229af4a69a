"""Bends tighter than a scan can show: where a surface goes on past its sheet, or layers of the scan are too close."""

from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, UniqueRows
from o3dleaf.core.places import tell_middle, tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count, tell_length, tell_share
from o3dleaf.leaf.blade.outline_area import in_polygon
from o3dleaf.leaf.margin.margin import Margin, cut_margin
from o3dleaf.leaf.margin.margin_curve import largest
from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.surface import ChartSurface

TIGHTEST = 1.0
"""Radius of a bend in spacings at least: from one point to the next the surface then turns by a radian."""
FOLDED = 1 / np.pi
"""Radius of a bend in spacings below which the surface turns back on itself from one point to the next: what no scan
shows. A crease is a bend less tight than that, and stays."""
BESIDE_FOLDS = 1.0
"""Spacings around a fold that are left out of a blade: its two sides and their bend."""
FOLD_LENGTH = 0.5
"""Spacings that a fold is long at least."""
LEAST_LEFT = 0.5
"""Share of a blade that its folds leave at least: with less of it nothing is left out, as of a few noisy points."""
FINELY, MAX_PLACES = 0.25, 1_000_000
"""Distance in spacings of the places where folds are looked for, and about how many there are at most."""
EVERY, AROUND = 0.5, 0.5
"""Distance in spacings of the places where bends are looked for, and from the points: the blade ends half a spacing
beyond them."""
PAST = 1e-6
"""Distance from the sheet in spacings from which on a place lies past its edge."""


def past_tight_bends(fit: SurfaceFit, spacing: float) -> BoolArray:
    """Return which points (n,) have feet past the edge of the sheet where the surface bends too tightly.

    There nothing holds the surface but what lies beyond a gap, towards which it turns: as at the edge of a fold of
    which one side was not seen. Points of the far side have feet on such a bend, but the blade does not go there.
    """
    places = tight_bends(fit.surface, fit.feet, spacing)
    if not len(places):
        return np.zeros(len(fit.feet), bool)
    beside = query(cKDTree(places), fit.feet)[0] <= AROUND * spacing
    return np.asarray(beside & (fit.mesh.distances(fit.feet) > PAST * spacing))


def without_folds(fit: SurfaceFit, margin: Margin) -> tuple[Margin, tuple[str, ...]]:
    """Return the margin without places where the surface is folded between points of the scan, and a line on them.

    No leaf shows there, and relief that stands on a fold passes through itself.
    """
    spacing = fit.problem.spacing
    low, high = margin.bounds
    step = max(FINELY * spacing, float(np.sqrt(np.prod(high - low) / MAX_PLACES)))
    along = [np.arange(first, last, step) for first, last in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
    places = places[in_polygon(margin.polygon, places)]
    folds = places[_bend(fit.surface, places) * FOLDED * spacing > 1]
    beside = shapely.get_parts(shapely.union_all(shapely.points(folds)).buffer(BESIDE_FOLDS * spacing))
    # Around what is as long, and does not bend in a single place, as a dent does.
    beside = beside[shapely.area(beside) >= (np.pi * BESIDE_FOLDS + 2 * FOLD_LENGTH) * BESIDE_FOLDS * spacing**2]
    left = largest(margin.polygon.difference(shapely.union_all(beside)))
    if not len(beside) or left.area < LEAST_LEFT * margin.area:
        return margin, ()
    cut, largest_fold = margin.area - left.area, max(beside, key=shapely.area)
    at = tell_middle(fit.surface.jet(folds[in_polygon(largest_fold, folds)], 0)[0], fit.points)
    size = f"{tell_length(cut, 2)}, {tell_share(cut / margin.area)} of the blade, in {tell_count(len(beside), 'place')}"
    said = f"left out: {size}, most about {at}: the surface is folded there between points of the scan"
    return cut_margin(margin, left), (said,)


class Bends(NamedTuple):
    """Bends of a surface: their places in its chart (k, 2), and their radii (k,)."""

    places: FloatArray
    radii: FloatArray

    @property
    def tightest(self) -> float:
        """The least radius; of none it is infinite."""
        return float(self.radii.min(initial=np.inf))

    def tell(self, surface: ChartSurface, points: FloatArray, spacing: float) -> str:
        """Return a line on the tightest one; there must be one. Its place is told as those of points (n, 3) are."""
        worst = self.places[[np.argmin(self.radii)]]
        place, least = tell_place(surface.jet(worst, 0)[0][0], points), spacing / 100
        radius = f"less than {tell_length(least)}" if self.tightest < least else tell_length(self.tightest)
        return f"around {place} the surface bent to a radius of {radius}, where points are {tell_length(spacing)} apart"


def tight_bends_on_sheet(
    surface: ChartSurface, mesh: ChartMesh, feet: FloatArray, spacing: float, tightest: float = TIGHTEST
) -> Bends:
    """Return the bends of a surface on its sheet around feet (n, 2) whose radii are less than `tightest` spacings."""
    places = tight_bends(surface, feet, spacing)
    places = places[mesh.distances(places) <= PAST * spacing] if len(places) else places
    bends = Bends(places, 1 / _bend(surface, places))
    tight = bends.radii < tightest * spacing
    return Bends(bends.places[tight], bends.radii[tight])


def tight_bends(surface: ChartSurface, feet: FloatArray, spacing: float) -> FloatArray:
    """Return places (k, 2) around feet (n, 2) of points of a spacing where a surface bends too tightly."""
    step = EVERY * spacing
    cells = UniqueRows.of(np.floor(feet / step).astype(np.int64)).rows
    reach = int(np.ceil(AROUND / EVERY))
    shifts = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
    places = (UniqueRows.of((cells[:, np.newaxis] + shifts).reshape(-1, 2)).rows + 0.5) * step
    places = places[query(cKDTree(feet), places)[0] <= AROUND * spacing]
    return np.asarray(places[_bend(surface, places) * TIGHTEST * spacing > 1.0])


def _bend(surface: ChartSurface, places: FloatArray) -> FloatArray:
    """Return the larger curvature (n,) at places (n, 2), one over the radius."""
    return np.asarray(np.abs(surface.curvatures(places)).max(axis=1, initial=0.0))
