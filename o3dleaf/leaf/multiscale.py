"""The multi-scale leaf: G(x) = F(T*(x)), micro-structure everywhere on the macro-scale blade (paper, section 2.6)."""

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.checks import FloatArray, as_bounds, require_positive
from o3dleaf.errors import ReconstructionError
from o3dleaf.files import require_writable
from o3dleaf.lattice import Lattice, sample_lattice
from o3dleaf.leaf import surface
from o3dleaf.leaf.blade import Blade
from o3dleaf.leaf.distance import SurfaceIndex, closest_points, signed_distance
from o3dleaf.leaf.frame import LeafFrame
from o3dleaf.leaf.grid import write_grid
from o3dleaf.leaf.height import HeightMap
from o3dleaf.leaf.outline import AlphaShape
from o3dleaf.leaf.tiling import TiledField
from o3dleaf.mesh.arrays import build_mesh
from o3dleaf.mesh.clip import discard_triangles, trim_to_manifold
from o3dleaf.mesh.components import RemovedComponents, connected_components, largest_components
from o3dleaf.mesh.files import SUFFIXES, write_triangle_mesh
from o3dleaf.mesh.polygonise import polygonise
from o3dleaf.parallel import Progress
from o3dleaf.store import write_model
from o3dleaf.units import unit_scale

LAYERS = 16
"""Least number of lattice layers through the patch: a blade thinner than the spacing keeps both faces."""

SHEET_SHARE = 0.25
"""A connected piece of this share of the largest one's area is a face of the blade; voids and specks are smaller."""


@dataclass(frozen=True, eq=False)
class Sheets:
    """The two faces of an open multi-scale blade, and what was left out of them.

    Attributes
    ----------
    mesh : open3d.geometry.TriangleMesh
        Two sheets, adaxial and abaxial, in world coordinates.
    removed : RemovedComponents
        Voids and specks (closed), scraps at the rim (open).
    """

    mesh: o3d.geometry.TriangleMesh
    removed: RemovedComponents


class MultiscaleLeaf:
    r"""One implicit function of the whole leaf, in world coordinates; the surface is G(x) = 0, G > 0 is leaf.

    .. math:: G(x) = F(T^*(x)), \qquad T^*(x) = (y_1,\, y_2,\, y_3 - H(y_1, y_2)), \quad y = T(x)

    with F the tiled micro-structure (the sums over balls and copies of the paper's section 2.6) and T
    the leaf frame's coordinates. The leaf works in the scan's unit; the texture keeps its own.

    Attributes
    ----------
    texture : TiledField
    blade : Blade
        The frame, the height_map and the outline that it was given.
    scale : float
        Factor from the scan's unit to the texture's.
    """

    def __init__(self, texture: TiledField, frame: LeafFrame, height_map: HeightMap, outline: AlphaShape) -> None:
        """Put the texture on the blade.

        Raises
        ------
        UnitError
            If only one of texture and frame has a unit.
        """
        self.texture = texture
        self.blade = Blade(frame, height_map, outline)
        self.scale = unit_scale(frame.unit, texture.unit)

    def state(self) -> dict[str, Any]:
        """Return what the leaf is made of, for `o3dleaf.store`."""
        blade = self.blade
        parts = {"frame": blade.frame, "height_map": blade.height_map, "outline": blade.outline}
        return {"texture": self.texture} | parts

    def save(self, path: str | PathLike[str]) -> None:
        """Write the leaf as one model file, which `o3dleaf.load` reads."""
        write_model(path, self)

    @property
    def unit(self) -> str | None:
        """Unit of length of world points: the scan's."""
        return self.blade.unit

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) a box of the world that holds the leaf, outline and micro-structure."""
        low, high = self.texture.cell[:, 2] / self.scale
        first, last = self.blade.outline.bounds
        along, across = np.linspace(first[0], last[0], 512), np.linspace(first[1], last[1], 32)
        flat = np.stack(np.meshgrid(along, across, [low, high], indexing="ij"), axis=-1).reshape(-1, 3)
        world = self.blade.lift(flat)
        slack = np.linalg.norm(np.diff(world.reshape(512, -1, 3), axis=0), axis=2).max()
        return np.array([world.min(axis=0) - slack, world.max(axis=0) + slack])

    def __call__(self, x: npt.ArrayLike) -> FloatArray:
        """Return G(x) at (n, 3) world points, in the unit of CT intensity; < 0 outside."""
        return self.texture(self.blade.flatten(x) * self.scale)

    def gradient(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) analytic gradient of G at world points, through weights, fits, tiling, H and frame."""
        flat = self.blade.flatten(x)
        return self.blade.pull_back(flat, self.texture.gradient(flat * self.scale) * self.scale)

    @cached_property
    def surface_index(self) -> SurfaceIndex:
        """What finds the nearest point of the surface, made when it is first asked for and kept."""
        return SurfaceIndex.build(self)

    def signed_distance(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n,) distances of (n, 3) world points to the leaf's surface, in `unit`; negative inside.

        The leaf is where G > 0 and (along, across) is in the outline: its surface is the two faces with their
        hairs, the rim, and the walls of the air pockets, which are outside. At every finite point it is finite; to
        the surface's samples it is a true minimum, and beside the nearest of them Newton's method finds the foot.
        """
        return signed_distance(self, x)

    def closest_points(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) points of the leaf's surface that `signed_distance` measures to."""
        return closest_points(self, x)[0]

    def write_grid(
        self,
        path: str | PathLike[str],
        spacing: float | npt.ArrayLike,
        bounds: npt.ArrayLike | None = None,
        *,
        what: str = "field",
        progress: Progress | None = None,
    ) -> None:
        """Sample the leaf at the whole multiples of `spacing` in a box of the world, into one file.

        The file appears whole or not at all, and is written piece by piece: memory does not grow with the grid.

        Parameters
        ----------
        path : path-like
            VTK ImageData (.vti) or NRRD (.nrrd), x fastest, little endian; origin, spacing and unit are in it.
        spacing : float or (3,) array_like
            Step, in `unit`.
        bounds : (2, 3) array_like, optional
            Lower, then upper corner, in `unit`; the leaf's own by default.
        what : {"field", "distance", "mask"}
            G (float32), the signed distance (float32), or 1 in the leaf and 0 outside it (uint8).
        progress : callable, optional
            ``progress(done, total)`` in grid points.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder cannot be written to, or the disk cannot hold the grid.
        """
        write_grid(self, path, spacing, bounds, what=what, progress=progress)

    def project(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n, 3) points of the surface G = 0 that Newton's method along the gradient reaches from x.

        .. math:: x ← x - λ\,G(x)\,∇G(x)/|∇G(x)|²

        with steps halved until \|G\| falls. Where that ends in a place without a surface - far away, in the
        air between hairs, in the middle of the blade - the result is the closest point of the leaf instead, as in
        `closest_points`. Otherwise the outline has no say here: the surface goes on past the rim.
        """
        return surface.project(self, x)

    def normals(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) outward unit normals −∇G/|∇G| of the level sets of G at world points; 0 where ∇G is."""
        return surface.normals(self, x)

    def mean_curvature(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n,) mean curvatures of the level sets of G at world points, in 1/`unit`.

        .. math:: κ = \tfrac{1}{2}\,∇·n, \qquad n = -∇G/|∇G|

        Positive where the leaf bulges: 1/R on a sphere of radius R, 1/2R on a cylinder. The texture's second
        derivatives are analytic; those of the blade are central differences of its analytic Jacobian, and jump with
        the frame's at the control points of a cubic midrib.
        """
        return surface.mean_curvature(self, x)

    def extract_mesh(
        self,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        method: str = "cubes",
        progress: Progress | None = None,
    ) -> o3d.geometry.TriangleMesh:
        """Return both faces of the leaf as a triangle mesh in world coordinates; see `extract_sheets`."""
        return self.extract_sheets(spacing, region, method=method, progress=progress).mesh

    def write_mesh(
        self,
        path: str | PathLike[str],
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        method: str = "cubes",
        progress: Progress | None = None,
    ) -> None:
        """Write both faces of the leaf to a PLY, OBJ or STL file, whole or not at all; see `extract_sheets`.

        Raises
        ------
        InputError
            If the suffix is unknown or the folder cannot be written to; said before the work.
        """
        require_writable(path, SUFFIXES)
        write_triangle_mesh(path, self.extract_mesh(spacing, region, method=method, progress=progress))

    def extract_sheets(
        self,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        method: str = "cubes",
        progress: Progress | None = None,
    ) -> Sheets:
        """Polygonise F in flat coordinates, discard what lies outside the outline, and map it to the world.

        Parameters
        ----------
        spacing : float
            Step along and across, in the scan's unit; the step through the blade is a whole fraction
            of it, at least `LAYERS` for the patch.
        region : (2, 2) array_like, optional
            Lower and upper (along, across) of the part wanted, in the scan's unit.
        method : {"cubes", "tetrahedra"}
            Marching cubes, or marching tetrahedra as in the paper.
        progress : callable, optional
            ``progress(done, total)`` in field evaluations.

        Raises
        ------
        ReconstructionError
            If the result is not exactly two sheets.
        """
        step = require_positive(spacing, "spacing")
        outline = self.blade.outline
        box = outline.bounds if region is None else as_bounds(region, 2, "region")
        lattice = self._lattice(box, step)
        columns = lattice.columns()
        keep = outline.contains(columns) & np.all((columns >= box[0]) & (columns <= box[1]), axis=1)
        mask = keep.reshape(lattice.shape[:2])
        flat_field = _Scaled(self.texture, self.scale, self.unit)
        samples = sample_lattice(flat_field, lattice, keep=mask, progress=progress)
        indices, triangles = polygonise(samples, 0.0, method, keep=mask)
        flat = lattice.positions(indices)
        flat, triangles = discard_triangles(flat, triangles, outline.contains(flat[:, :2]))
        flat, triangles = trim_to_manifold(flat, triangles)
        _, areas = connected_components((flat, triangles))
        count = int(np.sum(areas > SHEET_SHARE * areas.max(initial=0.0)))
        if count != 2:
            raise ReconstructionError(
                f"the surface at {step:.4g} {self.unit or ''} is in {count} sheets, not two (adaxial, abaxial); "
                "use a finer spacing or another threshold"
            )
        return Sheets(*largest_components(build_mesh(self.blade.lift(flat), triangles), 2))

    def _lattice(self, box: FloatArray, step: float) -> Lattice:
        """Return the lattice over a box of the plane, one layer beyond the patch's extent above and below."""
        low, high = self.texture.cell[:, 2] / self.scale
        layer = step / np.ceil(step * LAYERS / (high - low))
        bounds = np.array([[*box[0], low - layer], [*box[1], high + layer]])
        return Lattice.covering(bounds, (step, step, layer))


@dataclass(frozen=True, eq=False)
class _Scaled:
    """A field seen in another unit of length: x ↦ F(scale · x)."""

    field: TiledField
    scale: float
    unit: str | None

    @property
    def bounds(self) -> FloatArray:
        return self.field.bounds / self.scale

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        return self.field(np.asarray(points) * self.scale)

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        return self.field.gradient(np.asarray(points) * self.scale) * self.scale
