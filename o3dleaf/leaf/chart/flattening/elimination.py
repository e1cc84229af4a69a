"""Symmetric matrices of two unknowns a vertex, summed over triangles, in an order that is cheap to eliminate."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse
import scipy.sparse.linalg

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray

SYMMETRIC = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
"""Pivots on the diagonal: rows stay where the order of the columns puts them, and signs of pivots are the inertia."""
NARROW = {"relax": 1, "panel_size": 1}
"""A triangulation's columns have few entries: panels of SuperLU's usual width are twice as slow."""


@dataclass(frozen=True, eq=False)
class MeshPattern:
    """Where the (2n, 2n) matrices of a mesh's triangles have entries; a triangle's go to the same places each time.

    Attributes
    ----------
    unknowns : (2n,) ndarray of int64
        Of each row, its place in an (n, 2) array of u and v, end to end: vertices in the order of their elimination.
    indices, indptr : (e,), (2n + 1,) ndarrays of int32
        Of the matrix by columns.
    places : (36 m,) ndarray of int64
        Of a triangle's (6, 6) entries, u and v of one corner after the other, among those of the matrix.
    """

    unknowns: IntArray
    indices: npt.NDArray[np.int32]
    indptr: npt.NDArray[np.int32]
    places: IntArray

    @classmethod
    def of(cls, triangles: IntArray, count: int) -> "MeshPattern":
        """Return the pattern of a mesh of `count` vertices, minimum degree's order of its graph (Liu 1985)."""
        order = _minimum_degree(triangles, count)
        rank = np.empty(count, np.int64)
        rank[order] = np.arange(count)
        corners = rank[triangles]
        row, column = np.repeat(corners, 3, axis=1), np.tile(corners, 3)
        alone = np.arange(count)  # each vertex has a diagonal, also one of no triangle
        keys, of_pair = np.unique(np.append(column * count + row, alone * (count + 1)), return_inverse=True)
        rows, columns = keys % count, keys // count
        start = np.searchsorted(columns, np.arange(count + 1))
        size = np.diff(start)
        # Columns 2j and 2j + 1 have two entries for each of vertex j's neighbors.
        first = 4 * start[columns] + 2 * (np.arange(len(keys)) - start[columns])
        corner = of_pair.ravel()[: row.size].reshape(row.shape)
        axis = np.arange(2)
        places = first[corner][:, :, np.newaxis, np.newaxis] + axis[:, np.newaxis]
        places = places + 2 * size[column][:, :, np.newaxis, np.newaxis] * axis
        places = places.reshape(-1, 3, 3, 2, 2).transpose(0, 1, 3, 2, 4)
        indices = np.empty(4 * len(keys), np.int32)
        for k in range(2):
            for other in range(2):
                indices[first + 2 * size[columns] * k + other] = 2 * rows + other
        indptr = np.append(0, np.cumsum(np.repeat(2 * size, 2))).astype(np.int32)
        return cls((2 * order[:, np.newaxis] + axis).ravel(), indices, indptr, places.ravel())

    def matrix(self, shares: FloatArray) -> scipy.sparse.csc_array:
        """Return the sum of the triangles' (m, 6, 6) entries."""
        data = np.bincount(self.places, shares.ravel(), len(self.indices))
        return scipy.sparse.csc_array((data, self.indices, self.indptr), shape=(len(self.unknowns),) * 2)

    def hold(self, matrix: scipy.sparse.csc_array, held: BoolArray, shift: float) -> scipy.sparse.csc_array:
        """Return a matrix with the rows and columns `held` (2n,) those of 1, and a share of its diagonal added."""
        columns = np.repeat(np.arange(len(held)), np.diff(self.indptr))
        on_it = self.indices == columns
        data = np.where(on_it, 1 + shift, 1.0) * matrix.data
        data = np.where(held[self.indices] | held[columns], on_it, data)
        return scipy.sparse.csc_array((data, self.indices, self.indptr), shape=matrix.shape)


def factorize(matrix: scipy.sparse.csc_array) -> scipy.sparse.linalg.SuperLU:
    """Return the factors of a symmetric matrix in its own order."""
    return scipy.sparse.linalg.splu(matrix, permc_spec="NATURAL", **SYMMETRIC, **NARROW)


def _minimum_degree(triangles: IntArray, count: int) -> IntArray:
    """Return the vertices (n,) in the order of their elimination, which SciPy tells with a matrix's factors alone."""
    ends = np.concatenate([triangles.T.ravel(), np.roll(triangles, -1, axis=1).T.ravel()]).reshape(2, -1)
    graph = scipy.sparse.coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(count, count)).tocsc()
    graph = graph + graph.T
    heavy = scipy.sparse.diags_array(1.0 + np.asarray(graph.sum(axis=0)).ravel())
    factors = scipy.sparse.linalg.splu((heavy - graph).tocsc(), permc_spec="MMD_AT_PLUS_A", **SYMMETRIC, **NARROW)
    return np.argsort(factors.perm_c).astype(np.int64)
