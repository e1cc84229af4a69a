"""How a stalk is joined to what it would be cut from: a petiole is across one section of it."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.stalk.junction import Junction
from o3dleaf.leaf.chart.stalk.point_ways import PointWays

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
    """

    width: float
    most: float

    def why_kept(self) -> str | None:
        """Return why this is no petiole's joint, or None if it may be."""
        if self.width <= self.most:
            return None
        return f"it is joined to the rest over {tell_length(self.width)}, as a leaf is to ground that it lies over"


def attachment_of(ways: PointWays, stalk: BoolArray, junction: Junction) -> Attachment:
    """Return how the `stalk` (n,) among the points of the ways is joined to the others."""
    most = MAX_WIDTH * (junction.width + float(np.sqrt(np.median(ways.cells))))
    joint = ways.points[stalk & ways.beside(~stalk)]
    if not len(joint):
        return Attachment(0.0, most)
    off = joint - np.median(joint, axis=0)
    off -= np.outer(off @ junction.along, junction.along)
    return Attachment(2 * float(np.median(np.linalg.norm(off, axis=1))), most)
