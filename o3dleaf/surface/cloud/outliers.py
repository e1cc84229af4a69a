"""Outliers of a cloud: single points, small clusters, points a little off the surface beside them, and clutter."""

from contextlib import ExitStack

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Limit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.places import extent, tell_middle, tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray, fit_planes, largest_group, linked
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

NEIGHBORS = 8
MAX_GAP = 6.0
"""Medians of the distance to the eighth neighbor that a gap within a scan may have; the gappy wheat leaf has 3."""
MAX_RATIO = 2.5
"""Times that a point's eighth neighbor may be as far as its neighbors' eighth are in the median: of two million
random points three have 2.2 and none 2.5; four spacings off a surface it is 2.7."""
MIN_CLUSTER = 24
"""Fewer points than this are no piece of a surface: three times the neighbors that a plane is fitted to."""
DENSE = 0.25
"""Quantile of the distance to the eighth neighbor that is the surface's: three points of four may be clutter."""
FILLED = ((16, 0.45), (48, 0.55))
"""Neighbors, and how thick over long they are at least where points fill space: the median over as many of them is
0.57 and 0.7 then, by chance below the bound at one of a hundred. Of a surface only the larger is wide enough to show
that a thin part, or a corner, is none."""
SHEET = (16, 0.25)
"""Places of a cloud thinned to its own spacing around a point, and how thick over long they are with it at most on a
surface: of random points in space one in 14,000 is below, of those as far above a plane as from the next ones 5 %."""


@checked
def detect_outliers(
    cloud: CloudLike,
    *,
    max_gap: Limit = MAX_GAP,
    max_ratio: Limit = MAX_RATIO,
    max_clutter: Limit = MAX_RATIO,
    std_ratio: Limit = np.inf,
) -> npt.NDArray[np.bool_]:
    """Return which points of a cloud (n,) belong to no surface.

    Points are linked to those within `max_gap` times the median distance of an eighth neighbor; clusters of fewer than
    24 points are outliers, however far apart, unless nothing larger is there. So are points whose eighth neighbor is
    `max_ratio` times as far as that of the neighbors themselves, as in Breunig et al.: four spacings off a surface or
    so.

    Of both, a surface that is sampled more sparsely stays, also beside a dense one. Linked by their own density, to
    those of their eight nearest that are within 2.5 times the nearer eighth neighbor's distance of the two (the graph
    of mutual neighbors of Brito et al., with a margin), its points are in clusters of 24 or more; and each lies in the
    plane of the cloud around it, thinned to its own spacing.

    Clutter is outliers, too: points as sparse as that beside the densest quarter of the cloud which, taken alone, fill
    space, being about as thick as wide and long around most of them at two scales; a sparse surface, wires and scan
    lines do not. `std_ratio` adds Open3D's `remove_statistical_outlier`.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Without repeated points.
    max_gap : float
        Of a cloud in one piece, in medians of the distance to the eighth neighbor; infinite, no cluster is an outlier.
    max_ratio : float
        Of distances to the eighth neighbor; infinite where the density of a cloud jumps, as on the tip of a leaf.
    max_clutter : float
        Of the distance to the eighth neighbor, over that in the densest quarter, where points fill space; infinite,
        such points stay.
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

    Brito, Chávez, Quiroz and Yukich (1997), Connectivity of the mutual k-nearest-neighbor graph in clustering and
    outlier detection, Statistics & Probability Letters 35, 33-42.
    """
    whole = OrientedCloud.of(cloud)
    outlier, rest = np.zeros(len(whole), dtype=bool), whole
    with ExitStack() as steps:
        while True:
            searching, linking = progress.split(3, 1)
            with searching:
                near = rest.neighbors
            steps.enter_context(linking)
            if near.distance.shape[1] < 2:  # a point alone has no neighbor
                return outlier
            clutter = _are_clutter(rest.points, near.distance[:, 1 : NEIGHBORS + 1][:, -1], max_clutter)
            if not clutter.any():
                break
            # What it linked, or was as sparse beside, is judged without it; of neighbors only the last ones are kept.
            outlier[~outlier] = clutter
            del near
            rest = rest.take(~clutter)
        outlier[~outlier] = _are_apart(rest, max_gap, max_ratio, std_ratio)
        return outlier


def _are_apart(cloud: OrientedCloud, max_gap: float, max_ratio: float, std_ratio: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) of a cloud without clutter are in small clusters, isolated, or far on the mean."""
    near = cloud.neighbors
    distance = np.ascontiguousarray(near.distance[:, 1 : NEIGHBORS + 1])
    row = np.ascontiguousarray(near.row[:, 1 : NEIGHBORS + 1])
    far = distance[:, -1]
    cluster = _clusters(cloud, distance, row, max_gap * float(np.median(far)))
    outlier = _are_small(cluster) | _are_isolated(far, row, max_ratio)
    outlier[outlier] = ~_are_sparse_sheets(cloud.points, distance, row, outlier)
    if np.isfinite(std_ratio):
        mean = near.distance[:, :NEIGHBORS].mean(axis=1)
        outlier |= mean > mean.mean() + std_ratio * mean.std(ddof=1)
    return np.asarray(outlier)


def tell_outliers(cloud: OrientedCloud, outlier: npt.NDArray[np.bool_]) -> str:
    """Return in words where the largest group of a cloud's outliers, a mask (n,), is, how many and how long.

    Outliers are linked to those of their eight nearest ones that are within `MAX_GAP` times the cloud's median distance
    of an eighth neighbor.
    """
    strays = np.ascontiguousarray(cloud.points[outlier])
    if len(strays) == 1:
        return f"the outlier is at {tell_place(strays[0], cloud.points)}"
    usual = float(np.median(cloud.neighbors.distance[:, : NEIGHBORS + 1][:, -1]))
    group = largest_group(strays, MAX_GAP * usual)
    if len(group) == 1:
        return f"the outliers are apart from one another, one of them at {tell_place(group[0], cloud.points)}"
    size, place = tell_length(extent(group)), tell_middle(group, cloud.points)
    return f"the largest group of outliers has {len(group):,} points, is {size} long, and at {place}"


def _clusters(cloud: OrientedCloud, distance: FloatArray, row: IndexArray, reach: float) -> IndexArray:
    """Return the cluster (n,) of each point, linked to those within a reach; neighbors `row` (n, 8) at `distance`.

    The eight nearest of a point on a scan line may all lie on that line. Of a line of fewer than 24 points, one of the
    24 nearest of the point that is closest to another line belongs to that one.
    """
    cluster = linked(distance, row, reach)
    small = np.flatnonzero(_are_small(cluster))
    if not len(small):
        return cluster
    count = min(MIN_CLUSTER, len(cloud) - 1)
    away, near = query(cloud.tree, cloud.points[small], k=np.arange(2, count + 2))
    one, other = cluster[np.repeat(small, count)], cluster[near.ravel()]
    joined = (away.ravel() <= reach) & (one != other)
    pairs = coo_array((joined[joined], (one[joined], other[joined])), (len(cluster), len(cluster)))
    return np.asarray(connected_components(pairs, directed=False)[1][cluster])


def _are_small(cluster: IndexArray) -> npt.NDArray[np.bool_]:
    """Return which points (n,) are in clusters of fewer than 24, unless there is none larger."""
    size = np.bincount(cluster)
    return np.asarray(size[cluster] < min(MIN_CLUSTER, size.max()))


def _are_isolated(far: FloatArray, row: IndexArray, max_ratio: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have their eighth neighbor at `far` (n,) much farther than their neighbors (n, 8)."""
    isolated = np.empty(len(far), dtype=bool)

    def task(start: int, stop: int) -> None:
        isolated[start:stop] = far[start:stop] > max_ratio * np.median(far[row[start:stop]], axis=1)

    run_blocks(task, len(far), BLOCK)
    return isolated


def _are_clutter(points: FloatArray, far: FloatArray, max_clutter: float) -> npt.NDArray[np.bool_]:
    """Return which points (n,) have their eighth neighbor at `far` (n,) and, among points as sparse, fill space."""
    clutter = far > max_clutter * np.quantile(far, DENSE)
    thickness = _thickness(points[clutter])
    clutter[clutter] = np.all([some > least for some, (_, least) in zip(thickness, FILLED, strict=True)], axis=0)
    return clutter


def _are_sparse_sheets(
    points: FloatArray, distance: FloatArray, row: IndexArray, suspect: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Return which of the suspects (k,) among points (n, 3) lie on a surface of their own spacing.

    Each has sixteen places of the cloud around it that is averaged in voxels of half to once its spacing.
    """
    sheet = np.zeros(len(points), dtype=bool)
    if not suspect.any():
        return sheet[suspect]
    far = distance[:, -1]
    sheet[suspect] = ~_are_small(linked(distance, row, MAX_RATIO * np.minimum(far[:, np.newaxis], far[row])))[suspect]
    if not sheet.any():
        return sheet[suspect]
    spacing, usual = np.sqrt(np.pi / NEIGHBORS) * far, np.median(far[far > 0])  # points that are repeated have none
    octave = np.full(len(points), -np.inf)
    octave[sheet] = np.floor(np.log2(spacing[sheet] / usual))
    count, most = SHEET
    for each in np.unique(octave[sheet]):
        rows = np.flatnonzero(sheet & (octave == each))
        cells = Cells.sort(points, usual * 2.0**each)
        size = cells.last - cells.first
        means = np.add.reduceat(points[cells.order], cells.first) / size[:, np.newaxis]
        if len(means) < count:
            sheet[rows] = False
            continue
        near = query(cKDTree(means), points[rows], k=np.arange(1, count + 1))[1]
        own = len(means) + np.arange(len(rows))
        variance = fit_planes(np.vstack([means, points[rows]]), np.column_stack([own, near])).variance
        sheet[rows] = variance[:, 0] < most**2 * variance[:, 2]
    return sheet[suspect]


def _thickness(points: FloatArray) -> FloatArray:
    """Return how thick over long most neighborhoods around each point are, (2, n) for two sizes; NaN of few points."""
    if len(points) < FILLED[-1][0]:
        return np.full((len(FILLED), len(points)), np.nan)
    alone = np.ascontiguousarray(points)
    tree, thickness = cKDTree(alone), []
    for count, _ in FILLED:
        near = query(tree, alone, k=count)[1]
        variance = fit_planes(alone, near).variance
        thickness.append(np.median(np.sqrt(variance[:, 0] / variance[:, 2])[near], axis=1))
    return np.array(thickness)
