"""A hole of the leaf, kept or filled."""

from dataclasses import dataclass

import shapely

from o3dleaf.core.checks.arrays import FloatArray


@dataclass(frozen=True)
class Hole:
    """A hole of the leaf: a gap that is larger than the sample's own.

    Attributes
    ----------
    place : (2,) ndarray
        Its centroid in the chart.
    area, width : float
        Its area, and the diameter of the largest disc in it.
    filled : bool
        Whether it was filled on request.
    """

    place: FloatArray
    area: float
    width: float
    filled: bool

    @classmethod
    def of(cls, ring: FloatArray, limit: float) -> "Hole":
        """Return the hole inside a ring (n, 2), filled where it is no wider than a limit."""
        polygon = shapely.Polygon(ring)
        width = 2 * float(shapely.maximum_inscribed_circle(polygon).length)
        return cls(shapely.get_coordinates(polygon.centroid)[0], float(polygon.area), width, width <= limit)

    def __str__(self) -> str:
        fate = "filled" if self.filled else "kept"
        return f"hole of {self.width:.3g} across at u {self.place[0]:.4g}, v {self.place[1]:.4g}: {fate}"
