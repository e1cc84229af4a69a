"""Points sorted into cubic cells, so that all points within one edge of a cell are known without a search."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.surface.cloud import cloud_loops
from o3dleaf.surface.cloud.neighbors import IndexArray

MAX_CELLS = 2**62


@dataclass(frozen=True, eq=False)
class Cells:
    """Points in the order of their cells.

    Attributes
    ----------
    order : (n,) ndarray
        The points' rows, cell after cell, in their own order within each.
    number, first, last : (m,) ndarray
        Of each occupied cell: its number (z running fastest), and its stretch of `order`.
    shape : (3,) ndarray
        Cells along x, y and z.
    """

    order: IndexArray
    number: IndexArray
    first: IndexArray
    last: IndexArray
    shape: IndexArray

    @classmethod
    def sort(cls, points: FloatArray, size: float, *, shift: float = 0.0) -> "Cells":
        """Sort `points` (n, 3) into cells of edge `size`, or larger where their numbers would overflow.

        The cells begin at the points' lower corner, or so many cells below it.
        """
        low = points.min(axis=0) - shift * size
        extent = points.max(axis=0) - low
        while np.prod(extent / size + 1) > MAX_CELLS:
            size *= 2
        shape = (extent / size).astype(np.int64) + 1
        keys = cloud_loops.cell_keys(points, low, size, shape)
        order = np.argsort(keys, kind="stable")
        number, first = np.unique(keys[order], return_index=True)
        return cls(order, number, first, np.append(first[1:], len(points)), shape)
