"""Bends tighter than a scan can show: as a rule where a surface goes on past its sheet, around the edge of a fold."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.surface import ChartSurface

TIGHTEST = 1.0
"""Radius of a bend in spacings at least: from one point to the next the surface then turns by a radian."""
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


class Bend(NamedTuple):
    """A bend of a surface: its place in the world (3,), and its radius."""

    place: FloatArray
    radius: float


def tightest_bend(surface: ChartSurface, mesh: ChartMesh, feet: FloatArray, spacing: float) -> Bend | None:
    """Return the tightest bend of a surface on its sheet around feet (n, 2), if one is too tight."""
    places = tight_bends(surface, feet, spacing)
    places = places[mesh.distances(places) <= PAST * spacing] if len(places) else places
    if not len(places):
        return None
    bend = _bend(surface, places)
    worst = int(np.argmax(bend))
    return Bend(surface.jet(places[worst : worst + 1], 0)[0][0], float(1 / bend[worst]))


def tight_bends(surface: ChartSurface, feet: FloatArray, spacing: float) -> FloatArray:
    """Return places (k, 2) around feet (n, 2) of points of a spacing where a surface bends too tightly."""
    step = EVERY * spacing
    cells = np.unique(np.floor(feet / step).astype(np.int64), axis=0)
    reach = int(np.ceil(AROUND / EVERY))
    shifts = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
    places = (np.unique((cells[:, np.newaxis] + shifts).reshape(-1, 2), axis=0) + 0.5) * step
    places = places[query(cKDTree(feet), places)[0] <= AROUND * spacing]
    return np.asarray(places[_bend(surface, places) * TIGHTEST * spacing > 1.0])


def _bend(surface: ChartSurface, places: FloatArray) -> FloatArray:
    """Return the larger curvature (n,) at places (n, 2), one over the radius."""
    return np.asarray(np.abs(surface.curvatures(places)).max(axis=1, initial=0.0))
