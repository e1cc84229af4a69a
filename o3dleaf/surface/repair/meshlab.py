"""MeshLab's filters: simplification, remeshing, ears of holes, Poisson; the only file that imports pymeshlab (GPL-3).

Coordinates pass in double precision both ways, sizes are in the mesh's own unit, never percentages.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d
import pymeshlab

from o3dleaf.core.checks import FloatArray, as_points, require_positive
from o3dleaf.core.child_process import run_apart
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.mesh_arrays import (
    BoolArray,
    IntArray,
    MeshLike,
    build_mesh,
    drop_unused_vertices,
    mesh_arrays,
    require_triangles,
    triangle_areas,
)
from o3dleaf.surface.mesh.surface_distance import surface_distance_of

POISSON_SECONDS = 600.0
"""Time limit of `screened_poisson`: a depth of 10 over a million points takes a few minutes."""


SIMPLIFYING_STEP, SIMPLIFYING_END = float(np.log(4.0)), 0.1
"""Logarithms of numbers of triangles: the first step down, and the one at which the search for the fewest ends."""


def simplify_mesh(
    mesh: MeshLike,
    *,
    target_triangles: int | None = None,
    target_edge: float | None = None,
    deviation: float | None = None,
    quality: float = 0.3,
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
        Triangles to come down to; where border, topology or `deviation` forbid it, more are left.
    target_edge : float, optional
        The same as a mean edge length in the mesh's unit: area / (sqrt(3)/4 edge^2) triangles.
    deviation : float, optional
        How far the surfaces may be apart (`surface_distance`), in the mesh's unit. Without a target
        the mesh comes down as far as that allows, to a tenth of its triangles; some ten times the work.
    quality : float
        From 0 (any shape of triangle) to 1 (equilateral ones are preferred).

    Returns
    -------
    open3d.geometry.TriangleMesh
        float64 vertices, without colours or normals; `simplify_labels` keeps labels.

    Raises
    ------
    InputError
        If there is no target and no deviation, or both targets, or one is not above zero, or the
        mesh has no triangle.
    """
    given = require_triangles(mesh)
    fewest = _fewest_triangles(given, target_triangles, target_edge, deviation)
    return build_mesh(*_simplify(*given, np.zeros(len(given[1])), fewest, deviation, quality)[:2])


def simplify_labels(
    mesh: MeshLike, labels: npt.ArrayLike, **options: Any
) -> tuple[o3d.geometry.TriangleMesh, npt.NDArray[Any]]:
    """Return what `simplify_mesh` makes of a mesh, the lines between its labels locked as its border, and the labels.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Edge-manifold; not modified.
    labels : (m,) array_like
        One a triangle; any type that can be sorted.
    **options
        The other arguments of `simplify_mesh`.

    Raises
    ------
    InputError
        As `simplify_mesh`; if there is not one label a triangle.
    """
    given = require_triangles(mesh)
    found = np.asarray(labels)
    if found.shape != (len(given[1]),):
        raise InputError(f"labels: has shape {found.shape}; give one a triangle, {len(given[1])} in all")
    names, kind = np.unique(found, return_inverse=True)
    quality, deviation = options.pop("quality", 0.3), options.get("deviation")
    fewest = _fewest_triangles(given, **{"target_triangles": None, "target_edge": None, "deviation": None} | options)
    vertices, triangles, left = _simplify(*given, kind.astype(np.float64), fewest, deviation, quality)
    return build_mesh(vertices, triangles), names[left]


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


def cut_ears(vertices: FloatArray, triangles: IntArray, beside: BoolArray, longest: int) -> IntArray:
    """Return triangles that close the holes of up to `longest` edges, given the (m,) triangles beside them.

    MeshLab's ear cutting: between the holes' own vertices, best shaped ears first. The mesh must be
    manifold; on others the filter may never end.
    """
    session = _session(vertices, triangles, beside.astype(np.float64))
    session.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    session.meshing_close_holes(maxholesize=longest + 1, selected=True, newfaceselected=False)
    return _result(session)[1][len(triangles) :]


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


def _fewest_triangles(
    mesh: tuple[FloatArray, IntArray], target_triangles: int | None, target_edge: float | None, deviation: float | None
) -> int:
    """Return the number of triangles to come down to; 1 where only the deviation limits it."""
    if (target_triangles is not None) + (target_edge is not None) + (deviation is not None) == 0:
        raise InputError("target_triangles, target_edge, deviation: give one of them")
    if target_triangles is not None and target_edge is not None:
        raise InputError("target_triangles, target_edge: give one target, not two")
    if deviation is not None:
        require_positive(deviation, "deviation")
    if target_edge is not None:
        edge = require_positive(target_edge, "target_edge")
        return max(4, round(float(triangle_areas(*mesh).sum()) / (3**0.5 / 4 * edge**2)))
    return int(require_positive(1 if target_triangles is None else target_triangles, "target_triangles"))


def _simplify(
    vertices: FloatArray, triangles: IntArray, kind: FloatArray, fewest: int, deviation: float | None, quality: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return vertices, triangles and their kinds, of no fewer triangles than asked and no farther away."""
    whole = vertices, triangles, kind.astype(np.int64)
    if fewest >= len(triangles):
        return whole
    if deviation is None:
        return _collapse(*whole, fewest, quality)
    best, share, step = whole, 0.0, SIMPLIFYING_STEP
    # Down in large steps to the first that is too far away, then up and down by ever smaller ones.
    while step > SIMPLIFYING_END:
        tried = _collapse(*whole, max(fewest, round(len(triangles) * np.exp(share - step))), quality)
        allowed = surface_distance_of(whole[:2], tried[:2]) <= deviation
        if allowed and len(tried[1]) < len(best[1]):
            best, share = tried, share - step
            if len(best[1]) <= fewest:
                break
        else:
            step /= 2
    return best


def _collapse(
    vertices: FloatArray, triangles: IntArray, kind: IntArray, target: int, quality: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the mesh of about `target` triangles, lines between kinds locked, and the triangles' kinds."""
    # Each kind gets vertices of its own, so that the lines between them are borders, and is joined again after.
    names, corner = np.unique(triangles + len(vertices) * kind[:, np.newaxis], return_inverse=True)
    origin = names % len(vertices)
    session = _session(vertices[origin], corner.reshape(-1, 3), kind.astype(np.float64), origin + 1.0)
    session.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(target),
        qualitythr=quality,
        preserveboundary=True,
        preservenormal=True,
        preservetopology=True,
        planarquadric=True,
        autoclean=False,
    )
    found, left = _result(session)
    held = session.current_mesh().vertex_scalar_array().astype(np.int64) - 1
    shared = np.flatnonzero(np.bincount(origin, minlength=len(vertices)) > 1)
    same = np.isin(held, shared)
    first = np.full(len(vertices), len(found))
    np.minimum.at(first, held[same], np.flatnonzero(same))
    target_of = np.where(same, first[held], np.arange(len(found)))
    left_kind = session.current_mesh().face_scalar_array().astype(np.int64)
    return *drop_unused_vertices(found, target_of[left]), left_kind


def _session(
    vertices: FloatArray, triangles: IntArray, mark: FloatArray | None = None, names: FloatArray | None = None
) -> pymeshlab.MeshSet:
    """Return a MeshLab session that holds one mesh, with a scalar a face and one a vertex if given."""
    session = pymeshlab.MeshSet(verbose=False)
    scalars = {"f_scalar_array": mark, "v_scalar_array": names}
    more = {name: each for name, each in scalars.items() if each is not None}
    session.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32), **more))
    return session


def _result(session: pymeshlab.MeshSet) -> tuple[FloatArray, IntArray]:
    """Return the vertices and triangles of the session's mesh."""
    mesh = session.current_mesh()
    return np.array(mesh.vertex_matrix(), dtype=np.float64), np.array(mesh.face_matrix(), dtype=np.int64)
