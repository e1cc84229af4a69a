"""How near places are to data, in the data's own spacings: found for few, known beforehand of most."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray, as_weights, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import Progress, blocks, run_blocks
from o3dleaf.surface.reconstruction.vertex_support_loops import find_voxels, number_voxels

REACH = 4.0
"""Spacings from the data that a surface is followed, one more than the radius of the ball of `trim_to_support`."""

NEIGHBOURS = 12
"""Points whose distance tells the spacing; off by 1/(2 √12), 14 %, at one random point, before averaging."""

BLOCK = 1 << 14

BATCH = 1 << 18
"""Places that a tree or a field is asked for at once."""


class Data(NamedTuple):
    """The points (n, 3) that a surface was made from, their spacings (n,), their tree, and their normals if known."""

    points: FloatArray
    steps: FloatArray
    tree: cKDTree
    normals: FloatArray | None = None


def near_data(
    points: CloudLike,
    spacing: float | npt.ArrayLike | None = None,
    *,
    factor: float = REACH,
    tree: cKDTree | None = None,
) -> Callable[[FloatArray], BoolArray]:
    """Return the function that says which places (n, 3) lie within `factor` spacings of data.

    What `extract_isosurface` takes as `within` so that `trim_to_support` finds the surface far enough, and no farther,
    where points lie dense and where they lie thin.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
    spacing : float or (n,) array_like, optional
        As for `trim_to_support`.
    factor : float
        One more than that of `trim_to_support`.
    tree : scipy.spatial.cKDTree, optional
        Of the points, where there is one.

    Raises
    ------
    InputError
        If an argument cannot be meant.
    """
    require_positive(factor, "factor")
    data = points_of(points, least=NEIGHBOURS + 1 if spacing is None else 1)
    known = cKDTree(data) if tree is None else tree
    steps = spacings_of(data, spacing, known)
    surely = surely_near(data, factor * float(steps.min()))

    def near(places: FloatArray) -> BoolArray:
        found = surely(places)
        rest = np.flatnonzero(~found)
        far, nearest = nearest_of(known, places[rest])
        found[rest] = far <= factor * steps[nearest]
        return found

    return near


def surely_near(data: FloatArray, reach: float) -> Callable[[FloatArray], BoolArray]:
    """Return the function that says which places (n, 3) share a voxel of diagonal `reach` with a point of `data`.

    Those lie within `reach` of it, which is found at a fraction of the cost of the nearest point; of the others
    nothing is said. Places are best given in an order in which neighbours follow one another.
    """
    # Rounding must not make a voxel of a larger diagonal.
    side = reach / np.sqrt(3) * (1 - 1e-6)
    low = data.min(axis=0)
    shape = np.floor((data.max(axis=0) - low) / side) + 1
    if np.prod(shape) > 2.0**62:
        return lambda places: np.zeros(len(places), dtype=bool)
    grid = low, shape.astype(np.int64), side
    keys = np.empty(len(data), dtype=np.int64)
    run_blocks(lambda i, j: number_voxels(i, j, data, grid, keys), len(data), BLOCK)
    keys.sort()
    keys = keys[np.append(True, keys[1:] != keys[:-1])]

    def surely(places: FloatArray) -> BoolArray:
        found = np.empty(len(places), dtype=bool)
        run_blocks(lambda i, j: find_voxels(i, j, places, grid, keys, found), len(places), BLOCK)
        return found

    return surely


def nearest_of(tree: cKDTree, places: FloatArray, progress: Progress | None = None) -> tuple[FloatArray, IntArray]:
    """Return distance (n,) and row (n,) of the point of a tree that is nearest to each place (n, 3)."""
    far, nearest = np.empty(len(places)), np.empty(len(places), dtype=np.int64)
    for i, j in blocks(len(places), BATCH):
        far[i:j], nearest[i:j] = tree.query(places[i:j], workers=-1)
        if progress:
            progress(j, len(places))
    return far, nearest


def local_spacing(points: CloudLike, near: tuple[FloatArray, IntArray] | None = None) -> FloatArray:
    r"""Return the (n,) spacings 1/√(points per unit area) of a cloud on a surface, one for each point.

    :math:`s = r_k \sqrt{\pi/k}` from the distance r_k to the k-th neighbour, k = 12, which holds for random points and
    for lattices alike; then the neighbours' median, and the mean of theirs.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
    near : (distance, row), optional
        Of the points' nearest, themselves first: (n, k) arrays, k at least 13, where they are known.

    Raises
    ------
    InputError
        If there are fewer than 13 points, one is not finite, or 13 lie in one place.
    """
    data = points_of(points, least=NEIGHBOURS + 1)
    return spacings_of(data, None, cKDTree(data)) if near is None else _smooth_spacings(*near)


def spacings_of(data: FloatArray, spacing: float | npt.ArrayLike | None, tree: cKDTree) -> FloatArray:
    """Return the (n,) spacings of the data, given or found."""
    if spacing is not None:
        given = np.broadcast_to(np.asarray(spacing, dtype=np.float64), len(data)) if np.ndim(spacing) == 0 else spacing
        return as_weights(given, len(data), "spacing")
    far, near = np.empty((len(data), NEIGHBOURS + 1)), np.empty((len(data), NEIGHBOURS + 1), dtype=np.int64)
    # Asked in the tree's own order, neighbours in the question are neighbours in memory: three times faster.
    far[tree.indices], near[tree.indices] = tree.query(data[tree.indices], NEIGHBOURS + 1, workers=-1)
    return _smooth_spacings(far, near)


def _smooth_spacings(far: FloatArray, near: IntArray) -> FloatArray:
    """Return the (n,) spacings by the (n, k) distances and rows of neighbours, the median and then the mean of 13."""
    first, middle, found = far[:, NEIGHBOURS] * np.sqrt(np.pi / NEIGHBOURS), np.empty(len(far)), np.empty(len(far))

    def median(start: int, stop: int) -> None:
        middle[start:stop] = np.median(first[near[start:stop, : NEIGHBOURS + 1]], axis=1)

    def mean(start: int, stop: int) -> None:
        found[start:stop] = middle[near[start:stop, : NEIGHBOURS + 1]].mean(axis=1)

    run_blocks(median, len(far), BLOCK)
    run_blocks(mean, len(far), BLOCK)
    if not found.min() > 0:
        raise InputError(f"points: {NEIGHBOURS + 1} lie in one place; remove repeated ones")
    return found
