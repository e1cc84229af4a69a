"""The mesh of a leaf: one tile polygonized, set down all over the blade, in memory or in a file."""

import time
from collections.abc import Callable
from functools import cached_property, partial
from os import PathLike

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.processes.spread import current_spread
from o3dleaf.core.resume.blocks import keeping_blocks
from o3dleaf.core.resume.parts import current_parts
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.mesh_data import unit_comment
from o3dleaf.io.mesh_stream import Arrays, Copies, file_bytes, mesh_file
from o3dleaf.io.triangle_mesh import SUFFIXES
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing.assembly import BATCH_SIZE, Assembly, Fragments
from o3dleaf.leaf.instancing.block import FlatBlock
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.reduced import reduce_tile
from o3dleaf.leaf.remeshing import LeafTarget, remesh_flat, remesh_leaf
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.textured_blade import Texture, TexturedBlade
from o3dleaf.leaf.thin_rim import lower_crossings
from o3dleaf.leaf.tile_lattice import PeriodOf, extract_tiles, tile_lattice
from o3dleaf.surface.isosurface.polygonize import METHODS, lattice_positions
from o3dleaf.surface.repair.simplify import simplify_mesh

TRIAL = 1 << 16
"""Vertices that are taken to the world to see how long all of them will take."""

ROWS = "rows.ply"
"""The rows of tiles that are finished, where work is to be resumed."""


class MeshPlan:
    """Plan of a mesh of a multi-scale leaf at one spacing: counted, not yet made.

    Attributes
    ----------
    leaf : TexturedBlade
    outline : shapely geometry
        The area in the plane (along, across) that it covers.
    spacing : (3,) tuple of float
        The steps along, across and through the blade, in the scan's unit. Those in the plane divide the
        texture's period, so that they may differ a little from what was requested.
    closed : bool
    wholes : tuple of Tile
        The tile, all of a set, or, where hairs are thinned out, this with all of them and with none.
    vertices, triangles : int
        Of the mesh.
    voids, islands : int
        Pockets of air filled and islands removed, in every tile.
    fragments : Fragments
        Pieces that the outline cut off, and that are left out.
    lowered : LoweredVertices
        Vertices beside a tapered rim that are lower than the surface, so that no triangles cross.
    """

    def __init__(
        self,
        leaf: TexturedBlade,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        simplify: float | None = None,
        remesh_tile: float | None = None,
    ) -> None:
        """Polygonize one tile and count what the outline contains of it; see `MultiscaleLeaf.plan_mesh`."""
        kind = METHODS.index(require_choice(method, METHODS, "method"))
        box = None if region is None else as_bounds(region, 2, "region")
        self.leaf, self.closed = leaf, closed
        reduce = _reducer(leaf, simplify, remesh_tile)
        if remesh_tile is not None and isinstance(leaf.texture, ThinnedField):
            raise InputError(
                "remesh_tile: the surface of a leaf is made of periodic tiles, not of hairs that a map thins out; "
                "leave it out, or give simplify"
            )
        polygonizing, reducing, counting = progress.split(4, 2 if reduce else 0, 1)
        with polygonizing, keeping_blocks("tile"):
            # Only whole tiles are reduced: they are kept small.
            self.tile, tiles, self._copies, bare = extract_tiles(leaf, spacing, kind, together=reduce is None)
        self.wholes = (self.tile,) if bare is None else (self.tile, bare)
        with reducing:
            reduced = (
                None
                if reduce is None
                else [reduce_tile(tile, partial(reduce, kind)) for kind, tile in enumerate(tiles.tiles)]
            )
        with counting:
            started = time.perf_counter()
            plane = np.array(tiles.lattice.origin[:2]), np.array(tiles.lattice.spacing[:2])
            self.outline, cut = leaf.edge_curve(closed=closed), leaf.cuts_edges
            if box is not None and (closed or cut):
                self.outline, box = shapely.box(*box.ravel()) & self.outline, None
            edge = leaf.blade.edge_thickness(float(np.linalg.norm(plane[1])))
            area = footprint(sides_of(self.outline), *plane, box, edge)
            self.assembly = Assembly(tiles, area, closed=closed, cut=cut, reduced=reduced)
            self.lowered = lower_crossings(leaf, self.assembly, float(plane[1].max()))
            self._counting = time.perf_counter() - started

    def __repr__(self) -> str:
        unit = f" {self.leaf.unit}" if self.leaf.unit else ""
        size = f"{self.vertices:,} vertices, {self.triangles:,} triangles"
        return f"MeshPlan({size}, {'closed' if self.closed else 'open'}, step {self.spacing[0]:.4g}{unit})"

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Steps along, across and through the blade."""
        return self.tile.lattice.spacing

    @property
    def vertices(self) -> int:
        """Number of vertices that there will be."""
        return self.assembly.vertices

    @property
    def triangles(self) -> int:
        """Number of triangles that there will be."""
        return self.assembly.triangles

    @property
    def voids(self) -> int:
        """Pockets of air filled in every tile, of Wang tiles in all of the set."""
        return self.tile.runs.voids // self._copies

    @property
    def islands(self) -> int:
        """Islands removed beside every tile, of Wang tiles beside all of the set."""
        return self.tile.runs.islands // self._copies

    @property
    def fragments(self) -> Fragments:
        """Pieces that the outline cut off."""
        return self.assembly.fragments

    def bytes(self, path: str | PathLike[str]) -> int:
        """Return the size that a file of the path's suffix will have: exactly; of OBJ at most, nearly."""
        return file_bytes(require_writable(path, SUFFIXES).suffix.lower(), self.assembly, self._comments)[0]

    @property
    def _comments(self) -> tuple[str, ...]:
        """Comments in the header of a file."""
        steps = " ".join(f"{step:.6g}" for step in self.spacing)
        return (f"o3dleaf, spacing {steps} {self.leaf.unit or ''}", *unit_comment(self.leaf.unit))

    @cached_property
    def seconds(self) -> float:
        """Time that making the mesh takes, about: that of counting it, and its vertices' way to the world, by a trial.

        A file adds what the disk takes.
        """
        edges, fractions = np.resize(self.tile.edges, TRIAL), np.resize(self.tile.fractions, TRIAL)
        along, across = self.assembly.middle.tolist()
        places = lattice_positions(edges, fractions, self.tile.lattice.shape, (along, across, 0))
        flat = self.tile.lattice.positions(places)
        start = time.perf_counter()
        run_blocks(lambda first, last: self.leaf.blade.lift(flat[first:last]), TRIAL, BATCH_SIZE // 4)
        return self._counting + (time.perf_counter() - start) * self.vertices / TRIAL

    def extract(self, *, remesh: float | None = None) -> LabelledMesh:
        """Return the surface as a mesh in memory.

        Parameters
        ----------
        remesh : float, optional
            Edge length, in the scan's unit, of triangles that a solver accepts, every vertex on the surface: see
            `o3dleaf.remesh`. Closed, the faces meet the rim in a sharp edge over the outline.
        """
        arrays, blade = Arrays(self.assembly), self.leaf.blade
        if remesh is None:
            self.assembly.emit(arrays, self._lift)
            return self._labelled(arrays)
        edge = require_positive(remesh, "remesh")
        emitting, remeshing = progress.split(1, 20)
        with emitting:
            self.assembly.emit(arrays, lambda flat: flat)
        with remeshing:
            parts = arrays.vertices, arrays.triangles, arrays.labels
            target = LeafTarget(self.leaf, self.outline, *self.wholes)
            mesh = remesh_leaf(target, *parts, target_edge=edge, lowered=self.lowered.apply(arrays.vertices))
        return LabelledMesh(build_mesh(mesh.places, mesh.triangles), mesh.labels, unit=blade.unit)

    def write(self, path: str | PathLike[str]) -> None:
        """Write the surface to a PLY, STL or OBJ file, whole or not at all; only a few tiles are in memory.

        Where work is to be resumed (`o3dleaf.core.resume`), the rows of tiles that are finished are kept.

        Raises
        ------
        InputError
            If the suffix is unknown or the folder cannot be written to.
        O3DLeafError
            If the disk has no room for it, or writing fails.
        """
        parts = current_parts()
        if parts is None:
            with mesh_file(path, self.assembly, self._comments) as sink:
                self.assembly.emit(sink, self._lift)
            return
        scratch = parts.path(ROWS)
        first = parts.state.get(ROWS, 0) if scratch.exists() else 0
        with mesh_file(path, self.assembly, self._comments, scratch=scratch) as sink:
            self.assembly.emit(sink, self._lift, first=first, finished=partial(parts.record, ROWS))

    def write_and_extract(self, path: str | PathLike[str]) -> LabelledMesh:
        """Do both, `write` and `extract`, with every vertex taken to the world once."""
        arrays = Arrays(self.assembly)
        with mesh_file(path, self.assembly, self._comments) as sink:
            self.assembly.emit(Copies(arrays, sink), self._lift)
        return self._labelled(arrays)

    def _lift(self, flat: FloatArray) -> FloatArray:
        return self.leaf.blade.lift(self.lowered.apply(flat))

    def _labelled(self, arrays: Arrays) -> LabelledMesh:
        return LabelledMesh(build_mesh(arrays.vertices, arrays.triangles), arrays.labels, unit=self.leaf.unit)


def require_reduction(simplify: float | None, remesh_tile: float | None) -> None:
    """Raise `InputError` for a share of triangles, or an edge length, that no tile can be reduced to."""
    if simplify is not None and remesh_tile is not None:
        raise InputError("simplify, remesh_tile: both would reshape the tile; give one of them")
    if simplify is not None and not 0 < simplify < 1:
        raise InputError(f"simplify: is {simplify:g}; give the share of triangles to keep, between 0 and 1")
    if remesh_tile is not None:
        require_positive(remesh_tile, "remesh_tile")


def _reducer(
    leaf: TexturedBlade, simplify: float | None, remesh_tile: float | None
) -> Callable[[int, FloatArray, IntArray], tuple[FloatArray, IntArray]] | None:
    """Return the function that simplifies the tile of a number to a share of its triangles, or remeshes it."""
    require_reduction(simplify, remesh_tile)

    def simplified(_: int, vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
        target = round((simplify or 1.0) * len(triangles))
        return mesh_arrays(simplify_mesh((vertices, triangles), target_triangles=target))

    def remeshed(kind: int, vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
        mesh = remesh_flat(leaf, vertices, triangles, remesh_tile or 0, kind)
        return mesh.places, mesh.triangles

    if remesh_tile is not None:
        return remeshed
    return None if simplify is None else simplified


def extract_flat_tile(texture: Texture, scale: float, spacing: float, unit: str | None = None) -> LabelledMesh:
    """Return one flat period of a texture as a closed block, in lengths of `scale` of the texture's unit each.

    Opposite walls are alike but for the shift by a period, as cyclic boundaries want them. The walls are labelled rim.
    Of Wang tiles it is the torus of 4 × 4 on which each of them lies once.
    """
    block = _flat_block(texture, scale, spacing)
    arrays = Arrays(block)
    block.emit(arrays)
    return LabelledMesh(build_mesh(arrays.vertices, arrays.triangles), arrays.labels, unit=unit)


def write_flat_tile(
    texture: Texture, scale: float, spacing: float, path: str | PathLike[str], unit: str | None = None
) -> None:
    """Write what `extract_flat_tile` returns to a PLY, STL or OBJ file, block by block."""
    block = _flat_block(texture, scale, spacing)
    with mesh_file(path, block, ("o3dleaf", *unit_comment(unit))) as sink:
        block.emit(sink)


def _flat_block(texture: Texture, scale: float, spacing: float) -> FlatBlock:
    spread, values = current_spread(), PeriodOf(texture, scale)
    elsewhere = None if spread is None else spread.stand_in(texture)
    lattice = tile_lattice(values.periodic, scale, spacing)
    # Workers read the texture from where it was written.
    field = values if elsewhere is None else PeriodOf(elsewhere, scale)
    with keeping_blocks("tile"):
        return FlatBlock(extract_tile(field, lattice, sharpen=lattice.shape[:2]))
