"""Folds of the lift: places where the micro-structure is higher than the blade's radius of curvature."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import measure_in_words, tell_share
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.blade.outline_area import places_inside
from o3dleaf.leaf.residuals.places import Place, find_places, tell_places
from o3dleaf.leaf.textured_blade import TexturedBlade

PLACES = 100_000
"""Places of the blade that are looked at: on one of 200 mm by 12 mm, one every sixth of a millimeter."""
LAYERS = 16
"""Heights of the micro-structure on each side of the blade that are looked at."""


@dataclass(frozen=True)
class Folds:
    """Places where a leaf's surface passes through itself: its blade bends too tightly for the micro-structure.

    Attributes
    ----------
    share : float
        Of the blade's area: there the micro-structure reaches beyond the focal surface, det J of the lift ≤ 0.
    radius : float
        Least height at which the lift folds, over or under these places, in `unit`; ∞ where there are none.
    places : tuple of Place
        The largest of them.
    unit : str or None
    """

    share: float
    radius: float
    places: tuple[Place, ...]
    unit: str | None

    @classmethod
    def of(cls, leaf: TexturedBlade) -> "Folds":
        """Look for the folds of a leaf."""
        blade = leaf.blade
        plane = places_inside(blade.outline, PLACES)
        focal = blade.focal_heights(plane)
        folded = focal < np.abs(leaf.heights).max()
        folded[folded] = _reaches_focus(leaf, plane[folded])
        if not folded.any():
            return cls(0.0, np.inf, (), blade.unit)
        world = blade.lift(np.column_stack([plane, np.zeros(len(plane))]))
        places = find_places(world, folded, leaf.thickness)
        return cls(float(folded.mean()), float(focal[folded].min()), places, blade.unit)

    @property
    def warnings(self) -> list[str]:
        """One line, or none where there are no folds."""
        if not self.places:
            return []
        radius = measure_in_words(self.radius, self.unit)
        told = (
            f"the blade bends more tightly than the micro-structure is high, down to a radius of {radius}, on "
            f"{tell_share(self.share)} of it, {tell_places(self.places)}: triangles of the leaf's surface cross there; "
            "cut the scan there, or smooth it more"
        )
        return [told]

    def to_dict(self) -> dict[str, Any]:
        """Return all as plain values, the radius None if it is ∞."""
        return {
            "share": self.share,
            "radius": self.radius if np.isfinite(self.radius) else None,
            "places": [place.to_dict() for place in self.places],
            "warnings": self.warnings,
        }


def _reaches_focus(leaf: TexturedBlade, plane: FloatArray) -> BoolArray:
    """Return over which of the (n, 2) places there is leaf at a height at which the lift is folded."""
    low, high = leaf.heights
    reaches = np.zeros(len(plane), dtype=bool)
    upright = _determinants(leaf.blade, plane, 0.0) > 0
    for height in np.concatenate([np.linspace(low, 0, LAYERS + 1)[:-1], np.linspace(0, high, LAYERS + 1)[1:]]):
        folded = (_determinants(leaf.blade, plane, height) > 0) != upright
        rows = np.flatnonzero(folded & ~reaches)
        reaches[rows] = leaf.values(np.column_stack([plane[rows], np.full(len(rows), height)])) > 0
    return reaches


def _determinants(blade: Blade, plane: FloatArray, height: float) -> FloatArray:
    """Return det J (n,) of the lift at one height over (n, 2) places."""
    flat = np.column_stack([plane, np.full(len(plane), height)])
    return np.asarray(np.linalg.det(blade.lift_with_jacobian(flat).columns))
