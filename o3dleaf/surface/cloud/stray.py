"""Points that belong to no surface: alone, in small clusters, or a little off what is beside them."""

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import parity_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray, Neighbourhoods, nearest_neighbours

NEIGHBOURS = 8
LINK = 6.0
"""Medians of the distance to the eighth neighbour that a gap within a scan may have; the gappy wheat leaf has 3."""
LONELY = 2.5
"""Times that a point's eighth neighbour may be as far as its neighbours' eighth are in the median: of two million
random points three have 2.2 and none 2.5; four spacings off a surface it is 2.7."""
CLUSTER = 24
"""Fewer points than this are no piece of a surface: three times the neighbours that a plane is fitted to."""


def find_stray_points(points: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which of `points` (n, 3) are stray (n,).

    Points are linked to those of their eight nearest that are within 6 times the median distance of an eighth
    neighbour; pieces of fewer than 24 points are stray, however far apart, unless nothing larger is there. So are
    points whose eighth neighbour is 2.5 times as far as that of the neighbours themselves, as in Breunig et al.: some
    four spacings off a surface.

    References
    ----------
    Breunig, Kriegel, Ng and Sander (2000), LOF: identifying density-based local outliers, SIGMOD, 93-104.
    """
    return stray_among(nearest_neighbours(points, NEIGHBOURS + 1))


def stray_among(near: Neighbourhoods) -> npt.NDArray[np.bool_]:
    """Return which points are stray (n,), given their neighbourhoods."""
    distance = np.ascontiguousarray(near.distance[:, 1 : NEIGHBOURS + 1])
    row = np.ascontiguousarray(near.row[:, 1 : NEIGHBOURS + 1])
    parent, sign = np.arange(len(row)), np.ones(len(row), np.int8)
    parity_loops.join_near(row, distance, LINK * float(np.median(distance[:, -1])), parent, sign)
    parity_loops.flatten(parent, sign)
    size = np.bincount(parent)
    small = size[parent] < min(CLUSTER, size.max())
    return np.asarray(small | _are_lonely(distance[:, -1], row))


def _are_lonely(far: FloatArray, row: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have their eighth neighbour at `far` (n,) much farther than their neighbours (n, 8)."""
    lonely = np.empty(len(far), dtype=bool)

    def task(start: int, stop: int) -> None:
        lonely[start:stop] = far[start:stop] > LONELY * np.median(far[row[start:stop]], axis=1)

    run_blocks(task, len(far), BLOCK)
    return lonely
