"""One period of a periodic surface, polygonized once to be set down everywhere."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.lattice import BLOCK
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.processes.spread import each_block
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.core.resources.scratch import GrowingArray, is_held
from o3dleaf.leaf.instancing.runs import Runs, find_runs, solidify
from o3dleaf.leaf.instancing.tile_loops import INSIDE, count_cells, mark_crossed, name_in_tile
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION
from o3dleaf.surface.isosurface.polygonize import lattice_positions, march

SLAB_SIZE = 1 << 18
"""Samples in memory at once while a tile is made: 2 MiB of them, whatever the spacing, or one plane."""

MAX_STEPS = 12
"""Steps towards a field's zero along an edge: a smooth field takes three."""
TOLERANCE = 1e-4
"""Share of an edge by which the last of them moves a vertex."""
TINY = 1e-300
"""Size of a sample that is zero: its sign is what says where it belongs."""


@dataclass(frozen=True)
class TileLattice:
    """The lattice that one period is sampled on; it divides the period.

    Attributes
    ----------
    origin : (3,) tuple of float
        Position of point (0, 0, 0) of tile (0, 0).
    spacing : (3,) tuple of float
    shape : (3,) tuple of int
        Steps in a period along the first two axes, points along the third.
    """

    origin: tuple[float, float, float]
    spacing: tuple[float, float, float]
    shape: tuple[int, int, int]

    @property
    def period(self) -> FloatArray:
        """(2,) lengths of a tile."""
        return np.asarray(np.array(self.spacing[:2]) * self.shape[:2], dtype=np.float64)

    def positions(self, lattice: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) positions of (n, 3) lattice coordinates, counted from tile (0, 0) on.

        The one function that makes positions: equal lattice coordinates give equal bits.
        """
        return np.asarray(np.asarray(self.origin) + np.asarray(lattice) * np.asarray(self.spacing), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Tile:
    """The surface over one period, without the copies of its sides.

    Attributes
    ----------
    lattice : TileLattice
    method : int
        Place in `o3dleaf.surface.isosurface.polygonize.METHODS`.
    runs : Runs
        What is inside, voids filled.
    edges : (n,) ndarray of int64
        The edges that vertices lie on, 8 · (number of the lower point) + direction, rising.
    fractions : (n,) ndarray of float64
        How far along its edge each vertex lies.
    sides : (n,) ndarray of uint8
        `ABOVE` or `BELOW`: the air that each vertex looks at.
    upward : (n,) ndarray of bool
        Whether the lower end of the vertex's edge is the one inside.
    nodes : (m, 3) ndarray of int32
        Corners of the triangles, by cells: a vertex of this tile, or n + a row of `beyond`.
    cells : (nx ny + 1,) ndarray of int64
        First triangle over each cell of the plane.
    beyond : (h, 2) ndarray of int64
        Vertices of neighbors that triangles of this tile use: the edge in the neighbor's lattice, and the neighbor
        (bits: along, across); by edge, then by neighbor.
    beyond_fractions, beyond_sides : (h,) ndarrays
        Theirs.
    """

    lattice: TileLattice
    method: int
    runs: Runs
    edges: IntArray
    fractions: FloatArray
    sides: npt.NDArray[np.uint8]
    upward: npt.NDArray[np.bool_]
    nodes: npt.NDArray[np.int32]
    cells: IntArray
    beyond: IntArray
    beyond_fractions: FloatArray
    beyond_sides: npt.NDArray[np.uint8]

    @property
    def beyond_keys(self) -> IntArray:
        """(h,) numbers, rising, of vertices of neighbors: 4 · edge + neighbor."""
        return np.asarray(self.beyond[:, 0] * 4 + self.beyond[:, 1])

    @property
    def beyond_rows(self) -> IntArray:
        """(h,) vertices of this tile that those of its neighbors are copies of, where all places have this tile."""
        return np.searchsorted(self.edges, self.beyond[:, 0])


class Alike(Protocol):
    """Columns and edges of a lattice at which a field is the same: what is found at the first one stands for all."""

    def columns(self, columns: IntArray) -> IntArray:
        """Return the first column like each one, itself where there is none."""

    def edges(self, edges: IntArray) -> IntArray:
        """Return the first edge like each one."""


def extract_tile(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    method: int = 0,
    *,
    sharpen: tuple[int, int] | None = None,
    slab_size: int = SLAB_SIZE,
    alike: Alike | None = None,
) -> Tile:
    """Sample one period of a field, fill its voids, and polygonize it.

    Memory grows with the surface, not with the samples: a first pass over slabs notes what is inside, a
    second one evaluates the samples beside the surface again, and marches.

    Parameters
    ----------
    field : callable
        Values at (n, 3) points, > 0 inside, with the period of the lattice along the first two axes.
    lattice : TileLattice
    method : int
        Place in `o3dleaf.surface.isosurface.polygonize.METHODS`.
    sharpen : (2,) tuple of int, optional
        Put the vertices where the field itself is zero along their edges, not its linear interpolant. The steps along
        and across after which the field repeats: copies get the same bits.
    slab_size : int
        Samples in memory at once, if a plane has no more.
    alike : Alike, optional
        Columns and edges at which the field is the same, within the period: they get the same bits, and are inside and
        outside together.

    Raises
    ------
    ReconstructionError
        If the surface is not two sheets, one above the other.
    MemoryBudgetError
        If the lattice is so fine that the tile does not fit into memory.
    """
    nx, ny, nz = lattice.shape
    require_columns(nx * ny, max(lattice.spacing[:2]), layers=nz)
    places = list(blocks(nx, max(1, min(nx, slab_size // (ny * nz)))))
    runs = _find_runs(field, lattice, places, alike)
    march_slab = partial(_march_slab, field, lattice, method, alike)
    labelled = (_Slab(*place, _labels(runs, *place)) for place in places)
    found = _Found.of(each_block(march_slab, labelled))
    edges, fractions, sides, upward = (part.whole() for part in found.vertices)
    nodes, beyond = _nodes(edges, found)
    if sharpen is not None:
        fractions = _sharpened_alike(field, lattice, edges, fractions, upward, sharpen, alike)
    origins = np.searchsorted(edges, beyond[:, 0])
    return Tile(
        lattice,
        method,
        runs,
        edges,
        fractions,
        sides,
        upward,
        nodes,
        np.concatenate([[0], np.cumsum(found.cells.whole())]),
        beyond,
        fractions[origins],
        sides[origins],
    )


def _find_runs(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    places: list[tuple[int, int]],
    alike: Alike | None,
) -> Runs:
    """Return what is inside, voids filled, from the samples of slabs."""
    nx, ny, _ = lattice.shape
    counts, begin, flooded = GrowingArray(np.int64), GrowingArray(np.int64), np.zeros(2, dtype=np.int64)
    slabs = each_block(partial(_find_slab, field, lattice, alike), places)
    for (_, stop), (*found, solid) in zip(places, slabs, strict=True):
        flooded += solid
        for whole, part in zip((counts, begin), found, strict=True):
            whole.append(part)
        progress.report(stop, nx)
    # A hair may be cut by the top or bottom of a patch and is closed there; the blade itself may not.
    if flooded.max() > nx * ny / 2:
        raise ReconstructionError(
            "the surface is not two sheets (upper and lower side): the texture has no air above or below; "
            "use another threshold or a taller patch"
        )
    same = None if alike is None else alike.columns(np.arange(nx * ny))
    return solidify(lattice.shape, counts.whole(), begin.whole(), same)


class _Found(NamedTuple):
    """What the slabs of a tile add to it, one after the other.

    Attributes
    ----------
    vertices : tuple of GrowingArray
        Of the tile's own vertices edges, fractions, sides and ends.
    names, shifts : GrowingArray
        Of the vertices that the triangles of each slab use: the edge in its tile, and how many periods on it lies.
    triangles : GrowingArray
        Rows of the slab's names.
    cells : GrowingArray
        Number of triangles over each cell of the plane.
    sizes : list of (int, int)
        Names and triangles of each slab.
    """

    vertices: tuple[GrowingArray, ...]
    names: GrowingArray
    shifts: GrowingArray
    triangles: GrowingArray
    cells: GrowingArray
    sizes: list[tuple[int, int]]

    @classmethod
    def of(cls, slabs: Iterator[tuple[npt.NDArray[Any], ...]]) -> "_Found":
        """Gather what `_march_slab` returns of each slab."""
        vertices = tuple(GrowingArray(kind) for kind in (np.int64, np.float64, np.uint8, np.bool_))
        others = GrowingArray(np.int64), GrowingArray(np.uint8), GrowingArray(np.int32, (3,)), GrowingArray(np.int64)
        found = cls(vertices, *others, [])
        for parts in slabs:
            for whole, part in zip((*vertices, *others), parts, strict=True):
                whole.append(part)
            found.sizes.append((len(parts[4]), len(parts[6])))
        return found


def require_columns(count: float, step: float, layers: int = 0) -> None:
    """Raise `MemoryBudgetError` if a tile of so many columns, a step apart, does not fit into memory.

    Or `TimeBudgetError`, if its layers are known and take too long.
    """
    what = f"spacing: {in_words(count)} columns of the lattice in one tile"
    require_resources(cost_of_tile(count, layers), what, "give a larger one", step=step)


def cost_of_tile(columns: float, layers: float) -> Cost:
    """Return what a lattice over one tile takes; what lies in files (`GrowingArray`) no memory."""
    whole, beside = measured.TILE_COLUMN * columns, measured.TILE + measured.FILED_COLUMN * columns
    held = whole.bytes if is_held(whole.bytes) else min(whole.bytes, beside.bytes)
    return Cost(held) + measured.TILE_SAMPLE * (columns * layers)


class _Slab(NamedTuple):
    """Planes of a period, and the labels (n, m, nz) of their samples and of those on their far sides."""

    start: int
    stop: int
    labels: npt.NDArray[np.uint8]


def _labels(runs: Runs, start: int, stop: int) -> npt.NDArray[np.uint8]:
    """Return the labels of the samples of some planes, and of the next one."""
    nx, ny, nz = runs.shape
    i, j = np.arange(start, stop + 1) % nx, np.arange(ny + 1) % ny
    return runs.expand((i[:, np.newaxis] * ny + j).ravel()).reshape(len(i), len(j), nz)


def _find_slab(
    field: Callable[[FloatArray], FloatArray], lattice: TileLattice, alike: Alike | None, slab: tuple[int, int]
) -> tuple[npt.NDArray[Any], ...]:
    """Return the runs of a slab's columns, and how many of them are solid at the bottom and at the top."""
    inside = _sample(field, lattice, *slab, alike) > 0
    return *find_runs(inside), inside[:, [0, -1]].sum(axis=0)


def _sample(
    field: Callable[[FloatArray], FloatArray], lattice: TileLattice, start: int, stop: int, alike: Alike | None
) -> FloatArray:
    """Return the samples ((stop − start) ny, nz) of some planes of the period."""
    _, ny, nz = lattice.shape
    values = np.empty((stop - start) * ny * nz)
    for first, last in blocks(len(values), BLOCK):
        point = np.arange(first, last)
        indices = _first_points(start * ny + point // nz, point % nz, ny, alike)
        values[first:last] = field(lattice.positions(indices))
    return require_finite(values, "field values").reshape(-1, nz)


def _first_points(columns: IntArray, k: IntArray, ny: int, alike: Alike | None) -> IntArray:
    """Return the points (n, 3) of the first columns like these, at heights k."""
    first = columns if alike is None else alike.columns(columns)
    return np.stack([first // ny, first % ny, k], axis=1)


def _march_slab(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    method: int,
    alike: Alike | None,
    slab: _Slab,
) -> tuple[npt.NDArray[np.generic], ...]:
    """Return the part of the tile that a slab adds.

    Of its own vertices edges, fractions, sides and ends; of all that its triangles use names and shifts; the triangles
    as rows of these; their number by cells.
    """
    (nx, ny, nz), (start, stop, labels) = lattice.shape, slab
    i, j = np.arange(start, stop + 1) % nx, np.arange(ny + 1) % ny
    inside = labels == INSIDE
    needed = np.zeros(labels.shape, dtype=bool)
    mark_crossed(method, inside, needed)
    points = np.argwhere(needed)
    samples = field(lattice.positions(_first_points(i[points[:, 0]] * ny + j[points[:, 1]], points[:, 2], ny, alike)))
    values = np.ones(labels.shape)
    # What was filled or removed has the other sign: its size is what places the vertices beside it.
    values[needed] = np.maximum(np.abs(require_finite(samples, "field values")), TINY)
    surface = march(np.where(inside, values, -values), inside, method)
    names, shifts = np.empty_like(surface.edges), np.empty_like(surface.edges)
    name_in_tile(surface.edges, surface.shape, start, lattice.shape, names, shifts)
    point = surface.edges >> 3
    is_own = (point // ((ny + 1) * nz) < stop - start) & (point // nz % (ny + 1) < ny)
    step = [surface.edges & 1, surface.edges >> 1 & 1, surface.edges >> 2 & 1]
    low = np.stack([point // ((ny + 1) * nz), point // nz % (ny + 1), point % nz])
    upward = inside[tuple(low)]
    outer = np.where(upward, low + step, low)
    sides = labels[tuple(outer[:, is_own])]
    cells = np.zeros((stop - start, ny), dtype=np.int64)
    count_cells(method, inside, cells)
    triangles = surface.triangles.astype(np.int32)
    parts = names[is_own], surface.fractions[is_own], sides, upward[is_own]
    return *parts, names, shifts.astype(np.uint8), triangles, cells.ravel()


def _sharpened_alike(  # noqa: PLR0917 - the vertices, the field, and which edges are alike
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    edges: IntArray,
    fractions: FloatArray,
    upward: npt.NDArray[np.bool_],
    period: tuple[int, int],
    alike: Alike | None,
) -> FloatArray:
    """Return where the field is zero along each edge, asked once of edges that are alike."""
    if alike is None and period == lattice.shape[:2]:
        return _sharpened(field, lattice, edges, fractions, upward)
    folded = _folded(edges, lattice.shape, period) if alike is None else alike.edges(edges)
    first, rows, copies = np.unique(folded, return_index=True, return_inverse=True)
    return _sharpened(field, lattice, first, fractions[rows], upward[rows])[copies]


def _folded(edges: IntArray, shape: tuple[int, int, int], period: tuple[int, int]) -> IntArray:
    """Return the edges like these that start in the first `period` of steps."""
    _, ny, nz = shape
    column, rest = edges // (8 * nz), edges % (8 * nz)
    return np.asarray((column // ny % period[0] * ny + column % ny % period[1]) * 8 * nz + rest)


def _sharpened(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    edges: IntArray,
    fractions: FloatArray,
    upward: npt.NDArray[np.bool_],
) -> FloatArray:
    """Return where the field is zero along each edge, by the Illinois variant of regula falsi.

    Where its sign at an end is not what is inside there, a void having been filled, the fraction stays as it is.
    """
    sharpened = GrowingArray(np.float64)
    parts = (_Edges(edges[i:j], fractions[i:j], upward[i:j]) for i, j in blocks(len(edges), BLOCK))
    for (part,) in each_block(partial(_sharpen, field, lattice), parts):
        sharpened.append(part)
    return sharpened.whole()


class _Edges(NamedTuple):
    """Edges (n,), where a vertex lies along each, and whether its lower end is the one inside."""

    edges: IntArray
    fractions: FloatArray
    upward: npt.NDArray[np.bool_]


def _sharpen(field: Callable[[FloatArray], FloatArray], lattice: TileLattice, part: _Edges) -> tuple[FloatArray]:
    """Return where the field is zero along some edges."""
    sharpened, low = part.fractions.copy(), part.upward

    def values_at(rows: IntArray, share: FloatArray) -> FloatArray:
        return field(lattice.positions(lattice_positions(part.edges[rows], share, lattice.shape)))

    every = np.arange(len(sharpened))
    ends = [np.zeros(len(sharpened)), np.ones(len(sharpened))]
    values = [values_at(every, share) for share in ends]
    rows = np.flatnonzero(((values[0] > 0) == low) & ((values[1] > 0) != low))
    a, b, fa, fb = (each[rows] for each in (*ends, *values))
    for _ in range(MAX_STEPS):
        share = (a * fb - b * fa) / (fb - fa)
        sharpened[rows] = np.clip(share, MIN_FRACTION, 1 - MIN_FRACTION)
        f = values_at(rows, share)
        crossed = (f > 0) != (fb > 0)
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa / 2)
        b, fb = share, f
        # The secant's next step, which says how far the zero still is.
        going = np.abs(fb * (b - a)) > TOLERANCE * np.abs(fb - fa)
        rows = rows[going]
        a, b, fa, fb = (each[going] for each in (a, b, fa, fb))
        if not len(rows):
            break
    return (sharpened,)


def _nodes(edges: IntArray, found: _Found) -> tuple[npt.NDArray[np.int32], IntArray]:
    """Return the corners as nodes of the tile, and the vertices of neighbors among them."""
    names, shifts, nodes = (part.whole() for part in (found.names, found.shifts, found.triangles))
    away = np.flatnonzero(shifts)
    beyond = np.unique(np.searchsorted(edges, names[away]) * 4 + shifts[away])
    name = row = 0
    for count, many in found.sizes:
        own, shift, rows = names[name : name + count], shifts[name : name + count], nodes[row : row + many]
        number = np.searchsorted(edges, own)
        node = np.where(shift, len(edges) + np.searchsorted(beyond, number * 4 + shift), number)
        rows[:] = node.astype(np.int32)[rows]
        name, row = name + count, row + many
    return nodes, np.stack([edges[beyond >> 2], beyond & 3], axis=1)
