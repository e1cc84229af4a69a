"""Gaps among the triangles of a planar sample: by what they are enclosed in, by their area, and by their width."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation, components_of

CHANCE = 2.4
"""A gap of more than this many squares of the short side is one of the leaf: 24 cells of a random sample, the void of
16 cells that 100,000 points have by chance (n e^(−A) have A cells) and the triangles around it."""
FLAT = 1e-9
"""Area of a triangle over the square of its longest side, at least: flatter ones are as wide as can be."""
SLIT = 2.0
"""Length of a gap's banks over that of its mouth, from which on it is a slit: a half disc, a bite, has 1.6."""


def enclosed_by_chance(mesh: Triangulation, kept: BoolArray, size: FloatArray, short: float) -> BoolArray:
    """Return the gaps that the triangles kept enclose, where they are no larger than chance makes them."""
    cells = mesh.areas / size**2
    return small_gaps(mesh, ~kept & ~open_gaps(mesh, ~kept), cells, CHANCE * short**2)


def slits_of(mesh: Triangulation, kept: BoolArray, widest: float) -> BoolArray:
    """Return the triangles of gaps that are open to the outside, no wider than asked, and slits rather than bays."""
    slits = open_gaps(mesh, ~kept) & (_widths(mesh) <= widest)
    rows = np.flatnonzero(slits)
    if not len(rows):
        return slits
    labels = components_of(mesh.neighbors, slits)[rows]
    corners, others = mesh.points[mesh.triangles[rows]], mesh.neighbors[rows]
    sides = np.linalg.norm(np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1), axis=2)
    bank = np.append(kept, False)[others]
    mouth = ~bank & ~np.append(slits, False)[others]
    banks, mouths = (np.bincount(labels, (sides * each).sum(axis=1)) for each in (bank, mouth))
    slits[rows] = (banks >= SLIT * mouths)[labels]
    return slits


def _widths(mesh: Triangulation) -> FloatArray:
    """Return the diameters abc/2A of the empty circumcircles: how wide the gap is that a Delaunay triangle lies in."""
    corners = mesh.points[mesh.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return np.asarray(sides.prod(axis=1) / np.maximum(2 * mesh.areas, FLAT * sides.max(axis=1) ** 2))


def open_gaps(mesh: Triangulation, gaps: BoolArray) -> BoolArray:
    """Return those gaps that are open to the outside."""
    labels = components_of(mesh.neighbors, gaps)
    outside = np.zeros(labels.max() + 2, dtype=bool)
    outside[labels[gaps & (mesh.neighbors < 0).any(axis=1)]] = True
    return gaps & outside[labels]


def small_gaps(mesh: Triangulation, chosen: BoolArray, cells: FloatArray, most: float) -> BoolArray:
    """Return those of the chosen triangles whose component has no more cells than chance explains."""
    if not chosen.any():
        return chosen
    labels = components_of(mesh.neighbors, chosen)
    sums = np.bincount(labels[chosen], cells[chosen])
    small: BoolArray = np.less_equal(sums[labels], most)
    return chosen & small
