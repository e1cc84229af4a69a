"""Leaves that rest on one another: told apart by what lies over what, and parted where they touch by least."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, nearest_layers
from o3dleaf.leaf.sheet.widths import MOSTLY, OFF, STEEP, WIDEST
from o3dleaf.surface.mesh.topology import label_nodes
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

REACH = 2 * WIDEST
"""Distance in spacings up to which one point is seen to lie over another: passes of one sheet end at half of it."""
RISING = 0.2
"""Share of these places from which on the upper one lies farther off than passes do: what rests on a leaf rises from
it, passes keep their distance."""
FEWEST = 24
"""Points above, and below, from which on there are two sheets and no stragglers."""
LINK = 2.0
"""Spacings up to which points are linked: random ones hang together from 1.2 on (Meester and Roy 1996)."""
SLOPE = float(np.sin(np.radians(30.0)))
"""Sine of the angle off the tangent planes at which a link is worth nothing: half the right angle's half would be more
than noise, averaged, leaves between neighbors."""
CAPACITY = 1000
"""Of a link along both planes, as whole numbers are asked for."""
CROSSING = 2 / 3 * LINK**3
"""Links of random points that cross a line, for each spacing of its length."""
NARROW = 0.5
"""Length of the line that two leaves are parted along where they touch, over the square root of the lesser one's area,
at most; with more, all of one lies on the other, and nothing shows which points are whose."""
LEAST = 0.1
"""Share of the points that a leaf has at least, as in `find_necks`."""
BATCH_SIZE = 2048


class Resting(NamedTuple):
    """Rows (k,) of the points of the leaf above or below the largest one, none if not told apart; and a line."""

    others: IntArray
    note: str


def find_resting(sheets: OpenSheets) -> Resting | None:
    """Return what belongs to another leaf that lies on the one with the largest sheet, or under it; None if none does.

    A point that lies over another one, along the normal and facing its way, is of the upper leaf, and that one of the
    lower. Where a leaf's margin runs over the other, or both are seen one over the other, there are many such. All
    other points go with those that they are linked to along their planes: of all ways to part the two leaves that
    which cuts the fewest links (a minimum cut), so that they are parted across where they touch.

    Parameters
    ----------
    sheets : OpenSheets
        Of points that were averaged for their noise, and no more.
    """
    normals = _facing(sheets)
    upper, lower, heights = _one_over_another(sheets.points, normals, REACH * sheets.spacing, OFF * sheets.spacing)
    far = float(np.mean(heights > WIDEST * sheets.spacing)) if len(heights) else 0.0
    if min(upper.sum(), lower.sum()) < FEWEST or far < RISING:
        return None
    one, other, capacity = _links(sheets.points, normals, LINK * sheets.spacing)
    above, flow = _minimum_cut(one, other, capacity, upper, lower)
    if min(above.sum(), (~above).sum()) < LEAST * len(above):
        return None
    length = flow / (CAPACITY * CROSSING)
    place = tell_middle(sheets.points[upper | lower], sheets.points)
    if length > NARROW * np.sqrt(min(above.sum(), (~above).sum())):
        share = 100 * (upper | lower).mean()
        return Resting(
            np.empty(0, np.int64),
            f"two leaves lie on one another around {place}, {share:.2g} % of the points, and touch over so much that "
            "nothing shows which points are whose: taken as one, cut them apart",
        )
    same = above[one] == above[other]
    label = label_nodes(np.ascontiguousarray(one[same]), np.ascontiguousarray(other[same]), len(above))
    main = above[np.argmax(np.bincount(label)[label])]
    under, over = ("under", "over") if main else ("over", "under")
    hidden = _parts(label, above != main)
    note = f"another leaf lies {under} this one around {place}"
    if flow:
        note += f"; parted where they touch, along about {length * sheets.spacing:.2g}"
    if hidden > 1:
        note += f"; it shows in {hidden} pieces"
    return Resting(np.flatnonzero(above != main), note)


def _parts(label: IntArray, of: BoolArray) -> int:
    """Return how many pieces, by their `label` (n,), some points have."""
    return int((np.bincount(label[of]) >= FEWEST).sum())


def _facing(sheets: OpenSheets) -> FloatArray:
    """Return the normals (n, 3) of the points to the side of the largest sheet near them."""
    vertices, triangles = sheets.sheet()
    side = vertex_normals(vertices, triangles)[query(cKDTree(vertices), sheets.points)[1]]
    return np.where(np.einsum("ij,ij->i", sheets.normals, side)[:, np.newaxis] < 0, -sheets.normals, sheets.normals)


def _one_over_another(
    points: FloatArray, normals: FloatArray, reach: float, least: float
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Return which points (n,) lie over another one and not under one, and the reverse, and the heights of these."""
    distance = np.full((len(points), 2), np.inf)
    for i, j in blocks(len(points), BATCH_SIZE):
        layers = nearest_layers(points, normals, reach, STEEP, np.arange(i, j))
        distance[i:j] = np.where(
            (layers.facing >= MOSTLY) & (layers.distance >= least), layers.distance, np.inf
        )
    under, over = np.isfinite(distance).T
    upper, lower = over & ~under, under & ~over
    return upper, lower, np.concatenate([distance[upper, 1], distance[lower, 0]])


def _links(points: FloatArray, normals: FloatArray, reach: float) -> tuple[IntArray, IntArray, IntArray]:
    """Return the ends of links (m,) between points (n, 3) and what each is worth, the less the steeper it is."""
    one, other = np.ascontiguousarray(cKDTree(points).query_pairs(reach, output_type="ndarray").T, np.int64)
    away = points[other] - points[one]
    length = np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)
    steep = np.maximum(*(np.abs(np.einsum("ij,ij->i", away, normals[end])) for end in (one, other))) / length
    alike = np.abs(np.einsum("ij,ij->i", normals[one], normals[other]))
    worth = (CAPACITY * np.maximum(1 - (steep / SLOPE) ** 2, 0.0) * alike).astype(np.int64)
    kept = worth > 0
    return one[kept], other[kept], worth[kept]


def _minimum_cut(
    one: IntArray, other: IntArray, capacity: IntArray, upper: BoolArray, lower: BoolArray
) -> tuple[BoolArray, int]:
    """Return which points (n,) are parted from the lower ones by the cheapest cut, and what it costs.

    Of several such cuts the one that leaves the most with the upper ones; what hangs on neither is the larger one's.
    """
    count = len(upper)
    source, sink = np.flatnonzero(upper), np.flatnonzero(lower)
    start = np.concatenate([one, other, np.full(len(source), count), sink])
    end = np.concatenate([other, one, source, np.full(len(sink), count + 1)])
    most = np.iinfo(np.int32).max
    size = np.concatenate([capacity, capacity, np.full(len(source) + len(sink), most)])
    graph = coo_array((size.astype(np.int32), (start, end)), shape=(count + 2, count + 2)).tocsr()
    found = maximum_flow(graph, count, count + 1)
    left = graph - found.flow
    left.eliminate_zeros()
    of_upper, of_lower = np.zeros(count + 2, bool), np.zeros(count + 2, bool)
    of_upper[breadth_first_order(left, count, return_predecessors=False)] = True
    of_lower[breadth_first_order(left.T.tocsr(), count + 1, return_predecessors=False)] = True
    of_upper, of_lower = of_upper[:count], of_lower[:count]
    return np.asarray(of_upper | (~of_lower & (of_upper.sum() > of_lower.sum()))), int(found.flow_value)
