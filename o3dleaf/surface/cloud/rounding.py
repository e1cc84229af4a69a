"""Coordinates that were rounded to steps, as those of voxels and of depth cameras are, and levels wider than points."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.units import tell_length
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.downsample import groups_of
from o3dleaf.surface.cloud.neighbors import IndexArray, fit_planes
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import DROWNED, LINE, flatness_of

MIN_LEVELS = 3
"""Levels at least: any two are one step apart."""
TOLERANCE = 0.01
"""Of a step, by which levels may be off whole ones: single precision rounds them anew."""
SAMPLE = 4000
"""Points whose neighborhoods are seen."""
EXACT = 1e-3
"""Ratio of the standard deviations across and along a neighborhood up to which it is in one plane but for roundings of
single precision; of a shape that bends, at 500 spacings, it is as much."""
MIN_TERRACES = 0.02
"""Share of neighborhoods in planes across one direction from which on that is tried: of a ball in steps of one and a
quarter spacings 0.03 are, in steps of two 0.17."""
PARALLEL = 1e-5
"""One less the cosine of two directions up to which they are one, at roundings of single precision."""
TRIED = 64
"""Neighborhoods one of which has the direction that most others have."""
MAX_STEP = 6.0
"""Spacings between levels up to which they are joined: wider gaps stay open, so that each level is a sheet of its own,
as the treads of stairs are."""
TERRACES = "the surface has terraces or comes apart between them; give the cloud with more digits"
AVERAGED = "they were averaged in voxels of one step; give the cloud with more digits for more detail"
JOINED = (
    "they were averaged in voxels of one step, and sheets less than two steps apart are one; give the cloud with more "
    "digits for more detail"
)


class Levels(NamedTuple):
    """The unit direction (3,) along which coordinates are whole steps apart, and the step."""

    direction: FloatArray
    step: float

    @property
    def name(self) -> str:
        """The coordinate along the direction, in words."""
        axis = int(np.abs(self.direction).argmax())
        if abs(self.direction[axis]) >= 1 - PARALLEL:
            return "xyz"[axis]
        return f"the coordinate along {' '.join(f'{x:.3f}' for x in self.direction)}"


def find_steps(points: FloatArray) -> FloatArray:
    """Return the steps (d,) of points (n, d): coordinates along an axis are whole steps apart; 0 where they are not.

    All coordinates are, of those of a computer; what is done with a step is for its size to decide.
    """
    return np.array([_step_of(np.unique(column)) for column in points.T])


def find_levels(points: FloatArray, rows: IndexArray) -> Levels | None:
    """Return the levels of a cloud (n, 3), in whatever direction, by its neighborhoods `rows` (n, k), None without any.

    Where levels are wider apart than points neighborhoods lie in planes, all across that direction, as they do on the
    faces of a block; but the heights of all points are whole steps apart. Neighborhoods in a line, as those of contours
    and of scanners, show no plane.
    """
    with progress.silent():
        planes = fit_planes(points, rows[even_rows(len(points), SAMPLE)])
    across, along, most = planes.variance.T
    normals = planes.normal[(across <= EXACT**2 * most) & (along > LINE**2 * most)]
    if len(normals) < MIN_TERRACES * len(across):
        return None
    parallel = np.abs(normals[even_rows(len(normals), TRIED)] @ normals.T) >= 1 - PARALLEL
    chosen = normals[parallel[parallel.sum(axis=1).argmax()]]
    if len(chosen) < MIN_TERRACES * len(across):
        return None
    direction = np.linalg.eigh(chosen.T @ chosen)[1][:, -1]
    direction *= np.sign(direction[np.abs(direction).argmax()])
    heights = np.sort(points @ direction)
    rises = np.diff(heights)
    start = np.flatnonzero(np.append(True, rises > TOLERANCE * rises.max(initial=0.0)))
    step = _step_of(np.add.reduceat(heights, start) / np.diff(np.append(start, len(heights))))
    return Levels(direction, step) if step else None


def average_levels(cloud: OrientedCloud, normals: FloatArray | None = None) -> tuple[OrientedCloud, IndexArray]:
    """Return a cloud of the means of points on levels wider apart than the points are, and the first point of each.

    What is between two levels no point knows, and planes through the points of one are the level's own. In voxels of
    one step, with the levels in their middles, means are as far apart as the levels are. Of points with `normals`
    (n, 3) those that face away from the first one in their voxel have a mean of their own. Where means are no surface,
    as of parts that are thinner than a step, unless normals tell their sides apart, or levels are sheets of their own,
    the points stay, which is noted.

    Returns
    -------
    cloud : OrientedCloud
        The very one where there are no such levels.
    first : (m,) ndarray
        Rows of the first points that its points are means of.
    """
    every = np.arange(len(cloud))
    levels = find_levels(cloud.points, cloud.neighbors.row)
    if levels is None or levels.step <= cloud.spacing:
        return cloud, every
    # The levels' direction becomes an axis of the voxels.
    turned = np.ascontiguousarray(cloud.points @ np.linalg.svd(levels.direction[np.newaxis])[2].T)
    group, first = groups_of(Cells.sort(turned, levels.step, shift=0.5), normals)
    count = np.asarray(np.bincount(group, cloud.weights), dtype=np.float64)
    sums = [np.bincount(group, cloud.weights * column) for column in cloud.points.T]
    means = np.column_stack(sums) / count[:, np.newaxis]
    about = f"{levels.name} is rounded to steps of {tell_length(levels.step)}, where points are "
    about += f"{tell_length(cloud.spacing)} apart: "
    drowned = normals is None and flatness_of(means) > DROWNED
    if levels.step > MAX_STEP * cloud.spacing or drowned:
        return replace(cloud, notes=(*cloud.notes, about + TERRACES)), every
    said = JOINED if normals is None else AVERAGED
    removed = cloud.removed._replace(averaged=cloud.removed.averaged + len(group) - len(first))
    return OrientedCloud(means, None, count, removed, (*cloud.notes, about + said)), first


def _step_of(levels: FloatArray) -> float:
    """Return the step of levels, rising, or 0."""
    if len(levels) < MIN_LEVELS:
        return 0.0
    rises = np.diff(levels)
    steps = rises / rises.min()
    return float(rises.min()) if (np.abs(steps - np.round(steps)) <= TOLERANCE).all() else 0.0
