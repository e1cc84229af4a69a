"""Cleaning, and simplification by MeshLab's filters; the only file that imports pymeshlab (GPL-3).

Coordinates pass in double precision both ways, sizes are in the mesh's own unit, never percentages.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d
import pymeshlab

from o3dleaf.checks import FloatArray, as_points, require_positive
from o3dleaf.errors import InputError, O3DLeafError
from o3dleaf.geometry import CloudLike, points_of
from o3dleaf.mesh.apart import run_apart
from o3dleaf.mesh.arrays import BoolArray, IntArray, MeshLike, build_mesh, mesh_arrays, triangle_areas
from o3dleaf.mesh.crossings import find_crossings
from o3dleaf.mesh.draft import NEW, Draft
from o3dleaf.mesh.flips import flip_edges, folded_edges
from o3dleaf.mesh.merge import merge_close
from o3dleaf.mesh.repair import (
    drop_crossing,
    drop_flat,
    drop_repeated,
    drop_small,
    split_bowties,
    thin_edges,
    turn_flipped,
    weld,
)
from o3dleaf.mesh.topology import EdgeTable, fans_per_vertex, find_holes, label_fans, label_triangles

REMESHING_ROUNDS = 5
"""Rounds of splitting, collapsing, flipping and moving; more change little."""

FOLD_ANGLE = 1.0
"""Degrees: two triangles that meet at less than this are folded over; the rim of a blade is blunter."""


POISSON_SECONDS = 600.0
"""Time limit of `screened_poisson`: a depth of 10 over a million points takes a few minutes."""


@dataclass(frozen=True)
class Cleaning:
    """What `clean_mesh` is asked to do; its arguments."""

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
                raise InputError(f"{name}: is {value}; give zero (leave alone) or more")

    def steps(self) -> list[Callable[[Draft], Draft]]:
        """Return the repairs in the order in which one makes work for the next."""
        flip = partial(flip_edges, height=self.smallest_height, angle=self.fold_angle)
        small = partial(
            drop_small, diameter=self.smallest_component, area=self.smallest_area, triangles=self.fewest_triangles
        )
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
            Draft.compact,
            split_bowties,
            *([turn_flipped] if self.orient else []),
            *([partial(_close_holes, largest=self.largest_hole, angle=self.fold_angle)] if self.largest_hole else []),
        ]

    def of(self, draft: Draft) -> Draft:
        """Return a mesh that the steps leave as it is, to the bit."""
        steps = self.steps()
        # Ends: no step undoes another's, each takes away defects, triangles or vertices, and a split vertex,
        # which is welded and split again, comes out as it was.
        while True:
            before = draft
            for step in steps:
                draft = step(draft) if len(draft.triangles) else draft
            if draft.same(before):
                return draft


def clean_mesh(
    mesh: MeshLike,
    *,
    merge: float = 0.0,
    smallest_component: float = 0.0,
    smallest_area: float = 0.0,
    fewest_triangles: int = 0,
    largest_hole: float = 0.0,
    smallest_height: float = 0.0,
    fold_angle: float = FOLD_ANGLE,
    untangle: bool = False,
    orient: bool = True,
) -> o3d.geometry.TriangleMesh:
    """Return a mesh without duplicate or flat triangles, non-manifold edges or vertices; no vertex moves.

    Rounds of repairs until nothing changes, so that cleaning twice is cleaning once, bit for bit:
    vertices in one place are joined, duplicate and flat triangles removed, edges flipped where a
    triangle is flat or folded over its neighbour, triangles taken away until every edge has at most
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
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
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
    open3d.geometry.TriangleMesh
        float64 vertices, bit for bit some of the input's. Vertex colours stay, normals are computed
        anew if there were any; texture coordinates and materials are dropped. `clean_labels` says
        what becomes of labels.

    Raises
    ------
    InputError
        If the mesh has no triangle or a size is below zero.
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
    return _finish(mesh, cleaning.of(Draft.of(*_require_triangles(mesh))))


def clean_labels(
    mesh: MeshLike, labels: npt.ArrayLike, **options: float
) -> tuple[o3d.geometry.TriangleMesh, npt.NDArray[Any]]:
    """Return what `clean_mesh` makes of a mesh, and the labels of the triangles that are left.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    labels : (m, ...) array_like
        One row a triangle; any type. A triangle that closes a hole takes a neighbour's.
    **options
        The other arguments of `clean_mesh`.

    Raises
    ------
    InputError
        As `clean_mesh`; if there is not one label a triangle.
    """
    draft, given = Draft.of(*_require_triangles(mesh)), np.asarray(labels)
    if given.shape[:1] != draft.triangle_origin.shape:
        raise InputError(f"labels: has shape {given.shape}; give one a triangle, {len(draft.triangles)} in all")
    draft = Cleaning(**options).of(draft)  # type: ignore[arg-type]
    return _finish(mesh, draft), given[_spread(draft)]


def simplify_mesh(
    mesh: MeshLike, *, target_triangles: int | None = None, target_edge: float | None = None, quality: float = 0.3
) -> o3d.geometry.TriangleMesh:
    """Return a mesh of fewer triangles by quadric edge collapse; the border and the topology stay.

    Garland & Heckbert 1997 (Proc. SIGGRAPH), as MeshLab does it: vertices inside move to where the
    squared distance to the planes of the triangles collapsed so far is least, vertices on the border
    stay bit for bit, and no collapse changes the genus or joins two sheets.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Edge-manifold; not modified.
    target_triangles : int, optional
        Triangles to come down to; where border and topology forbid it, more are left.
    target_edge : float, optional
        The same as a mean edge length in the mesh's unit: area / (sqrt(3)/4 edge^2) triangles.
    quality : float
        From 0 (any shape of triangle) to 1 (equilateral ones are preferred).

    Raises
    ------
    InputError
        If not exactly one target is given, or it is not above zero, or the mesh has no triangle.
    """
    vertices, triangles = _require_triangles(mesh)
    if (target_triangles is None) == (target_edge is None):
        raise InputError("target_triangles, target_edge: give exactly one of the two")
    if target_edge is not None:
        if not target_edge > 0:
            raise InputError(f"target_edge: is {target_edge}; give a length above zero")
        area = triangle_areas(vertices, triangles).sum()
        target_triangles = max(4, round(area / (np.sqrt(3) / 4 * target_edge**2)))
    if target_triangles is None or target_triangles < 1:
        raise InputError(f"target_triangles: is {target_triangles}; give a number above zero")
    if target_triangles >= len(triangles):
        return build_mesh(vertices, triangles)
    session = _session(vertices, triangles)
    session.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(target_triangles),
        qualitythr=quality,
        preserveboundary=True,
        preservenormal=True,
        preservetopology=True,
        planarquadric=True,
    )
    return build_mesh(*_result(session))


def remesh_mesh(mesh: MeshLike, *, target_edge: float, deviation: float | None = None) -> o3d.geometry.TriangleMesh:
    """Return a mesh of nearly equilateral triangles; triangles with a vertex on the border stay as they are.

    MeshLab's isotropic explicit remeshing: edges split, collapsed and flipped, vertices moved along the surface.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Edge-manifold; not modified.
    target_edge : float
        Edge length to reach, in the mesh's unit.
    deviation : float, optional
        How far the new surface may lie from the old one; a tenth of the edge by default.

    Raises
    ------
    InputError
        If a length is not above zero or the mesh has no triangle.
    """
    vertices, triangles = _require_triangles(mesh)
    edge = require_positive(target_edge, "target_edge")
    most = edge / 10 if deviation is None else require_positive(deviation, "deviation")
    edges = EdgeTable.of(triangles)
    on_border = np.zeros(len(vertices), dtype=bool)
    on_border[edges.ends[edges.count == 1]] = True
    session = _session(vertices, triangles, np.where(on_border[triangles].any(axis=1), 1.0, 0.0))
    session.compute_selection_by_condition_per_face(condselect="fq < 0.5")
    session.meshing_isotropic_explicit_remeshing(
        iterations=REMESHING_ROUNDS,
        selectedonly=True,
        targetlen=pymeshlab.PureValue(edge),
        checksurfdist=True,
        maxsurfdist=pymeshlab.PureValue(most),
    )
    return build_mesh(*_result(session))


def screened_poisson(
    points: CloudLike, normals: npt.ArrayLike, depth: int = 8, *, seconds: float = POISSON_SECONDS
) -> o3d.geometry.TriangleMesh:
    """Return MeshLab's screened Poisson surface of oriented points, computed in a process of its own.

    Kazhdan & Hoppe 2013 (ACM Trans. Graph. 32), as a peer to compare with. One thread: with more,
    MeshLab's solver now and then never ends. Its surface goes on where there are no points.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
        In any unit.
    normals : (n, 3) array_like
        Outward.
    depth : int
        Depth of the octree: its finest cells are 1.1 times the cloud's extent over 2**depth.
    seconds : float
        Time limit.

    Raises
    ------
    InputError
        If there is not one normal a point, or a number is not above zero.
    O3DLeafError
        If MeshLab crashes, does not end in time, or finds no surface.
    """
    given, facing = points_of(points, least=1), as_points(normals, "normals", dim=3)
    if len(given) != len(facing):
        raise InputError(f"normals: are {len(facing)} for {len(given)} points; give one a point")
    require_positive(depth, "depth")
    found = run_apart(
        poisson_arrays,
        (given, facing),
        {"depth": int(depth)},
        name="screened Poisson",
        cure="check the normals, or lower the depth",
        seconds=require_positive(seconds, "seconds"),
    )
    if not len(found[1]):
        raise O3DLeafError("screened Poisson: found no surface; check the normals, or give more points")
    return build_mesh(*found)


def poisson_arrays(points: FloatArray, normals: FloatArray, depth: int) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of the screened Poisson surface; `screened_poisson` runs this apart."""
    session = pymeshlab.MeshSet(verbose=False)
    session.add_mesh(pymeshlab.Mesh(points, v_normals_matrix=normals))
    session.generate_surface_reconstruction_screened_poisson(depth=depth, threads=1)
    return _result(session)


def count_self_intersections(mesh: MeshLike) -> int:
    """Return how many triangles cross a triangle that they share no edge or vertex with (MeshLab's filter).

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
    """
    vertices, triangles = mesh_arrays(mesh)
    if not len(triangles):
        return 0
    session = _session(vertices, triangles)
    session.compute_selection_by_self_intersections_per_face()
    return int(session.current_mesh().selected_face_number())


def _close_holes(draft: Draft, largest: float, angle: float) -> Draft:
    """Close the holes with a perimeter up to `largest`, but for those where that would make a defect."""
    edges = EdgeTable.of(draft.triangles)
    holes = find_holes(draft.vertices, draft.triangles, edges)
    small = ~holes.is_rim & (holes.perimeter <= largest)
    if not small.any():
        return draft
    mark = np.zeros(len(draft.triangles))
    mark[edges.triangles_of(holes.edges[small[holes.of_edge]])] = 1.0
    session = _session(draft.vertices, draft.triangles, mark)
    session.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    most = int(np.bincount(holes.of_edge)[small].max())
    session.meshing_close_holes(maxholesize=most + 1, selected=True, newfaceselected=False)
    new = _result(session)[1][len(mark) :]
    fill = Draft(draft.vertices, new, draft.vertex_origin, np.full(len(new), NEW))
    # Three vertices in one line make MeshLab's ears flat.
    fill = flip_edges(fill, 0.0, angle)
    origin = np.concatenate([draft.triangle_origin, fill.triangle_origin])
    filled = replace(draft, triangles=np.concatenate([draft.triangles, fill.triangles]), triangle_origin=origin)
    patch = label_triangles(fill.triangles)
    spoilt = np.bincount(patch, weights=_is_defective(filled, angle)[len(mark) :]) > 0
    return filled.only(np.append(np.ones(len(mark), dtype=bool), ~spoilt[patch]))


def _is_defective(draft: Draft, angle: float) -> BoolArray:
    """Return which triangles have any defect that `clean_mesh` counts."""
    edges = EdgeTable.of(draft.triangles)
    bad_edge = (edges.count > 2) | edges.against | folded_edges(draft.vertices, edges, angle)
    bowtie = fans_per_vertex(draft.triangles, label_fans(draft.triangles, edges), len(draft.vertices)) > 1
    bad = find_crossings(draft.vertices, draft.triangles) | draft.heights()[2]
    bad |= bad_edge[edges.of_half.reshape(-1, 3)].any(axis=1) | bowtie[draft.triangles].any(axis=1)
    return np.asarray(bad)


def _spread(draft: Draft) -> IntArray:
    """Return the origins of the triangles; new ones take the first that a neighbour has."""
    origin = draft.triangle_origin.copy()
    edges = EdgeTable.of(draft.triangles)
    pairs = edges.order[edges.first(np.flatnonzero(edges.count == 2))[:, np.newaxis] + [0, 1]] // 3
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    while (origin == NEW).any():
        to, of = pairs[(origin[pairs[:, 0]] == NEW) & (origin[pairs[:, 1]] != NEW)].T
        origin[to[::-1]] = origin[of[::-1]]
    return origin


def _finish(mesh: MeshLike, draft: Draft) -> o3d.geometry.TriangleMesh:
    """Return the draft as a mesh, with the colours and normals that the input had."""
    result = build_mesh(draft.vertices, draft.triangles)
    if isinstance(mesh, o3d.t.geometry.TriangleMesh):
        mesh = mesh.to_legacy()
    if isinstance(mesh, o3d.geometry.TriangleMesh):
        if mesh.has_vertex_colors():
            result.vertex_colors = o3d.utility.Vector3dVector(np.asarray(mesh.vertex_colors)[draft.vertex_origin])
        if mesh.has_vertex_normals():
            result.compute_vertex_normals()
    return result


def _require_triangles(mesh: MeshLike) -> tuple[FloatArray, IntArray]:
    """Return the mesh's arrays, or raise `InputError` where it has no triangle."""
    vertices, triangles = mesh_arrays(mesh)
    if not len(triangles):
        raise InputError("mesh: has no triangles; nothing to work on")
    return vertices, triangles


def _session(vertices: FloatArray, triangles: IntArray, mark: FloatArray | None = None) -> pymeshlab.MeshSet:
    """Return a MeshLab session that holds one mesh, with a scalar a face if given."""
    session = pymeshlab.MeshSet(verbose=False)
    more = {} if mark is None else {"f_scalar_array": mark}
    session.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32), **more))
    return session


def _result(session: pymeshlab.MeshSet) -> tuple[FloatArray, IntArray]:
    """Return the vertices and triangles of the session's mesh."""
    mesh = session.current_mesh()
    return np.array(mesh.vertex_matrix(), dtype=np.float64), np.array(mesh.face_matrix(), dtype=np.int64)
