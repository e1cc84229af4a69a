"""How well the area of a blade is known from a random scan of it."""

import numpy as np
import shapely

from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.residuals.off_blade import points_on


def area_deviation(blade: Blade, spacing: float, noise: float) -> float:
    """Return the standard deviation of a blade's area by the chance of a random scan.

    σ_A = √(P s² (s / 2 + σ)) for a perimeter P, a spacing s = 1/√(points per area) and noise σ. A stretch of margin
    of length ℓ is known from about ℓ / s points within a spacing of it, to s² / ℓ; stretches of two spacings, which a
    margin follows each by itself, err independently. Noise along the surface makes the edge as much less sharp.
    """
    return float(np.sqrt(_perimeter(blade) * spacing**2 * (spacing / 2 + noise)))


def _perimeter(blade: Blade) -> float:
    """Return the length of the margin in the world, with those of the holes that are kept."""
    rings = (shapely.get_coordinates(ring) for ring in shapely.get_parts(shapely.get_rings(blade.outline.polygon)))
    return float(sum(np.linalg.norm(np.diff(points_on(blade, ring), axis=0), axis=1).sum() for ring in rings))
