"""Where data are too few for the surface made of them: handles and breaks within a few points, and points without it.

By Gauss and Bonnet what a surface bends, its curvature summed over it, is 2π (V − E + F): each handle, be it a hole
through a sheet or a bridge between two, has −4π, and the two tips that a part torn in two ends in have +4π. Where the
sampling resolves a shape that is spread over many points; within the neighborhood of one it is there by chance. Around
a handle that is so because no points lie on it, and each end of a bridge, which may be long, has half of its −4π.
"""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.places import tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.measure_loops import sum_angles
from o3dleaf.surface.reconstruction.proximity import nearest_data

NEIGHBORS = 16
"""Points of a neighborhood, as wherever a cloud's planes are fitted."""

BROKEN = 3 * np.pi
"""Curvature of a neighborhood that no part of a shape has: one tip has 2π, two that were one part have 4π."""

JOINED = -1.5 * np.pi
"""Curvature without data, of a neighborhood on either side, up to which it is a handle's: an end of a bridge that is
all without has −2π, a handle with data a fifth of −4π."""

BARE = 0.7
"""Spacings from the nearest point beyond which a surface is without data: of random points a fifth of it is."""

NOISE = 3.0
"""Standard deviations of the data off the surface that do not count."""


def find_unresolved(vertices: FloatArray, triangles: IntArray, data: OrientedCloud) -> FloatArray:
    """Return (n,) the curvature of the surface around each point where it is that of a handle or a break, 0 elsewhere.

    That is the sum over the vertices that are nearest to the point or to one of its neighbors: to fifteen for breaks,
    and for handles, which have two sheets, to 31, without the vertices near data.

    Parameters
    ----------
    vertices, triangles : (m, 3), (k, 3) ndarrays
    data : OrientedCloud
        The n points that the surface was made of.
    """
    distance, nearest = nearest_data(data, vertices)
    deficit = angle_deficits(vertices, triangles)
    bare = distance > BARE * data.point_spacing[nearest]
    broken = _sum_around(data, nearest, deficit, NEIGHBORS, BROKEN)
    joined = _sum_around(data, nearest, np.where(bare, deficit, 0.0), 2 * NEIGHBORS, JOINED)
    return np.where(joined != 0, joined, broken)


def _sum_around(data: OrientedCloud, nearest: IntArray, values: FloatArray, count: int, least: float) -> FloatArray:
    """Return (n,) the sums of values at vertices, by their nearest points, over so many of these around each one.

    They are 0 where they do not reach `least`, which has the sign that is asked for.
    """
    own = np.asarray(np.bincount(nearest, values, len(data)), dtype=np.float64)
    total = np.zeros(len(data))
    near = np.arange(1, min(count, len(data)) + 1)
    # A sum as large has a part of it in one of its terms, and the points that sum it are near that one.
    seeds = np.flatnonzero(own / least >= 1 / count)
    if len(seeds):
        rows = np.unique(query(data.tree, data.points[seeds], near)[1])
        total[rows] = own[query(data.tree, data.points[rows], near)[1]].sum(axis=1)
    return np.where(total / least >= 1, total, 0.0)


def angle_deficits(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return (m,) 2π less the angles of the triangles at each vertex; 0 on a rim, where that is no curvature."""
    angles, turn = np.zeros(len(vertices)), np.zeros(len(vertices), dtype=np.int64)
    sum_angles(vertices, triangles, angles, turn)
    inside = (turn == 0) & (angles > 0)
    return np.where(inside, 2 * np.pi - angles, 0.0)


def find_lost(vertices: FloatArray, triangles: IntArray, data: OrientedCloud) -> BoolArray:
    """Return which points (n,) are left without surface, with most of those around them.

    It has none where no triangle is within its spacing or three standard deviations of the noise.

    Parameters
    ----------
    vertices, triangles : (m, 3), (k, 3) ndarrays
    data : OrientedCloud
    """
    reach = np.maximum(data.point_spacing, NOISE * data.noise if data.is_measurable else 0.0)
    distance, nearest = nearest_data(data, vertices)
    lost = np.ones(len(data), dtype=bool)
    lost[nearest[distance <= reach[nearest]]] = False
    rows = np.flatnonzero(lost)  # that no vertex is nearest to, as chance has it
    tree = cKDTree(vertices, balanced_tree=False, compact_nodes=False)
    rows = rows[query(tree, data.points[rows])[0] > reach[rows]]
    if len(rows):  # of which a triangle may be nearer: its edges may be longer than the spacing
        rows = rows[distance_to_mesh(vertices, triangles, data.points[rows]) > reach[rows]]
    lost[:] = False
    lost[rows] = True
    around = query(data.tree, data.points[rows], np.arange(1, min(NEIGHBORS, len(data)) + 1))[1]
    lost[rows] = lost[around].mean(axis=1) > 0.5
    return lost


def doubts(vertices: FloatArray, triangles: IntArray, data: OrientedCloud) -> list[str]:
    """Return what is to be said of a surface where its data are too few, one line a reason, with number and place.

    Parameters
    ----------
    vertices, triangles : (m, 3), (k, 3) ndarrays
    data : OrientedCloud
        What the surface was made of.
    """
    said = []
    lost = np.flatnonzero(find_lost(vertices, triangles, data))
    if len(lost):
        place = tell_place(data.points[lost[0]], data.points)
        said.append(f"{len(lost):,} points in all have no surface within their spacing, one of them at {place}")
    curvature = np.abs(find_unresolved(vertices, triangles, data))
    count = int(np.count_nonzero(curvature))
    if count:
        place = tell_place(data.points[curvature.argmax()], data.points)
        said.append(
            f"the surface has a hole, a bridge or a break that too few points show, most of all at "
            f"{place} ({tell_count(count, 'point')} in all): parts may be joined or torn there"
        )
    return said
