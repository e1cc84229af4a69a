"""Leaves that rest on one another: told apart by what lies over what, and parted where they touch."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.layers.widths import CLEAN, MEETING, MOSTLY, OFF, STEEP, WIDEST
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, nearest_layers
from o3dleaf.leaf.sheet.pieces.fragment import is_fragment
from o3dleaf.leaf.sheet.pieces.leaf_pair import LeafPair
from o3dleaf.leaf.sheet.pieces.minimum_cut import Links, minimum_cut
from o3dleaf.leaf.sheet.pieces.nearer_surface import tell_by_surface
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

REACH = 2 * WIDEST
"""Distance in spacings up to which one point is seen to lie over another: passes of one sheet end at half of it."""
RISING = 0.1
"""Share of these places from which on the upper one lies farther off than passes do: what rests on a leaf rises from
it, where passes keep their distance."""
FEWEST = 24
"""Points above, and below, from which on they are no stragglers."""
NARROW = 0.5
"""Length of the line along which two leaves that touch are parted, over the square root of the lesser one's area, at
most, as of necks: where it is longer nothing shows which points are whose."""
SIDES = 0.9
"""Share of the points that lie over or under others from which on these may be the two sides of one leaf."""
MIN_SHARE = 0.1
"""Share of the points of both that a leaf has at least, as in `find_necks`."""


class Resting(NamedTuple):
    """What rests on a leaf: another one, or a fragment of one, too small for a leaf, by the rows (k,) of its points."""

    pair: LeafPair | None = None
    fragment: IntArray = np.empty(0, np.int64)


class _TwoLeaves(NamedTuple):
    """Points of the upper leaf (n,), of the lower (n,), spacings that they touch along at least, and unsure ones."""

    above: BoolArray
    below: BoolArray
    length: float
    unsure: int = 0

    @property
    def lesser(self) -> int:
        """Points of the lesser leaf."""
        return int(min(self.above.sum(), self.below.sum()))

    @property
    def is_narrow(self) -> bool:
        """Whether the leaves touch along so little that they are told apart."""
        return self.length <= NARROW * float(np.sqrt(self.lesser))

    @property
    def is_shred(self) -> bool:
        """Whether the lesser one is too small for a leaf."""
        return self.lesser < MIN_SHARE * int(np.count_nonzero(self.above | self.below))


def find_resting(points: FloatArray, noise: float, sheets: OpenSheets, rows: IntArray) -> Resting:
    """Return the points of two leaves that lie on one another, one of them with the largest sheet, or of a fragment.

    A point that lies over another one, along the normal and facing its way, is of the upper leaf, and that one of the
    lower: a margin that runs over a face, or two faces. All others go with those that they are linked to along their
    planes, by a minimum cut: the leaves are parted across where they touch by least. Where both are seen one over the
    other there, points go to the surface that they are nearer to.

    Parameters
    ----------
    points : (n, 3) ndarray
        As scanned.
    noise : float
    sheets : OpenSheets
        Of the points averaged for their noise, and no more.
    rows : (n,) ndarray of int
        Of the points, in the scan.
    """
    normals, spacing = _facing(sheets), sheets.spacing
    upper, lower, heights = _one_over_another(sheets.points, normals, REACH * spacing, OFF * spacing)
    if min(upper.sum(), lower.sum()) < FEWEST or np.mean(heights > WIDEST * spacing) < RISING:
        return Resting()
    links = Links.of(sheets.points, normals, spacing)
    parted = _TwoLeaves(*minimum_cut(links, upper, lower))
    if parted.length > 0 and not (parted.is_narrow and parted.is_shred):
        free = np.flatnonzero(~(upper | lower))
        told = tell_by_surface(points, normals, parted.above, free, spacing, max(noise, CLEAN * spacing))
        if told is not None:
            one, other = upper.copy(), lower.copy()
            one[told.rows], other[told.rows] = told.first, ~told.first
            again = _TwoLeaves(*minimum_cut(links, one, other), told.unsure)
            parted = min(parted, again, key=lambda each: (each.is_shred, each.length))
    side = parted.above.astype(np.int64) - parted.below
    piece = links.kept(side[links.one] == side[links.other]).groups(len(side))
    if side[np.argmax(np.bincount(piece)[piece])] == 0:
        return Resting()
    if parted.is_shred:
        lesser = min(parted.above, parted.below, key=np.count_nonzero)
        of_other = is_fragment(points, noise, links, lesser, upper | lower, spacing)
        return Resting(fragment=np.flatnonzero(lesser)) if of_other else Resting()
    share = float((upper | lower).mean())
    at = tell_middle(points[upper | lower], points)
    said = f"two leaves, or parts of one, lie on one another around {at}, {100 * share:.3g} % of the points"
    if share > SIDES:
        apart = float(np.median(heights))
        said += (
            f", {tell_length(apart)} apart, as both sides of a leaf are (for one blade between them, thin the scan "
            f"until its points are {tell_length(apart / MEETING)} apart)"
        )
    if not parted.is_narrow:
        return Resting(LeafPair((), said, parted.length))
    if parted.length > 0:
        said += f", and touch along at least {tell_length(parted.length * spacing)}"
    if parted.unsure:
        said += f" ({100 * parted.unsure / len(points):.3g} % of the points within the noise of both)"
    return Resting(LeafPair((rows[parted.above], rows[parted.below]), said, parted.length))


def _facing(sheets: OpenSheets) -> FloatArray:
    """Return the normals (n, 3) of the points to the side of the largest sheet near them."""
    vertices, triangles = sheets.sheet()
    side = vertex_normals(vertices, triangles)[query(cKDTree(vertices), sheets.points)[1]]
    return np.where(np.einsum("ij,ij->i", sheets.normals, side)[:, np.newaxis] < 0, -sheets.normals, sheets.normals)


def _one_over_another(
    points: FloatArray, normals: FloatArray, reach: float, least: float
) -> tuple[BoolArray, BoolArray, FloatArray]:
    """Return which points (n,) lie over another one and under none, and the reverse, and the heights (k,) of these."""
    layers = nearest_layers(points, normals, reach, STEEP)
    of_layer = (layers.facing >= MOSTLY) & (layers.distance >= least)
    distance = np.where(of_layer, layers.distance, np.inf)
    under, over = np.isfinite(distance).T
    upper, lower = over & ~under, under & ~over
    return upper, lower, np.concatenate([distance[upper, 1], distance[lower, 0]])
