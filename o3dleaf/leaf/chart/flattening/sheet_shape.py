"""The shape of a mesh that has a chart: one oriented manifold piece of genus 0 with a boundary; its boundary rings."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, triangle_areas
from o3dleaf.core.places import extent, tell_place
from o3dleaf.core.units import tell_count, tell_length
from o3dleaf.leaf.chart.flattening.handles import shortest_handle
from o3dleaf.surface.mesh.topology import (
    BoundaryRings,
    EdgeTable,
    fans_per_vertex,
    find_holes,
    label_fans,
    label_triangles,
    trace_rings,
)

__all__ = ["BoundaryRings", "largest_sheet", "require_sheet", "rim_first"]

SHOWN = 200
"""Places that are marked of a whole surface at most: a picture shows no more."""


def require_sheet(vertices: FloatArray, triangles: IntArray) -> BoundaryRings:
    """Return the boundary rings of a disc with holes, the rim first, or raise `ReconstructionError` with the place."""
    if not len(triangles):
        raise ReconstructionError("chart: the sheet has no triangles; give the mesh of a leaf")
    edges = EdgeTable.of(triangles)
    _require_manifold(vertices, triangles, edges)
    pieces = int(label_triangles(triangles, edges).max()) + 1
    used = vertices[np.unique(triangles)]
    used = used[:: -(-len(used) // SHOWN)]
    if pieces > 1:
        raise ReconstructionError(f"chart: the sheet is in {pieces} pieces; give one of them", used)
    loops = find_holes(vertices, triangles, edges)
    if not len(loops.edges):
        raise ReconstructionError(
            f"chart: the surface about {tell_place(used.mean(axis=0), used)}, {tell_length(extent(used))} across, is "
            "closed and has no margin; a leaf's blade is one open sheet: give one side of it",
            used,
        )
    rings = trace_rings(edges, loops)
    handles = (2 - len(rings) - _euler(triangles, edges)) // 2
    if handles:
        loop = vertices[shortest_handle(vertices, triangles, edges, loops)]
        around = tell_length(float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum()))
        raise ReconstructionError(
            f"chart: the sheet has {tell_count(handles, 'handle')}, the smallest {around} around at "
            f"{tell_place(loop.mean(axis=0), used)}, where folds or scan passes touch, and cannot be laid flat; "
            "cut it there, or give it as one sheet",
            loop,
        )
    return rings


def rim_first(rings: BoundaryRings) -> list[IntArray]:
    """Return the vertices of each ring, the longest first: a chart's outline, then its holes."""
    return [rings[int(ring)] for ring in np.argsort(-rings.perimeter, kind="stable")]


def largest_sheet(vertices: FloatArray, triangles: IntArray, kept: BoolArray) -> BoolArray:
    """Return which (m,) triangles make the largest sheet of those kept: one piece, met by itself in no single point."""
    kept = kept.copy()
    while kept.any():
        rows = np.flatnonzero(kept)
        piece = label_triangles(triangles[rows])
        area = np.bincount(piece, weights=triangle_areas(vertices, triangles[rows]))
        kept[rows[piece != np.argmax(area)]] = False
        rows = np.flatnonzero(kept)
        fans = label_fans(triangles[rows])
        pinched = fans_per_vertex(triangles[rows], fans, len(vertices)) > 1
        if not pinched.any():
            break
        # Of the fans at such a vertex the largest stays.
        size = np.bincount(fans.ravel())
        owner = np.zeros(len(size), dtype=np.int64)
        owner[fans.ravel()] = triangles[rows].ravel()
        order = np.lexsort((-size, owner))
        largest = np.zeros(len(size), dtype=bool)
        largest[order[np.unique(owner[order], return_index=True)[1]]] = True
        kept[rows[(pinched[triangles[rows]] & ~largest[fans]).any(axis=1)]] = False
    return kept


def _euler(triangles: IntArray, edges: EdgeTable) -> int:
    return len(np.unique(triangles)) - len(edges.ends) + len(triangles)


def _require_manifold(vertices: FloatArray, triangles: IntArray, edges: EdgeTable) -> None:
    bad = np.flatnonzero((edges.count > 2) | edges.inconsistent)
    if len(bad):
        raise ReconstructionError(
            f"chart: {len(bad)} edges join more than two triangles or two that face opposite ways, one of them at "
            f"{tell_place(vertices[edges.ends[bad[0]]].mean(axis=0), vertices)}; clean the mesh",
            vertices[edges.ends[bad]].mean(axis=1),
        )
    twice = np.flatnonzero(fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices)) > 1)
    if len(twice):
        raise ReconstructionError(
            f"chart: the sheet meets itself in {len(twice)} single points, one of them at "
            f"{tell_place(vertices[twice[0]], vertices)}; clean the mesh",
            vertices[twice],
        )
