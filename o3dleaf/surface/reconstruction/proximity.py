"""Distances from places to the nearest data, in the data's own spacings: found for few, bounded for most."""

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import box_of
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.isosurface.remembered import rows_among
from o3dleaf.surface.reconstruction.vertex_support_loops import VoxelGrid, find_voxels, number_voxels

REACH = 4.0
"""Spacings from the data that a surface is followed, one more than the radius of the ball of `trim_to_data`."""

OWN = 1.0
"""Spacings from its nearest point within which a place is that point's, whatever lies around."""

BLOCK = 1 << 14

BATCH_SIZE = 1 << 18
"""Places that a tree or a field is evaluated at together."""

Mask = Callable[[FloatArray], BoolArray]
"""A function of places (n, 3) that returns a mask (n,)."""


@checked
def distance_mask(cloud: CloudLike, *, factor: Positive = REACH) -> Mask:
    """Return the function that tests which places (n, 3) lie within `factor` spacings of a point, of its own.

    What `extract_isosurface` takes as `within` so that the surface reaches as far as `trim_to_data` needs, and no
    farther, where points lie dense and where they lie thin.

    Parameters
    ----------
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
    factor : float
        One more than that of `trim_to_data`.

    Raises
    ------
    InputError
        If an argument cannot be meant.
    """
    require_positive(factor, "factor")
    data = OrientedCloud.of(cloud)
    spacing = data.point_spacing
    classes = sorted(data.spacing_classes, key=lambda some: -len(some.rows))
    sure = [conservative_mask(data.points[some.rows], factor * float(some.least)) for some in classes]

    def mask(places: FloatArray) -> BoolArray:
        inside, rest = np.zeros(len(places), dtype=bool), np.arange(len(places))
        for each in sure:
            inside[rest] = each(places[rest])
            rest = rest[~inside[rest]]
            if not len(rest):
                return inside
        with progress.silent():  # who follows a surface reports how far it is
            distance, nearest = data_around(data, places[rest])
        inside[rest] = distance <= factor * spacing[nearest]
        return inside

    return mask


def conservative_mask(points: FloatArray, reach: float) -> Mask:
    """Return the function that tests which places (n, 3) share a voxel of diagonal `reach` with one of `points`.

    Those lie within `reach` of it, which is found at a fraction of the cost of the nearest point; others may do so
    too. Places are best given in an order in which neighbors follow one another.
    """
    # Rounding must not make a voxel of a larger diagonal.
    side = reach / np.sqrt(3) * (1 - 1e-6)
    low, high = box_of(points)
    shape = np.floor((high - low) / side) + 1
    if np.prod(shape) > 2.0**62:
        return lambda places: np.zeros(len(places), dtype=bool)
    grid = VoxelGrid(low, shape.astype(np.int64), side)
    keys = np.empty(len(points), dtype=np.int64)
    run_blocks(lambda i, j: number_voxels(i, j, points, grid, keys), len(points), BLOCK)
    keys.sort()
    keys = keys[np.append(True, keys[1:] != keys[:-1])]

    def mask(places: FloatArray) -> BoolArray:
        inside = np.empty(len(places), dtype=bool)
        run_blocks(lambda i, j: find_voxels(i, j, places, grid, keys, inside), len(places), BLOCK)
        return inside

    return mask


def nearest_points(tree: cKDTree, places: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return distance (n,) and row (n,) of the point of a tree that is nearest to each place (n, 3)."""
    distance, nearest = np.empty(len(places)), np.empty(len(places), dtype=np.int64)
    for i, j in blocks(len(places), BATCH_SIZE):
        distance[i:j], nearest[i:j] = query(tree, places[i:j])
        progress.report(j, len(places))
    return distance, nearest


def nearest_data(data: OrientedCloud, places: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return what `nearest_points` does of a cloud, which remembers it: several steps ask it for the same vertices.

    Some ask for part of those that another has asked for, or for more: what is known of them is not searched again.
    """
    known: tuple[FloatArray, FloatArray, IntArray] | None = vars(data).get("_nearest")
    if known is None:
        answer = nearest_points(data.tree, places)
    elif np.array_equal(known[0], places):
        answer = known[1:]
    else:
        rows, answer = rows_among(places, known[0]), (np.empty(len(places)), np.empty(len(places), dtype=np.int64))
        new = rows < 0
        for whole, before, found in zip(answer, known[1:], nearest_points(data.tree, places[new]), strict=True):
            whole[new], whole[~new] = found, before[rows[~new]]
    if known is None or len(places) > len(known[0]) // 2:  # a few places more or less are no reason to forget many
        vars(data)["_nearest"] = np.array(places), *answer
    progress.report(len(places), len(places))
    return answer


def data_around(
    data: OrientedCloud, places: FloatArray, nearest: tuple[FloatArray, IntArray] | None = None
) -> tuple[FloatArray, IntArray]:
    r"""Return which point of the data each place (n, 3) is nearest to in that point's spacings, and how far (n,).

    .. math:: \arg\min_j |x - x_j| / s_j

    Where data are about as dense all around, or one lies within its spacing, that is the nearest one. Beside dense data
    that end where sparse ones go on, it is one of those: a gap is no wider for what is dense on its other side. Found
    to the width of a class of spacings, a fifth. `nearest` is what `nearest_points` says, where that is known.
    """
    nearest = nearest_data(data, places) if nearest is None else nearest
    distance, row = nearest[0].copy(), nearest[1].copy()
    spacing, own = data.point_spacing, data.point_spacing[row]
    ratio = distance / own
    for some in data.spacing_classes if (ratio > OWN).any() else ():
        asked = np.flatnonzero((ratio > OWN) & (own < some.least))
        if not len(asked):
            continue
        reach = some.greatest * float(ratio[asked].max())
        far, near = query(some.tree, places[asked], distance_upper_bound=reach)
        found = np.flatnonzero(np.isfinite(far))
        far, near, asked = far[found], some.rows[near[found]], asked[found]
        less = far / spacing[near] < ratio[asked]
        distance[asked[less]], row[asked[less]] = far[less], near[less]
        ratio[asked[less]] = far[less] / spacing[near[less]]
    return distance, row
