"""Distortion of the micro-structure by the map from flat coordinates to the world: stretch, shear, thickness."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.offset import NormalOffsets, surface_tangents

STRAIGHT = 1e-12
"""Turning of the frame per length of the leaf below which it is none: its focal surface is infinitely far."""


@dataclass(frozen=True, eq=False)
class Distortion:
    r"""The Jacobian of `Blade.lift` at height 0, J = (S₁, S₂, D), D = V along up and N along the normal, at n places.

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
        D · N: the thickness in the world of a unit thickness. Along up the cosine of the blade's slope.
    area : (n,) ndarray
        |S₁ × S₂|.
    singular_values : (n, 3) ndarray
        Of J, largest first: the axes of the ellipsoid that a small unit ball becomes.
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
    singular_values: FloatArray
    focal: FloatArray

    def __repr__(self) -> str:
        ranges = [(name, getattr(self, name)) for name in ("along", "across", "thickness")]
        text = ", ".join(f"{name} {values.min():.3g} to {values.max():.3g}" for name, values in ranges)
        return f"Distortion({len(self.plane):,} places: {text})"

    @property
    def volume(self) -> FloatArray:
        """Det J (n,), area × thickness: the volume in the world of a unit volume."""
        return self.area * self.thickness

    def to_dict(self) -> dict[str, Any]:
        """Return least, median and greatest of each as plain values, for a summary; of `focal` the least, None if ∞."""
        names = ("along", "across", "shear", "thickness", "area", "volume")
        table = {name: np.quantile(getattr(self, name), (0, 0.5, 1)).tolist() for name in names}
        nearest = float(self.focal.min())
        return table | {"focal": nearest if np.isfinite(nearest) else None}

    @classmethod
    def of(cls, frame: LeafFrame, height_map: HeightMap, plane: FloatArray, offset: str) -> "Distortion":
        """Measure the map of a frame and a height map, with heights along "up" or "normal", at (n, 2) places."""
        height, *gradient = height_map.jet(plane, 1).T
        leaf = np.column_stack([plane, height])
        jacobian = frame.jacobian(leaf)
        first, second = surface_tangents(jacobian, np.stack(gradient, axis=1))
        cross = np.cross(first, second)
        area = np.linalg.norm(cross, axis=1)
        along, across = np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1)
        normal = cross / area[:, np.newaxis]
        direction = normal if offset == "normal" else jacobian[:, :, 2]
        return cls(
            plane=plane,
            along=along,
            across=across,
            shear=np.arcsin(np.clip(np.einsum("ni,ni->n", first, second) / (along * across), -1, 1)),
            thickness=np.einsum("ni,ni->n", direction, normal),
            area=area,
            singular_values=np.linalg.svd(np.stack([first, second, direction], axis=2), compute_uv=False),
            focal=_focal(frame, height_map, plane) if offset == "normal" else _focal_up(frame, leaf, jacobian),
        )


def _focal(frame: LeafFrame, height_map: HeightMap, plane: FloatArray) -> FloatArray:
    """Return the least radius of curvature of the blade (n,)."""
    flat = np.column_stack([plane, np.zeros(len(plane))])
    curvature = np.abs(NormalOffsets.at(frame, height_map, flat).curvatures).max(axis=1, initial=0.0)
    return _reciprocal(curvature, frame.length)


def _focal_up(frame: LeafFrame, leaf: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return the height at which det ∂x/∂y, linear in y₃, vanishes."""
    determinant = np.linalg.det(jacobian)
    higher = np.linalg.det(frame.jacobian(leaf + np.array([0.0, 0.0, frame.length])))
    fall = np.abs(higher - determinant) / frame.length
    return np.asarray(np.abs(determinant) * _reciprocal(fall, frame.length))


def _reciprocal(curvature: FloatArray, length: float) -> FloatArray:
    """Return the radii of curvature, ∞ where there is none."""
    curved = curvature > STRAIGHT / length
    return np.where(curved, 1 / np.where(curved, curvature, 1.0), np.inf)
