"""How many points more than its density a thinned sample has along an edge, so that it passes for that of a wider leaf.

Of a cloud that was thinned to the averages of voxels each voxel that the leaf reaches into has one point, however
little of it the leaf covers; of one that was thinned to a least distance no point beyond the edge shuts out others.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.margin.edge.edge_fit import moved_along, widened
from o3dleaf.leaf.margin.edge.edge_frame import INSIDE, EdgeFrame, EdgeSample, edge_frame
from o3dleaf.leaf.margin.edge.edge_score import MAX_EXCESS, blurred, crowded
from o3dleaf.leaf.margin.edge.least_distance import MIN_RANDOM, excess_beside
from o3dleaf.leaf.margin.sample_spacing import BoolArray

STRIP = 1.0
"""Spacings that a strip along the edge is deep; what is more lies within the outer half of the first."""
REGULAR, RANDOM = 0.08, 0.5
"""How random averages of voxels are: cells in which a plane cuts cubes vary in area by a tenth of what those of
independent points do, where voxels are full, and with one point to a voxel by half; then 0.05 are more, and no area
hangs on them. What is as regular as a grid has rows, and a strip holds as many of them as it happens to."""
BEYOND_CHANCE = 3.0
"""Deviations from which on more points along the edge are none of chance's."""
BEYOND_ROWS = 2.0
"""Deviations by which rows along an edge make strips differ: at most √2 as the waves of one spacing, 2 as those of
two."""
DEEPER = np.arange(1.0, 3.25, 0.25)
"""Spacings inside at which pairs of strips are compared that no edge has cut: what they differ by is that of rows."""


def edge_excess(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> float:
    r"""Return how many points more than its density a sample has for each spacing of its edge; 0 if chance explains it.

    Of two strips along the edge, each a spacing deep, the outer one has n₁ points and the inner one n₂. The edge is
    found at a distance o(ε) outside of the true one (`crowded`), so that an excess ε is where

    .. math:: ε - o(ε) = (n_1 - n_2) / ℓ - κ,

    ℓ the length and κ the mean curvature. The deviation of the right side is √(2 r/ℓ) for a sample r times as random
    as independent points; where rows run along the edge, pairs of strips deeper inside differ, too, and tell by how
    much (`_rows`). The inner strip stands for the density: that of a scan falls and rises towards its margin.

    Parameters
    ----------
    curve : (k, 2) ndarray
        Near the margin, with the leaf on its left.
    apexes : (a, 2) ndarray
        Its sharp tips, points of the curve.
    sample : EdgeSample
    """
    frame = edge_frame(curve, apexes, sample)
    found = moved_along(frame, widened(frame, blurred(frame.noise))[0], 1.0)
    frame = edge_frame(found, found[frame.apexes], sample)
    seen = blurred(frame.noise)
    deep = frame.observed & (frame.half_width > INSIDE * seen.blur)
    length = float(frame.length[deep].sum())
    if length <= 0:
        return 0.0
    depth = -frame.across[deep[frame.node]]
    outer, inner = np.count_nonzero(depth < STRIP), np.count_nonzero((depth >= STRIP) & (depth < 2 * STRIP))
    more = (outer - inner) / length - STRIP**2 * _curvature(frame, deep)
    tried = np.linspace(0.0, MAX_EXCESS, 15)
    noise = np.array([np.mean(frame.noise)])
    off = float(np.mean(seen.offset)) + np.array([crowded(noise, excess)[0] for excess in tried])
    seen_more = tried - off
    excess = float(np.interp(more, seen_more, tried))
    chance = np.sqrt(2 * STRIP * sample.randomness / length)
    explained = max(BEYOND_CHANCE * chance, BEYOND_ROWS * _rows(frame, deep, sample))
    return excess if more - seen_more[0] > explained else 0.0


def _rows(frame: EdgeFrame, deep: BoolArray, sample: EdgeSample) -> float:
    """Return the deviation of the difference of two strips next to each other inside, beyond that of chance.

    Points on lines, as those on the edges of a lattice of voxels are, lie in one strip or the other where the edge runs
    along them, and its own two strips differ by as much. The places of an edge with room for five strips tell it, if
    they are half of it or more; 0 elsewhere.
    """
    points = np.asarray(sample.local.tree.data)
    tree, reach = cKDTree(frame.curve), float(DEEPER[-1] + 2 * STRIP)
    away = tree.query(frame.curve - (reach * frame.spacing)[:, None] * frame.normals)[0]
    wide = deep & (away > (reach - STRIP / 2) * frame.spacing)  # else what is as deep is nearer to the other side
    length = float(frame.length[wide].sum())
    if length < frame.length[deep].sum() / 2:
        return 0.0
    node = tree.query(points)[1]
    depth = -((points - frame.curve[node]) * frame.normals[node]).sum(axis=1) / frame.spacing[node]
    depth = np.sort(depth[wide[node]])
    first, second, last = np.searchsorted(depth, DEEPER + STRIP * np.array([[0.0], [1.0], [2.0]]))
    differ = (2 * second - first - last) / length - STRIP**2 * _curvature(frame, wide)
    return float(np.sqrt(max(np.mean(differ**2) - 2 * STRIP * sample.randomness / length, 0.0)))


def _curvature(frame: EdgeFrame, nodes: BoolArray) -> float:
    """Return the mean curvature of some nodes (n,)."""
    return float(np.average(frame.curvature[nodes], weights=frame.length[nodes]))


def with_edge_excess(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> EdgeSample:
    """Return the sample with the excess that its edge shows, or without a least distance that was not thinned to.

    Samples too random for thinned ones, lattices and lines have neither: along a margin the last line has more points
    than the strip beside it, and the sides of cells are a least distance, too.
    """
    if sample.lines is not None or not MIN_RANDOM <= sample.randomness <= RANDOM:
        return replace(sample, thinned_to=0.0)
    if sample.thinned_to > 0 or sample.randomness < REGULAR:
        return sample
    return replace(sample, excess=edge_excess(curve, apexes, sample))


def tell_excess(sample: EdgeSample) -> tuple[str, ...]:
    """Return a line on points that do not count as more leaf; none where there are no more than the density tells."""
    if sample.thinned_to > 0:
        more = float(excess_beside(sample.thinned_to / np.median(sample.local.values)))
        how = f"after thinning to a least distance of {tell_length(sample.thinned_to)}"
    elif sample.excess > 0:
        more, how = sample.excess, "averages of voxels have (voxel_down_sample)"
    else:
        return ()
    said = f"{more:.2g} points more to each spacing along the margin than the density inside tells"
    return (f"{said}, as {how}: they do not count as more leaf",)
