"""Distortion of the micro-structure by the map from flat coordinates to the world: stretch, shear, thickness."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray

STRAIGHT = 1e-12
"""Curvature, times the length of the leaf, below which it is none: its focal surface is infinitely far."""
QUANTILES = (0.01, 0.99)
"""Of the area, between which lengths are told."""


@dataclass(frozen=True, eq=False)
class Distortion:
    r"""The Jacobian of `Blade.lift` at height 0, J = (S₁, S₂, D), with D the direction of heights, at n places.

    A copy of the texture without any distortion has 1 everywhere, and no shear.

    Attributes
    ----------
    plane : (n, 2) ndarray
        (along, across).
    along, across : (n,) ndarrays
        |S₁| and |S₂|: lengths in the world of a unit length in the plane.
    shear : (n,) ndarray
        What the angle between S₁ and S₂ lacks of a right one, in radians.
    thickness : (n,) ndarray
        D · N, N the unit normal: the thickness in the world of a unit thickness. Along up the cosine of the blade's
        slope.
    area : (n,) ndarray
        |S₁ × S₂|.
    jacobian : (n, 3, 3) ndarray
        J itself.
    focal : (n,) ndarray
        Height above or below the blade, in its unit, at which the map folds; ∞ where it never does. Micro-structure
        that is taller cannot be put there.
    """

    plane: FloatArray
    along: FloatArray
    across: FloatArray
    shear: FloatArray
    thickness: FloatArray
    area: FloatArray
    jacobian: FloatArray
    focal: FloatArray

    def __repr__(self) -> str:
        ranges = [(name, getattr(self, name)) for name in ("along", "across", "thickness")]
        text = ", ".join(f"{name} {values.min():.3g} to {values.max():.3g}" for name, values in ranges)
        return f"Distortion({len(self.plane):,} places: {text})"

    @property
    def singular_values(self) -> FloatArray:
        """Those of J (n, 3), largest first: the axes of the ellipsoid that a small unit ball becomes."""
        return np.asarray(np.linalg.svd(self.jacobian, compute_uv=False))

    @property
    def volume(self) -> FloatArray:
        """Det J (n,), area × thickness: the volume in the world of a unit volume."""
        return self.area * self.thickness

    @property
    def stretch(self) -> tuple[float, float]:
        """The least and the greatest singular value of the plane's map to the world, of 99 % of the places each."""
        first, second = self.along, self.across
        mean, shear = (first**2 + second**2) / 2, first * second * np.sin(self.shear)
        half = np.hypot((first**2 - second**2) / 2, shear)
        low, _ = range_of(np.sqrt(np.maximum(mean - half, 0.0)))
        _, high = range_of(np.sqrt(mean + half))
        return low, high

    def to_dict(self) -> dict[str, Any]:
        """Return least, median and greatest of each as plain values, for a summary; of `focal` the least, None if ∞."""
        names = ("along", "across", "shear", "thickness", "area", "volume")
        table = {name: np.quantile(getattr(self, name), (0, 0.5, 1)).tolist() for name in names}
        nearest = float(self.focal.min())
        return table | {"focal": nearest if np.isfinite(nearest) else None}

    @classmethod
    def of(cls, plane: FloatArray, columns: FloatArray, focal: FloatArray) -> "Distortion":
        """Measure a map at (n, 2) places by its Jacobian at height 0.

        Parameters
        ----------
        plane : (n, 2) ndarray
        columns : (n, 3, 3) ndarray
            ``columns[:, k]`` is ∂X/∂z_k, as in `Lifted`.
        focal : (n,) ndarray
            Heights at which the map folds.
        """
        first, second, direction = columns[:, 0], columns[:, 1], columns[:, 2]
        cross = np.cross(first, second)
        area = np.linalg.norm(cross, axis=1)
        along, across = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
        return cls(
            plane=plane,
            along=along,
            across=across,
            shear=np.arcsin(np.clip(np.einsum("ni,ni->n", first, second) / (along * across), -1, 1)),
            thickness=np.einsum("ni,ni->n", direction, cross / area[:, np.newaxis]),
            area=area,
            jacobian=columns.transpose(0, 2, 1),
            focal=focal,
        )


def range_of(values: FloatArray) -> tuple[float, float]:
    """Return what 1 % of the values are below, and 99 %."""
    low, high = np.quantile(values, QUANTILES).tolist()
    return low, high


def radii_of(curvature: FloatArray, length: float) -> FloatArray:
    """Return the radii of curvature (n,) on a leaf of a given length, ∞ where there is no curvature."""
    curved = curvature > STRAIGHT / length
    return np.where(curved, 1 / np.where(curved, curvature, 1.0), np.inf)
