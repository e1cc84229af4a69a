"""MeshLab's filters: edge collapse and ear cutting; the only file that imports pymeshlab (GPL-3).

Coordinates pass in double precision both ways, sizes are in the mesh's own unit, never percentages.
"""

import importlib
import threading
from concurrent.futures import Future
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, drop_unused_vertices

if TYPE_CHECKING:
    import pymeshlab


def cut_ears(vertices: FloatArray, triangles: IntArray, beside: BoolArray, longest: int) -> IntArray:
    """Return triangles that close the holes of up to `longest` edges, given the (m,) triangles beside them.

    MeshLab's ear cutting: between the holes' own vertices, best shaped ears first. The mesh must be
    manifold; on others the filter may never end.
    """
    session = _session(vertices, triangles, beside.astype(np.float64))
    session.compute_selection_by_condition_per_face(condselect="fq > 0.5")
    session.meshing_close_holes(maxholesize=longest + 1, selected=True, newfaceselected=False)
    return _result(session)[1][len(triangles) :]


Parts = tuple[FloatArray, IntArray, IntArray]
"""Vertices (n, 3), triangles (m, 3), and of which kind, from 0 on, each triangle is (m,)."""


def collapse_edges(mesh: Parts, target: int, quality: float, locked: BoolArray | None = None) -> Parts:
    """Return the mesh of about `target` triangles: lines between kinds stay, and (m,) `locked` triangles."""
    vertices, triangles, kind = mesh
    # Each kind gets vertices of its own, so that the lines between them are borders, and is joined again after.
    names, corner = np.unique(triangles + len(vertices) * kind[:, np.newaxis], return_inverse=True)
    origin = names % len(vertices)
    # What MeshLab takes for nothing depends on the unit: at an extent of 1 to 2 all meshes are alike, to the last bit.
    unit = 2.0 ** np.floor(np.log2(max(float(np.ptp(vertices[origin], axis=0).max()), np.finfo(float).tiny)))
    kept = 0 if locked is None else int(np.count_nonzero(locked))
    mark = kind if locked is None else np.where(locked, -1 - kind, kind)
    session = _session(vertices[origin] / unit, corner.reshape(-1, 3), mark.astype(np.float64), origin + 1.0)
    if kept:
        session.compute_selection_by_condition_per_face(condselect="fq >= 0")
    # Of a selection MeshLab counts what is selected alone.
    session.meshing_decimation_quadric_edge_collapse(
        targetfacenum=int(target) - kept,
        selected=kept > 0,
        qualitythr=quality,
        preserveboundary=True,
        preservenormal=True,
        preservetopology=True,
        planarquadric=True,
        autoclean=False,
    )
    vertices_left, left = _result(session)
    vertices_left *= unit
    source = session.current_mesh().vertex_scalar_array().astype(np.int64) - 1
    shared = np.flatnonzero(np.bincount(origin, minlength=len(vertices)) > 1)
    same = np.isin(source, shared)
    first = np.full(len(vertices), len(vertices_left))
    np.minimum.at(first, source[same], np.flatnonzero(same))
    target_of = np.where(same, first[source], np.arange(len(vertices_left)))
    left_kind = session.current_mesh().face_scalar_array().astype(np.int64)
    return *drop_unused_vertices(vertices_left, target_of[left]), np.where(left_kind < 0, -1 - left_kind, left_kind)


def _session(
    vertices: FloatArray, triangles: IntArray, mark: FloatArray | None = None, names: FloatArray | None = None
) -> "pymeshlab.MeshSet":
    """Return a MeshLab session that holds one mesh, with a scalar a face and one a vertex if given."""
    meshlab = _loaded()
    session = meshlab.MeshSet(verbose=False)
    scalars = {"f_scalar_array": mark, "v_scalar_array": names}
    more = {name: each for name, each in scalars.items() if each is not None}
    session.add_mesh(meshlab.Mesh(vertices, triangles.astype(np.int32), **more))
    return session


@cache
def _loaded() -> ModuleType:
    """Return pymeshlab, which few jobs need, once it is loaded: a tenth of a second.

    A thread of its own loads it and never ends: MeshLab's plugins share the `QThreadData` of the thread that loads
    them, and where that one has ended they free it before the last of them is done with it, as the process ends
    (malloc_consolidate, exit code 134, now and then).
    """
    loaded: Future[ModuleType] = Future()

    def load() -> None:
        try:
            loaded.set_result(importlib.import_module("pymeshlab"))
        except BaseException as cause:  # noqa: BLE001 - it is for whoever waits
            loaded.set_exception(cause)
        else:
            threading.Event().wait()

    threading.Thread(target=load, name="pymeshlab", daemon=True).start()
    return loaded.result()


def _result(session: "pymeshlab.MeshSet") -> tuple[FloatArray, IntArray]:
    """Return the vertices and triangles of the session's mesh."""
    mesh = session.current_mesh()
    return (
        np.array(mesh.vertex_matrix(), dtype=np.float64, order="C"),
        np.array(mesh.face_matrix(), dtype=np.int64, order="C"),
    )
