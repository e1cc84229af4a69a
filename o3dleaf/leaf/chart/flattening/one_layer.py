"""Charts that lie over themselves nowhere: relaxed until parts of the margin meet, which then push no farther."""

from collections.abc import Callable
from functools import partial

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import look_for_stop
from o3dleaf.leaf.chart.flattening.embedding import flip_free_descent
from o3dleaf.leaf.chart.flattening.rigid_energy import RigidEnergy

STEPS = 40
"""From one release of the margin to the next, at most: ten to thirty are usual."""
RELEASES = 8
"""Of the margin where it was held, at most: neighbors have moved since, and left it room or not."""
AT_REST = 1e-3
"""Share of the energy by which a step may still change it when the chart is taken to rest, held as it is."""
NO_USE = 1e-2
"""Share of the energy that a release must bring for another one to be tried."""


def lies_over_itself(chart: FloatArray, rims: list[IntArray]) -> bool:
    """Return whether the boundary of a chart (n, 2) without flipped triangles, its outline first, crosses itself."""
    shell, *holes = (chart[rim] for rim in rims)
    return not shapely.Polygon(shell, holes).is_valid


def relax_in_one_layer(
    vertices: FloatArray, triangles: IntArray, chart: FloatArray, rims: list[IntArray], releases: int = RELEASES
) -> FloatArray:
    """Return a chart (n, 2) relaxed without flips from one that lies over itself nowhere, and no more does itself.

    Edges of the boundary that cross at the start may go on to.

    A ruffled margin is longer than the outline of any chart of its sheet that keeps lengths, so that relaxed freely its
    waves come to lie over each other in the plane, where one surface S(u, v) cannot go through both. A step after which
    the boundary would cross itself is taken back, and from there on the vertices of the edges that crossed are held,
    until all is at rest; then they are released, as often as that lowers the energy. A map without flips whose
    boundary is simple is one to one, and steps are small changes, so that the first crossing is one of the boundary
    (Smith and Schaefer 2015, ACM TOG 34:70, who repel the boundary where it is held here).

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
    chart : (n, 2) ndarray
        Without flipped triangles.
    rims : list of (k,) ndarrays
        Vertices of the boundary's rings, the outline first.
    releases : int
        At most.
    """
    energy_of = RigidEnergy(vertices, triangles)
    before, known = np.inf, _crossing(chart, rims)
    for _ in range(1 + releases):
        chart = _relaxed_until_held(vertices, triangles, chart, partial(_crossing_anew, rims, known), energy_of)
        energy = energy_of(chart)
        if before - energy < NO_USE * energy:
            break
        before = energy
    return chart


def _relaxed_until_held(
    vertices: FloatArray,
    triangles: IntArray,
    chart: FloatArray,
    crossing: Callable[[FloatArray], IntArray],
    energy_of: RigidEnergy,
) -> FloatArray:
    """Return the chart (n, 2) nearer to rest, with those vertices held that would cross."""
    held, before = np.empty(0, np.int64), np.inf
    step = flip_free_descent(vertices, triangles, chart)
    for _ in range(STEPS):
        look_for_stop()
        moved = step(1)
        met = crossing(moved)
        if len(met):
            more = np.union1d(held, met)
            if len(more) == len(held):
                break
            held, step = more, flip_free_descent(vertices, triangles, chart, more)
            continue
        chart, energy = moved, energy_of(moved)
        if abs(before - energy) <= AT_REST * energy:
            break
        before = energy
    return chart


def _crossing_anew(rims: list[IntArray], known: IntArray, chart: FloatArray) -> IntArray:
    """Return the vertices of those edges of the boundary that cross, without those that did before."""
    return np.setdiff1d(_crossing(chart, rims), known) if lies_over_itself(chart, rims) else known[:0]


def _crossing(chart: FloatArray, rims: list[IntArray]) -> IntArray:
    """Return the vertices of those edges of the boundary that cross or touch others beside their neighbors."""
    ends = np.concatenate([np.stack([rim, np.roll(rim, -1)], axis=1) for rim in rims])
    edges = shapely.linestrings(chart[ends])
    first, second = shapely.STRtree(edges).query(edges, predicate="intersects")
    apart = ~(ends[first][:, :, np.newaxis] == ends[second][:, np.newaxis, :]).any(axis=(1, 2))
    return np.unique(ends[first[apart]])
