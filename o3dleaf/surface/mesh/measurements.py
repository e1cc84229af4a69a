"""Measurements of a mesh in one pass: edges, pieces, fans, loops, angles, areas, broken triangles."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.measure_loops import bound_used, mark_used, measure_edges, measure_triangles, share_areas
from o3dleaf.surface.mesh.topology import (
    BoundaryLoops,
    EdgeTable,
    fans_per_vertex,
    find_flipped,
    find_holes,
    label_fans,
    label_triangles,
)

BLOCK = 2**16
"""Triangles or edges that one thread measures at a time."""

FLAT = 1e-12
"""A triangle is degenerate if its area is at most this times its longest edge squared (float64 rounding)."""


@dataclass(frozen=True, eq=False, repr=False)
class MeshMeasurements:
    """Parts and sizes of a mesh of n vertices, m triangles and e edges.

    Attributes
    ----------
    vertices, triangles : ndarrays
        The mesh.
    edges : EdgeTable
    piece : (m,) ndarray
        Edge-connected piece of each triangle, numbered by its first triangle.
    bowtie : (n,) ndarray of bool
        Whether a vertex has more than one fan.
    is_used : (n,) ndarray of bool
        Whether a triangle uses a vertex.
    loops : BoundaryLoops
    area, smallest_angle, largest_angle : (m,) ndarrays
        In the square of the mesh's unit, and in degrees.
    edge_length : (e,) ndarray
    is_degenerate, is_duplicate, is_flipped, is_crossing : (m,) ndarrays of bool
        See `Defects`.
    orientable : bool
    volume : float
        The sum of det(a, b, c) / 6: what a closed mesh encloses, positive if its triangles face outward.
    """

    vertices: FloatArray
    triangles: IntArray
    edges: EdgeTable
    piece: IntArray
    bowtie: BoolArray
    is_used: BoolArray
    loops: BoundaryLoops
    area: FloatArray
    smallest_angle: FloatArray
    largest_angle: FloatArray
    edge_length: FloatArray
    is_degenerate: BoolArray
    is_duplicate: BoolArray
    is_flipped: BoolArray
    is_crossing: BoolArray
    orientable: bool
    volume: float

    def __repr__(self) -> str:
        return f"MeshMeasurements({len(self.vertices):,} vertices, {len(self.triangles):,} triangles)"

    @classmethod
    def of(cls, vertices: FloatArray, triangles: IntArray) -> "MeshMeasurements":
        """Measure a mesh."""
        pairing, joining, measuring, walking, crossing = progress.split(1, 1, 1, 1, 1)
        with pairing:
            edges = EdgeTable.of(triangles)
        with joining:
            piece = label_triangles(triangles, edges)
            bowtie = fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices)) > 1
        with measuring:
            measures = _measure(vertices, triangles)
            length, is_used = np.empty(len(edges.ends)), np.zeros(len(vertices), dtype=bool)
            run_blocks(lambda i, j: measure_edges(vertices, edges.ends, i, j, length), len(length), BLOCK)
            mark_used(triangles, is_used)
        with walking:
            flipped, orientable = find_flipped(edges, measures["area"])
            loops, duplicate = find_holes(vertices, triangles, edges, piece, measures["area"]), edges.duplicates()
        with crossing:
            is_crossing = find_crossings(vertices, triangles)
        return cls(
            vertices=vertices,
            triangles=triangles,
            edges=edges,
            piece=piece,
            bowtie=bowtie,
            is_used=is_used,
            loops=loops,
            edge_length=length,
            is_duplicate=duplicate,
            is_flipped=flipped,
            is_crossing=is_crossing,
            orientable=orientable,
            **measures,
        )

    @property
    def pieces(self) -> int:
        """Number of edge-connected pieces."""
        return int(self.piece.max(initial=-1)) + 1

    @property
    def nonmanifold_edges(self) -> int:
        """Number of edges of three triangles or more."""
        return int((self.edges.count > 2).sum())

    @property
    def is_closed(self) -> bool:
        """True if there are triangles, and no boundary."""
        return len(self.triangles) > 0 and len(self.loops.edges) == 0

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lower, then upper corner of the box around the vertices in use; zeros of none."""
        return np.asarray(bound_used(self.vertices, self.is_used)) if self.is_used.any() else np.zeros((2, 3))

    def vertex_area(self) -> FloatArray:
        """Return the (n,) areas of the vertices: a third of each of their triangles."""
        shared = np.zeros(len(self.vertices))
        share_areas(self.triangles, self.area, shared)
        return shared


def _measure(vertices: FloatArray, triangles: IntArray) -> dict[str, Any]:
    """Return areas, angles, degenerate triangles and the volume, by their names in `MeshMeasurements`."""
    many = len(triangles)
    area, smallest, largest, solid = (np.empty(many) for _ in range(4))
    degenerate = np.empty(many, dtype=bool)
    # From the mesh's own middle, so that a mesh far from the origin loses no digits.
    middle = vertices.mean(axis=0) if len(vertices) else np.zeros(3)

    def measure(start: int, stop: int) -> None:
        rows = area, smallest, largest, solid, degenerate
        measure_triangles(vertices, triangles, middle, FLAT, start, stop, *rows)

    run_blocks(measure, many, BLOCK)
    return {
        "area": area,
        "smallest_angle": smallest,
        "largest_angle": largest,
        "is_degenerate": degenerate,
        "volume": float(solid.sum()),
    }
