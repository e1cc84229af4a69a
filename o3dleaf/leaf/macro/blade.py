"""The paper's blade: frame, height map and outline together, its section 2.4."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds, as_points
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, ReconstructionError, UnitError
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.leaf.blade.blade import SAMPLE_COUNT, Blade
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.frame_quality import FrameQuality
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.lift import focal_along_normal, focal_up, lift_up
from o3dleaf.leaf.macro.offset import (
    MIN_ROOM,
    OFFSETS,
    NormalOffsets,
    flatten_along_normal,
    lift_along_normal,
    pull_back_along_normal,
)
from o3dleaf.leaf.macro.outline import MAX_FRAGMENTS, AlphaShape
from o3dleaf.surface.mesh.clip import discard_triangles, trim_to_manifold
from o3dleaf.surface.mesh.components import largest_component


@checked
@dataclass(frozen=True, eq=False)
class HeightMapBlade(Blade):
    r"""The blade as a surface over its flattened plane: S = m(y₁) + y₂ A(y₁) + H(y₁, y₂) V(y₁) inside an outline.

    Both directions of the paper's T* are here: `flatten` takes the world to flat coordinates
    (along, across, height above the blade), `lift` takes them back. Heights are measured along V, as in
    the paper, x = S + y₃ V; or along the blade's own normal, x = S + y₃ N, which keeps the thickness of
    what lies on a slope.

    Attributes
    ----------
    frame : LeafFrame
    height_map : HeightMap
    outline : AlphaShape
        In leaf coordinates (along, across).
    offset : {"up", "normal"}
        Direction of heights. Along the normal, points beyond the blade's focal surface, where
        normals meet (see `distortion`), keep the flat coordinates that they have along `up`.
    """

    frame: LeafFrame
    height_map: HeightMap
    outline: AlphaShape
    offset: str = "up"

    stored_class: ClassVar[str] = "Blade"

    def __post_init__(self) -> None:
        """Refuse parts in different units, which were fitted to one scan, and a normal without derivatives."""
        if self.frame.unit != self.height_map.unit:
            raise UnitError(
                f"frame is in {self.frame.unit}, height map in {self.height_map.unit}; fit both in one unit"
            )
        if require_choice(self.offset, OFFSETS, "offset") == "normal":
            try:
                self.height_map.jet(self.height_map.bounds[:1])
            except InputError as cause:
                raise InputError(
                    "offset: 'normal' needs second derivatives, which this height map lacks; fit it with "
                    "kernel='cubic', or use offset='up'"
                ) from cause

    def __repr__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"HeightMapBlade({self.frame.length:.4g}{unit} long, heights along {self.offset})"

    @property
    def unit(self) -> str | None:
        """Unit of length of the world and of leaf coordinates."""
        return self.frame.unit

    def flatten(self, x: npt.ArrayLike) -> FloatArray:
        """Return T*(x), along up (y₁, y₂, y₃ − H(y₁, y₂)), of (n, 3) world points (paper, section 2.6)."""
        points = as_points(x, "x", dim=3)
        flat = self.frame.to_leaf(points)
        flat[:, 2] -= self.height_map(flat[:, :2])
        if self.offset == "up":
            return flat
        return flatten_along_normal(self.frame, self.height_map, points, flat)

    def lift(self, flat: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points of (n, 3) flat coordinates: the inverse of `flatten`."""
        leaf = as_points(flat, "flat", dim=3)
        if self.offset == "normal":
            return lift_along_normal(self.frame, self.height_map, leaf)
        leaf = leaf.copy()
        leaf[:, 2] += self.height_map(leaf[:, :2])
        return self.frame.to_world(leaf)

    def lift_with_jacobian(self, flat: FloatArray) -> Lifted:
        """Return the world points of (n, 3) flat coordinates, and the lift's Jacobian there."""
        if self.offset == "up":
            return lift_up(self.frame, self.height_map, flat)
        offsets = NormalOffsets.at(self.frame, self.height_map, flat)
        return Lifted(offsets.points, np.ascontiguousarray(offsets.jacobian.transpose(0, 2, 1)))

    def pull_back(self, flat: FloatArray, gradient: FloatArray, x: FloatArray | None = None) -> FloatArray:
        r"""Return the world gradients of g(T*(x)) from the gradients of g, both (n, 3), at flat coordinates.

        .. math:: ∇_x\,g(T^*(x)) = J^{-T} \bigl(g_1 - g_3 H_1,\; g_2 - g_3 H_2,\; g_3\bigr), \qquad J = ∂x/∂y

        along up; along the normal J⁻ᵀ g, with J the Jacobian of `lift`.

        Parameters
        ----------
        flat, gradient : (n, 3) ndarrays
        x : (n, 3) ndarray, optional
            The world points that `flatten` made `flat` of. They tell which ones lie beyond the focal surface
            and have coordinates along up; without them only `flat` itself can, by its height.
        """
        if self.offset == "up":
            return self.lift_with_jacobian(flat).pull_back(gradient)
        offsets = NormalOffsets.at(self.frame, self.height_map, flat)
        pulled = pull_back_along_normal(offsets, gradient)
        beyond = offsets.room <= MIN_ROOM
        if x is not None:
            beyond |= ~offsets.reach(x, self.frame.length)
        upright = lift_up(self.frame, self.height_map, flat[beyond])
        pulled[beyond] = upright.pull_back(gradient[beyond])
        return pulled

    def focal_heights(self, plane: FloatArray) -> FloatArray:
        """Return the heights (n,) above or below the (n, 2) places at which the lift folds; ∞ where it never does."""
        focal = focal_along_normal if self.offset == "normal" else focal_up
        return focal(self.frame, self.height_map, plane)

    def describe(self) -> dict[str, Any]:
        """Return what a summary says of the scan and the outline; of the fit see `frame_quality`."""
        frame, outline = self.frame, self.outline
        past = (outline.points[:, 0] < 0) | (outline.points[:, 0] > frame.length)
        return {
            "scan": {
                "points": len(outline.points),
                "axis_length": frame.length,
                "notes": list(frame.notes),
                "points_past_the_ends": int(np.sum(past)),
            },
            "outline": {"alpha": outline.alpha, "alpha_chosen": outline.automatic, "area_in_the_plane": outline.area},
        }

    def frame_quality(self, points: CloudLike) -> FrameQuality:
        """Return the quality of the frame for the scan and for this blade, at `SAMPLE_COUNT` places inside the outline.

        Parameters
        ----------
        points : (n, 3) array_like or Open3D point cloud
            The scan, at least two points, in `unit`.
        """
        plane = self._places(SAMPLE_COUNT)
        leaf = np.column_stack([plane, self.height_map(plane)])
        return FrameQuality.of(self.frame, points_of(points, "points", least=2), leaf)

    def _places(self, count: int) -> FloatArray:
        """Return about `count` (along, across) on a square grid inside the outline, and the scan's own."""
        return np.concatenate([super()._places(count), self.outline.points])

    @checked
    def extract_mesh(self, spacing: Positive, region: npt.ArrayLike | None = None) -> o3d.geometry.TriangleMesh:
        """Return the blade as one open sheet, triangulated at `spacing` and clipped by the outline.

        Parameters
        ----------
        spacing : float
            Step in leaf coordinates, in `unit`.
        region : (2, 2) array_like, optional
            Lower and upper (along, across) of the part wanted; the whole outline by default.

        Raises
        ------
        ReconstructionError
            If the outline contains no triangle at this spacing.
        """
        step = require_positive(spacing, "spacing")
        box = self.outline.bounds if region is None else as_bounds(region, 2, "region")
        first, last = np.floor(box[0] / step), np.ceil(box[1] / step)
        along, across = (np.arange(a, b + 1) * step for a, b in zip(first, last, strict=True))
        plane = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1).reshape(-1, 2)
        vertices, triangles = discard_triangles(
            np.column_stack([plane, np.zeros(len(plane))]),
            _grid_triangles(len(along), len(across)),
            self.outline.contains(plane),
        )
        if not len(triangles):
            raise ReconstructionError(
                f"no triangle of {step:.4g} {self.unit or ''} fits the outline; use a finer spacing"
            )
        vertices, triangles = trim_to_manifold(vertices, triangles)
        mesh, areas = largest_component(build_mesh(self.lift(vertices), triangles))
        if areas[1:].sum() > MAX_FRAGMENTS * areas[0]:
            raise ReconstructionError(
                f"at {step:.4g} {self.unit or ''} the blade falls into {len(areas)} pieces, where its outline is "
                "narrower than the spacing; use a finer spacing or a larger alpha"
            )
        return mesh


def _grid_triangles(rows: int, columns: int) -> npt.NDArray[np.int64]:
    """Return the triangles of a grid of points, counter-clockwise seen from +up, diagonals alternating."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    b, c, d = a + columns, a + columns + 1, a + 1
    even = ((i + j) % 2 == 0).ravel()
    first = np.where(even, [a, b, c], [a, b, d])
    second = np.where(even, [a, c, d], [b, c, d])
    return np.stack([first.T, second.T], axis=1).reshape(-1, 3).astype(np.int64)
