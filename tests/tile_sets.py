"""A set of tiles made by the colors of their corners, and the triangles of a mesh as bits."""

from functools import partial

import numpy as np

from o3dleaf.leaf.instancing.components import RIM
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.instancing.sets.tile_set import MatchingBorders, TileSet, split_torus
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.leaf.texture.wang.corners import KINDS, SIDE, TORUS, kinds_of, torus_color
from tile_fields import PERIOD

SHAPE = (24, 20, 31)
LATTICE = TileLattice((0.0, 0.0, -0.4), (PERIOD / 24, PERIOD / 20, 0.8 / 30), SHAPE)
WHOLE = TileLattice(LATTICE.origin, LATTICE.spacing, (SIDE * 24, SIDE * 20, 31))
BORDERS = MatchingBorders(SHAPE[:2], SHAPE[2], TORUS)


def laid(color, points):
    """A layer whose thickness and waves follow from the colors of corners, on borders from those of their ends."""
    share = points[:, :2] / PERIOD
    place = np.floor(share).astype(np.int64)
    u, v = (share - place).T
    tone = np.zeros(len(points))
    for a, b in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = (1 - abs(u - a)) ** 2 * (1 + 2 * abs(u - a)) * (1 - abs(v - b)) ** 2 * (1 + 2 * abs(v - b))
        tone += weight * color(place[:, 0] + a, place[:, 1] + b)
    middle = np.sin(np.pi * u) ** 2 * np.sin(np.pi * v) ** 2
    kind = kinds_of(color, *place.T)
    half = 0.1037 + 0.05 * tone + 0.03 * np.sin(2 * np.pi * u) * tone + 0.04 * middle * np.cos(kind + 5 * u + 3 * v)
    blade = half - np.abs(points[:, 2] - 0.02 * tone)
    # A pocket on each border along, of tiles on both sides of it.
    pocket = 0.06 - np.sqrt((PERIOD * (u - 0.5)) ** 2 + (PERIOD * np.minimum(v, 1 - v)) ** 2 + points[:, 2] ** 2)
    return np.minimum(blade, -pocket)


def torus_of(method=0, *, alike=BORDERS):
    return extract_tile(partial(laid, torus_color), WHOLE, method, sharpen=WHOLE.shape[:2], alike=alike)


def finer_torus(ratio):
    """The torus on a lattice of `ratio` times as many steps."""
    nx, ny, nz = SHAPE[0] * ratio, SHAPE[1] * ratio, (SHAPE[2] - 1) * ratio + 1
    lattice = TileLattice(WHOLE.origin, tuple(np.array(WHOLE.spacing) / ratio), (SIDE * nx, SIDE * ny, nz))
    alike = MatchingBorders((nx, ny), nz, TORUS)
    return extract_tile(partial(laid, torus_color), lattice, sharpen=lattice.shape[:2], alike=alike)


def kind_of(color, place):
    return int(kinds_of(color, *(np.array(number) for number in place)))


def set_of(torus, color):
    """The tiles of a torus, laid by the colors of the plane's corners."""
    shape = tuple(count // SIDE for count in torus.lattice.shape[:2])
    parts = {kind_of(torus_color, place): part for place, part in split_torus(torus, shape).items()}
    return TileSet(tuple(parts[kind] for kind in range(KINDS)), partial(kind_of, color))


def facets(found, *, rim=True):
    """The triangles by the bits of their corners, each from its first corner in order."""
    chosen = found.triangles if rim else found.triangles[found.labels != RIM]
    corners = found.vertices[chosen].view(np.int64)
    first = np.lexsort(corners.transpose(2, 0, 1), axis=1)[:, 0]
    turned = np.take_along_axis(corners, (first[:, np.newaxis, np.newaxis] + np.arange(3)[:, np.newaxis]) % 3, axis=1)
    return {row.tobytes() for row in turned.reshape(-1, 9)}
