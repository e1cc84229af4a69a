"""Points of two sheets parted by a minimum cut of the links between neighbors, worth the less the steeper they are."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.topology import label_nodes

LINK = 2.0
"""Spacings up to which points are linked: random ones hang together from 1.2 on (Meester and Roy 1996)."""
SLOPE = float(np.sin(np.radians(30.0)))
"""Sine of the angle off the planes at which a link is worth nothing, that of a bend of a radius of its length."""
CAPACITY = 1000
"""Of a link along both planes: maximum flows are of whole numbers."""
CROSSING = 2 / 3 * LINK**3
"""Links of random points that cross a line, for each spacing of it. The cheapest line keeps to where there are fewer, a
half to a third."""


class Links(NamedTuple):
    """Links between points: their ends (m,), (m,), and what each is worth (m,), the less the steeper it is."""

    one: IntArray
    other: IntArray
    worth: IntArray

    @classmethod
    def of(cls, points: FloatArray, normals: FloatArray, spacing: float) -> "Links":
        """Link points (n, 3) with unit normals (n, 3), of either sign."""
        pairs = cKDTree(points).query_pairs(LINK * spacing, output_type="ndarray")
        one, other = np.ascontiguousarray(pairs.T, np.int64)
        away = points[other] - points[one]
        length = np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)
        steep = np.maximum(*(np.abs(np.einsum("ij,ij->i", away, normals[end])) for end in (one, other))) / length
        alike = np.abs(np.einsum("ij,ij->i", normals[one], normals[other]))
        worth = (CAPACITY * np.maximum(1 - (steep / SLOPE) ** 2, 0.0) * alike).astype(np.int64)
        return cls(one, other, worth).kept(worth > 0)

    def kept(self, kept: BoolArray) -> "Links":
        """Return some of the links."""
        return Links(self.one[kept], self.other[kept], self.worth[kept])

    def groups(self, count: int) -> IntArray:
        """Return which group (n,) each of so many points hangs together with."""
        return label_nodes(np.ascontiguousarray(self.one), np.ascontiguousarray(self.other), count)


def minimum_cut(links: Links, first: BoolArray, second: BoolArray) -> tuple[BoolArray, BoolArray, float]:
    """Return the points that go with the `first` (n,) and with the `second` (n,), and the cut's length in spacings.

    Of all ways to part the two it is the one that cuts the fewest links, each counted as much as it is worth. Points
    that hang on neither go with none.

    References
    ----------
    Boykov and Kolmogorov (2004), An experimental comparison of min-cut/max-flow algorithms for energy minimization in
    vision.
    """
    links = links.kept(~(first | second)[links.one] | ~(first | second)[links.other])
    count, source, sink = len(first), np.flatnonzero(first), np.flatnonzero(second)
    start = np.concatenate([links.one, links.other, np.full(len(source), count), sink])
    end = np.concatenate([links.other, links.one, source, np.full(len(sink), count + 1)])
    most = np.full(len(source) + len(sink), np.iinfo(np.int32).max)
    size = np.concatenate([links.worth, links.worth, most]).astype(np.int32)
    graph = coo_array((size, (start, end)), shape=(count + 2, count + 2)).tocsr()
    found = maximum_flow(graph, count, count + 1)
    left = (graph - found.flow).tocsr()
    left.eliminate_zeros()
    with_first, with_second = np.zeros(count + 2, bool), np.zeros(count + 2, bool)
    with_first[breadth_first_order(left, count, return_predecessors=False)] = True
    with_second[breadth_first_order(left.T.tocsr(), count + 1, return_predecessors=False)] = True
    # Between two cuts that are as cheap points are within reach of neither: they go with the larger part.
    free = ~with_first & ~with_second
    between = np.zeros(count + 2, bool)
    hangs = links.groups(count)
    between[:count] = np.isin(hangs, np.unique(hangs[first | second]))
    larger = with_first if with_first.sum() >= with_second.sum() else with_second
    larger |= free & between
    return with_first[:count], with_second[:count], found.flow_value / (CAPACITY * CROSSING)
