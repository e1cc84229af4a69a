"""The one class for a cloud: points, outward normals and weights, with what is known of them."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray, as_row
from o3dleaf.core.checks.attributes import as_normals, as_weights
from o3dleaf.core.checks.coordinates import surface_wanted
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of, raw_normals
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.branchings.branchings import Branchings
from o3dleaf.surface.cloud.neighbors import (
    IndexArray,
    Neighborhoods,
    SpacingClass,
    nearest_neighbors,
    reordered,
    smooth_spacings,
    spacing_classes,
)
from o3dleaf.surface.cloud.noise import CLEAN, PATCHES, Patches, Places, is_shape, measure_places
from o3dleaf.surface.cloud.surfels import Surfels

SIDED = ("spacing", "noise", "measured", "is_clean")
"""What is known of a cloud by the side of its points, and so anew where their normals are others."""


class Removed(NamedTuple):
    """Points removed for being NaN or infinite, there twice, outliers, averaged in their voxel, and cut out.

    Cut out are those along lines where sheets branch, or the normals of an open sheet contradict one another.
    """

    non_finite: int = 0
    repeated: int = 0
    outliers: int = 0
    averaged: int = 0
    cut: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class OrientedCloud:
    """A point cloud with normals and weights; tree, neighbors, spacing and noise are computed once, when first used.

    Every step of a cloud takes one, or what `OrientedCloud.of` makes one of, and most return one.

    Attributes
    ----------
    points : (n, 3) ndarray
    normals : (n, 3) ndarray or None
        Of unit length; outward, but for clouds on their way to `orient_normals`.
    weights : (n,) ndarray
        How many measured points each stands for.
    removed : Removed
        Points that preprocessing took out, counted by reason.
    notes : tuple of str
        What was decided on the way, one sentence each.
    branchings : Branchings or None
        Lines along which its sheets are cut apart.
    """

    points: FloatArray
    normals: FloatArray | None
    weights: FloatArray
    removed: Removed = field(default_factory=Removed)
    notes: tuple[str, ...] = ()
    branchings: Branchings | None = None

    @classmethod
    def of(
        cls,
        cloud: CloudLike,
        normals: npt.ArrayLike | None = None,
        *,
        weights: npt.ArrayLike | None = None,
        spacing: float | npt.ArrayLike | None = None,
    ) -> "OrientedCloud":
        """Return any cloud as an `OrientedCloud`; one that is one already comes back as it is.

        Parameters
        ----------
        cloud : (n, 3) array_like or Open3D point cloud, legacy or tensor
        normals : (n, 3) array_like, optional
            Outward normals in place of those of the cloud.
        weights : (n,) array_like, optional
            How many measured points each stands for; left out, one.
        spacing : float or (n,) array_like, optional
            1/√(points per unit area) of all or of each point, where it is known.

        Raises
        ------
        InputError
            If there is no point, an array has another shape, or a value is not finite.
        """
        if isinstance(cloud, cls) and normals is None and weights is None and spacing is None:
            return cloud
        points = points_of(cloud, "cloud", least=1)
        directions = raw_normals(cloud) if normals is None else normals
        unit = None if directions is None else as_normals(directions, points)
        if weights is None:
            counts = cloud.weights if isinstance(cloud, cls) else np.broadcast_to(1.0, len(points))
        else:
            counts = as_weights(weights, len(points))
        made = cls(points, unit, counts)
        if spacing is not None:
            each = as_row(spacing, "spacing", count=len(points))
            require_positive(float(each.max()), "spacing")
            given = as_weights(each, len(points), "spacing")
            vars(made).update(point_spacing=given, spacing=float(np.median(given)))
        return made

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        parts = [f"{len(self):,} points" + ("" if self.normals is None else " with normals")]
        parts += [f"{name} {vars(self)[name]:.3g}" for name in ("spacing", "noise") if name in vars(self)]
        return f"OrientedCloud({', '.join(parts)})"

    @property
    def decisions(self) -> tuple[str, ...]:
        """Points that preprocessing removed and choices it made, one sentence each; empty for a clean cloud."""
        reasons = (
            "not finite",
            "repeated",
            "far from all others or scattered through space",
            "averaged with others of their voxel",
            "cut out",
        )
        counts = [f"{count:,} {why}" for count, why in zip(self.removed, reasons, strict=True) if count]
        return (f"points left out: {', '.join(counts)}", *self.notes) if counts else self.notes

    @cached_property
    def tree(self) -> cKDTree:
        """The k-d tree of the points."""
        return cKDTree(self.points)

    @cached_property
    def neighbors(self) -> Neighborhoods:
        """Distances and rows (n, 16) of the nearest points of each point, itself first."""
        return nearest_neighbors(self.tree)

    @cached_property
    def patches(self) -> Patches:
        """The nearest points of some hundred of the points, which noise and spacing are measured from."""
        return Patches(self.points, self.tree)

    @cached_property
    def surfels(self) -> Surfels:
        """The cloud at the scale at which it is a surface: its points, or under noise groups of them."""
        if len(self) < 3:
            raise InputError(f"cloud: has {len(self)} points; at least 3 are needed")
        return Surfels.of(self.points, self.neighbors.row)

    @cached_property
    def spacing(self) -> float:
        """Median of 1/√(points per unit area), seen along the normal: noise, however thick, does not count.

        The k nearest points of a point cover an ellipse whose area is 4π √(λ₁ λ₂), with λ their variances along the
        surface: s² = 4π √(λ₁ λ₂)/(k − 1). Where noise makes neighborhoods round, every second, fourth, ... point is
        measured, of which the surface shows; two sheets within the noise then count as one. Of a cloud with normals
        only neighbors of the same side count, at some hundred places. Points at random come out 4 % too close, a square
        lattice 6 % too wide.
        """
        sided = self.normals is not None and self.is_measurable
        spacing = float(np.nanmedian(self.measured.spacing if sided else self.surfels.spacing))
        if not spacing > 0:
            raise InputError(f"cloud: most points lie on a line or in one place; {surface_wanted(self.points)}")
        return spacing

    @cached_property
    def point_spacing(self) -> FloatArray:
        """Spacing (n,) around each point, see `point_spacing`."""
        return smooth_spacings(self.neighbors)

    @cached_property
    def spacing_classes(self) -> tuple[SpacingClass, ...]:
        """The points by classes of their spacings, the sparsest first."""
        return spacing_classes(self.points, self.point_spacing)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the points across their surface, see `estimate_noise`."""
        if not self.measured.known:
            raise InputError("cloud: most neighborhoods are no piece of a surface, however large; is this a volume?")
        return float(np.nanmedian(self.measured.noise))

    @cached_property
    def is_clean(self) -> bool:
        """Whether the noise is at most a tenth of the spacing, or what seems to be noise is detail of the shape.

        What quadrics leave of a shape falls with their patches, which noise does not.
        """
        return self.noise <= CLEAN * self.spacing or is_shape(self.patches, self.normals)

    @property
    def is_measurable(self) -> bool:
        """Whether the points are enough, and most of them on a surface, so that their noise can be measured."""
        return len(self) >= PATCHES[0] and self.measured.known

    @cached_property
    def measured(self) -> Places:
        """Noise and spacing at some hundred of the points, by side where there are normals, see `measure_places`."""
        if len(self) < PATCHES[0]:
            raise InputError(f"cloud: has {len(self)} points; at least {PATCHES[0]} are needed for its noise")
        return measure_places(self.patches, self.normals)

    def require_normals(self) -> FloatArray:
        """Return the normals (n, 3), or raise `InputError` where there are none."""
        if self.normals is None:
            raise InputError("cloud: has no normals; compute them with `preprocess_point_cloud`")
        return self.normals

    def take(self, rows: npt.NDArray[np.generic]) -> "OrientedCloud":
        """Return some of the points, by a mask (n,) or by their rows."""
        normals = None if self.normals is None else self.normals[rows]
        points = np.ascontiguousarray(self.points[rows])
        return replace(self, points=points, normals=normals, weights=self.weights[rows])

    def reordered(self, order: IndexArray, tree: cKDTree | None = None) -> "OrientedCloud":
        """Return all points in another order, of which `tree` may be one, with what is known of them."""
        cloud, known = self.take(order), vars(self)
        if tree is not None:
            vars(cloud)["tree"] = tree
        if "neighbors" in known:
            vars(cloud)["neighbors"] = reordered(self.neighbors, order)
        if "point_spacing" in known:
            vars(cloud)["point_spacing"] = self.point_spacing[order]
        return cloud

    def with_normals(self, normals: FloatArray, notes: tuple[str, ...] = ()) -> "OrientedCloud":
        """Return the same points, with what is known of them but by side, other unit normals (n, 3) and more notes."""
        cloud = replace(self, normals=normals, notes=self.notes + notes)
        anew = {*vars(cloud), *SIDED}
        vars(cloud).update({name: value for name, value in vars(self).items() if name not in anew})
        return cloud

    def compact(self) -> None:
        """Find the spacings, and drop the neighborhoods, the largest arrays of a job, from memory.

        Whoever needs neighborhoods later finds them again.
        """
        _ = self.spacing, self.point_spacing
        for name in ("neighbors", "patches", "surfels"):
            vars(self).pop(name, None)


def point_spacing(cloud: CloudLike) -> FloatArray:
    r"""Return the (n,) spacings 1/√(points per unit area) of a cloud on a surface, one for each point.

    :math:`s = r_k \sqrt{\pi/k}` from the distance r_k to the k-th neighbor, k = 12, which holds for random points and
    for lattices alike; then the neighbors' median, and the mean of theirs. The median of a whole cloud, also under
    noise thicker than it, is `OrientedCloud.spacing`.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud

    Raises
    ------
    InputError
        If there are fewer than 13 points, one is not finite, or 13 lie in one place.
    """
    return OrientedCloud.of(cloud).point_spacing


def estimate_noise(cloud: CloudLike) -> float:
    r"""Return the standard deviation of a cloud's points across the surface, in their unit.

    At each of some hundred places a quadric :math:`z(u, v)` over the plane of the nearest k points leaves residuals
    of standard deviation :math:`σ_k`, six degrees of freedom taken off; the smallest k whose patch has a radius of
    at least 4.5 σ_k gives σ there, and the median over the places is returned: creases and rims do not count. Of a
    cloud with outward normals only points on the side of the place count, however near those of another sheet are.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud

    Raises
    ------
    InputError
        If there are fewer than sixteen points or one is not finite.
    """
    return OrientedCloud.of(cloud).noise
