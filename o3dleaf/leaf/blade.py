"""The blade: frame, height map and outline together, the macro-scale leaf of the paper's section 2.4."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.checks import FloatArray, as_bounds, as_points, require_positive
from o3dleaf.errors import ReconstructionError, UnitError
from o3dleaf.leaf.frame import LeafFrame
from o3dleaf.leaf.height import HeightMap
from o3dleaf.leaf.outline import CRUMBS, AlphaShape
from o3dleaf.leaf.surface import lift, pull_back
from o3dleaf.mesh.arrays import build_mesh
from o3dleaf.mesh.clip import discard_triangles, trim_to_manifold
from o3dleaf.mesh.components import largest_components


@dataclass(frozen=True, eq=False)
class Blade:
    r"""The blade as a surface over its flattened plane: x = m(y₁) + y₂ A(y₁) + H(y₁, y₂) V(y₁) inside an outline.

    It holds both directions of the paper's T*: `flatten` takes the world to flat coordinates
    (along, across, height above the blade), `lift` takes them back.

    Attributes
    ----------
    frame : LeafFrame
    height_map : HeightMap
    outline : AlphaShape
        In leaf coordinates (along, across).
    """

    frame: LeafFrame
    height_map: HeightMap
    outline: AlphaShape

    def __post_init__(self) -> None:
        """Refuse parts in different units: they were fitted to one scan."""
        if self.frame.unit != self.height_map.unit:
            raise UnitError(
                f"frame is in {self.frame.unit}, height map in {self.height_map.unit}; fit both in one unit"
            )

    @property
    def unit(self) -> str | None:
        """Unit of length of the world and of leaf coordinates."""
        return self.frame.unit

    def flatten(self, x: npt.ArrayLike) -> FloatArray:
        """Return T*(x) = (y₁, y₂, y₃ − H(y₁, y₂)) of (n, 3) world points (paper, section 2.6)."""
        flat = self.frame.to_leaf(x)
        flat[:, 2] -= self.height_map(flat[:, :2])
        return flat

    def lift(self, flat: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points of (n, 3) flat coordinates: the inverse of `flatten`."""
        leaf = as_points(flat, "flat", dim=3).copy()
        leaf[:, 2] += self.height_map(leaf[:, :2])
        return self.frame.to_world(leaf)

    def pull_back(self, flat: FloatArray, gradient: FloatArray) -> FloatArray:
        r"""Return the world gradients of g(T*(x)) from the gradients of g, both (n, 3), at flat coordinates.

        .. math:: ∇_x\,g(T^*(x)) = J^{-T} \bigl(g_1 - g_3 H_1,\; g_2 - g_3 H_2,\; g_3\bigr), \qquad J = ∂x/∂y
        """
        return pull_back(lift(self, flat).columns, gradient)

    def extract_mesh(self, spacing: float, region: npt.ArrayLike | None = None) -> o3d.geometry.TriangleMesh:
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
            If the outline holds no triangle at this spacing.
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
        mesh, removed = largest_components(build_mesh(self.lift(vertices), triangles), 1)
        if removed.open_area > CRUMBS * mesh.get_surface_area():
            raise ReconstructionError(
                f"at {step:.4g} {self.unit or ''} the blade falls into {1 + removed.open} pieces, where its outline is "
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
