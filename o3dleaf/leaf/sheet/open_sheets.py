"""A cloud at given widths of averaging made into open sheets, and what of it does not lie on the largest one."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, UniqueRows, drop_unused_vertices, triangle_areas
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.average import average_across, thin
from o3dleaf.leaf.sheet.gluing import glue_sheets
from o3dleaf.leaf.sheet.layer_loops import find_layers
from o3dleaf.leaf.sheet.stars import SLOPE, triangulate
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, label_triangles

PLANE = 1.25
"""Least width, in local spacings, that normals are found over: 2.5 spacings around a point some twenty others lie."""
APART = 0.5
"""Distance of vertices in spacings: nearer points only make thin triangles."""
APART_PER_WIDTH = 0.35
"""The same in widths of averaging, whatever the spacing: a surface averaged over a width has no finer shape."""
GAP = 3.0
"""Circumradius of triangles in spacings, as in `trim_to_data`: wider gaps are holes."""
BRIDGE = 6.5
"""The same of triangles that join pieces: `detect_outliers` takes what is 6 medians of the eighth neighbor's distance
away, ten spacings, for a part of the same scan."""
SPARSEST = 3.0
"""Times the median that the spacing may be locally: of stragglers it means nothing."""
BESIDE = 2.0
"""Spacings from a line where sheets branch within which planes are found of points from more than one of them."""
FLAT = float(np.sin(np.radians(25.0)))
"""Sine of the angle that neighbors may lie off the tangent planes beside such a line: less than half a right angle."""
TOUCH, ALONG = 0.5, 4
"""Share of the gap's radius within which a rim touches what is more than so many edges off along the sheet."""
BLOCK = 16
"""Cells of points that one thread looks above and below at a time."""
VOTES, SIZE = 0.1, 0.1
"""What a missing star, and a circumradius of the largest, count against a triangle, beside 1 - cos of its bends."""


@dataclass(frozen=True, eq=False)
class OpenSheets:
    """Sheets through an averaged cloud.

    Attributes
    ----------
    points, normals : (n, 3) ndarrays
        All points of the cloud, averaged, and the normals there, of either sign.
    vertices, triangles : (v, 3), (m, 3) ndarrays
        Manifold, oriented, of genus 0; vertices are some of the points, doubled along cuts.
    piece : (m,) ndarray
        Which sheet each triangle belongs to, the largest by area first.
    areas : (p,) ndarray
        Of the sheets.
    cut : (c, 3) ndarray
        Middles of edges along which sheets were cut, for they would have had handles.
    spacing : float
        Of the cloud as it was scanned.
    gap : float
        Circumradius up to which triangles were made everywhere: wider gaps are holes.
    """

    points: FloatArray
    normals: FloatArray
    vertices: FloatArray
    triangles: IntArray
    piece: IntArray
    areas: FloatArray
    cut: FloatArray
    spacing: float
    gap: float

    @classmethod
    def of(
        cls, points: FloatArray, width: FloatArray, spacing: float, branches: FloatArray | None = None
    ) -> "OpenSheets":
        """Average points (n, 3) across the surface over a width (n,) and triangulate them.

        Within two spacings of places (k, 3) where sheets branch planes are found of points from more than one of them,
        and no vertex is made; across, what lies flat is joined, and no wide gap.
        """
        sparse = _local_spacing(points)
        planes = PLANE * spacing / np.median(sparse) * sparse
        averaged, normals = average_across(points, width, PLANE * spacing, planes)
        rows = thin(averaged, np.maximum(APART * spacing, APART_PER_WIDTH * width))
        far = np.full(len(rows), np.inf) if branches is None else query(cKDTree(branches), averaged[rows])[0]
        rows, far = rows[far > BESIDE * spacing], far[far > BESIDE * spacing]
        vertices, upright = np.ascontiguousarray(averaged[rows]), np.ascontiguousarray(normals[rows])
        local = _local_spacing(vertices)
        slope = np.where(far < (BESIDE + BRIDGE) * spacing, FLAT, SLOPE)
        triangles, votes, radius = triangulate(vertices, upright, BRIDGE * local, slope)
        size = radius / (GAP * local[triangles].max(axis=1))
        across = (size > 1) & (slope[triangles] < SLOPE).any(axis=1)
        triangles, votes, size = triangles[~across], votes[~across], size[~across]
        kept = _within_gaps(triangles, size <= 1)
        triangles, votes, size = triangles[kept], votes[kept], size[kept]
        across = unit_normals(vertices, triangles)
        glued, source, cut = glue_sheets(triangles, across, VOTES * (3 - votes) + SIZE * size)
        middles = vertices[triangles.ravel()[cut]].mean(axis=1) if len(cut) else np.empty((0, 3))
        piece, areas = _rank(vertices[source], glued)
        return cls(
            averaged, normals, vertices[source], glued, piece, areas, middles, spacing, GAP * float(np.median(local))
        )

    def sheet(self, number: int = 0) -> tuple[FloatArray, IntArray]:
        """Return vertices and triangles of one sheet."""
        return drop_unused_vertices(self.vertices, self.triangles[self.piece == number])

    @cached_property
    def is_closed(self) -> bool:
        """Whether the largest sheet has no rim."""
        return not find_holes(*self.sheet()).is_rim.any()

    def rim(self) -> FloatArray:
        """Return the vertices (k, 3) on the rims of the largest sheet."""
        vertices, triangles = self.sheet()
        edges = EdgeTable.of(triangles)
        return np.asarray(vertices[np.unique(edges.ends[edges.count == 1])])

    def contacts(self) -> FloatArray:
        """Return the places (k, 3) where the rim of the largest sheet comes near parts that are far off along it.

        There sheets branch, for only two of them can be joined; or margins of the leaf touch.
        """
        vertices, triangles = self.sheet()
        edges = EdgeTable.of(triangles)
        rim = np.unique(edges.ends[edges.count == 1]).astype(np.int64)
        near = cKDTree(vertices[rim]).sparse_distance_matrix(cKDTree(vertices), TOUCH * self.gap, output_type="ndarray")
        count, ends = len(vertices), np.concatenate([edges.ends, edges.ends[:, ::-1]]).astype(np.int64)
        step = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(count, count)).tocsr()
        ring = (
            step[rim]
            + coo_array((np.ones(len(rim), bool), (np.arange(len(rim)), rim)), shape=(len(rim), count)).tocsr()
        )
        for _ in range(ALONG - 1):
            ring = ring + ring @ step
        i, j = np.asarray(near["i"], np.int64), np.asarray(near["j"], np.int64)
        apart = np.asarray(~ring.astype(bool).tocsr()[i, j]).ravel() if len(i) else np.zeros(0, bool)
        return np.asarray(vertices[np.unique(rim[i[apart]])])

    @cached_property
    def off(self) -> FloatArray:
        """Distances (n,) of the averaged points from the largest sheet."""
        return distance_to_mesh(*self.sheet(), self.points)


def _local_spacing(points: FloatArray) -> FloatArray:
    """Return the spacing (n,) around each of the points (n, 3), from the median to `SPARSEST` times that."""
    local = OrientedCloud.of(points).point_spacing
    return np.asarray(np.clip(local, np.median(local), SPARSEST * np.median(local)))


def unit_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m, 3) unit normals of triangles."""
    first, second, third = (vertices[triangles[:, corner]] for corner in range(3))
    across = np.cross(second - first, third - first)
    length: FloatArray = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across / np.where(length > 0, length, 1.0))


def _within_gaps(triangles: IntArray, small: BoolArray) -> BoolArray:
    """Return which triangles (m,) to keep: small ones, and patches of others that join pieces of these."""
    if small.all():
        return small
    edges = EdgeTable.of(triangles)
    inner = np.flatnonzero(edges.count == 2)
    first = edges.first(inner)
    one, other = edges.order[first] // 3, edges.order[first + 1] // 3
    rows = np.flatnonzero(small)
    of_small = np.full(len(triangles), -1)
    of_small[rows] = label_triangles(triangles[rows])
    rows = np.flatnonzero(~small)
    of_large = np.full(len(triangles), -1)
    of_large[rows] = label_triangles(triangles[rows])
    touching = np.concatenate([np.column_stack([one, other]), np.column_stack([other, one])])
    touching = touching[(of_large[touching[:, 0]] >= 0) & (of_small[touching[:, 1]] >= 0)]
    met = UniqueRows.of(np.column_stack([of_large[touching[:, 0]], of_small[touching[:, 1]]])).rows
    joins = np.bincount(met[:, 0], minlength=int(of_large.max()) + 1) > 1
    return np.asarray(small | (joins[of_large] & ~small))


def _rank(vertices: FloatArray, triangles: IntArray) -> tuple[IntArray, FloatArray]:
    """Return the sheet of each triangle (m,), the largest first, and their areas."""
    label = label_triangles(triangles)
    areas = np.bincount(label, triangle_areas(vertices, triangles))
    order = np.argsort(-areas, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank[label].astype(np.int64), np.asarray(areas[order], np.float64)


class Overlaps(NamedTuple):
    """What lies above and below vertices of a sheet: distances (v, 2), cosines of normals (v, 2), vertices (v, 2)."""

    distance: FloatArray
    facing: FloatArray
    row: IntArray


def nearest_layers(
    vertices: FloatArray, normals: FloatArray, reach: float, steep: float, rows: IntArray | None = None
) -> Overlaps:
    """Return the nearest vertex above and below each, or each of `rows`, with its distance and both normals' cosine.

    Above and below is what lies within acos(`steep`) of the normal; where there is nothing in `reach` the distance is
    infinite and the row -1.
    """
    cells = Cells.sort(vertices, reach)
    order = cells.order
    asked = np.ones(len(vertices), bool) if rows is None else np.isin(order, rows)
    sheet, lists = (vertices[order], normals[order]), (cells.number, cells.first, cells.last, cells.shape)
    distance, row = np.full((len(vertices), 2), np.inf), np.full((len(vertices), 2), -1)

    def task(start: int, stop: int) -> None:
        find_layers(*sheet, reach, steep, asked, order, *lists, start, stop, distance, row)

    run_blocks(task, len(cells.number), BLOCK)
    rows = np.arange(len(vertices)) if rows is None else rows
    distance, row = distance[rows], row[rows]
    facing = np.einsum("ia,ija->ij", normals[rows], normals[row])
    return Overlaps(distance, np.where(row >= 0, facing, 0.0), row)
