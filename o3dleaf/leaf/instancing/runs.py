"""The inside of a periodic layer: its largest component, voids filled, without the islands beside it.

Samples hang together along the axes, across the sides of the period too, as they do in the surface
that `o3dleaf.surface.isosurface` draws around them. They are held as runs along the columns of the lattice: some
five numbers a column, where the samples themselves would grow with the cube of the resolution.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.scratch import ROWS, made_by_rows, offsets_of, scratch_array
from o3dleaf.leaf.instancing.tile_loops import ABOVE, BELOW, INSIDE, count_runs, expand_runs, fill_runs, unite_all
from o3dleaf.surface.mesh.topology import label_nodes


@dataclass(frozen=True, eq=False)
class Runs:
    """The labels of a period's samples, column by column.

    Attributes
    ----------
    shape : (3,) tuple of int
        Columns along the two periods, samples in a column.
    first : (nx ny + 1,) ndarray of int64
        First run of each column.
    begin : (r,) ndarray of int64
        Sample at which each run begins.
    label : (r,) ndarray of uint8
        `INSIDE`, `ABOVE` or `BELOW`.
    voids, islands : int
        Components of air that were filled, and of solid that were removed.
    """

    shape: tuple[int, int, int]
    first: IntArray
    begin: IntArray
    label: npt.NDArray[np.uint8]
    voids: int
    islands: int

    def expand(self, columns: IntArray) -> npt.NDArray[np.uint8]:
        """Return the labels (m, nz) of all samples of some columns (m,)."""
        dense = np.empty((len(columns), self.shape[2]), dtype=np.uint8)
        expand_runs(columns, self.first, self.begin, self.label, dense)
        return dense


def find_runs(inside: BoolArray) -> tuple[IntArray, IntArray]:
    """Return the number of runs in each of m columns, and where they begin; outside and inside take turns.

    Parameters
    ----------
    inside : (m, nz) ndarray of bool
        The first and the last sample of a column count as outside: the surface is closed there.
    """
    counts = np.empty(len(inside), dtype=np.int64)
    count_runs(inside, counts)
    first = np.concatenate([[0], np.cumsum(counts)])
    begin = np.empty(first[-1], dtype=np.int64)
    fill_runs(inside, first, begin)
    return counts, begin


def solidify(shape: tuple[int, int, int], counts: IntArray, begin: IntArray, alike: IntArray | None = None) -> Runs:
    """Return the labels of a period: the largest component of solid, voids in it filled, the air above and below.

    Parameters
    ----------
    shape : (3,) tuple of int
    counts, begin : (nx ny,), (r,) ndarrays of int64
        As `find_runs` gives them for all columns, the second axis running fastest.
    alike : (nx ny,) ndarray of int64, optional
        The first column like each one: what hangs together there is one piece in all of them.

    Raises
    ------
    ReconstructionError
        If nothing is inside, or the air above and below hang together: not two sheets.
    """
    first = offsets_of(counts)
    solid, length = _solid_lengths(shape[2], first, begin)
    piece, around = (made_by_rows(begin.shape, np.arange, np.int64) for _ in range(2))
    unite_all(shape, first, begin, piece, solid, -1)
    copies = _copied_runs(first, alike)
    piece = _joined(piece, copies)
    main = _largest(piece, length)
    if main is None:
        raise ReconstructionError("the texture has no solid at this spacing; use a finer spacing or another threshold")
    unite_all(shape, first, begin, around, piece, main)
    around = _joined(around, copies)
    above = _distinct(len(counts), lambda start, stop: around[first[start + 1 : stop + 1] - 1])
    below = _distinct(len(counts), lambda start, stop: around[first[start:stop]])
    if np.intersect1d(above, below).size:
        raise ReconstructionError(
            "the surface is one sheet, not two (upper and lower side): air reaches through the layer; "
            "use a finer spacing or another threshold"
        )

    def labels(start: int, stop: int) -> npt.NDArray[np.uint8]:
        air = around[start:stop]
        label = np.where(np.isin(air, below), BELOW, np.where(np.isin(air, above), ABOVE, INSIDE))
        return np.where(piece[start:stop] == main, INSIDE, label).astype(np.uint8)

    label = made_by_rows(begin.shape, labels, np.uint8)

    def turned(kind: int, start: int, stop: int) -> IntArray:
        """Return the pieces of a kind, 0 air and 1 solid, that do not keep it."""
        rows = slice(start, stop)
        return np.asarray(piece[rows][(solid[rows] == kind) & ((label[rows] == INSIDE) != kind)])

    voids, islands = (len(_distinct(len(begin), partial(turned, kind))) for kind in range(2))
    return Runs(shape, first, begin, label, voids, islands)


def _solid_lengths(layers: int, first: IntArray, begin: IntArray) -> tuple[IntArray, IntArray]:
    """Return of each run whether it is solid, 1 or 0, and of solid ones how many samples it has, else 0."""
    solid, length = (scratch_array(begin.shape, np.int64) for _ in range(2))
    for start, stop in blocks(len(first) - 1, ROWS):
        heads, rows = first[start:stop], slice(first[start], first[stop])
        solid[rows] = (np.arange(first[start], first[stop]) - np.repeat(heads, np.diff(first[start : stop + 1]))) % 2
        length[rows] = np.diff(begin[rows], append=layers)
        length[first[start + 1 : stop + 1] - 1] = layers - begin[first[start + 1 : stop + 1] - 1]
        length[rows] *= solid[rows]
    return solid, length


def _largest(piece: IntArray, length: IntArray) -> int | None:
    """Return the piece of runs that has most samples, of equal ones the first, or None where none has any."""
    size = made_by_rows(piece.shape, lambda start, stop: np.zeros(stop - start, dtype=np.int64), np.int64)
    for start, stop in blocks(len(piece), ROWS):
        some, rows = np.unique(piece[start:stop], return_inverse=True)
        size[some] += np.bincount(rows, length[start:stop]).astype(np.int64)
    return int(np.argmax(size)) if size.any() else None


def _distinct(count: int, values: Callable[[int, int], IntArray]) -> IntArray:
    """Return the distinct ones, rising, of what ``values(start, stop)`` returns of rows, some at a time."""
    return np.unique(np.concatenate([np.unique(values(*part)) for part in blocks(count, ROWS)]))


def _copied_runs(first: IntArray, alike: IntArray | None) -> IntArray:
    """Return the runs (k, 2) of columns that are copies, and those of the first columns like them."""
    if alike is None:
        return np.empty((0, 2), dtype=np.int64)
    copies = np.flatnonzero(alike != np.arange(len(alike)))
    counts = first[copies + 1] - first[copies]
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([np.repeat(start, counts) + within for start in (first[copies], first[alike[copies]])], axis=1)


def _joined(piece: IntArray, copies: IntArray) -> IntArray:
    """Return the pieces of runs, those of copies joined."""
    return label_nodes(piece[copies[:, 0]], piece[copies[:, 1]], len(piece))[piece] if len(copies) else piece
