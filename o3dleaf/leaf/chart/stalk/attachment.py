"""How a stalk is joined to what it would be cut from: across one section of it, at the margin of its blade."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.stalk.junction import Junction
from o3dleaf.leaf.chart.stalk.point_ways import PointWays
from o3dleaf.leaf.sheet.pieces.table import CELL, goes_around

MAX_WIDTH = 2.0
"""Of the joint, in widths of the stalk and a spacing, at most: 1 a tube, 1.5 one that flares."""


class Attachment(NamedTuple):
    """The joint of a stalk and the rest of what was scanned.

    Attributes
    ----------
    width : float
        Twice the median distance, across the stalk, of its points that are linked to others from their middle: a tube's
        diameter, half the width of a strip.
    most : float
        That width of a petiole, at most.
    is_inside : bool
        Whether the rest goes on around it, seen along the normal of its mean plane.
    """

    width: float
    most: float
    is_inside: bool

    def why_kept(self) -> str | None:
        """Return why this is no petiole's joint, or None if it may be: more so where something lies over ground."""
        if self.width > self.most:
            return f"it is joined to the rest over {tell_length(self.width)}, as a leaf is to ground that it lies over"
        return "the rest goes on all around it, as ground does around a leaf" if self.is_inside else None


def attachment_of(ways: PointWays, stalk: BoolArray, junction: Junction) -> Attachment:
    """Return how the `stalk` (n,) among the points of the ways is joined to the others."""
    spacing = float(np.sqrt(np.median(ways.cells)))
    joint = ways.points[stalk & ways.beside(~stalk)]
    most = MAX_WIDTH * (junction.width + spacing)
    if not len(joint):
        return Attachment(0.0, most, is_inside=False)
    off = joint - np.median(joint, axis=0)
    off -= np.outer(off @ junction.along, junction.along)
    width = 2 * float(np.median(np.linalg.norm(off, axis=1)))
    return Attachment(width, most, goes_around(*_seen(ways.points[~stalk], joint), CELL * spacing))


def _seen(rest: FloatArray, joint: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places (n, 2) and (k, 2) of points in the mean plane of the first ones (n, 3)."""
    middle = rest.mean(axis=0)
    plane = np.linalg.eigh(np.cov((rest - middle).T))[1][:, 1:]
    return (rest - middle) @ plane, (joint - middle) @ plane
