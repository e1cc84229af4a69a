"""How far each place of a mesh is from the data that hold it, along the mesh: another sheet's data do not count."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_normals
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, MeshLike, build_mesh, require_triangles
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.mesh.adjacency_loops import list_ends
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.reconstruction.proximity import Data, nearest_of
from o3dleaf.surface.reconstruction.vertex_support_loops import find_feet, spread_lines

CHOICE = 16
"""Nearest points among which the one is sought that holds a vertex."""

HOLD = 1.0
"""Spacings within which data hold a vertex by themselves; to others the way is measured along the mesh."""

FACING = -0.3
"""Least cosine between the normals of a vertex and of data that hold it: 0 on the rim of a thin sheet, −1 where a
surface has turned over and runs back between sheets that both face the other way."""

SAMPLED = 20_000
"""Triangles whose edges tell how fine a mesh is."""

BLOCK = 1 << 14


class Surroundings(NamedTuple):
    """The vertices beside each vertex of a mesh: those of v are around[begin[v] : begin[v + 1]]."""

    begin: IntArray
    around: IntArray

    @classmethod
    def of(cls, triangles: IntArray, count: int) -> "Surroundings":
        """Return those of `count` vertices."""
        ends = EdgeTable.of(triangles).ends.astype(np.int64)
        begin, at_vertex = np.zeros(count + 1, dtype=np.int64), np.empty(ends.size, dtype=np.int64)
        list_ends(ends, begin, at_vertex)
        owner = np.repeat(np.arange(count), np.diff(begin))
        return cls(begin, ends[at_vertex].sum(axis=1) - owner)


def are_turned(normals: FloatArray, data: Data, nearest: IntArray) -> BoolArray:
    """Return which normals (n, 3) of a surface turn away from those of the data nearest to them, rows (n,)."""
    if data.normals is None:
        return np.zeros(len(nearest), dtype=bool)
    turned: BoolArray = np.einsum("ij,ij->i", normals, data.normals[nearest]) < FACING
    return turned


def turned_over(mesh: MeshLike, points: CloudLike, normals: npt.ArrayLike, tree: cKDTree | None = None) -> BoolArray:
    """Return (n,) which vertices face away from all of the sixteen data nearest to them.

    There a surface runs back between two sheets that face the same way, which no field with an inside and an outside
    can join otherwise: a flap, or the fold between two scans of one sheet that do not fit together.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
    points : (m, 3) array_like or Open3D point cloud
        The data, in the mesh's unit.
    normals : (m, 3) array_like
        Theirs, outward.
    tree : scipy.spatial.cKDTree, optional
        Of the points, where there is one.

    Raises
    ------
    InputError
        If an argument cannot be meant.
    """
    vertices, triangles = require_triangles(mesh)
    sites = points_of(points, least=1)
    data = Data(sites, np.ones(len(sites)), cKDTree(sites) if tree is None else tree, as_normals(normals, sites))
    facing = vertex_normals(vertices, triangles)
    turned = are_turned(facing, data, nearest_of(data.tree, vertices)[1])
    turned[turned] = np.isinf(feet_of(vertices[turned], facing[turned], data, 0.0)[0])
    return turned


def vertex_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of the vertices."""
    mesh = build_mesh(vertices, triangles)
    mesh.compute_vertex_normals()
    return np.array(mesh.vertex_normals)


def feet_of(vertices: FloatArray, normals: FloatArray, data: Data, noise: float) -> tuple[FloatArray, FloatArray]:
    """Return distances (n,) of vertices (n, 3) from what holds them, infinite where nothing does, and its feet (n, 3).

    Of the sixteen nearest data those hold a vertex that face its way; along its normal `noise` does not count.
    """
    near = data.tree.query(vertices, np.arange(1, min(CHOICE, len(data.points)) + 1), workers=-1)[1]
    facing = np.zeros((1, 3)) if data.normals is None else data.normals
    far, feet = np.full(len(vertices), np.inf), np.zeros((len(vertices), 3))

    def task(start: int, stop: int) -> None:
        find_feet(start, stop, (vertices, normals), (data.points, facing, near), (noise, FACING), far, feet)

    run_blocks(task, len(vertices), BLOCK)
    return far, feet


class Surface(NamedTuple):
    """A mesh, its vertices' normals (n, 3), and their nearest data: distances and rows (n,)."""

    vertices: FloatArray
    triangles: IntArray
    normals: FloatArray
    far: FloatArray
    nearest: IntArray


def distance_along(surface: Surface, data: Data, noise: float, reach: float) -> FloatArray:
    """Return how far each vertex (n,) is from the data that hold it, in their spacings, `reach` at most.

    A vertex with data within a spacing, or an edge, that face its way is held by them. To the others feet are handed
    on from vertex to vertex, so that data of another sheet, however near, do not count.

    Parameters
    ----------
    surface : Surface
    data : Data
    noise : float
        Distance along the normals that does not count.
    reach : float
        Beyond as many spacings all are alike.
    """
    local = data.steps[surface.nearest]
    hold = np.maximum(HOLD * local, _edge_length(surface))
    far, feet = surface.far.copy(), data.points[surface.nearest]
    loose = are_turned(surface.normals, data, surface.nearest) | (far > hold)
    far[loose], feet[loose] = feet_of(surface.vertices[loose], surface.normals[loose], data, noise)
    far[far > hold] = np.inf
    # Feet are handed on where some vertex needs one.
    used, triangles = np.unique(surface.triangles[np.isinf(far)[surface.triangles].any(axis=1)], return_inverse=True)
    beside = Surroundings.of(triangles.reshape(-1, 3), len(used))
    distance = far[used]
    foot = np.where(np.isinf(distance), -1, np.arange(len(used)))
    points = np.repeat(feet[used, np.newaxis], 2, axis=1)
    spread_lines(surface.vertices[used], *beside, reach * local[used], points, foot, distance)
    far[used] = distance
    return np.minimum(far / local, reach)


def _edge_length(surface: Surface) -> float:
    """Return the median length of a mesh's edges."""
    one, other = surface.triangles[:: -(-len(surface.triangles) // SAMPLED), :2].T
    return float(np.median(np.linalg.norm(surface.vertices[other] - surface.vertices[one], axis=1)))
