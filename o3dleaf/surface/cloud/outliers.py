"""Outliers of a cloud: single points, small clusters, and points a little off the surface beside them."""

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Limit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import parity_loops
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

NEIGHBORS = 8
MAX_GAP = 6.0
"""Medians of the distance to the eighth neighbor that a gap within a scan may have; the gappy wheat leaf has 3."""
MAX_RATIO = 2.5
"""Times that a point's eighth neighbor may be as far as its neighbors' eighth are in the median: of two million
random points three have 2.2 and none 2.5; four spacings off a surface it is 2.7."""
MIN_CLUSTER = 24
"""Fewer points than this are no piece of a surface: three times the neighbors that a plane is fitted to."""


@checked
def detect_outliers(
    cloud: CloudLike, *, max_gap: Limit = MAX_GAP, max_ratio: Limit = MAX_RATIO, std_ratio: Limit = np.inf
) -> npt.NDArray[np.bool_]:
    """Return which points of a cloud (n,) belong to no surface.

    Points are linked to those of their eight nearest that are within `max_gap` times the median distance of an eighth
    neighbor; clusters of fewer than 24 points are outliers, however far apart, unless nothing larger is there. So are
    points whose eighth neighbor is `max_ratio` times as far as that of the neighbors themselves, as in Breunig et al.:
    some four spacings off a surface. `std_ratio` adds Open3D's `remove_statistical_outlier`.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Without repeated points.
    max_gap : float
        Of a cloud in one piece, in medians of the distance to the eighth neighbor; infinite, no cluster is an outlier.
    max_ratio : float
        Of distances to the eighth neighbor; infinite where the density of a cloud jumps, as on the tip of a leaf.
    std_ratio : float
        Standard deviations above the mean that the mean distance to the eight nearest, the point itself among them,
        may have.

    Raises
    ------
    InputError
        If a coordinate is not finite, or beyond 1e±30.

    References
    ----------
    Breunig, Kriegel, Ng and Sander (2000), LOF: identifying density-based local outliers, SIGMOD, 93-104.
    """
    searching, linking = progress.split(3, 1)
    with searching:
        near = OrientedCloud.of(cloud).neighbors
    with linking:
        if near.distance.shape[1] < 2:  # a point alone has no neighbor
            return np.zeros(len(near.distance), dtype=bool)
        distance = np.ascontiguousarray(near.distance[:, 1 : NEIGHBORS + 1])
        row = np.ascontiguousarray(near.row[:, 1 : NEIGHBORS + 1])
        outlier = _in_small_clusters(distance, row, max_gap) | _are_isolated(distance[:, -1], row, max_ratio)
        if np.isfinite(std_ratio):
            mean = near.distance[:, :NEIGHBORS].mean(axis=1)
            outlier |= mean > mean.mean() + std_ratio * mean.std(ddof=1)
        return np.asarray(outlier)


def _in_small_clusters(distance: FloatArray, row: IndexArray, max_gap: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) few others are linked to, by the distances and rows (n, 8) of their neighbors."""
    parent, sign = np.arange(len(row)), np.ones(len(row), np.int8)
    parity_loops.join_near(row, distance, max_gap * float(np.median(distance[:, -1])), parent, sign)
    parity_loops.flatten(parent, sign)
    size = np.bincount(parent)
    return np.asarray(size[parent] < min(MIN_CLUSTER, size.max()))


def _are_isolated(far: FloatArray, row: IndexArray, max_ratio: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have their eighth neighbor at `far` (n,) much farther than their neighbors (n, 8)."""
    isolated = np.empty(len(far), dtype=bool)

    def task(start: int, stop: int) -> None:
        isolated[start:stop] = far[start:stop] > max_ratio * np.median(far[row[start:stop]], axis=1)

    run_blocks(task, len(far), BLOCK)
    return isolated
