"""The realised surface: one tile polygonised, set down all over the blade, in memory or in a file."""

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import cached_property
from os import PathLike

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks import FloatArray, as_bounds, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.parallel import Progress, run_blocks
from o3dleaf.core.progress import listening
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.triangle_mesh import SUFFIXES
from o3dleaf.leaf.distance.projection import Texture
from o3dleaf.leaf.instancing.assembly import VERTICES, Assembly, Scraps
from o3dleaf.leaf.instancing.block import extract_block
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.levels import Level
from o3dleaf.leaf.instancing.levels import extract_levels as _extract_levels
from o3dleaf.leaf.instancing.reduced import Reduce, reduce_tile
from o3dleaf.leaf.instancing.stream import Arrays, file_bytes, mesh_file, unit_comment
from o3dleaf.leaf.instancing.tile import Tile, TileLattice, extract_tile
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.macro.outline import sides_of
from o3dleaf.leaf.remeshing import remesh_flat, remesh_leaf
from o3dleaf.surface.isosurface.polygonize import METHODS, lattice_positions
from o3dleaf.surface.repair.simplify import simplify_mesh

LAYERS = 16
"""Least number of lattice layers through the patch: a blade thinner than the spacing keeps both faces."""

LEAST_CELLS = 64
"""Cells along each axis of what is set down as one piece."""

TRIAL = 1 << 16
"""Vertices that are taken to the world to see how long all of them will take."""


class Realisation:
    """The surface of a multi-scale leaf at one spacing: counted, not yet made.

    Attributes
    ----------
    texture : TiledField or PatchBlend
    blade : Blade
    scale : float
        Factor from the blade's unit to the texture's.
    outline : shapely geometry
        What it is cut along, in the plane (along, across).
    spacing : (3,) tuple of float
        The steps along, across and through the blade, in the scan's unit. Those in the plane divide the
        texture's period, so that they may differ a little from what was asked for.
    closed : bool
    vertices, triangles : int
        What there will be.
    voids, specks : int
        Pockets of air filled and pieces of solid removed, in every tile.
    scraps : Scraps
        Pieces that the outline cut off, and that are left out.
    """

    def __init__(
        self,
        texture: Texture,
        blade: Blade,
        scale: float,
        spacing: float,
        region: npt.ArrayLike | None = None,
        *,
        closed: bool = False,
        method: str = "cubes",
        simplify: float | None = None,
        remesh_tile: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Polygonise one tile and count what the outline holds of it; see `MultiscaleLeaf.realise`."""
        kind = METHODS.index(require_choice(method, METHODS, "method"))
        box = None if region is None else as_bounds(region, 2, "region")
        self.texture, self.blade, self.scale, self.closed = texture, blade, scale, closed
        # Only whole pieces are reduced: they are kept small.
        lattice = leaf_lattice(texture, blade, scale, spacing, together=simplify is None and remesh_tile is None)
        one = tile_lattice(texture, scale, spacing) if is_one_tile(texture, blade, scale) else lattice
        self._copies = lattice.shape[0] * lattice.shape[1] // (one.shape[0] * one.shape[1])
        with listening(progress) if progress else nullcontext():
            self.tile: Tile = extract_tile(lambda flat: texture(flat * scale), lattice, kind, sharpen=one.shape[:2])
        plane = np.array(lattice.origin[:2]), np.array(lattice.spacing[:2])
        reduce = self._reducing(simplify, remesh_tile)
        reduced = None if reduce is None else reduce_tile(self.tile, reduce)
        started = time.perf_counter()
        self.outline = blade.outline.rounded if closed else blade.outline.polygon
        if closed and box is not None:
            self.outline = shapely.box(*box.ravel()) & self.outline
        area = footprint(sides_of(self.outline), *plane, None if closed else box)
        self.assembly = Assembly(self.tile, area, closed=closed, reduced=reduced)
        self._counting = time.perf_counter() - started

    def _reducing(self, simplify: float | None, remesh_tile: float | None) -> Reduce | None:
        """Return the function that simplifies a tile to a share of its triangles, or remeshes it to an edge length."""
        if simplify is not None and remesh_tile is not None:
            raise InputError("simplify, remesh_tile: both would reshape the tile; give one of them")
        if simplify is not None and not 0 < simplify < 1:
            raise InputError(f"simplify: is {simplify:g}; give the share of triangles to keep, between 0 and 1")

        def simplified(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
            target = round((simplify or 1.0) * len(triangles))
            return mesh_arrays(simplify_mesh((vertices, triangles), target_triangles=target))

        def remeshed(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
            found = remesh_flat(self, vertices, triangles, require_positive(remesh_tile or 0, "remesh_tile"))
            return found.places, found.triangles

        if remesh_tile is not None:
            return remeshed
        return None if simplify is None else simplified

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
        """Pockets of air filled in every tile."""
        return self.tile.runs.voids // self._copies

    @property
    def specks(self) -> int:
        """Pieces of solid removed beside every tile."""
        return self.tile.runs.specks // self._copies

    @property
    def scraps(self) -> Scraps:
        """Pieces that the outline cut off."""
        return self.assembly.scraps

    def bytes(self, path: str | PathLike[str]) -> int:
        """Return the size that a file of the path's suffix will have: exactly; of OBJ at most, nearly."""
        return file_bytes(require_writable(path, SUFFIXES).suffix.lower(), self.assembly, self._comments)[0]

    @property
    def _comments(self) -> tuple[str, ...]:
        """What a file says of itself."""
        steps = " ".join(f"{step:.6g}" for step in self.spacing)
        return (f"o3dleaf, spacing {steps} {self.blade.unit or ''}", *unit_comment(self.blade.unit))

    @cached_property
    def seconds(self) -> float:
        """What making the mesh takes, about: as long as counting it, and its vertices' way to the world, by a trial.

        A file adds what the disk takes.
        """
        edges, fractions = np.resize(self.tile.edges, TRIAL), np.resize(self.tile.fractions, TRIAL)
        along, across = self.assembly.middle.tolist()
        places = lattice_positions(edges, fractions, self.tile.lattice.shape, (along, across, 0))
        flat = self.tile.lattice.positions(places)
        start = time.perf_counter()
        run_blocks(lambda first, last: self.blade.lift(flat[first:last]), TRIAL, VERTICES // 4)
        return self._counting + (time.perf_counter() - start) * self.vertices / TRIAL

    def extract(self, progress: Progress | None = None, *, remesh: float | None = None) -> LabelledMesh:
        """Return the surface as a mesh in memory.

        Parameters
        ----------
        progress : callable, optional
            ``progress(done, total)`` in vertices, or in blocks where it is remeshed.
        remesh : float, optional
            Edge length, in the scan's unit, of triangles that a solver accepts, every vertex on the surface: see
            `o3dleaf.remeshing`. Closed, the faces meet the rim in a sharp edge over the outline.
        """
        arrays = Arrays(self.assembly)
        if remesh is None:
            with listening(progress) if progress else nullcontext():
                self.assembly.emit(arrays, self.blade.lift)
            return LabelledMesh(build_mesh(arrays.vertices, arrays.triangles), arrays.labels, unit=self.blade.unit)
        edge = require_positive(remesh, "remesh")
        self.assembly.emit(arrays, lambda flat: flat)
        parts = arrays.vertices, arrays.triangles, arrays.labels
        found = remesh_leaf(self, self.outline, self.tile, *parts, edge)
        return LabelledMesh(build_mesh(found.places, found.triangles), found.labels, unit=self.blade.unit)

    def write(self, path: str | PathLike[str], progress: Progress | None = None) -> None:
        """Write the surface to a PLY, STL or OBJ file, whole or not at all; only a few tiles are held.

        Raises
        ------
        InputError
            If the suffix is unknown or the folder cannot be written to.
        O3DLeafError
            If the disk has no room for it, or writing fails.
        """
        heard = listening(progress) if progress else nullcontext()
        with heard, mesh_file(path, self.assembly, self._comments) as sink:
            self.assembly.emit(sink, self.blade.lift)


def extract_windows(
    texture: Texture,
    blade: Blade,
    scale: float,
    spacing: float,
    levels: Sequence[tuple[npt.ArrayLike, float]],
    *,
    closed: bool = False,
) -> LabelledMesh:
    """Return one mesh, coarse but for windows (region, spacing) in it; see `MultiscaleLeaf.extract_levels`."""
    lattice = leaf_lattice(texture, blade, scale, spacing)

    def values(flat: FloatArray) -> FloatArray:
        return texture(flat * scale)

    plane = np.array(lattice.origin[:2]), np.array(lattice.spacing[:2])
    area = footprint(sides_of(blade.outline.rounded if closed else blade.outline.polygon), *plane, None)
    root = Level(extract_tile(values, lattice, sharpen=lattice.shape[:2]), area, area.box, closed)
    for region, step in levels:
        _set_in(root, as_bounds(region, 2, "region"), require_positive(step, "spacing"), values)
    vertices, triangles, labels = _extract_levels(root, values)
    return LabelledMesh(build_mesh(blade.lift(vertices), triangles), labels, unit=blade.unit)


def _set_in(root: Level, region: FloatArray, step: float, values: Callable[[FloatArray], FloatArray]) -> None:
    """Set a window into the finest level that holds it; its box grows to whole columns of that level."""

    def columns(level: Level) -> FloatArray:
        lattice = level.tile.lattice
        return np.asarray((region - lattice.origin[:2]) / lattice.spacing[:2])

    parent, holds = root, True
    while holds:
        holds = False
        for child in parent.children:
            low, high = columns(child)
            if (low >= child.box[0] + child.ratio).all() and (high <= child.box[1] - child.ratio).all():
                parent, holds = child, True
                break
            if (low < child.box[1]).all() and (high > child.box[0]).all():
                raise InputError("levels: two windows cross; set the finer one into the other, and name it later")
    lattice = parent.tile.lattice
    around = max(lattice.spacing[:2])
    ratio = 2 ** round(np.log2(around / step))
    if ratio < 2:
        raise InputError(
            f"levels: a window at {step:g} is no finer than the {around:.4g} around it; give half of that or less"
        )
    low, high = columns(parent)
    box = np.stack([np.floor(low + 1e-9), np.ceil(high - 1e-9)]).astype(np.int64)
    # A cell beside each curtain, and one at least between them.
    box[1] = ratio * np.maximum(box[1], box[0] + (2 if ratio == 2 else 1))
    box[0] *= ratio
    (nx, ny, nz), spacing = lattice.shape, tuple((np.array(lattice.spacing) / ratio).tolist())
    fine = TileLattice(lattice.origin, spacing, (nx * ratio, ny * ratio, (nz - 1) * ratio + 1))
    parent.children.append(
        Level(extract_tile(values, fine, sharpen=fine.shape[:2]), parent.footprint, box, ratio=ratio)
    )


def extract_flat_tile(texture: Texture, scale: float, spacing: float, unit: str | None = None) -> LabelledMesh:
    """Return one flat period of a texture as a closed block, in lengths of `scale` of the texture's unit each.

    Opposite walls are alike but for the shift by a period, as cyclic boundaries want them. The walls are labelled rim.
    """
    lattice = tile_lattice(texture, scale, spacing)
    vertices, triangles, labels = extract_block(
        extract_tile(lambda flat: texture(flat * scale), lattice, sharpen=lattice.shape[:2])
    )
    return LabelledMesh(build_mesh(vertices, triangles), labels, unit=unit)


def tile_rows(texture: Texture, blade: Blade, scale: float) -> range:
    """Return the numbers of the tiles along that the outline reaches into."""
    reach = (blade.outline.bounds[:, 0] * scale - texture.cell[0, 0]) / texture.period[0]
    return range(int(np.floor(reach[0])), int(np.ceil(reach[1])) + 1)


def is_one_tile(texture: Texture, blade: Blade, scale: float) -> bool:
    """Return whether all tiles over the blade are alike, or several patches are blended along it."""
    return len({texture.tile_key(p) for p in tile_rows(texture, blade, scale)}) == 1


def leaf_lattice(
    texture: Texture, blade: Blade, scale: float, spacing: float, *, together: bool = False
) -> TileLattice:
    """Return the lattice of what is set down over a blade: a tile, some of them, or one row of tiles along all of it.

    `together`, small tiles make one piece, as each place costs time too. Where several patches are blended along the
    blade, the row repeats across only, and memory grows with its length.
    """
    lattice = tile_lattice(texture, scale, spacing)
    (nx, ny, nz), (x, y, z) = lattice.shape, lattice.origin
    along, across = (-(-LEAST_CELLS // count) if together else 1 for count in (nx, ny))
    if is_one_tile(texture, blade, scale):
        return TileLattice(lattice.origin, lattice.spacing, (nx * along, ny * across, nz))
    rows = tile_rows(texture, blade, scale)
    origin = x + rows[0] * float(lattice.period[0]), y, z
    return TileLattice(origin, lattice.spacing, (nx * len(rows), ny * across, nz))


def tile_lattice(texture: Texture, scale: float, spacing: float) -> TileLattice:
    """Return the lattice of one period: steps in the plane divide it, layers are a whole fraction of the step.

    The texture lies within the layers but for the first and the last one.
    """
    step = require_positive(spacing, "spacing")
    low, high = texture.cell[:, 2] / scale
    layer = step / np.ceil(step * LAYERS / (high - low))
    first, last = np.floor(low / layer + 1e-9) - 1, np.ceil(high / layer - 1e-9) + 1
    period = texture.period / scale
    count = np.maximum(np.round(period / step), 1).astype(int)
    origin = *(texture.cell[0, :2] / scale).tolist(), float(first * layer)
    return TileLattice(origin, (*(period / count).tolist(), float(layer)), (*count.tolist(), int(last - first) + 1))
