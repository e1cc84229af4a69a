"""`clean_mesh`: repairs, in rounds, until a mesh is at rest."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import NotNegative, Whole
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, build_mesh, require_triangles
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.io.labelled_mesh import LabelledMesh, with_or_without_labels
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.repair.editable_mesh import NEW, EditableMesh
from o3dleaf.surface.repair.flips import flip_edges
from o3dleaf.surface.repair.holes import close_holes
from o3dleaf.surface.repair.merge_vertices import merge_close
from o3dleaf.surface.repair.repairs import (
    drop_crossing,
    drop_flat,
    drop_repeated,
    drop_small,
    split_bowties,
    thin_edges,
    turn_flipped,
    weld,
)

FOLD_ANGLE = 1.0
"""Degrees: two triangles that meet at less than this are folded over; the rim of a blade is blunter."""


@dataclass(frozen=True)
class Cleaning:
    """Options of `clean_mesh`."""

    merge: float = 0.0
    smallest_component: float = 0.0
    smallest_area: float = 0.0
    fewest_triangles: int = 0
    largest_hole: float = 0.0
    smallest_height: float = 0.0
    fold_angle: float = FOLD_ANGLE
    untangle: bool = False
    orient: bool = True

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"{name}: is {value}; give zero (no change) or more")

    def steps(self) -> list[Callable[[EditableMesh], EditableMesh]]:
        """Return the repairs in the order in which one makes work for the next."""
        flip = partial(flip_edges, height=self.smallest_height, angle=self.fold_angle)
        small = partial(
            drop_small, diameter=self.smallest_component, area=self.smallest_area, triangles=self.fewest_triangles
        )
        close = partial(close_holes, largest=self.largest_hole, height=self.smallest_height, angle=self.fold_angle)
        merge = partial(merge_close, distance=self.merge, angle=self.fold_angle, orient=self.orient)
        return [
            weld,
            *([merge] if self.merge > 0 else []),
            drop_repeated,
            *([turn_flipped] if self.orient else []),
            flip,
            drop_flat,
            thin_edges,
            *([drop_crossing] if self.untangle else []),
            small,
            *([turn_flipped] if self.orient else []),
            *([close] if self.largest_hole > 0 else []),
            EditableMesh.compact,
            split_bowties,
        ]

    def of(self, mesh: EditableMesh) -> EditableMesh:
        """Return a mesh that the steps leave as it is, to the bit."""
        steps = self.steps()
        # Ends: no step undoes another's, each takes away defects, triangles or vertices, and a split vertex,
        # which is welded and split again, comes out as it was.
        while True:
            before = mesh
            for step in steps:
                mesh = step(mesh) if len(mesh.triangles) else mesh
            if mesh.same(before):
                return mesh


@with_or_without_labels
@checked
def clean_mesh(
    mesh: LabelledMesh,
    *,
    merge: NotNegative = 0.0,
    smallest_component: NotNegative = 0.0,
    smallest_area: NotNegative = 0.0,
    fewest_triangles: Whole = 0,
    largest_hole: NotNegative = 0.0,
    smallest_height: NotNegative = 0.0,
    fold_angle: NotNegative = FOLD_ANGLE,
    untangle: bool = False,
    orient: bool = True,
) -> LabelledMesh:
    """Return a mesh without duplicate or flat triangles, non-manifold edges or vertices; no vertex moves.

    Rounds of repairs until nothing changes, so that cleaning twice is cleaning once, bit for bit:
    vertices in one place are joined, duplicate and flat triangles removed, edges flipped where a
    triangle is flat or folded over its neighbor, triangles taken away until every edge has at most
    two (fins before what they stand on), bow-tie vertices split into one a fan, small components
    removed, flipped triangles turned, holes closed with triangles between their own vertices
    (MeshLab's ear cutting).

    Nothing gets worse: compared with the mesh whose coincident vertices are joined, there are not
    more non-manifold edges or vertices, inconsistent edges, degenerate, duplicate or crossing
    triangles, nor folded edges, of the first two and of the flat and duplicate ones none at all.
    What would make a defect is not done: such a flip, merge or closed hole is left out. A triangle
    taken away leaves at most three edges on the boundary, and nothing else adds to it.

    Parameters
    ----------
    mesh : LabelledMesh, open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    merge : float
        Vertices at most this far from an earlier one are joined to it, and none moves farther; in
        the mesh's unit. With 0 no vertex moves at all.
    smallest_component : float
        Pieces whose bounding box has a shorter diagonal than this are removed; in the mesh's unit.
    smallest_area : float
        Pieces with a smaller area are removed; in the square of the mesh's unit.
    fewest_triangles : int
        Pieces of fewer triangles are removed.
    largest_hole : float
        Holes with a perimeter up to this are closed, the rim of an open sheet never is (see
        `mesh_report` for which loop is a rim); in the mesh's unit.
    smallest_height : float
        Triangles with a smaller height over their longest edge, at whose foot a vertex stands like a
        T, are flipped away where that helps; the surface then moves by at most so much. In the
        mesh's unit.
    fold_angle : float
        Two triangles that meet at less than this are folded over; in degrees, 180 being flat.
    untangle : bool
        Remove the triangles that cross others; the holes that they leave are closed up to `largest_hole`.
    orient : bool
        Turn the triangles that run against the larger part, by area, of their patch.

    Returns
    -------
    LabelledMesh if one was given, else open3d.geometry.TriangleMesh
        float64 vertices, bit for bit some of the input's. Vertex colors stay, normals are computed
        anew if there were any; texture coordinates and materials are dropped. Triangles keep their
        labels, one that closes a hole takes a neighbor's.

    Raises
    ------
    InputError
        If the mesh has no triangle, not one label a triangle, or a size is below zero.
    """
    cleaning = Cleaning(
        merge=merge,
        smallest_component=smallest_component,
        smallest_area=smallest_area,
        fewest_triangles=fewest_triangles,
        largest_hole=largest_hole,
        smallest_height=smallest_height,
        fold_angle=fold_angle,
        untangle=untangle,
        orient=orient,
    )
    vertices, triangles = require_triangles(mesh.mesh)
    held = measured.CLEANED_TRIANGLE * len(triangles)
    require_resources(held, f"clean: {len(triangles):,} triangles", "simplify the mesh first")
    labels = mesh.labels_of(len(triangles))
    cleaned = cleaning.of(EditableMesh.of(vertices, triangles))
    left = None if labels is None else labels[_spread(cleaned)]
    return replace(mesh, mesh=_finish(mesh.mesh, cleaned), labels=left)


def _spread(mesh: EditableMesh) -> IntArray:
    """Return the origins of the triangles; new ones take the first that a neighbor has."""
    origin = mesh.triangle_origin.copy()
    edges = EdgeTable.of(mesh.triangles)
    pairs = edges.order[edges.first(np.flatnonzero(edges.count == 2))[:, np.newaxis] + [0, 1]] // 3
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    while (origin == NEW).any():
        to, of = pairs[(origin[pairs[:, 0]] == NEW) & (origin[pairs[:, 1]] != NEW)].T
        origin[to[::-1]] = origin[of[::-1]]
    return origin


def _finish(given: MeshLike, cleaned: EditableMesh) -> o3d.geometry.TriangleMesh:
    """Return a cleaned mesh with the colors and normals that the input had."""
    result = build_mesh(cleaned.vertices, cleaned.triangles)
    if isinstance(given, o3d.t.geometry.TriangleMesh):
        given = given.to_legacy()
    if isinstance(given, o3d.geometry.TriangleMesh):
        if given.has_vertex_colors():
            result.vertex_colors = o3d.utility.Vector3dVector(np.asarray(given.vertex_colors)[cleaned.vertex_origin])
        if given.has_vertex_normals():
            result.compute_vertex_normals()
    return result
