"""Geodesic distance from each vertex of a mesh to the nearest data of its own sheet."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, MeshLike, build_mesh, require_triangles
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.adjacency_loops import list_ends
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.reconstruction.proximity import data_around, nearest_data
from o3dleaf.surface.reconstruction.vertex_support_loops import PointsWithNormals, find_closest, propagate_lines

NEAREST = 16
"""Nearest points among which the closest of a vertex's own sheet is sought."""

SUPPORTED = 1.0
"""Spacings within which data support a vertex by themselves; for others distances are measured along the mesh."""

FACING = -0.3
"""Least cosine between the normals of a vertex and of data of its sheet: 0 on the rim of a thin sheet, −1 where a
surface has turned over and runs back between sheets that both face the other way."""

SAMPLE_SIZE = 20_000
"""Triangles by whose edges the fineness of a mesh is measured."""

BLOCK = 1 << 14


class VertexNeighbors(NamedTuple):
    """The neighbors of each vertex of a mesh: those of v are neighbors[begin[v] : begin[v + 1]]."""

    begin: IntArray
    neighbors: IntArray

    @classmethod
    def of(cls, triangles: IntArray, count: int) -> "VertexNeighbors":
        """Return those of `count` vertices."""
        ends = EdgeTable.of(triangles).ends.astype(np.int64)
        begin, at_vertex = np.zeros(count + 1, dtype=np.int64), np.empty(ends.size, dtype=np.int64)
        list_ends(ends, begin, at_vertex)
        vertex = np.repeat(np.arange(count), np.diff(begin))
        return cls(begin, ends[at_vertex].sum(axis=1) - vertex)


def find_inverted_regions(mesh: MeshLike, cloud: CloudLike) -> BoolArray:
    """Return (n,) which vertices face away from all of the sixteen data points nearest to them.

    There a surface runs back between two sheets that face the same way, which no field with an inside and an outside
    can join otherwise: a flap, or the fold between two scans of one sheet that do not fit together.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        The data, with normals, in the mesh's unit.

    Raises
    ------
    InputError
        If an argument cannot be meant, or the cloud has no normals.
    """
    vertices, triangles = require_triangles(mesh)
    data = OrientedCloud.of(cloud)
    data.require_normals()
    normals = vertex_normals(vertices, triangles)
    inverted = face_away(normals, data, nearest_data(data, vertices)[1])
    inverted[inverted] = np.isinf(closest_points(vertices[inverted], normals[inverted], data, 0.0)[0])
    return inverted


def face_away(normals: FloatArray, data: OrientedCloud, nearest: IntArray) -> BoolArray:
    """Return which normals (n, 3) of a surface face away from those of the data nearest to them, rows (n,)."""
    if data.normals is None:
        return np.zeros(len(nearest), dtype=bool)
    away: BoolArray = np.einsum("ij,ij->i", normals, data.normals[nearest]) < FACING
    return away


def vertex_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of the vertices."""
    mesh = build_mesh(vertices, triangles)
    mesh.compute_vertex_normals()
    return np.array(mesh.vertex_normals)


def closest_points(
    vertices: FloatArray, normals: FloatArray, data: OrientedCloud, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Return distances (n,) of vertices (n, 3) from the closest data of their own sheet, and these places (n, 3).

    Of the sixteen nearest data those count that face a vertex's way; along its normal `noise` does not count. Where
    none is left the distance is infinite.
    """
    near = query(data.tree, vertices, np.arange(1, min(NEAREST, len(data)) + 1))[1]
    surface = PointsWithNormals(vertices, normals)
    sheet = PointsWithNormals(data.points, np.zeros((1, 3)) if data.normals is None else data.normals)
    distance, closest = np.full(len(vertices), np.inf), np.zeros((len(vertices), 3))

    def task(start: int, stop: int) -> None:
        find_closest(start, stop, surface, sheet, near, noise, FACING, distance, closest)

    run_blocks(task, len(vertices), BLOCK)
    return distance, closest


class MeshNearData(NamedTuple):
    """A mesh, its vertices' normals (n, 3), and the data around them (`data_around`): distances and rows (n,)."""

    vertices: FloatArray
    triangles: IntArray
    normals: FloatArray
    distance: FloatArray
    nearest: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, triangles: IntArray, data: OrientedCloud) -> "MeshNearData":
        """Find normals and nearest data."""
        return cls(vertices, triangles, vertex_normals(vertices, triangles), *data_around(data, vertices))

    @property
    def edge_length(self) -> float:
        """Median length of the edges."""
        one, other = self.triangles[:: -(-len(self.triangles) // SAMPLE_SIZE), :2].T
        return float(np.median(np.linalg.norm(self.vertices[other] - self.vertices[one], axis=1)))


def distance_along(mesh: MeshNearData, data: OrientedCloud, noise: float, reach: float) -> FloatArray:
    """Return the geodesic distance of each vertex (n,) from the data of its sheet, in spacings, `reach` at most.

    A vertex with data within a spacing, or an edge, that face its way is supported by them. To the others the closest
    points are propagated from vertex to vertex, so that data of another sheet, however near, do not count.

    Parameters
    ----------
    mesh : MeshNearData
    data : OrientedCloud
    noise : float
        Distance along the normals that does not count.
    reach : float
        Beyond as many spacings all are alike.
    """
    spacing = data.point_spacing[mesh.nearest]
    supported = np.maximum(SUPPORTED * spacing, mesh.edge_length)
    distance, closest = mesh.distance.copy(), data.points[mesh.nearest]
    loose = face_away(mesh.normals, data, mesh.nearest) | (distance > supported)
    distance[loose], closest[loose] = closest_points(mesh.vertices[loose], mesh.normals[loose], data, noise)
    distance[distance > supported] = np.inf
    # Closest points are propagated where some vertex has none.
    used, triangles = np.unique(mesh.triangles[np.isinf(distance)[mesh.triangles].any(axis=1)], return_inverse=True)
    neighbors = VertexNeighbors.of(triangles.reshape(-1, 3), len(used))
    far = distance[used]
    line = np.where(np.isinf(far), -1, np.arange(len(used)))
    ends = np.repeat(closest[used, np.newaxis], 2, axis=1)
    propagate_lines(mesh.vertices[used], *neighbors, reach * spacing[used], ends, line, far)
    distance[used] = far
    return np.minimum(distance / spacing, reach)
