"""The triangles of every kind of defect of a mesh."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, mesh_arrays
from o3dleaf.surface.mesh.measurements import MeshMeasurements
from o3dleaf.surface.mesh.topology import BoundaryRings, trace_rings

WORST = 20
"""Triangles with the smallest angles that are named."""

STRAY = 0.01
"""A piece is stray if its area is less than this part of the largest one's."""


@dataclass(frozen=True, eq=False, repr=False)
class Defects:
    """Rows of the triangles that are part of each kind of defect, rising; of `sharpest`, the worst first.

    Attributes
    ----------
    boundary, hole : (k,) ndarrays of int64
        With an edge on the boundary; with one on a loop that is not the rim of an open sheet.
    nonmanifold_edge, nonmanifold_vertex : (k,) ndarrays of int64
        With an edge of three triangles or more; with a corner at a vertex of several fans (bow-tie).
    flipped : (k,) ndarray of int64
        Running against the larger part, by area, of their orientable patch.
    self_intersecting : (k,) ndarray of int64
        Meeting another triangle in more than a common corner or edge.
    degenerate, duplicate : (k,) ndarrays of int64
        Without an area; on the same vertices as one before.
    stray : (k,) ndarray of int64
        Of pieces that are far smaller than the largest one.
    sharpest : (k,) ndarray of int64
        With the smallest angles of all.
    rings : BoundaryRings
        The boundary as walks from vertex to vertex, and which of them go around holes.
    """

    boundary: IntArray
    hole: IntArray
    nonmanifold_edge: IntArray
    nonmanifold_vertex: IntArray
    flipped: IntArray
    self_intersecting: IntArray
    degenerate: IntArray
    duplicate: IntArray
    stray: IntArray
    sharpest: IntArray
    rings: BoundaryRings

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(rows):,} {name.replace('_', ' ')}" for name, rows in self.rows().items() if len(rows))
        return f"Defects({counts or 'none'})"

    def rows(self) -> dict[str, IntArray]:
        """Return the triangles of each kind by its name; small angles, which every mesh has, are not among them."""
        names = [name for name in self.__dataclass_fields__ if name not in {"rings", "sharpest"}]
        return {name: getattr(self, name) for name in names}


def find_defects(mesh: MeshLike, *, worst: int = WORST, stray: float = STRAY) -> Defects:
    """Return the triangles of every defect that `mesh_report` counts.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    worst : int
        How many of the triangles with the smallest angles to name.
    stray : float
        A piece is stray if its area is less than this part of the largest one's.

    Raises
    ------
    InputError
        If it is no mesh, or `worst` or `stray` is below zero.
    """
    if worst < 0 or stray < 0:
        raise InputError("worst, stray: give zero or more")
    return defects_of(MeshMeasurements.of(*mesh_arrays(mesh)), worst, stray)


def defects_of(measured: MeshMeasurements, worst: int = WORST, stray: float = STRAY) -> Defects:
    """Return the defects of a measured mesh; the arguments are those of `find_defects`."""
    edges, loops = measured.edges, measured.loops
    area = np.bincount(measured.piece, weights=measured.area)
    small = area < stray * area.max(initial=0.0)
    order = np.argpartition(measured.smallest_angle, worst)[:worst] if worst < len(measured.triangles) else slice(None)
    sharpest = np.arange(len(measured.triangles))[order]
    return Defects(
        boundary=edges.triangles_of(loops.edges),
        hole=edges.triangles_of(loops.edges[~loops.is_rim[loops.of_edge]]),
        nonmanifold_edge=edges.triangles_of(np.flatnonzero(edges.count > 2)),
        nonmanifold_vertex=np.flatnonzero(measured.bowtie[measured.triangles].any(axis=1)),
        flipped=np.flatnonzero(measured.is_flipped),
        self_intersecting=np.flatnonzero(measured.is_crossing),
        degenerate=np.flatnonzero(measured.is_degenerate),
        duplicate=np.flatnonzero(measured.is_duplicate),
        stray=np.flatnonzero(small[measured.piece]) if small.any() else np.empty(0, dtype=np.int64),
        sharpest=sharpest[np.lexsort((sharpest, measured.smallest_angle[sharpest]))],
        rings=trace_rings(edges, loops),
    )
