"""The plane inside a margin as triangles, cut along it: a lattice within, a band of triangles out to the curve."""

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks import FloatArray, as_bounds, require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.fitting.rbf.tail import IntArray

CLEARANCE = 0.5
"""Nodes of the lattice keep this many steps from the margin, so that no triangle between is a sliver."""
SAGITTA = 0.02
"""The margin strays from a chord by no more than this many steps: chords are halved until it holds."""
CORNER = np.radians(30.0)
"""A vertex of the margin where it turns by more is kept as a vertex of the mesh."""


def triangulate(
    polygon: shapely.Polygon, spacing: float, region: npt.ArrayLike | None = None
) -> tuple[FloatArray, IntArray]:
    """Return the plane inside a polygon as triangles that end on it, equilateral in the lattice within.

    All vertices at the border lie on the polygon's curve, corners of more than `CORNER` among them, none farther
    apart than `spacing`, and the curve strays from its chords by at most s = `SAGITTA` · spacing. So the triangles'
    area differs from the polygon's by at most s times its length, however large the step, and not at all where the
    polygon's own sides are the chords. Euler's characteristic is that of the polygon.

    Parameters
    ----------
    polygon : shapely Polygon
        Valid, with its holes.
    spacing : float
        Side of the lattice's triangles.
    region : (2, 2) array-like, optional
        Lower and upper corner of a box: only what is inside it. The lattice is the same for all boxes.

    Returns
    -------
    vertices : (n, 2) ndarray
    triangles : (m, 3) int64 ndarray
        Counter-clockwise.

    Raises
    ------
    ReconstructionError
        If nothing is inside.
    """
    step = require_positive(spacing, "spacing")
    area = polygon
    if region is not None:
        low, high = as_bounds(region, 2, "region")
        area = polygon.intersection(shapely.box(*low, *high))
    parts = [part for part in _polygons(area) if part.area > 0]
    if not parts:
        raise ReconstructionError("the region lies outside the margin; choose another region")
    meshes = [_triangulated(_resampled(part, step), step) for part in parts]
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    triangles = [faces + start for (_, faces), start in zip(meshes, starts[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def _polygons(area: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]


def _resampled(polygon: shapely.Polygon, step: float) -> shapely.Polygon:
    """Return the polygon with chords of at most a step; a finer one where chords would cross."""
    for halving in range(20):
        rings = [_chords(ring, step / 2**halving) for ring in (polygon.exterior, *polygon.interiors)]
        resampled = shapely.Polygon(rings[0], rings[1:])
        if resampled.is_valid and resampled.area > 0:
            return shapely.orient_polygons(resampled)
    return shapely.orient_polygons(polygon)


def _chords(ring: shapely.LinearRing, step: float) -> FloatArray:
    """Return places (k, 2) on a ring: its corners, and between them arcs cut to a step, halved where they bulge."""
    points = shapely.get_coordinates(ring)[:-1]
    sides = np.roll(points, -1, axis=0) - points
    lengths = np.hypot(*sides.T)
    points, sides, lengths = points[lengths > 0], sides[lengths > 0], lengths[lengths > 0]
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.abs(np.angle(np.exp(1j * (angle - np.roll(angle, 1)))))
    corners = np.flatnonzero(turn > CORNER)
    first = int(corners[0]) if len(corners) else 0
    points, lengths = np.roll(points, -first, axis=0), np.roll(lengths, -first)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    closed = np.vstack([points, points[:1]])
    stops = np.concatenate([along[corners - first], along[-1:]]) if len(corners) else along[-1] * np.arange(4) / 3
    stops = np.unique(np.concatenate([[0.0], stops]))
    cuts = [
        np.linspace(start, stop, max(1, int(np.ceil((stop - start) / step * (1 - 1e-12)))), endpoint=False)
        for start, stop in zip(stops[:-1], stops[1:], strict=True)
    ]
    places = np.concatenate(cuts)
    for _ in range(12):
        bulging = _sagittas(closed, along, places) > SAGITTA * step
        if not bulging.any():
            break
        ends = np.append(places[1:], along[-1])
        places = np.sort(np.concatenate([places, (places[bulging] + ends[bulging]) / 2]))
    return _at(closed, along, places)


def _at(closed: FloatArray, along: FloatArray, places: FloatArray) -> FloatArray:
    return np.stack([np.interp(places, along, column) for column in closed.T], axis=1)


def _sagittas(closed: FloatArray, along: FloatArray, places: FloatArray) -> FloatArray:
    """Return how far (k,) the ring strays from the chord that begins at each place."""
    chord = np.searchsorted(places, along[:-1], side="right") - 1
    ends = np.append(places[1:], along[-1])
    start, stop = _at(closed, along, places), _at(closed, along, ends)
    direction = stop - start
    direction /= np.maximum(np.hypot(*direction.T), 1e-300)[:, None]
    away = closed[:-1] - start[chord]
    distance = np.abs(away[:, 0] * direction[chord, 1] - away[:, 1] * direction[chord, 0])
    sagittas = np.zeros(len(places))
    np.maximum.at(sagittas, chord, distance)
    return sagittas


def _triangulated(polygon: shapely.Polygon, step: float) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of a polygon: lattice triangles well inside, the band around them by its corners."""
    nodes, core = _core(polygon, step)
    band: shapely.Geometry = polygon
    if len(core):
        rings = _boundary_rings(core)
        band = polygon.difference(_area_of(nodes, rings))
    corners = shapely.get_coordinates(shapely.get_parts(shapely.constrained_delaunay_triangles(band)))
    corners = corners.reshape(-1, 4, 2)[:, :3].reshape(-1, 2)
    used = np.unique(core)
    both = np.concatenate([nodes[used], corners])
    vertices, number = np.unique(both, axis=0, return_inverse=True)
    place = np.full(len(nodes), -1, dtype=np.int64)
    place[used] = number[: len(used)]
    faces = np.concatenate([place[core], number[len(used) :].reshape(-1, 3)]).astype(np.int64)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces[twice < 0] = faces[twice < 0][:, [0, 2, 1]]
    return vertices, faces


def _core(polygon: shapely.Polygon, step: float) -> tuple[FloatArray, IntArray]:
    """Return lattice nodes, and the lattice triangles whose corners keep clear of the polygon's border."""
    u_low, v_low, u_high, v_high = polygon.bounds
    height = step * np.sqrt(3) / 2
    rows = np.arange(np.floor(v_low / height), np.ceil(v_high / height) + 1).astype(np.int64)
    columns = np.arange(np.floor(u_low / step) - 1, np.ceil(u_high / step) + 1).astype(np.int64)
    odd = (rows % 2)[:, None]
    u = (columns[None, :] + 0.5 * odd) * step
    v = np.broadcast_to((rows * height)[:, None], u.shape)
    shrunk = polygon.buffer(-CLEARANCE * step)
    shapely.prepare(shrunk)
    inside = shapely.contains_xy(shrunk, u, v)
    index = np.arange(u.size).reshape(u.shape)
    low, high = index[:-1], index[1:]
    even = np.broadcast_to(odd[:-1] == 0, (len(rows) - 1, len(columns) - 1))
    a, b, c, d = low[:, :-1], low[:, 1:], high[:, :-1], high[:, 1:]
    first = np.where(even[..., None], np.stack([a, b, c], -1), np.stack([a, b, d], -1)).reshape(-1, 3)
    second = np.where(even[..., None], np.stack([b, d, c], -1), np.stack([a, d, c], -1)).reshape(-1, 3)
    triangles = np.concatenate([first, second])
    triangles = triangles[inside.ravel()[triangles].all(axis=1)]
    # A lattice triangle may lie across a hole that is smaller than it.
    corners = np.stack([u.ravel(), v.ravel()], axis=1)
    if polygon.interiors:
        triangles = triangles[~_across(polygon, corners, triangles, step)]
    return corners, _without_pinches(triangles, u.size)


def _across(polygon: shapely.Polygon, nodes: FloatArray, triangles: IntArray, step: float) -> npt.NDArray[np.bool_]:
    """Return which triangles come near a hole or the outer ring though their corners keep clear of it."""
    tree = shapely.STRtree(list(polygon.interiors))
    shapes = shapely.polygons(nodes[triangles])
    bad = np.zeros(len(triangles), dtype=bool)
    bad[tree.query(shapes, predicate="dwithin", distance=0.25 * step)[0]] = True
    return bad


def _without_pinches(triangles: IntArray, count: int) -> IntArray:
    """Return the triangles without those that meet others in a corner alone: every border vertex has one way on."""
    while len(triangles):
        sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        keys, back = sides[:, 0] * count + sides[:, 1], sides[:, 1] * count + sides[:, 0]
        border = sides[~np.isin(keys, back)]
        pinched = np.flatnonzero(np.bincount(border[:, 0], minlength=count) > 1)
        if not len(pinched):
            break
        triangles = triangles[~np.isin(triangles, pinched).any(axis=1)]
    return triangles


def _boundary_rings(triangles: IntArray) -> list[IntArray]:
    """Return the closed border of counter-clockwise triangles without pinches, as rings of vertices."""
    count = int(triangles.max()) + 1
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    border = sides[~np.isin(sides[:, 0] * count + sides[:, 1], sides[:, 1] * count + sides[:, 0])]
    following = dict(zip(border[:, 0].tolist(), border[:, 1].tolist(), strict=True))
    rings = []
    while following:
        start, to = following.popitem()
        ring = [start]
        while to != start:
            ring.append(to)
            to = following.pop(to)
        rings.append(np.array(ring, dtype=np.int64))
    return rings


def _area_of(nodes: FloatArray, rings: list[IntArray]) -> shapely.Geometry:
    """Return the area inside rings: counter-clockwise ones are outer, clockwise ones holes."""
    lines = [shapely.LinearRing(nodes[ring]) for ring in rings]
    outer = shapely.union_all([shapely.Polygon(line) for line in lines if line.is_ccw])
    holes = [shapely.Polygon(line) for line in lines if not line.is_ccw]
    return outer.difference(shapely.union_all(holes)) if holes else outer
