"""The cut between what lies and what is laid over it, along which the two differ least (Kwatra et al. 2003)."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray

SCALE = 1e5
"""Units of a whole mismatch, that of any two points: flows are counted in whole numbers."""
UNCUTTABLE = 2**30
"""Capacity of what may not be cut."""


def least_cut(cost: FloatArray, keeps: BoolArray, takes: BoolArray) -> tuple[BoolArray, float]:
    r"""Return which nodes of a grid show the new content, and what the cut around them costs.

    Of all ways to part the nodes, neighbors s and t on different sides cost cost(s) + cost(t), that one is returned
    whose sum is least; of several the one with the most new content, so that the cut does not depend on the flow that
    finds it.

    Parameters
    ----------
    cost : (n, m) ndarray
        Mismatch of old and new content at each node, 1 that of any two points.
    keeps, takes : (n, m) ndarrays of bool
        Nodes that keep the old content, and nodes that take the new one, whatever that costs.
    """
    number = np.arange(cost.size).reshape(cost.shape)
    # One more unit for a link, so that of equal cuts the shorter is less.
    units = np.minimum(np.round(SCALE * cost), UNCUTTABLE >> 2).astype(np.int64)
    parts = []
    for here, there in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        weight = (units[here] + units[there] + 1).ravel()
        one, other = number[here].ravel(), number[there].ravel()
        parts += [(one, other, weight), (other, one, weight)]
    source, sink = cost.size, cost.size + 1
    for ends, mask in ((True, keeps), (False, takes)):
        at = number[mask]
        pole, most = np.full(len(at), source if ends else sink), np.full(len(at), UNCUTTABLE)
        parts.append((pole, at, most) if ends else (at, pole, most))
    rows, columns, capacity = (np.concatenate(part) for part in zip(*parts, strict=True))
    graph = csr_array((capacity.astype(np.int32), (rows, columns)), shape=(cost.size + 2, cost.size + 2))
    found = maximum_flow(graph, source, sink)
    rest = graph - found.flow
    rest.data = np.maximum(rest.data, 0)
    rest.eliminate_zeros()
    old = np.zeros(cost.size + 2, dtype=bool)
    old[breadth_first_order(rest, source, return_predecessors=False)] = True
    return ~old[: cost.size].reshape(cost.shape), found.flow_value / SCALE


def disc(shape: tuple[int, int], center: npt.ArrayLike, radius: float) -> BoolArray:
    """Return which nodes of a grid lie nearer to one than `radius`."""
    i, j = np.ogrid[: shape[0], : shape[1]]
    ci, cj = np.asarray(center)
    return np.asarray((i - ci) ** 2 + (j - cj) ** 2 < radius**2)
