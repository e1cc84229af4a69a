"""The inside of a periodic layer: its largest component, voids filled, without the islands beside it.

Samples hang together along the axes, across the sides of the period too, as they do in the surface
that `o3dleaf.surface.isosurface` draws around them. They are held as runs along the columns of the lattice: some
five numbers a column, where the samples themselves would grow with the cube of the resolution.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
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
    first = np.concatenate([[0], np.cumsum(counts)])
    solid = (np.arange(len(begin)) - np.repeat(first[:-1], counts)) % 2
    piece = np.arange(len(begin))
    unite_all(shape, first, begin, piece, solid, -1)
    copies = _copied_runs(first, alike)
    piece = _joined(piece, copies)
    length = np.diff(begin, append=0)
    length[first[1:] - 1] = shape[2] - begin[first[1:] - 1]
    size = np.bincount(piece, length * solid, len(begin))
    if not size.any():
        raise ReconstructionError("the texture has no solid at this spacing; use a finer spacing or another threshold")
    main = int(np.argmax(size))
    around = np.arange(len(begin))
    unite_all(shape, first, begin, around, piece, main)
    around = _joined(around, copies)
    label = np.zeros(len(begin), dtype=np.uint8)
    above, below = np.unique(around[first[1:] - 1]), np.unique(around[first[:-1]])
    if np.intersect1d(above, below).size:
        raise ReconstructionError(
            "the surface is one sheet, not two (upper and lower side): air reaches through the layer; "
            "use a finer spacing or another threshold"
        )
    label[np.isin(around, above)], label[np.isin(around, below)] = ABOVE, BELOW
    label[piece == main] = INSIDE
    voids = np.unique(piece[(solid == 0) & (label == INSIDE)]).size
    islands = np.unique(piece[(solid == 1) & (label != INSIDE)]).size
    return Runs(shape, first, begin, label, int(voids), int(islands))


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
