"""A vertex for each loop: on the surface by Newton's method or, where it has a crease, where tangent planes meet."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.newton import euclidean
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.surface.isosurface.band.band import BATCH_SIZE, BLOCK
from o3dleaf.surface.isosurface.band.band_surface import tangent_planes
from o3dleaf.surface.isosurface.crease_edge_loops import TangentPlanes
from o3dleaf.surface.isosurface.crease_edges import MAX_OUTSIDE, MIN_COSINE, meet_planes, stop_at_level
from o3dleaf.surface.isosurface.octree import tracing_loops
from o3dleaf.surface.isosurface.octree.octree_band import OctreeBand
from o3dleaf.surface.isosurface.octree.traced import TracedLoops

MAX_ITERATIONS = 2
"""Newton's steps of a vertex: the middle of a loop is off by the square of its leaf, and each step squares that."""

SETTLED = 0.03
"""Share of a leaf: after a shorter step a vertex is off by about its square, a thousandth."""


CREASED, SMOOTH, MIDDLE = 0, 2, 3
"""Places of a vertex, from the best to one where hardly any triangles cross: where tangent planes meet (and then moved
into the leaf), on the surface within the leaf, and in the middle of the loop."""


class LoopVertices(NamedTuple):
    """Vertices of loops.

    Attributes
    ----------
    smooth, middle : (v, 3) ndarrays
        On the surface, and in the middles of loops.
    creased : (k,) ndarray of int64
        Which ones are on creases.
    met : (2, k, 3) ndarray
        Where tangent planes meet there, if the surface is there: half a leaf outside it at most, and within it.
    """

    smooth: FloatArray
    middle: FloatArray
    creased: IntArray
    met: FloatArray

    def best(self) -> IntArray:
        """Return the best place (v,) of each: `CREASED` or `SMOOTH`."""
        choice = np.full(len(self.smooth), SMOOTH)
        choice[self.creased] = CREASED
        return choice

    def at(self, choice: IntArray) -> FloatArray:
        """Return the vertices (v, 3) at some places (v,)."""
        vertices = np.where((choice == MIDDLE)[:, np.newaxis], self.middle, self.smooth)
        of_crease = choice[self.creased]
        meeting = np.flatnonzero(of_crease < SMOOTH)
        vertices[self.creased[meeting]] = self.met[of_crease[meeting], meeting]
        return vertices


def place_vertices(band: OctreeBand, traced: TracedLoops, field: Field, *, features: bool) -> LoopVertices:
    """Return the vertices of loops, none outside its leaf or the box.

    Those of loops that the box cuts stay in the middle of their crossings.
    """
    keys, levels = traced.leaves.keys[traced.leaf], traced.leaves.levels[traced.leaf]
    low, high = band.place_in(keys, levels, 0.0), band.place_in(keys, levels, 1.0)
    if band.box is not None:
        low, high = np.clip(low, *band.box), np.clip(high, *band.box)
    middle, cut = traced.middles(), np.zeros(len(keys), dtype=bool)
    cut[traced.incidences.loop[traced.edges.on_box[traced.edge]]] = True
    vertices, rows, side = middle.copy(), np.flatnonzero(~cut), float(band.step[0]) * np.exp2(levels)
    for _ in range(MAX_ITERATIONS):
        moved = np.clip(vertices[rows] + _steps(band, field, vertices[rows]), low[rows], high[rows])
        length = np.linalg.norm(moved - vertices[rows], axis=1)
        vertices[rows] = moved
        rows = rows[length > SETTLED * side[rows]]
    if not features:
        return LoopVertices(vertices, middle, np.empty(0, dtype=np.int64), np.empty((2, 0, 3)))
    planes, creased = _planes(band, traced, field)
    rows = np.flatnonzero(creased & ~cut)
    met = meet_planes(planes.squares[rows], planes.right[rows], planes.middle[rows])
    met = stop_at_level(planes.middle[rows], met, band.ask)
    low, high, beyond = low[rows], high[rows], MAX_OUTSIDE * side[rows, np.newaxis]
    met = np.stack([np.clip(met, low - beyond, high + beyond), np.clip(met, low, high)])
    return LoopVertices(vertices, middle, rows, met)


def _steps(band: OctreeBand, field: Field, points: FloatArray) -> FloatArray:
    """Return Newton's steps (n, 3) from points (n, 3) towards the level."""
    steps = np.empty_like(points)
    for i, j in blocks(len(points), BATCH_SIZE):
        values, slopes = values_and_gradients(field, points[i:j])
        steps[i:j] = euclidean(points[i:j], values - band.level, slopes, band.widths[1])
    return require_finite(steps, "field gradients")


def _planes(band: OctreeBand, traced: TracedLoops, field: Field) -> tuple[TangentPlanes, BoolArray]:
    """Return the planes tangent to the surface where loops are crossed, and which loops (v,) are creased."""
    places, many = traced.edges.places, len(traced.leaf)
    (feet, normals), creased = tangent_planes(field, places, band.level, band.widths[1]), np.empty(many, dtype=bool)
    planes = TangentPlanes(np.empty((many, 3, 3)), np.empty((many, 3)), np.empty((many, 3)), traced.leaf)

    def add(start: int, stop: int) -> None:
        tracing_loops.add_loop_planes(
            start, stop, traced.first, traced.edge, places, feet, normals, MIN_COSINE, planes, creased
        )

    run_blocks(add, many, BLOCK)
    return planes, creased
