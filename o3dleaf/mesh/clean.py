"""Repair and simplification by MeshLab's filters; the only file that imports pymeshlab (GPL-3).

Coordinates pass in double precision both ways, sizes are in the mesh's own unit, never percentages.
"""

import numpy as np
import open3d as o3d
import pymeshlab

from o3dleaf.checks import FloatArray, require_positive
from o3dleaf.errors import InputError
from o3dleaf.mesh.arrays import IntArray, MeshLike, build_mesh, mesh_arrays, triangle_areas
from o3dleaf.mesh.topology import EdgeTable, find_holes, label_triangles

REMESHING_ROUNDS = 5
"""Rounds of splitting, collapsing, flipping and moving; more change little."""

PASSES = 10
"""Rounds of cleaning at most: a repair can uncover a defect, in practice two rounds reach rest."""


def clean_mesh(
    mesh: MeshLike, *, smallest_component: float = 0.0, largest_hole: float = 0.0, orient: bool = True
) -> o3d.geometry.TriangleMesh:
    """Return a mesh without duplicate or null triangles, non-manifold edges or vertices; no vertex moves.

    Rounds of MeshLab's filters until nothing changes, so that cleaning twice is cleaning once:
    duplicate vertices are merged, duplicate and null triangles removed, triangles taken away until
    every edge has at most two (the smallest first), bow-tie vertices split into one a fan, small
    components removed, holes closed with triangles between their own vertices.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    smallest_component : float
        Pieces whose bounding box has a shorter diagonal than this are removed; in the mesh's unit.
    largest_hole : float
        Holes with a perimeter up to this are closed, the rim of an open sheet never is (see
        `mesh_report` for which loop is a rim); in the mesh's unit.
    orient : bool
        Turn the triangles that run against the larger part, by area, of their piece.

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices, bit for bit those of the input that are left.

    Raises
    ------
    InputError
        If the mesh has no triangle or a size is below zero.
    """
    if min(smallest_component, largest_hole) < 0:
        raise InputError("smallest_component, largest_hole: give lengths of zero (leave alone) or more")
    vertices, triangles = _require_triangles(mesh)
    for _ in range(PASSES):
        before = len(vertices), len(triangles)
        vertices, triangles = _repair(vertices, triangles, smallest_component)
        if orient:
            triangles = _turn_minority(vertices, triangles)
        if largest_hole > 0:
            vertices, triangles = _close_holes(vertices, triangles, largest_hole)
        if (len(vertices), len(triangles)) == before or not len(triangles):
            break
    return build_mesh(vertices, triangles)


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


def _repair(vertices: FloatArray, triangles: IntArray, smallest_component: float) -> tuple[FloatArray, IntArray]:
    """Run the filters that remove or split, in the order in which one makes work for the next."""
    session = _session(vertices, triangles)
    session.meshing_remove_duplicate_vertices()
    session.meshing_remove_duplicate_faces()
    session.meshing_remove_null_faces()
    session.meshing_repair_non_manifold_edges(method="Remove Faces")
    session.meshing_repair_non_manifold_vertices(vertdispratio=0)
    if smallest_component > 0:
        size = pymeshlab.PureValue(smallest_component)
        session.meshing_remove_connected_component_by_diameter(mincomponentdiag=size)
    session.meshing_remove_unreferenced_vertices()
    return _result(session)


def _close_holes(vertices: FloatArray, triangles: IntArray, largest: float) -> tuple[FloatArray, IntArray]:
    """Close the holes with a perimeter up to `largest`; MeshLab is told which by a triangle beside each."""
    edges = EdgeTable.of(triangles)
    holes = find_holes(vertices, triangles, edges)
    small = ~holes.is_rim & (holes.perimeter <= largest)
    if not small.any():
        return vertices, triangles
    beside = np.zeros(len(edges.count), dtype=bool)
    beside[holes.edges[small[holes.of_edge]]] = True
    mark = beside[edges.of_half].reshape(-1, 3).any(axis=1)
    session = _session(vertices, triangles, np.where(mark, 1.0, 0.0))
    session.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    most = int(np.bincount(holes.of_edge)[small].max())
    session.meshing_close_holes(maxholesize=most + 1, selected=True, newfaceselected=False)
    return _result(session)


def _turn_minority(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Return the triangles turned alike within each piece, as most of its area was before."""
    edges = EdgeTable.of(triangles)
    if not edges.inconsistent().any():
        return triangles
    session = _session(vertices, triangles)
    session.meshing_re_orient_faces_coherently()
    alike = session.current_mesh().face_matrix().astype(np.int64)
    turned = _winding(alike) != _winding(triangles)
    piece, area = label_triangles(triangles, edges), triangle_areas(vertices, triangles)
    against = np.bincount(piece, weights=area * turned) > np.bincount(piece, weights=area) / 2
    return np.where((turned ^ against[piece])[:, np.newaxis], triangles[:, ::-1], triangles)


def _winding(triangles: IntArray) -> IntArray:
    """Return the vertex after the smallest one of each triangle: turning a triangle changes it."""
    after = (triangles.argmin(axis=1) + 1) % 3
    return np.asarray(np.take_along_axis(triangles, after[:, np.newaxis], axis=1)[:, 0])


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
