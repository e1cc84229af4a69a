"""The blade: the macro-scale leaf as a map between flat coordinates and the world, inside an outline."""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.blade.distortion import Distortion
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.blade.outline_area import Outline, places_inside
from o3dleaf.leaf.instancing.footprint import EdgeThickness

SAMPLE_COUNT = 20_000
"""Places of the blade at which its map is measured."""
DIFFERENCE_STEP = 1e-4
"""Step of the differences of the lift's Jacobian, of the blade's width: blades bend over their width."""

OpenEdges: TypeAlias = Literal["cells", "cut"]


class RimThickness(Protocol):
    """The thickness of a blade that falls, within a radius of its margin, from 1 to the least one; see `Taper`."""

    radius: float
    least: float

    def values(self, uv: npt.ArrayLike, edge: float = 0.0) -> FloatArray:
        """Return the thickness (n,) at (n, 2) places, of which those less than `edge` deep count as on the margin."""


class Blade(ABC):
    r"""A surface S over the plane inside an outline, and a direction D in which heights above it are measured.

    .. math:: x = S(z_1, z_2) + z_3\, D(z_1, z_2)

    Flat coordinates z are (along, across, height above the blade): `flatten` takes the world to them, `lift` takes
    them back. `HeightMapBlade` is the paper's.

    Attributes
    ----------
    outline : Outline
        In the plane (along, across).
    open_edges : {"cells", "cut"}
        How a mesh of two open sheets ends: with the last whole cells of its lattice inside the outline, as the
        paper's, or cut along it.
    notes : tuple of str
        What of the scan was left out, cut off, filled or averaged, one line each.
    other_pieces : (k, 3) ndarray or None
        Where a piece of the scan was asked for, its points that belong to other ones.
    several_pieces : bool
        Whether the scan has other pieces that could be asked for; not kept in a file.
    """

    outline: Outline
    notes: tuple[str, ...] = ()
    other_pieces: FloatArray | None = None
    several_pieces: bool = False
    open_edges: ClassVar[OpenEdges] = "cells"

    @property
    @abstractmethod
    def unit(self) -> str | None:
        """Unit of length of the world and of flat coordinates."""

    @abstractmethod
    def flatten(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) flat coordinates of world points (n, 3)."""

    @abstractmethod
    def lift(self, flat: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points of (n, 3) flat coordinates: the inverse of `flatten`."""

    @abstractmethod
    def lift_with_jacobian(self, flat: FloatArray) -> Lifted:
        """Return the world points of (n, 3) flat coordinates, and the lift's Jacobian there."""

    @abstractmethod
    def focal_heights(self, plane: FloatArray) -> FloatArray:
        """Return the heights (n,) above or below the (n, 2) places at which the lift folds; ∞ where it never does."""

    @abstractmethod
    def extract_mesh(self, spacing: float, region: npt.ArrayLike | None = None) -> o3d.geometry.TriangleMesh:
        """Return the blade as one open sheet with triangles of about `spacing`, of a (2, 2) region or all of it.

        Raises
        ------
        ReconstructionError
            If the outline contains no triangle at this spacing.
        """

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return what a summary says of the blade, as plain values, by headings."""

    @property
    def most_thickness(self) -> float:
        """The largest factor by which the blade makes heights longer."""
        return 1.0

    @property
    def rim(self) -> RimThickness | None:
        """The thickness, where it falls towards the margin."""
        return None

    def edge_thickness(self, reach: float) -> EdgeThickness | None:  # noqa: ARG002 - of those that taper
        """Return the thickness at a mesh's edge, which lies within `reach` of the outline; None where it is 1."""
        return None

    @property
    def warnings(self) -> list[str]:
        """Defects, one line each; empty for a good blade."""
        return []

    def lift_hessians(self, flat: FloatArray) -> FloatArray:
        """Return ∂²X/∂z_a∂z_b, (n, 3, 3, 3), from central differences of the analytic Jacobian; X is linear in z₃."""
        hessians = np.zeros((len(flat), 3, 3, 3))
        step = DIFFERENCE_STEP * float(np.ptp(self.outline.bounds[:, 1]))
        for axis in range(2):
            shift = step * np.eye(3)[axis]
            ahead, behind = (self.lift_with_jacobian(flat + sign * shift).columns for sign in (1.0, -1.0))
            hessians[:, axis] = (ahead - behind) / (2 * step)
        hessians[:, 2, :2] = hessians[:, :2, 2]
        return (hessians + hessians.transpose(0, 2, 1, 3)) / 2

    def pull_back(self, flat: FloatArray, gradient: FloatArray, x: FloatArray | None = None) -> FloatArray:
        r"""Return the world gradients J⁻ᵀ g of functions of z with gradients g, both (n, 3), J the lift's Jacobian.

        Parameters
        ----------
        flat, gradient : (n, 3) ndarrays
        x : (n, 3) ndarray, optional
            The world points that `flatten` made `flat` of, for a blade whose points differ in how they were measured.
        """
        del x
        return self.lift_with_jacobian(flat).pull_back(gradient)

    @checked
    def window(self, x: npt.ArrayLike, size: Positive) -> FloatArray:
        """Return the region (2, 2), `size` wide along and across, around the point of the blade under a world point.

        Parameters
        ----------
        x : (3,) array_like
            A point of the world near the leaf, in the scan's unit.
        size : float

        Raises
        ------
        InputError
            If the point does not lie over the blade.
        """
        middle = self.flatten(as_points(x, "x", dim=3)[:1])[0, :2]
        if not self.outline.contains(middle)[0]:
            raise InputError(
                f"x: lies at along {middle[0]:.4g}, across {middle[1]:.4g}, beside the blade; give a point over it"
            )
        half = require_positive(size, "size") / 2
        return np.array([middle - half, middle + half])

    def distortion(self, plane: npt.ArrayLike | None = None) -> Distortion:
        """Return the distortion by the map from flat coordinates to the world of what lies on the blade.

        Parameters
        ----------
        plane : (n, 2) array_like, optional
            Places (along, across), in `unit`; `SAMPLE_COUNT` ones inside the outline by default.
        """
        places = self._places(SAMPLE_COUNT) if plane is None else as_points(plane, "plane", dim=2)
        columns = self.lift_with_jacobian(np.column_stack([places, np.zeros(len(places))])).columns
        return Distortion.of(places, columns, self.focal_heights(places))

    def _places(self, count: int) -> FloatArray:
        """Return about `count` (along, across) on a square grid inside the outline."""
        return places_inside(self.outline, count)
