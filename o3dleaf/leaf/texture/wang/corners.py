"""The corners of a plane of Wang tiles: two colors, drawn by a hash, and the tile that four of them call for.

Tiles fit where their corners agree (Lagae and Dutré 2006): the neighbor across a corner too, which colored edges do
not see. A corner's color follows from its place and the seed alone, so that any window of the plane is what the whole
has there.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from o3dleaf.core.mesh_arrays import IntArray

KINDS = 16
"""Tiles of a set: all that two colors at four corners give."""

SIDE = 4
"""Tiles along a side of the torus."""

TORUS = np.array([[1, 0, 1, 1], [1, 0, 0, 0], [0, 0, 0, 1], [1, 1, 0, 1]])
"""Colors of the corners of a torus of 4 × 4 tiles on which each tile of the set lies once: a de Bruijn torus."""

CORNERS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""Corners of a tile, (along, across), in the order of the bits of its kind."""

Coloring: TypeAlias = Callable[[IntArray, IntArray], IntArray]
"""Takes numbers of corners along and across to their colors, 0 or 1."""


def torus_color(i: IntArray, j: IntArray) -> IntArray:
    """Return the colors of corners of the torus."""
    return np.asarray(TORUS[i % SIDE, j % SIDE])


def hashed(i: IntArray, j: IntArray, seed: int) -> IntArray:
    """Return a number of 63 bits for each corner, as good as random (the finalizer of SplitMix64, twice)."""
    with np.errstate(over="ignore"):
        first = _mixed(np.asarray(i, dtype=np.int64).view(np.uint64) + _mixed(np.array(seed, dtype=np.uint64)))
        both = _mixed(np.asarray(j, dtype=np.int64).view(np.uint64) + first)
    return (both >> np.uint64(1)).astype(np.int64)


def seeded(seed: int) -> Coloring:
    """Return the coloring of a seed: each color as often as the other, each corner of its own."""
    return lambda i, j: hashed(i, j, seed) >> 62


def kinds_of(color: Coloring, p: IntArray, q: IntArray) -> IntArray:
    """Return the tiles, 0 to 15, in places (p, q): a bit for the color of each corner, in the order of `CORNERS`."""
    kinds = np.zeros(np.shape(p), dtype=np.int64)
    for bit, (a, b) in enumerate(CORNERS):
        kinds += color(p + a, q + b) << bit
    return kinds


def corners_of(kind: int) -> dict[tuple[int, int], int]:
    """Return the colors of the corners of a tile."""
    return {corner: kind >> bit & 1 for bit, corner in enumerate(CORNERS)}


def _mixed(x: np.ndarray[tuple[int, ...], np.dtype[np.uint64]]) -> np.ndarray[tuple[int, ...], np.dtype[np.uint64]]:
    """Return numbers of 64 bits, stirred."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ (x >> np.uint64(31)))
