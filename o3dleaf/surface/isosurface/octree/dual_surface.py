"""The dual of an octree: a polygon for each crossed edge, between the vertices of the loops that it belongs to.

Two leaves share one face at most, and each pair of edges joined there is one side of two polygons: what comes of closed
bands is closed and, as each loop has a vertex of its own, manifold. Where two pairs on one face join the same two
loops, their sides have a vertex each, halfway between the pair's crossings. A polygon of four is cut by a diagonal from
a least leaf, which meets the leaf across at that edge alone: no other polygon has the same diagonal.
"""

import numpy as np

from o3dleaf.core import journal, progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import DataWarning
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, drop_unused_vertices
from o3dleaf.core.places import tell_middle
from o3dleaf.surface.isosurface.crease_edges import MIN_COSINE
from o3dleaf.surface.isosurface.octree.loop_vertices import MIDDLE, LoopVertices, place_vertices
from o3dleaf.surface.isosurface.octree.octree_band import OctreeBand
from o3dleaf.surface.isosurface.octree.traced import TracedLoops
from o3dleaf.surface.mesh.clip import trim_to_manifold
from o3dleaf.surface.mesh.crossings import find_crossings

ROUNDS = 6
"""Times that polygons are cut: after each those vertices are moved whose triangles cross others."""

RINGS = 2
"""Rings of triangles around vertices that may cross theirs."""

SHARES = (1, 4, 1)
"""About how long tracing, placing and cutting polygons take."""


def draw_dual(
    band: OctreeBand, *, ends: bool, features: bool, exact: Field | None = None
) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles by the keys of leaves and edges, made manifold where the band `ends`.

    Vertices are placed on the field `exact`, where that of the band is rough; with `features` where tangent planes
    meet, in leaves where normals disagree.

    References
    ----------
    Ju, Losasso, Schaefer and Warren (2002), Dual contouring of Hermite data.
    Nielson (2004), Dual marching cubes: a vertex for each loop of a cell, not each cell.
    """
    tracing, placing, cutting = progress.split(*SHARES)
    with tracing:
        traced = band.traced()
    with placing:
        placed = place_vertices(band, traced, exact or band.field, features=features)
    with cutting:
        broken = (traced.edges.around < 0).any(axis=1)
        vertices, triangles = _draw(traced, placed, np.flatnonzero(~broken))
        if not ends or not broken.any():
            return drop_unused_vertices(vertices, triangles)
        suspect, rim = np.zeros(len(vertices), dtype=bool), traced.edges.around[broken]
        suspect[traced.incidences.loop[rim[rim >= 0]]] = True
        return trim_to_manifold(vertices, triangles, suspect)


def _draw(traced: TracedLoops, placed: LoopVertices, edges: IntArray) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of the polygons of some edges, vertices being moved where triangles cross.

    Duals have such where a field turns within a leaf (Ju and Udeshi 2006), most of all beside creases. What is left of
    them is told.
    """
    choice, (corners, fans, added) = placed.best(), _polygons(traced, len(placed.smooth), edges)
    looked_at = None
    for _ in range(ROUNDS):
        vertices = placed.at(choice)
        triangles = np.concatenate([_cut_by_diagonals(traced, vertices, corners), fans])
        whole = np.concatenate([vertices, added])
        crossing = _find_crossing(whole, triangles, looked_at)
        if not len(crossing):
            break
        looked_at = np.unique(triangles[crossing])
        back = looked_at[looked_at < len(choice)]
        back = back[choice[back] < MIDDLE]
        if not len(back):
            break
        choice[back] += 1
    if len(crossing):
        crossing = _find_crossing(whole, triangles, None)
        place = tell_middle(whole[triangles[crossing[0]]], whole)
        cause = f"{len(crossing):,} of {len(triangles):,} triangles cross others, as at {place}"
        journal.tell(f"{cause}: the field turns within a cell; clean_mesh(mesh, untangle=True) has none", DataWarning)
    return whole, triangles


def _find_crossing(vertices: FloatArray, triangles: IntArray, moved: IntArray | None) -> IntArray:
    """Return which triangles cross others: of those around vertices that have moved, if any there do, else of all."""
    if moved is not None:
        near = np.zeros(len(vertices), dtype=bool)
        near[moved] = True
        for _ in range(RINGS):
            around = np.flatnonzero(near[triangles].any(axis=1))
            near[triangles[around]] = True
        crossing = around[find_crossings(vertices, triangles[around])]
        if len(crossing):
            return crossing
    return np.flatnonzero(find_crossings(vertices, triangles))


def _polygons(traced: TracedLoops, count: int, edges: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return the corners (p, 4) of the polygons of edges all of whose leaves are there; those with doubled sides cut.

    Of these the triangles and the vertices, beyond `count`, that they add. A corner comes twice in a row where its leaf
    fills two quadrants.
    """
    forward, around = traced.edges.forward[edges], traced.edges.around[edges]
    around = np.where(forward[:, np.newaxis], around, around[:, ::-1])
    corners = traced.incidences.loop[around]
    doubled = _doubled(corners, count)
    fanned = doubled.any(axis=1)
    return corners[~fanned], *_fan(traced, edges[fanned], around[fanned], doubled[fanned], count)


def _doubled(corners: IntArray, count: int) -> BoolArray:
    """Return which sides (p, 4) of polygons, from each corner to the next, run between the same two loops twice."""
    following = np.roll(corners, -1, axis=1)
    side = np.minimum(corners, following) * np.int64(count) + np.maximum(corners, following)
    side[corners == following] = -1
    rising = np.sort(side[side >= 0])
    return np.isin(side, np.unique(rising[2:][rising[2:] == rising[:-2]]))


def _cut_by_diagonals(traced: TracedLoops, vertices: FloatArray, corners: IntArray) -> IntArray:
    """Return the triangles of polygons (p, 4), see `_polygons`, cut by a diagonal from a least leaf.

    That is the shorter one of those across which they hardly turn, else the one across which they turn less: where a
    vertex on a crease lies outside its leaf, the other one may leave a fold.
    """
    repeated = corners == np.roll(corners, -1, axis=1)
    three = repeated.any(axis=1)
    level = traced.leaves.levels[traced.leaf[corners]]
    least = level == level.min(axis=1, keepdims=True)
    wide = ~(least[:, :2] | least[:, 2:])
    length = np.linalg.norm(vertices[corners[:, 2:]] - vertices[corners[:, :2]], axis=2)
    bend = np.maximum(MIN_COSINE - _cosines(vertices[corners]), 0.0)
    length[wide], bend[wide] = np.inf, np.inf
    best = np.where(bend[:, 0] == bend[:, 1], length.argmin(axis=1), bend.argmin(axis=1))
    turn = np.where(three, repeated.argmax(axis=1), best)
    corners = np.take_along_axis(corners, (turn[:, np.newaxis] + np.arange(4)) % 4, axis=1)
    return np.concatenate([corners[:, [0, 2, 3]], corners[~three][:, :3]])


def _cosines(places: FloatArray) -> FloatArray:
    """Return the cosines (p, 2) of the angles by which polygons (p, 4, 3) turn across either diagonal."""
    side = np.roll(places, -1, axis=1) - places
    normal = np.cross(side, np.roll(side, -1, axis=1))  # of the triangles that end at corners 2, 3, 0 and 1
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), np.finfo(np.float64).tiny)
    return np.asarray((normal[:, :2] * normal[:, 2:]).sum(axis=2))


def _fan(
    traced: TracedLoops, edges: IntArray, around: IntArray, doubled: BoolArray, count: int
) -> tuple[IntArray, FloatArray]:
    """Return the triangles of polygons about the crossings of their edges, and these with vertices on doubled sides.

    `count` vertices are there before; incidences `around` edges and `doubled` sides are (p, 4).
    """
    places, many = traced.edges.places, len(traced.edges.places)
    before = np.empty(len(traced.edge), dtype=np.int64)
    before[traced.incidences.following] = np.arange(len(before))
    # Seen from outside a loop runs clockwise, and so the edge before lies on the face that the next corner shares.
    own, other = np.broadcast_to(edges[:, np.newaxis], around.shape)[doubled], traced.edge[before[around]][doubled]
    pairs, place = np.unique(np.minimum(own, other) * np.int64(many) + np.maximum(own, other), return_inverse=True)
    added = np.concatenate([places[edges], (places[pairs // many] + places[pairs % many]) / 2])
    corners = traced.incidences.loop[around]
    following, middle = np.roll(corners, -1, axis=1), np.broadcast_to(count + np.arange(len(edges)), (4, len(edges))).T
    split, plain = count + len(edges) + place, ~doubled & (corners != following)
    triangles = [
        np.column_stack([middle[plain], corners[plain], following[plain]]),
        np.column_stack([middle[doubled], corners[doubled], split]),
        np.column_stack([middle[doubled], split, following[doubled]]),
    ]
    return np.concatenate(triangles), added
