"""`find_branchings`: the lines of a cloud along which three or more sheets meet."""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.core.parallel import blocks
from o3dleaf.surface.cloud.branchings.arms import ALONG, Arms, count_arms
from o3dleaf.surface.cloud.branchings.axes import Axes, find_axes
from o3dleaf.surface.cloud.branchings.axis_loops import FEWEST
from o3dleaf.surface.cloud.branchings.branchings import Branchings, half_gaps, join_places
from o3dleaf.surface.cloud.neighbors import IndexArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import Surfels

ROUGH = 0.25
"""Flatness of a neighborhood above which it may lie where sheets meet: of two at 35° to a third it has 0.3."""
APART = 1.5
"""Spacings between the places that are looked at: each finds the line within two."""
LENGTH = 8.0
"""Spacings of a line at least, as long as the neighborhoods that it is seen in: a shorter one is one look's mistake."""
LOOKS = 2 * LENGTH / APART
"""Sure looks at a line at least: two for every `APART` spacings of the shortest, as lines have in the mean of which all
is seen. Noise in the crotches of a solid made up lines of two to eight, and one of eleven, in 96 draws."""
LINK = 4 * ALONG
"""Spacings within which places on a straight line are of one, and half as many of any: each has seen its sheets a
quarter as far along, and random points leave gaps that are twice as long."""
CLEARANCE = 1.75
"""Spacings off the line up to which points are left out: planes nearer to it are of points from several sheets."""
SEPARATE = 2.0
"""Spacings that the cut ends of two sheets are apart at least: nearer a field joins them."""
EVEN = 16
"""Places over which the spacing is the median: points at random clump within few spacings."""
BATCH_SIZE = 2048
"""Places looked at together."""


def find_branchings(cloud: CloudLike) -> Branchings | None:
    """Return the lines along which three or more sheets of a cloud meet, or None where there are none.

    Where neighborhoods are not flat, the flat ones around say through which line their planes pass, and the points in
    the plane across it how many sheets leave it. Creases have two, and corners of solids, where faces meet in a point,
    no such line. Lines of an even number of sheets are left: bodies that touch make such, whose inside and outside
    alternate around them. Under noise neighborhoods and spacings are those of groups of points (`Surfels`).

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        Without repeated points. Of one with normals, thin parts of solids are told from sheets.
    """
    known = OrientedCloud.of(cloud)
    surfels = known.surfels
    if surfels.scale.flatness > ROUGH:
        return None
    ratio = _flatness(surfels)
    flat = ratio <= ROUGH
    places, spacing = _places(surfels, ratio > ROUGH, flat)
    if not len(places):
        return None
    tree, points, normals = known.tree, surfels.points[flat], surfels.planes.normal[flat]
    off = float(np.median(np.sqrt(surfels.planes.variance[flat, 0])))
    found: list[Axes] = []
    arms_of: list[Arms] = []
    for i, j in blocks(len(places), BATCH_SIZE):
        axes = find_axes(surfels.points[places[i:j]], spacing[i:j], points, normals)
        arms = count_arms(axes, tree, np.full(len(axes), off), known.normals)
        met = np.flatnonzero(arms.sheets)
        found.append(axes.take(met))
        arms_of.append(arms.take(met))
        progress.report(j, len(places))
    axes = Axes(*(np.concatenate(each) for each in zip(*found, strict=True)))
    sheets, angle, sure = (np.concatenate(each) for each in zip(*arms_of, strict=True))
    return _lines(axes, Arms(sheets, angle, sure))


def _flatness(surfels: Surfels) -> FloatArray:
    """Return the (m,) ratios of the standard deviations across and along the surfels' neighborhoods."""
    across, along = surfels.planes.variance[:, 0], surfels.planes.variance[:, 1]
    return np.asarray(np.sqrt(across / np.maximum(along, np.finfo(np.float64).tiny)))


def _places(
    surfels: Surfels, rough: npt.NDArray[np.bool_], flat: npt.NDArray[np.bool_]
) -> tuple[IndexArray, FloatArray]:
    """Return the surfels (k,) at which to look, and the spacing (k,) of surfels around.

    They are rough ones near enough flat ones, about one in each voxel. The spacing is that of the flat ones: where
    sheets meet the others' planes seem smaller than their neighborhoods are.
    """
    some = np.flatnonzero(rough)
    some = some[flat[surfels.rows].sum(axis=1)[surfels.rows[some]].sum(axis=1) >= FEWEST]
    if not len(some):
        return some, np.empty(0)
    own = np.empty(len(surfels.points))
    own[surfels.group] = surfels.spacing
    own *= np.sqrt(len(surfels.group) / len(surfels.points))
    points = surfels.points[some]
    voxel = np.floor((points - points.min(axis=0)) / (APART * np.median(own[flat]))).astype(np.int64)
    some = some[UniqueRows.of(voxel).first]
    around = surfels.rows[surfels.rows[some]].reshape(len(some), -1)
    # The median of those that are flat; NumPy's own of such rows takes ten times as long.
    ranked, many = np.sort(np.where(flat[around], own[around], np.inf), axis=1), flat[around].sum(axis=1)
    middle = np.take_along_axis(ranked, np.column_stack([many - 1, many]) // 2, axis=1)
    spacing = middle.mean(axis=1)
    others = cKDTree(surfels.points[some]).query(surfels.points[some], k=np.arange(1, min(EVEN, len(some)) + 1))[1]
    return some, np.median(spacing[others], axis=1)


def _lines(axes: Axes, arms: Arms) -> Branchings | None:
    """Return the places that make lines of which the sure ones reach so far that they are none by chance."""
    if not len(axes):
        return None
    line = join_places(axes.point, axes.direction, LINK * axes.spacing)
    count = int(line.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, line[arms.sure], axes.point[arms.sure])
    np.maximum.at(high, line[arms.sure], axes.point[arms.sure])
    length = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
    odd = 2 * np.bincount(line, arms.sheets % 2) > np.bincount(line)
    seen = np.bincount(line, arms.sure) >= LOOKS
    kept = np.flatnonzero((length[line] >= LENGTH * axes.spacing) & (odd & seen)[line])
    if not len(kept):
        return None
    axes, line = axes.take(kept), np.unique(line[kept], return_inverse=True)[1]
    angle = arms.angle[kept]
    apart = SEPARATE / (2 * np.sin(angle / 2))
    clearance = np.maximum(CLEARANCE, apart) * axes.spacing
    half = half_gaps(axes.point, axes.direction, LINK * axes.spacing, APART * axes.spacing)
    return Branchings(axes.point, axes.direction, arms.sheets[kept], half, angle, clearance, line.astype(np.int64))
