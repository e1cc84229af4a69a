"""Loops of crossed edges around leaves: each is where one sheet of the surface passes through a leaf."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.isosurface.band.band import BLOCK, Band
from o3dleaf.surface.isosurface.band.band_surface import Ends, end_on_box
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION
from o3dleaf.surface.isosurface.octree import tracing_loops
from o3dleaf.surface.isosurface.octree.octree import OctreeLeaves
from o3dleaf.surface.isosurface.octree.tracing_loops import Incidences


class LeastEdges(NamedTuple):
    """Crossed edges between two nodes with none between, by the keys of their lower ends.

    Attributes
    ----------
    around : (e, 4) ndarray of int64
        Incidences of the leaves in the quadrants around, counter-clockwise; −1 where the band ends.
    places : (e, 3) ndarray
        Where they are crossed, the field being linear along them.
    forward : (e,) ndarray of bool
        Whether the lower end is inside.
    on_box : (e,) ndarray of bool
        Whether that is on a face of the box.
    """

    around: IntArray
    places: FloatArray
    forward: BoolArray
    on_box: BoolArray


@dataclass(frozen=True, eq=False)
class TracedLoops:
    """The loops of some leaves, and their edges.

    Attributes
    ----------
    leaves : OctreeLeaves
    leaf : (v,) ndarray of int64
        The leaf of each loop.
    first : (v + 1,) ndarray of int64
        The first incidence of each loop.
    incidences : Incidences
    edge : (i,) ndarray of int64
        The edge of each incidence.
    edges : LeastEdges
    """

    leaves: OctreeLeaves
    leaf: IntArray
    first: IntArray
    incidences: Incidences
    edge: IntArray
    edges: LeastEdges

    @classmethod
    def of(cls, band: Band, leaves: OctreeLeaves) -> "TracedLoops":
        """Trace the surface around leaves of a band."""
        count, many = np.empty((2, len(leaves.keys)), dtype=np.int64)
        present, inside = leaves.present, leaves.inside
        run_blocks(lambda i, j: tracing_loops.count_traced(i, j, present, inside, count, many), len(count), BLOCK)
        total, ends = int(count.sum()), np.cumsum(count)
        found = Incidences(*(np.empty(total, dtype=kind) for kind in ("i4", "i4", "i1", "i1", "i8", "i8")))
        rows = ends - count, np.cumsum(many) - many

        def task(start: int, stop: int) -> None:
            tracing_loops.list_traced(start, stop, present, inside, leaves.nodes, *rows, found)

        run_blocks(task, len(count), BLOCK)
        first = np.append(np.searchsorted(found.loop, np.arange(many.sum())), total)
        return cls(leaves, np.repeat(np.arange(len(many)), many), first, found, *_edges(band, found))

    def middles(self) -> FloatArray:
        """Return the mean (v, 3) of the places where the edges of each loop are crossed."""
        total = np.add.reduceat(self.edges.places[self.edge], self.first[:-1])
        return np.asarray(total / np.diff(self.first)[:, np.newaxis])


def _edges(band: Band, found: Incidences) -> tuple[IntArray, LeastEdges]:
    """Return the edge of each incidence, and the edges."""
    # A key and the two bits of an axis are one int64.
    name = band.keys[found.lower] << 2 | found.axis
    order = np.argsort(name, kind="stable")
    new = np.append(True, name[order][1:] != name[order][:-1])
    edge, some = np.empty(len(name), dtype=np.int64), order[new]
    edge[order] = np.cumsum(new) - 1
    around = np.full((len(some), 4), -1, dtype=np.int64)
    for quadrant in range(4):
        filled = np.flatnonzero(found.quadrants >> quadrant & 1)
        around[edge[filled], quadrant] = filled
    rows = found.lower[some], found.upper[some]
    ends = Ends(*(band.positions(band.keys[each]) for each in rows), *(band.values[each] for each in rows))
    share = np.clip(ends.here / (ends.here - ends.there), MIN_FRACTION, 1 - MIN_FRACTION)
    places, on_box = ends.lower + share[:, np.newaxis] * (ends.upper - ends.lower), np.zeros(len(some), dtype=bool)
    if band.box is not None:
        cut, ended = end_on_box(band, band.box, ends)
        places[cut], on_box[cut] = ended, ((ended == band.box[0]) | (ended == band.box[1])).any(axis=1)
    return edge, LeastEdges(around, places, ends.here > 0, on_box)
