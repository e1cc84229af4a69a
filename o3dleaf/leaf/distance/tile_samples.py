"""Samples of one tile's surface, in blocks and bricks, of which all the cells of the blade show copies."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.newton import euclidean
from o3dleaf.core.parallel import blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.distance.projection import BATCH_SIZE
from o3dleaf.leaf.distance.roots import find_roots
from o3dleaf.leaf.distance.search_loops import TileArrays
from o3dleaf.leaf.distance.solid import FilledLattice
from o3dleaf.leaf.texture.period import Period
from o3dleaf.leaf.textured_blade import TexturedBlade
from o3dleaf.surface.isosurface.polygonize import polygonize

Singles = npt.NDArray[np.float32]

MAX_SAMPLES = 1 << 18
"""Samples of a tile: 3 MB. Finer patches, or larger ones, are sampled more coarsely."""
CELL_STEPS = (4, 16)
"""Least and largest side of a block, in steps of the sampling."""
STRAIGHT = 1 / 16
"""By how much the blade may bend away from a cell's straight copy of a block, of the same."""
PROBES = 48
"""Places along the leaf, and a quarter as many across, where its curvature is looked at."""
BRICK_STEPS = 8
"""Side of a brick, in steps of the sampling: some fifty samples."""
SLAB = 16
"""Layers of the lattice that are polygonized at once, so that a tile never needs the memory of its lattice."""
MAX_CELLS = 1 << 17
"""Cells of the blade: 14 MB. On larger blades they are larger."""

BENT = 1 / 64
"""Share of |F|: a field of which more is left after two of Newton's steps bends there."""
UNSEEN = -1
"""Over no zone of hairs the surface without them is that with them, and need not be sampled twice."""

EPSILON = 1e-6
"""Share of its side that a brick's box is larger than its samples, against roundings in single precision."""


@dataclass(frozen=True, eq=False)
class TileSamples:
    """Points of F = 0 over one period of the texture, sorted into blocks of the plane and bricks of each block.

    Attributes
    ----------
    period : Period
        What repeats, in the texture's unit.
    origin, cell : (2,) ndarrays
        Corner of the tile and sides of a block in the plane, in the leaf's unit.
    shape : (2,) tuple of int
        Number of blocks along and across.
    step : float
        About the distance of neighboring samples.
    bricks : (blocks + 1,) int64 ndarray
        First brick of each block.
    extents : (blocks, 2, 3) float32 ndarray
        Middle and half sides of the box of each block's samples.
    boxes : (bricks, 2, 3) float32 ndarray
        Middle and half sides of the box of each brick's samples.
    places : (bricks + 1,) int64 ndarray
        First sample of each brick.
    samples : (3, n) float32 ndarray
        Relative to the middle of their block at height 0.
    pieces : (bricks,) int64 ndarray
        The piece of a zone of hairs that each brick's samples lie over, −1: none.
    bare : (bricks,) bool ndarray
        Whether they are seen where it is removed; else where it is not.
    filled : tuple of FilledLattice
        The air that is enclosed, if pockets were filled, of each of the leaf's `periods`.
    """

    period: Period
    origin: FloatArray
    cell: FloatArray
    shape: tuple[int, int]
    step: float
    bricks: IntArray
    extents: Singles
    boxes: Singles
    places: IntArray
    samples: Singles
    pieces: IntArray
    bare: BoolArray
    filled: tuple[FilledLattice, ...]

    @classmethod
    def sample(cls, leaf: TexturedBlade, *, closed: bool = False) -> "TileSamples":
        """Sample the leaf's texture with its pockets and islands or, closed, without them.

        Raises
        ------
        ReconstructionError
            If the texture has no surface, or pockets cannot be filled: air reaches through the blade.
        """
        period = leaf.period
        low, size, tiles = leaf.texture.cell[0] / leaf.scale, period.tile / leaf.scale, np.array(period.kinds.shape)
        step = _step(leaf, float(period.tile.prod() * tiles.prod()))
        surfaces = [_surface_points(each, period, step, closed=closed) for each in leaf.periods]
        count = np.maximum(np.round(size / max(_straight_cell(leaf, step), _least_cell(leaf))), 1).astype(np.int64)
        cell, shape = size / count, count * tiles
        relative = np.concatenate([points for points, _ in surfaces]) - [*low[:2], 0.0]
        where = np.clip((relative[:, :2] // cell).astype(np.int64), 0, shape - 1)
        variant = _variants(leaf, where // count, relative[:, :2] / size, [len(points) for points, _ in surfaces])
        relative[:, :2] -= (where + 0.5) * cell
        brick = np.floor(relative / (BRICK_STEPS * step)).astype(np.int64)
        block = where[:, 0] * shape[1] + where[:, 1]
        order = np.lexsort((*brick.T, variant, block))
        order = order[variant[order] != UNSEEN]
        block, brick, samples = block[order], brick[order], relative[order].astype(np.float32)
        variant = variant[order]
        fresh = np.diff(block, prepend=-1) != 0
        fresh[1:] |= np.any(brick[1:] != brick[:-1], axis=1) | (variant[1:] != variant[:-1])
        starts = np.flatnonzero(fresh)
        least, most = np.minimum.reduceat(samples, starts), np.maximum.reduceat(samples, starts)
        boxes = _as_boxes(least, most)
        bricks = np.searchsorted(block[starts], np.arange(shape.prod() + 1))
        extents = np.zeros((len(bricks) - 1, 2, 3), dtype=np.float32)
        some = np.flatnonzero(np.diff(bricks))
        bounds = [merge.reduceat(ends, bricks[some]) for merge, ends in ((np.minimum, least), (np.maximum, most))]
        extents[some] = _as_boxes(*bounds)
        return cls(
            period,
            low[:2],
            cell,
            (int(shape[0]), int(shape[1])),
            step,
            bricks,
            extents,
            boxes,
            np.append(starts, len(samples)),
            np.ascontiguousarray(samples.T),
            (variant[starts] >> 1).astype(np.int64),
            variant[starts] % 2 == 1,
            tuple(filled for _, filled in surfaces if filled is not None),
        )

    @property
    def count(self) -> IntArray:
        """(2,) blocks along each side of a tile."""
        return np.asarray(np.array(self.shape) // self.period.kinds.shape)

    def blocks_at(self, corners: IntArray) -> IntArray:
        """Return the blocks that cells (n, 2) of the plane show, counted from the period's corner."""
        i, j = self.period.cells(corners, self.count).T
        return np.asarray(i * self.shape[1] + j)

    def pieces_in_blocks(self, count: int) -> BoolArray:
        """Return which of so many pieces of zones of hairs each block has samples over, (blocks, count)."""
        held = np.zeros((len(self.bricks) - 1, count + 1), dtype=bool)
        held[np.repeat(np.arange(len(held)), np.diff(self.bricks)), self.pieces] = True
        return np.asarray(held[:, :-1])

    @property
    def arrays(self) -> TileArrays:
        """The samples as compiled functions take them."""
        return TileArrays(self.bricks, self.boxes, self.places, self.samples, self.extents)


def _variants(leaf: TexturedBlade, places: IntArray, shares: FloatArray, counts: list[int]) -> npt.NDArray[np.int32]:
    """Return 2 k for samples over the piece k of a zone of hairs and −2 over none, 1 more for those without hairs.

    Parameters
    ----------
    leaf : TexturedBlade
    places : (n, 2) ndarray
        Of their tiles in the period.
    shares : (n, 2) ndarray
        Where they lie in it, in tiles.
    counts : list of int
        Of the surface of each of the leaf's `periods`.
    """
    pieces = leaf.hairs.zones.pieces_at(leaf.period.kinds[tuple(places.T)], shares - places)
    return (2 * pieces + np.repeat(np.arange(len(counts)), counts)).astype(np.int32)


def _as_boxes(low: Singles, high: Singles) -> Singles:
    """Return the middles and half sides (n, 2, 3) of boxes from their corners."""
    half = (high - low) * np.float32(0.5 + EPSILON)
    return np.stack([(low + high) / 2, half], axis=1)


def _step(leaf: TexturedBlade, area: float) -> float:
    """Return half the distance of the texture's data, or more where that would make too many samples."""
    # A rough surface with pockets has some four times the tile's area on each of its faces.
    return float(max(0.5 * leaf.texture.data_distance, np.sqrt(8 * area / MAX_SAMPLES)) / leaf.scale)


def _straight_cell(leaf: TexturedBlade, step: float) -> float:
    """Return the side of a cell over which the blade, off by κ side²/8 where X'' is κ, is as good as straight."""
    bounds = leaf.blade.outline.bounds
    places = np.meshgrid(
        *[np.linspace(bounds[0, axis], bounds[1, axis], n) for axis, n in ((0, PROBES), (1, PROBES // 4))]
    )
    flat = np.column_stack([*(each.ravel() for each in places), np.zeros(places[0].size)])
    curvature = float(np.median(np.linalg.norm(leaf.blade.lift_hessians(flat), axis=3).max(axis=(1, 2))))
    least, most = (steps * step for steps in CELL_STEPS)
    return float(np.clip(np.sqrt(8 * STRAIGHT * step / max(curvature, 1e-300)), least, most))


def _least_cell(leaf: TexturedBlade) -> float:
    """Return the side of a cell of which the outline's box contains `MAX_CELLS`."""
    return float(np.sqrt(np.ptp(leaf.blade.outline.bounds, axis=0).prod() / MAX_CELLS))


def _surface_points(
    leaf: TexturedBlade, period: Period, step: float, *, closed: bool
) -> tuple[FloatArray, FilledLattice | None]:
    """Return points (n, 3) of F = 0 over one period: the vertices of marching cubes, moved onto it."""
    low, high = leaf.texture.cell / leaf.scale
    size, tiles = np.append(period.tile / leaf.scale, high[2] - low[2]), np.array([*period.kinds.shape, 1])
    counts = np.ceil(size / step).astype(np.int64)
    steps = size / counts
    counts *= tiles
    positive = np.empty((*counts[:2], counts[2] + 3), dtype=bool) if closed else None
    with progress.silent():
        parts = [_slab_vertices(leaf, low, steps, counts, slab, positive) for slab in blocks(int(counts[0]), SLAB)]
    vertices = np.concatenate(parts)
    if not len(vertices):
        raise ReconstructionError(
            "the texture has no surface: its values are all above 0, or all below; check the level"
        )
    # Half a spacing of its data beyond the patch all is air: the lattice has a layer below it.
    origin = low - steps * [0, 0, 1]
    filled = None if positive is None else FilledLattice.fill(origin, steps, positive, period, leaf.scale)
    if filled is not None:
        vertices = vertices[filled.is_crossed_at(vertices)]
    points = origin + vertices * steps
    for first, last in blocks(len(points), BATCH_SIZE):
        edges = [origin + end(vertices[first:last]) * steps for end in (np.floor, np.ceil)]
        points[first:last] = _onto_surface(leaf, points[first:last], edges, step / 4)
    return points, filled


def _onto_surface(leaf: TexturedBlade, points: FloatArray, edges: list[FloatArray], reach: float) -> FloatArray:
    """Return points moved onto F = 0: by two of Newton's steps, each at most `reach` along each axis.

    Where F bends these may lead astray; there it is sought between the two ends of the point's edge of the lattice.
    """
    before = []
    for _ in range(2):
        values, gradients = leaf.values_and_gradients(points)
        before.append(np.abs(values))
        points = points + np.clip(euclidean(points, values, gradients, np.inf), -reach, reach)
    rows = np.flatnonzero(before[1] > BENT * before[0])
    rows = rows[np.abs(leaf.values(points[rows])) > BENT * before[0][rows]]
    low, high = (end[rows] for end in edges)
    f_low, f_high = leaf.values(low), leaf.values(high)
    some = (f_low > 0) != (f_high > 0)
    low, way = low[some], (high - low)[some]

    def along(part: IntArray, share: FloatArray) -> FloatArray:
        return leaf.values(low[part] + share[:, np.newaxis] * way[part])

    share = find_roots(along, np.zeros(len(low)), np.ones(len(low)), f_low[some], f_high[some])
    points[rows[some]] = low + share[:, np.newaxis] * way
    return points


def _slab_vertices(
    leaf: TexturedBlade,
    low: FloatArray,
    steps: FloatArray,
    counts: IntArray,
    slab: tuple[int, int],
    positive: npt.NDArray[np.bool_] | None,
) -> FloatArray:
    """Return the vertices of marching cubes over some layers of cells, in steps, those on the last faces left out.

    They are the next slab's, or the first one's. Signs are written into their layers of `positive`.
    """
    thick = slab[1] - slab[0]
    # A layer above and below the patch closes what its faces cut.
    origin = low + steps * [slab[0], 0, -1]
    lattice = Lattice(tuple(origin), tuple(steps), (thick + 1, int(counts[1]) + 1, int(counts[2]) + 3))
    samples = sample_lattice(leaf.values, lattice, dtype=np.float32, block=BATCH_SIZE)
    if positive is not None:
        positive[slab[0] : slab[1]] = samples[:-1, :-1] > 0
    vertices, _ = polygonize(samples, 0.0)
    inner = np.all(vertices[:, :2] < [thick - 1e-9, counts[1] - 1e-9], axis=1)
    return vertices[inner] + [slab[0], 0, 0]
