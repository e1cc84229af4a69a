"""The multi-scale leaf: micro-structure everywhere on the macro-scale blade (paper, section 2.6)."""

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy.typing as npt
import open3d as o3d

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Share
from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.errors import InputError
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.models.model_file import write_model
from o3dleaf.io.triangle_mesh import SUFFIXES, write_mesh
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.distance.measured_leaf import MeasuredLeaf
from o3dleaf.leaf.fine_windows import extract_windows
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.meshing import MeshPlan, extract_flat_tile
from o3dleaf.leaf.textured_blade import Texture


@checked
class MultiscaleLeaf(MeasuredLeaf):
    r"""Implicit function of the whole leaf in world coordinates; the surface is G(x) = 0, G > 0 is leaf.

    .. math:: G(x) = F(T^*(x)), \qquad T^*(x) = (y_1,\, y_2,\, y_3 - H(y_1, y_2)), \quad y = T(x)

    with F the tiled micro-structure (the sums over balls and copies of the paper's section 2.6) and T
    the leaf frame's coordinates; on another blade T* is its `flatten`. The leaf works in the scan's unit; the texture
    keeps its own.

    Attributes
    ----------
    texture : TiledField, PatchBlend or WangField
    blade : Blade
        A `HeightMapBlade` of the frame, the height_map, the outline and the offset, or the blade that it was given.
    scale : float
        Factor from the scan's unit to the texture's.
    """

    def __init__(
        self,
        texture: Texture,
        frame: LeafFrame | None = None,
        height_map: HeightMap | None = None,
        outline: AlphaShape | None = None,
        *,
        offset: str = "up",
        blade: Blade | None = None,
    ) -> None:
        """Put the texture on a blade, or on the paper's, its thickness along `offset`; see `HeightMapBlade`.

        Raises
        ------
        InputError
            If neither a blade nor all parts of one are given, or both.
        UnitError
            If only one of texture and frame has a unit.
        """
        if blade is None:
            if frame is None or height_map is None or outline is None:
                raise InputError("blade: is missing; give one, or a frame, a height_map and an outline")
            blade = HeightMapBlade(frame, height_map, outline, offset)
        elif frame is not None or height_map is not None or outline is not None:
            raise InputError("blade: is given beside parts of one; give the blade or its frame, height_map and outline")
        super().__init__(texture, blade)

    def __repr__(self) -> str:
        return f"MultiscaleLeaf({self.texture!r} on {self.blade!r})"

    def state(self) -> dict[str, Any]:
        """Return what the leaf is made of, for `o3dleaf.io.models.model_file`."""
        blade = self.blade
        if not isinstance(blade, HeightMapBlade):
            return {"texture": self.texture, "blade": blade}
        parts = {"frame": blade.frame, "height_map": blade.height_map, "outline": blade.outline}
        return {"texture": self.texture, "offset": blade.offset} | parts

    @checked
    def save(self, path: str | PathLike[str]) -> None:
        """Write the leaf as one model file, which `o3dleaf.load` reads."""
        write_model(self, path)

    @checked
    def plan_mesh(
        self,
        spacing: Positive,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        simplify: Share | None = None,
        remesh_tile: Positive | None = None,
    ) -> MeshPlan:
        """Polygonize one tile of the texture and count what the outline contains of it; nothing else is made yet.

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
            the outline cuts stay as they were polygonized; to remesh all of the surface, see `MeshPlan.extract`.

        Raises
        ------
        ReconstructionError
            If the result is not exactly two sheets, or one solid.
        """
        reshaped: dict[str, Any] = {"simplify": simplify, "remesh_tile": remesh_tile}
        return MeshPlan(self, spacing, region, closed=closed, method=method, **reshaped)

    @checked
    def extract_mesh(
        self,
        spacing: Positive,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        remesh: Positive | None = None,
    ) -> o3d.geometry.TriangleMesh:
        """Return the surface of the leaf as a triangle mesh in world coordinates; see `plan_mesh`.

        ``remesh`` is an edge length, in the scan's unit, for triangles that a solver accepts; see
        `MeshPlan.extract`.
        """
        planning, extracting = progress.split(1, 2)
        with planning:
            plan = self.plan_mesh(spacing, region, closed=closed, method=method)
        with extracting:
            return plan.extract(remesh=remesh).mesh

    @checked
    def write_mesh(
        self,
        path: str | PathLike[str],
        spacing: Positive,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        remesh: Positive | None = None,
    ) -> None:
        """Write the surface of the leaf to a PLY, STL or OBJ file, whole or not at all; see `plan_mesh`.

        Only a few tiles are in memory, whatever the leaf's size, but where it is to be remeshed, to edges of the
        length `remesh`: then all of it is. Faces carry labels: 0 adaxial, 1 abaxial, 2 rim.

        Raises
        ------
        InputError
            If the suffix is unknown or the folder cannot be written to; before any work.
        O3DLeafError
            If the disk has no room for the file.
        """
        require_writable(path, SUFFIXES)
        planning, writing = progress.split(1, 2)
        with planning:
            plan = self.plan_mesh(spacing, region, closed=closed, method=method)
        with writing:
            if remesh is None:
                plan.write(path)
            else:
                write_mesh(plan.extract(remesh=remesh), path)

    @checked
    def extract_tile(self, spacing: Positive) -> LabelledMesh:
        """Return one flat period of the micro-structure as a closed block, in the scan's unit, for cyclic boundaries.

        Coordinates are (along, across, height above the blade); opposite walls are alike but for the shift. Of Wang
        tiles it is the torus of 4 × 4 on which each of them lies once.
        """
        return extract_flat_tile(self.texture, self.scale, spacing, self.unit)

    @checked
    def extract_levels(
        self, spacing: Positive, levels: Sequence[tuple[npt.ArrayLike, float]], *, closed: bool = False
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
            As in `plan_mesh`.

        Raises
        ------
        InputError
            If a window reaches the rim or the edge of the one around, or two cross.
        """
        return extract_windows(self, spacing, levels, closed=closed)
