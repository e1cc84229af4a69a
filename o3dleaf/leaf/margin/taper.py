"""The taper: how the thickness of a leaf falls towards its margin, to the round rim that leaves have."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks

LEAST = 0.1
"""Share of the thickness that is left at the margin: enough for a rim, which a solid must have."""
BLOCK = 1 << 12


@dataclass(frozen=True, eq=False)
class Taper:
    r"""The factor τ of heights at a distance d inside the margin, an ellipse's quarter over the rim's radius R.

    .. math:: τ^2 = l^2 + (1 - l^2) (1 - (1 - d/R)^2), \\quad 0 \\le d \\le R

    and 1 further inside; outside the margin it goes on, positive, with a continuous derivative.

    Attributes
    ----------
    polygon : shapely Polygon
        The area inside the margin.
    radius : float
    """

    polygon: shapely.Polygon
    radius: float

    def values(self, uv: FloatArray) -> FloatArray:
        """Return τ (n,) at (n, 2) places."""
        return self.jet(uv)[:, 0]

    def jet(self, uv: FloatArray) -> FloatArray:
        """Return τ, ∂τ/∂u and ∂τ/∂v (n, 3) at (n, 2) places."""
        jets = np.empty((len(uv), 3))
        border = self.polygon.boundary
        shapely.prepare(border)

        def task(start: int, stop: int) -> None:
            plane = uv[start:stop]
            points = shapely.points(plane)
            nearest = shapely.get_coordinates(shapely.shortest_line(points, border)).reshape(-1, 2, 2)[:, 1]
            away = plane - nearest
            length = np.linalg.norm(away, axis=1)
            side = np.where(shapely.intersects_xy(self.polygon, *plane.T), 1.0, -1.0)
            value, slope = _profile(side * length / self.radius)
            jets[start:stop, 0] = value
            factor = slope / self.radius * side / np.where(length > 0, length, 1.0)
            jets[start:stop, 1:] = factor[:, np.newaxis] * away

        run_blocks(task, len(uv), BLOCK)
        return jets


def _profile(depth: FloatArray) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return τ and its derivative by the depth d/R."""
    inner = np.clip(depth, 0.0, 1.0)
    value = np.sqrt(LEAST**2 + (1 - LEAST**2) * (1 - (1 - inner) ** 2))
    slope = (1 - LEAST**2) * (1 - inner) / value
    fall = 1 - (1 - LEAST**2) / LEAST**2 * np.minimum(depth, 0.0)
    return value / fall, slope / fall**2
