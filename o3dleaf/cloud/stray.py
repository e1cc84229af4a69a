"""Points that belong to no surface: far from all others, alone or in small clusters."""

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray
from o3dleaf.cloud import parity
from o3dleaf.cloud.neighbours import Neighbourhoods, nearest_neighbours

NEIGHBOURS = 8
LINK = 6.0
"""Medians of the distance to the eighth neighbour that a gap within a scan may have; the gappy wheat leaf has 3."""
CLUSTER = 24
"""Fewer points than this are no piece of a surface: three times the neighbours that a plane is fitted to."""


def find_stray_points(points: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which of `points` (n, 3) are stray (n,).

    Points are linked to those of their eight nearest that are within 6 times the median distance of an eighth
    neighbour; pieces of fewer than 24 points are stray, however far apart, unless nothing larger is there.
    """
    return stray_among(nearest_neighbours(points, NEIGHBOURS + 1))


def stray_among(near: Neighbourhoods) -> npt.NDArray[np.bool_]:
    """Return which points are stray (n,), given their neighbourhoods."""
    distance, row = (np.ascontiguousarray(part[:, 1 : NEIGHBOURS + 1]) for part in near[:2])
    parent, sign = np.arange(len(row)), np.ones(len(row), np.int8)
    parity.join_near(row, distance, LINK * float(np.median(distance[:, -1])), parent, sign)
    parity.flatten(parent, sign)
    size = np.bincount(parent)
    return np.asarray(size[parent] < min(CLUSTER, size.max()), dtype=bool)
