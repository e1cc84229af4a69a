"""Limits of the edits that remeshing may make."""

from typing import NamedTuple

import numpy as np

RELAXED = ((15.0, 1.25, 0.2), (5.0, 1.5, -0.2))
"""Angles below which, and how much, slivers may have more: longer edges, sharper turns."""


class Limits(NamedTuple):
    """Limits of an edit; compiled passes take them as they are.

    Attributes
    ----------
    shortest, longest : float
        Edges shorter are collapsed, longer ones split, and none is made longer.
    deviation : float
        How far what is taken away may lie from what is left.
    quality : float
        Score from which a triangle is good enough; see `o3dleaf.surface.remeshing.score_loops`.
    min_cosine : float
        Least cosine between a new triangle's normal and those it takes the place of.
    floor : float
        Least score of what a vertex leaves behind that comes to the surface: of a fan with a fold anything would be
        better.
    """

    shortest: float
    longest: float
    deviation: float
    quality: float = 0.5
    min_cosine: float = 0.6
    floor: float = 0.0

    def relaxed(self) -> tuple["Limits", ...]:
        """Return what is allowed where nothing less would do."""
        return tuple(
            self._replace(longest=longer * self.longest, quality=float(np.sin(np.radians(angle))), min_cosine=cosine)
            for angle, longer, cosine in RELAXED
        )

    def coarser(self, factor: float) -> "Limits":
        """Return limits for longer edges, which may lie further away."""
        return self._replace(
            shortest=factor * self.shortest, longest=factor * self.longest, deviation=factor**2 * self.deviation
        )

    @property
    def loose(self) -> "Limits":
        """Limits on the way to the surface."""
        return self._replace(longest=2 * self.longest, quality=0.05, min_cosine=-0.2)
