"""The multi-scale leaf: G(x) = F(T*(x)), micro-structure everywhere on the macro-scale blade (paper, section 2.6)."""

from collections.abc import Sequence
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks import FloatArray, as_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import Progress, blocks
from o3dleaf.core.units import unit_scale
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.model_file import write_model
from o3dleaf.io.triangle_mesh import SUFFIXES, write_mesh
from o3dleaf.leaf.distance import projection
from o3dleaf.leaf.distance.distance import SurfaceIndex, closest_points, signed_distance
from o3dleaf.leaf.distance.grid import write_grid
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.meshing import Realisation, extract_flat_tile, extract_windows, is_one_tile
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField

CHUNK = 1 << 17
"""Points asked for together: gradients hold 160 bytes each, 20 MB, and the threads of each part have enough to do."""


class MultiscaleLeaf:
    r"""One implicit function of the whole leaf, in world coordinates; the surface is G(x) = 0, G > 0 is leaf.

    .. math:: G(x) = F(T^*(x)), \qquad T^*(x) = (y_1,\, y_2,\, y_3 - H(y_1, y_2)), \quad y = T(x)

    with F the tiled micro-structure (the sums over balls and copies of the paper's section 2.6) and T
    the leaf frame's coordinates. The leaf works in the scan's unit; the texture keeps its own.

    Attributes
    ----------
    texture : TiledField or PatchBlend
    blade : Blade
        The frame, the height_map, the outline and the offset that it was given.
    scale : float
        Factor from the scan's unit to the texture's.
    """

    def __init__(
        self,
        texture: TiledField | PatchBlend,
        frame: LeafFrame,
        height_map: HeightMap,
        outline: AlphaShape,
        *,
        offset: str = "up",
    ) -> None:
        """Put the texture on the blade, its thickness along `offset`: "up", as the paper, or "normal"; see `Blade`.

        Raises
        ------
        UnitError
            If only one of texture and frame has a unit.
        """
        self.texture = texture
        self.blade = Blade(frame, height_map, outline, offset)
        self.scale = unit_scale(frame.unit, texture.unit)

    def state(self) -> dict[str, Any]:
        """Return what the leaf is made of, for `o3dleaf.io.model_file`."""
        blade = self.blade
        parts = {"frame": blade.frame, "height_map": blade.height_map, "outline": blade.outline}
        return {"texture": self.texture, "offset": blade.offset} | parts

    def save(self, path: str | PathLike[str]) -> None:
        """Write the leaf as one model file, which `o3dleaf.load` reads."""
        write_model(self, path)

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
        points = as_points(x, "x", dim=3)
        values = np.empty(len(points))
        for first, last in blocks(len(points), CHUNK):
            values[first:last] = self.texture(self.blade.flatten(points[first:last]) * self.scale)
        return values

    def gradient(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) analytic gradient of G at world points, through weights, fits, tiling, H and frame."""
        points = as_points(x, "x", dim=3)
        gradients = np.empty_like(points)
        for first, last in blocks(len(points), CHUNK):
            flat = self.blade.flatten(points[first:last])
            inner = self.texture.gradient(flat * self.scale) * self.scale
            gradients[first:last] = self.blade.pull_back(flat, inner, points[first:last])
        return gradients

    @cached_property
    def surface_index(self) -> SurfaceIndex:
        """What finds the nearest point of the surface, pockets and specks too; see `index_of`."""
        return self._build_index(closed=False)

    @cached_property
    def solid_index(self) -> SurfaceIndex:
        """The same of the closed solid."""
        return self._build_index(closed=True)

    def index_of(self, *, closed: bool = False) -> SurfaceIndex:
        """Return what finds the nearest point of the surface, made when it is first asked for and kept.

        Raises
        ------
        InputError
            If several patches are blended along the leaf: it holds one tile.
        """
        return self.solid_index if closed else self.surface_index

    def _build_index(self, *, closed: bool) -> SurfaceIndex:
        if not is_one_tile(self.texture, self.blade, self.scale):
            raise InputError(
                "texture: several patches along the leaf have no one tile to measure to; extract a mesh and ask "
                "Open3D's RaycastingScene"
            )
        return SurfaceIndex.build(self, closed=closed)

    def signed_distance(self, x: npt.ArrayLike, *, closed: bool = False) -> FloatArray:
        """Return the (n,) distances of (n, 3) world points to the leaf's surface, in `unit`; negative inside.

        The leaf is where G > 0 and (along, across) is in the outline: its surface is the two faces with their
        hairs, the rim, and the walls of the air pockets, which are outside. At every finite point it is finite; to
        the surface's samples it is a true minimum, and beside the nearest of them Newton's method finds the foot.

        Parameters
        ----------
        x : (n, 3) array_like
        closed : bool
            True: to the solid that ``extract_mesh(closed=True)`` draws and a droplet meets: the outline is rounded,
            air that the blade encloses is leaf, and specks beside it are not. Half the distance of the data is the
            step at which it is told what is enclosed.

        Raises
        ------
        InputError
            If several patches are blended along the leaf.
        ReconstructionError
            If it is to be closed, and air reaches through the blade.
        """
        return signed_distance(self, x, closed=closed)

    def closest_points(self, x: npt.ArrayLike, *, closed: bool = False) -> FloatArray:
        """Return the (n, 3) points of the leaf's surface that `signed_distance` measures to."""
        return closest_points(self, x, closed=closed)[0]

    def write_grid(
        self,
        path: str | PathLike[str],
        spacing: float | npt.ArrayLike,
        bounds: npt.ArrayLike | None = None,
        *,
        what: str = "field",
        closed: bool = False,
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
        closed : bool
            Of distance and mask: that of the closed solid, as in `signed_distance`.
        progress : callable, optional
            ``progress(done, total)`` in grid points.

        Raises
        ------
        InputError
            If the suffix is unknown, the folder cannot be written to, or several patches are blended along the leaf
            and distances are asked for.
        O3DLeafError
            If the disk has no room for the grid.
        """
        write_grid(self, path, spacing, bounds, what=what, closed=closed, progress=progress)

    def project(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n, 3) points of the surface G = 0 that Newton's method along the gradient reaches from x.

        .. math:: x ← x - λ\,G(x)\,∇G(x)/|∇G(x)|²

        with steps halved until \|G\| falls. Where that ends in a place without a surface - far away, in the
        air between hairs, in the middle of the blade - the result is the closest point of the leaf instead, as in
        `closest_points`. Otherwise the outline has no say here: the surface goes on past the rim.
        """
        return projection.project(self, x)

    def normals(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) outward unit normals −∇G/|∇G| of the level sets of G at world points; 0 where ∇G is."""
        return projection.normals(self, x)

    def mean_curvature(self, x: npt.ArrayLike) -> FloatArray:
        r"""Return the (n,) mean curvatures of the level sets of G at world points, in 1/`unit`.

        .. math:: κ = \tfrac{1}{2}\,∇·n, \qquad n = -∇G/|∇G|

        Positive where the leaf bulges: 1/R on a sphere of radius R, 1/2R on a cylinder. The texture's second
        derivatives are analytic; those of the blade are central differences of its analytic Jacobian, and jump with
        the frame's at the control points of a cubic midrib.
        """
        return projection.mean_curvature(self, x)

    def realise(
        self,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        simplify: float | None = None,
        remesh_tile: float | None = None,
        progress: Progress | None = None,
    ) -> Realisation:
        """Polygonise one tile of the texture and count what the outline holds of it; nothing else is made yet.

        Parameters
        ----------
        spacing : float
            Step along and across, in the scan's unit, rounded to a whole fraction of the texture's period;
            the step through the blade is a whole fraction of it, at least `LAYERS` for the patch.
        region : (2, 2) array_like, optional
            Lower and upper (along, across) of the part wanted, in the scan's unit; see `Blade.window`.
        closed : bool
            False: two sheets, adaxial and abaxial, over the cells that lie in the outline, whole (the paper
            discards triangles outside it). True: one solid, cut along the outline, whose corners are rounded,
            or the region; its rim is the third face.
        method : {"cubes", "tetrahedra"}
            Marching cubes, or marching tetrahedra as in the paper.
        simplify : float, optional
            Share of its triangles that a tile is simplified to by quadric edge collapse, once, its border locked.
        remesh_tile : float, optional
            Or the edge length, in the scan's unit, that it is remeshed to, flat, its border locked. The tiles that
            the outline cuts stay as they were polygonised; to remesh all of the surface, see `Realisation.extract`.
        progress : callable, optional
            ``progress(done, total)`` in samples of one tile.

        Raises
        ------
        ReconstructionError
            If the result is not exactly two sheets, or one solid.
        """
        parts = self.texture, self.blade, self.scale
        how: dict[str, Any] = {"closed": closed, "method": method, "simplify": simplify, "remesh_tile": remesh_tile}
        return Realisation(*parts, spacing, region, **how, progress=progress)

    def extract_mesh(
        self,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        remesh: float | None = None,
        progress: Progress | None = None,
    ) -> o3d.geometry.TriangleMesh:
        """Return the surface of the leaf as a triangle mesh in world coordinates; see `realise`.

        ``remesh`` is an edge length, in the scan's unit, for triangles that a solver accepts; see
        `Realisation.extract`.
        """
        return self.realise(spacing, region, closed=closed, method=method).extract(progress, remesh=remesh).mesh

    def write_mesh(
        self,
        path: str | PathLike[str],
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        remesh: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Write the surface of the leaf to a PLY, STL or OBJ file, whole or not at all; see `realise`.

        Only a few tiles are held, whatever the leaf's size, but where it is to be remeshed, to edges of the length
        `remesh`: then all of it is. Faces carry labels: 0 adaxial, 1 abaxial, 2 rim.

        Raises
        ------
        InputError
            If the suffix is unknown or the folder cannot be written to; said before the work.
        O3DLeafError
            If the disk has no room for the file.
        """
        require_writable(path, SUFFIXES)
        projection = self.realise(spacing, region, closed=closed, method=method)
        if remesh is None:
            projection.write(path, progress)
        else:
            write_mesh(projection.extract(progress, remesh=remesh), path)

    def extract_tile(self, spacing: float) -> LabelledMesh:
        """Return one flat period of the micro-structure as a closed block, in the scan's unit, for cyclic boundaries.

        Coordinates are (along, across, height above the blade); opposite walls are alike but for the shift.
        """
        return extract_flat_tile(self.texture, self.scale, spacing, self.unit)

    def extract_levels(
        self, spacing: float, levels: Sequence[tuple[npt.ArrayLike, float]], *, closed: bool = False
    ) -> LabelledMesh:
        """Return one mesh of the whole leaf, without a crack, coarse but for windows: fine where a droplet lands.

        Parameters
        ----------
        spacing : float
            Step outside the windows, in the scan's unit.
        levels : sequence of (region, spacing)
            Windows, each a (2, 2) box in leaf coordinates and its step; steps are rounded to halves, quarters, ...
            of the level around. A window within another one is named after it.
        closed : bool
            As in `realise`.

        Raises
        ------
        InputError
            If a window reaches the rim or the edge of the one around, or two cross.
        """
        return extract_windows(self.texture, self.blade, self.scale, spacing, levels, closed=closed)
