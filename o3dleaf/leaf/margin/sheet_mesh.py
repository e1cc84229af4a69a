"""The plane inside a margin as triangles, cut along it: a lattice within, a band of triangles out to the curve."""

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.chords import Chords, chords_of
from o3dleaf.leaf.margin.sheet_band import triangulate_band

CLEARANCE = 0.5
"""Nodes of the lattice keep this many steps from the margin, so that no triangle between is a sliver."""
SAGITTA = 0.02
"""The margin strays from a chord by no more than this many steps: chords are halved until it holds."""
SHARE = 1e-3
"""The area of the triangles differs by no more than this share, however large the step."""
TRIES = 10
"""Times that chords are halved or lattice triangles given up where the band does not conform; two are usual.
At corners of a few degrees it need not end: then sides are kept as they are, with triangles that are not Delaunay."""


def triangulate(
    polygon: shapely.Polygon, spacing: float, region: npt.ArrayLike | None = None
) -> tuple[FloatArray, IntArray]:
    """Return the plane inside a polygon as triangles that end on it, equilateral in the lattice within.

    All vertices at the border lie on the polygon's curve, its corners among them, none farther apart than `spacing`.
    The curve strays from its chords by at most s, the least of `SAGITTA` · spacing and 1.5 `SHARE` of area over
    length. So the area differs from the polygon's by about ⅔ s times its length at most, a thousandth, however large
    the step, and as the square of the step where that is small. Euler's characteristic is that of the polygon.

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
    MemoryBudgetError
        If the spacing is so small that the triangles do not fit into memory.
    """
    step = require_positive(spacing, "spacing")
    area = polygon
    if region is not None:
        low, high = as_bounds(region, 2, "region")
        area = polygon.intersection(shapely.box(*low, *high))
    parts = [part for part in _polygons(area) if part.area > 0]
    if not parts:
        raise ReconstructionError("the region lies outside the margin; choose another region")
    with np.errstate(over="ignore", divide="ignore"):
        count = float(np.float64(sum(part.area for part in parts)) / (3**0.5 / 4) / step / step)
    what = f"spacing: about {in_words(count)} triangles"
    require_resources(measured.SHEET_TRIANGLE * count, what, "give a larger one", step=step)
    meshes = [_triangulated(part, step) for part in parts]
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes])
    triangles = [faces + start for (_, faces), start in zip(meshes, starts[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def _polygons(area: shapely.Geometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]


def _triangulated(part: shapely.Polygon, step: float) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of a polygon: lattice triangles well inside, and the band around them."""
    margin = _margin(part, step)
    nodes, core = _core(part, step)
    for left in reversed(range(TRIES)):
        border = border_of(core)
        rim = np.unique(border)
        points, rings = _stacked(margin)
        place = np.full(len(nodes) + 1, -1, dtype=np.int64)
        place[rim] = np.arange(len(rim))
        sides = np.concatenate([place[border[:, ::-1]], rings + len(rim)])
        band = triangulate_band(np.concatenate([nodes[rim], points]), sides, conform=not left)
        if not len(band.missing):
            break
        core = _without_pinches(core[~_has_side(core, border[band.missing[band.missing < len(border)]])])
        margin = _halved(margin, band.missing[band.missing >= len(border)] - len(border))
    inner = np.setdiff1d(core, rim)
    place[inner] = len(rim) + len(points) + np.arange(len(inner))
    vertices = np.concatenate([nodes[rim], points, nodes[inner]])
    return vertices, np.concatenate([band.triangles, place[core]])


def _margin(polygon: shapely.Polygon, step: float) -> list[Chords]:
    """Return the rings of a polygon as chords, finer ones where chords would cross."""
    polygon = shapely.orient_polygons(polygon)
    rings = [polygon.exterior, *polygon.interiors]
    sagitta = min(SAGITTA * step, 1.5 * SHARE * polygon.area / polygon.length)
    for halving in range(20):
        margin = [chords_of(shapely.get_coordinates(ring)[:-1], step, sagitta / 2**halving) for ring in rings]
        chain = [chords.points for chords in margin]
        if shapely.Polygon(chain[0], chain[1:]).is_valid:
            return margin
    return [chords_of(shapely.get_coordinates(ring)[:-1], step, 0.0) for ring in rings]


def _stacked(margin: list[Chords]) -> tuple[FloatArray, IntArray]:
    """Return the points (k, 2) of all rings, and their sides (k, 2), each the number of two points."""
    counts = [len(chords.places) for chords in margin]
    starts = np.cumsum([0, *counts[:-1]])
    numbers = [start + np.arange(count) for start, count in zip(starts, counts, strict=True)]
    sides = [np.stack([number, np.roll(number, -1)], axis=1) for number in numbers]
    return np.concatenate([chords.points for chords in margin]), np.concatenate(sides)


def _halved(margin: list[Chords], sides: IntArray) -> list[Chords]:
    """Return the rings with the given sides, counted through all of them, cut in two."""
    starts = np.cumsum([0] + [len(chords.places) for chords in margin])
    return [
        chords.halved(sides[(sides >= start) & (sides < stop)] - start)
        for chords, start, stop in zip(margin, starts[:-1], starts[1:], strict=True)
    ]


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
    return corners, _without_pinches(triangles)


def _across(polygon: shapely.Polygon, nodes: FloatArray, triangles: IntArray, step: float) -> npt.NDArray[np.bool_]:
    """Return which triangles come near a hole or the outer ring though their corners keep clear of it."""
    tree = shapely.STRtree(list(polygon.interiors))
    shapes = shapely.polygons(nodes[triangles])
    bad = np.zeros(len(triangles), dtype=bool)
    bad[tree.query(shapes, predicate="dwithin", distance=0.25 * step)[0]] = True
    return bad


def _without_pinches(triangles: IntArray) -> IntArray:
    """Return the triangles without those that meet others in a corner alone: every border vertex has one way on."""
    while len(triangles):
        border = border_of(triangles)
        pinched = np.flatnonzero(np.bincount(border[:, 0]) > 1)
        if not len(pinched):
            break
        at = np.zeros(int(triangles.max()) + 1, dtype=bool)
        at[pinched] = True
        triangles = triangles[~at[triangles].any(axis=1)]
    return triangles


def border_of(triangles: IntArray) -> IntArray:
    """Return the sides (b, 2) of counter-clockwise triangles that have none on their right."""
    if not len(triangles):
        return np.empty((0, 2), dtype=np.int64)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    keys = np.minimum(*sides.T) * (int(sides.max()) + 1) + np.maximum(*sides.T)
    order = np.argsort(keys)
    keys = keys[order]
    single = np.ones(len(keys), dtype=bool)
    same = keys[1:] == keys[:-1]
    single[1:] &= ~same
    single[:-1] &= ~same
    return np.asarray(sides[order[single]])


def _has_side(triangles: IntArray, sides: IntArray) -> npt.NDArray[np.bool_]:
    """Return which triangles have one of the directed sides (s, 2)."""
    wanted = {(int(a), int(b)) for a, b in sides}
    ends = np.unique(sides)
    near = np.flatnonzero(np.isin(triangles, ends).sum(axis=1) > 1)
    found = np.zeros(len(triangles), dtype=bool)
    for number in near:
        a, b, c = (int(corner) for corner in triangles[number])
        found[number] = bool(wanted & {(a, b), (b, c), (c, a)})
    return found
