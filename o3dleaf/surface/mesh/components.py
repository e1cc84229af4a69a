"""Edge-connected pieces of a mesh: the largest are kept, the others counted."""

from dataclasses import asdict, dataclass

import numpy as np
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, build_mesh, drop_unused_vertices, mesh_arrays, triangle_areas
from o3dleaf.surface.mesh.topology import EdgeTable, label_triangles


@dataclass(frozen=True)
class RemovedComponents:
    """Pieces that `largest_components` took away; areas in the square of the mesh's unit.

    Attributes
    ----------
    closed, open : int
        Number of pieces without a boundary (voids inside the blade, islands beside it) and with one
        (fragments cut off by the outline).
    closed_area, open_area : float
        Their total areas.
    largest_area : float
        Area of the largest piece removed.
    """

    closed: int
    closed_area: float
    open: int
    open_area: float
    largest_area: float

    def to_dict(self) -> dict[str, float]:
        """Return the figures as one flat dictionary."""
        return asdict(self)


def connected_components(mesh: MeshLike) -> tuple[IntArray, FloatArray]:
    """Return which edge-connected piece each triangle belongs to, the largest by area first.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)

    Returns
    -------
    labels : (m,) ndarray of int64
        0 for the triangles of the largest piece, 1 for the next, and so on.
    areas : (c,) ndarray of float64
        Area of each piece, falling, in the square of the mesh's unit.
    """
    vertices, triangles = mesh_arrays(mesh)
    return _ranked_components(triangles, triangle_areas(vertices, triangles), EdgeTable.of(triangles))


def _ranked_components(triangles: IntArray, area: FloatArray, edges: EdgeTable) -> tuple[IntArray, FloatArray]:
    """Return labels by falling area, and the areas; of equal pieces, the one seen first comes first."""
    labels = label_triangles(triangles, edges)
    areas = np.bincount(labels, weights=area).astype(np.float64)
    ranking = np.argsort(-areas, kind="stable")
    rank = np.empty(len(areas), dtype=np.int64)
    rank[ranking] = np.arange(len(areas))
    return rank[labels], areas[ranking]


def largest_components(mesh: MeshLike, count: int = 1) -> tuple[o3d.geometry.TriangleMesh, RemovedComponents]:
    """Return the `count` largest pieces of a mesh, by area, and the record of what was removed.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified; vertices in any unit.
    count : int
        Pieces to keep: 2 for the two faces of an open blade, 1 for a closed one.

    Raises
    ------
    InputError
        If `count` is below 1.
    """
    if count < 1:
        raise InputError(f"count: is {count}; keep 1 component or more")
    vertices, triangles = mesh_arrays(mesh)
    edges = EdgeTable.of(triangles)
    labels, areas = _ranked_components(triangles, triangle_areas(vertices, triangles), edges)
    is_open = np.zeros(len(areas), dtype=bool)
    is_open[labels[np.flatnonzero(edges.count[edges.of_half] == 1) // 3]] = True
    gone, gone_open = areas[count:], is_open[count:]
    removed = RemovedComponents(
        closed=int((~gone_open).sum()),
        closed_area=float(gone[~gone_open].sum()),
        open=int(gone_open.sum()),
        open_area=float(gone[gone_open].sum()),
        largest_area=float(gone.max(initial=0.0)),
    )
    return build_mesh(*drop_unused_vertices(vertices, triangles[labels < count])), removed
