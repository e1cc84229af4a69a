"""Downsampling of clouds: by voxels that keep the two sides of a thin sheet apart, by noise, or to a number."""

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.neighbors import IndexArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

PER_NOISE = 1.8
"""Side of the voxels that points are averaged in, in standard deviations of the noise: wider ones take rims and
corners off, narrower ones leave the fit with more points than it needs."""
TAIL = 0.1
"""Share of its neighbors' weight up to which a mean is one of a tail: of a normal distribution, beyond 2.1 σ."""
MIN_GROWTH = 1.02
"""Of voxels from one size to the next that is tried: four percent fewer points."""


@checked
def voxel_down_sample(cloud: CloudLike, voxel_size: Positive) -> OrientedCloud:
    """Return the means of a cloud's points in each voxel whose normals face one way, each with its weight.

    As Open3D's `voxel_down_sample`, except that points whose normals face away from those of the first point in their
    voxel have a mean of their own, and that the mean of ten points has the weight of ten points in a fit. The means
    stand in the order of their first points.

    Parameters
    ----------
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        With normals.
    voxel_size : float
        Edge of a voxel; the voxels begin at the cloud's lower corner.

    Raises
    ------
    InputError
        If the size is not above zero, or the cloud has no normals.
    """
    whole = OrientedCloud.of(cloud)
    points, normals = whole.points, whole.require_normals()
    cells = Cells.sort(points, require_positive(voxel_size, "voxel_size"))
    group, start = groups_of(cells, normals)
    weight = np.asarray(np.bincount(group, whole.weights, len(start)), dtype=np.float64)
    mean, direction = (
        np.column_stack([np.bincount(group, whole.weights * part[:, a], len(start)) for a in range(3)])
        / weight[:, np.newaxis]
        for part in (points, normals)
    )
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    removed = whole.removed._replace(averaged=whole.removed.averaged + len(points) - len(mean))
    return OrientedCloud(mean, unit, weight, removed, whole.notes, whole.branchings)


def adaptive_down_sample(cloud: CloudLike) -> OrientedCloud:
    """Return a cloud with its points averaged where noise is thicker than the spacing, each with its weight.

    Voxels of 1.8 standard deviations of the noise contain too few points to lose any shape that the noise has left,
    and make the fit of a dense noisy scan a small one. Where they are narrower than a spacing the cloud comes back as
    it is.

    Parameters
    ----------
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        With normals.

    Raises
    ------
    InputError
        If the cloud has no normals, or is no surface.
    """
    whole = OrientedCloud.of(cloud)
    measuring, averaging, trimming = progress.split(1, 3, 1)
    with measuring:
        voxel_size = PER_NOISE * whole.noise
    if voxel_size <= whole.spacing:
        return whole
    with averaging:
        averaged = voxel_down_sample(whole, voxel_size)
    with trimming:
        return remove_tails(averaged)


def thin(cloud: CloudLike, most: int) -> OrientedCloud:
    """Return a cloud of at most `most` points: itself, or the means of its points in cubic voxels, with their weights.

    The voxels are the first so large in a row in which each is as much larger as would be enough if the points covered
    a surface evenly: there are not many fewer than `most`. Normals are left out, as the sides of a sheet are not kept
    apart. The means stand in the order of their first points.

    Parameters
    ----------
    cloud : (n, 3) array_like, Open3D point cloud or OrientedCloud
    most : int

    Raises
    ------
    InputError
        If `most` is not above zero.
    """
    whole = OrientedCloud.of(cloud)
    require_positive(most, "most")
    if len(whole) <= most:
        return whole
    points = whole.points
    size = float(np.ptp(points, axis=0).max()) / most or 1.0
    while len((cells := Cells.sort(points, size)).first) > most:
        size *= max(np.sqrt(len(cells.first) / most), MIN_GROWTH)
    count, group = len(cells.first), groups_of(cells)[0]
    weight = np.asarray(np.bincount(group, whole.weights, count), dtype=np.float64)
    mean = np.column_stack([np.bincount(group, whole.weights * points[:, axis], count) for axis in range(3)])
    removed = whole.removed._replace(averaged=whole.removed.averaged + len(points) - count)
    return OrientedCloud(mean / weight[:, np.newaxis], None, weight, removed, whole.notes, whole.branchings)


def groups_of(cells: Cells, normals: FloatArray | None = None) -> tuple[IndexArray, IndexArray]:
    """Return the group (n,) of each point in cells, numbered by their first points, and the rows (g,) of these.

    A cell is a group; of points with `normals` (n, 3) those that face away from the first one make another.
    """
    length = cells.last - cells.first
    cell = np.empty(len(cells.order), np.int64)
    cell[cells.order] = np.repeat(np.arange(len(length)), length)
    if normals is not None:
        first = cells.order[cells.first][cell]
        cell = 2 * cell + (np.einsum("ij,ij->i", normals, normals[first]) < 0)
    _, start, group = np.unique(cell, return_index=True, return_inverse=True)
    rank = np.empty(len(start), np.int64)
    rank[np.argsort(start)] = np.arange(len(start))
    return rank[group], np.sort(start)


def remove_tails(cloud: OrientedCloud) -> OrientedCloud:
    """Return a cloud of means without those that stand for a tenth of the points that their neighbors do, or fewer.

    What the neighbors stand for is the mean over their points, Σw²/Σw, which those in the middle decide. Such
    voxels contain the tails of the noise: the normal of a single point three deviations off means nothing where a
    hundred others determine the surface.
    """
    near = cloud.weights[cloud.neighbors.row]
    kept = cloud.weights > TAIL * (near * near).sum(axis=1) / near.sum(axis=1)
    return cloud if kept.all() else cloud.take(kept)
