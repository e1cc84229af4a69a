"""Round-ended wires side by side, as in a bundle."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.samples.solids import Feet, Solid, directions


@checked
@dataclass(frozen=True, eq=False)
class Wires(Solid):
    """Wires along the third axis of their own, each with round ends, none of which touches another.

    Attributes
    ----------
    places : tuple of (2,) tuples
        Where their axes are.
    radius : float
    length : float
        Of their axes, between the centers of the round ends.

    Raises
    ------
    InputError
        If two of them touch.
    """

    places: tuple[tuple[float, float], ...] = ((-0.3, 0.0), (0.0, 0.0), (0.3, 0.0))
    radius: Positive = 0.1
    length: Positive = 1.0

    def __post_init__(self) -> None:
        if not self.places or (pdist(self._places) <= 2 * self.radius).any():
            raise InputError("places: give one or more, farther apart than two radii")

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of their box."""
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        return np.array([[*(low - self.radius), -self.radius], [*(high + self.radius), self.length + self.radius]])

    @property
    def area(self) -> float:
        """Area of the surface: the ends are those of one ball each."""
        return float(2 * np.pi * self.radius * (self.length + 2 * self.radius) * len(self.places))

    @property
    def _places(self) -> FloatArray:
        return np.array(self.places, dtype=np.float64)

    def _feet(self, points: FloatArray) -> Feet:
        nearest = np.linalg.norm(points[:, np.newaxis, :2] - self._places, axis=2).argmin(axis=1)
        axis = np.column_stack([self._places[nearest], np.clip(points[:, 2], 0.0, self.length)])
        normals, length = directions(points - axis, np.array([1.0, 0.0, 0.0]))
        return Feet(axis + self.radius * normals, normals, length - self.radius)

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """By Archimedes a piece of the axis has as much area beside the ends' balls as beside the middle."""
        wire = rng.integers(len(self.places), size=count)
        along = rng.uniform(-self.radius, self.length + self.radius, count)
        angle = rng.uniform(0.0, 2 * np.pi, count)
        beyond = along - np.clip(along, 0.0, self.length)
        wide = np.sqrt(self.radius**2 - beyond**2)
        return np.column_stack(
            [self._places[wire] + wide[:, np.newaxis] * np.column_stack([np.cos(angle), np.sin(angle)]), along]
        )
