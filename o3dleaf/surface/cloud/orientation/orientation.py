"""Orientation of normals: first by their neighbors' agreement, then by what encloses a volume."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import InputError, OrientationError
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_share
from o3dleaf.surface.cloud.neighbors import nearest_neighbors
from o3dleaf.surface.cloud.normals import on_seams
from o3dleaf.surface.cloud.orientation.close_sheets import Middle, middle_of, split_sheets
from o3dleaf.surface.cloud.orientation.sides import OPEN, OPEN_NOTE, Sides, find_sides
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import MIN_POINTS, Surfels
from o3dleaf.surface.cloud.winding.closed import close_anew
from o3dleaf.surface.cloud.winding.consistency import settle_doubts, settle_sheets

COARSER = 8
"""Times that an open sheet whose normals contradict one another is thinned at most, from where it is flattest."""
CUT = 2.0
"""Spacings on both sides of a line of contradiction within which points are cut out: planes of sixteen points reach as
far, and where they hold points of more than one sheet their normals mean nothing."""
CUTS = 3
CUT_NOTE = (
    "normals contradict one another along a line, where sheets branch or a sheet has one side: {:,} points ({}) "
    "were cut out there, around {}"
)
MAX_CUT = 0.2
"""Share of the points that may be cut out; of more the cloud is no sheet anywhere."""


class Orientation(NamedTuple):
    """Normals that point outward.

    Attributes
    ----------
    normals : (n, 3) ndarray
    notes : tuple of str
        What was decided or could not be, one sentence each.
    cut : (n,) ndarray of bool or None
        Points that are to be left out, for a sheet to have two sides: where it branches, or across a Moebius strip.
    is_open : bool
        True for an open sheet, of which either side may be outside.
    """

    normals: FloatArray
    notes: tuple[str, ...]
    cut: npt.NDArray[np.bool_] | None = None
    is_open: bool = False

    def __repr__(self) -> str:
        return f"Orientation({len(self.normals):,} normals, notes {self.notes})"


def estimate_normals(cloud: CloudLike) -> FloatArray:
    """Return unit normals (n, 3) of either sign: of the planes through neighbors, or groups of them under noise.

    Neighborhoods are 16 points, or 16 groups of the 2, 4, 8, ... points with which they become flat; groups' normals
    are blended at the points.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud

    Raises
    ------
    InputError
        If there are fewer than three points, or one is not finite.
    """
    known = OrientedCloud.of(cloud)
    return known.surfels.blend(known.points, known.surfels.planes.normal)[0]


def orient_normals(cloud: CloudLike, normals: npt.ArrayLike | None = None) -> Orientation:
    """Return the normals of a cloud turned outward, and what there is to say about it.

    On the cloud, coarsened until its neighborhoods are flat, neighbors' normals are compared, as in Hoppe et al., but
    mirrored between them, so that they agree across sharp edges and thin gaps too, and pieces that agree within are
    joined by the sum over all edges between them. The pieces' signs are those with which they enclose a volume: the
    winding number on a closed surface is 1/2, and each of two sheets that face one another makes 1/2 on the other. An
    open sheet has no outside; the side that it bulges to is taken, and a note says so. Where open sheets branch, or
    have one side, normals contradict one another along a line: the points there are to be cut out, and the normals of
    the others are found without them.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
    normals : (n, 3) array_like, optional
        Unit normals of either sign in place of those of the cloud. Where there are none, those by which the
        sides were found are returned.

    Raises
    ------
    OrientationError
        If the points fill a volume, or an open sheet contradicts itself throughout.
    InputError
        If the arrays do not match, or a value is not finite.

    References
    ----------
    Hoppe et al. (1992), SIGGRAPH, 71-78; Koenig & Gumhold (2009), VMV, 83-92 (mirrored normals); Xu et al. (2023), ACM
    Trans. Graph. 42, 111 (orientation from the winding number).
    """
    known = OrientedCloud.of(cloud)
    given = known.normals if normals is None else as_points(normals, "normals", dim=3)
    if given is not None and len(given) != len(known):
        raise InputError(f"normals: {len(given)} for {len(known)} points; give one per point")
    found = orient_surfels(known.points, known.surfels)
    if found.is_open:
        found = found._replace(notes=(OPEN_NOTE, *found.notes))
    if given is None:
        return found
    side = np.einsum("ij,ij->i", given, found.normals)
    return found._replace(normals=np.where(side < 0, -1.0, 1.0)[:, np.newaxis] * given)


def orient_surfels(points: FloatArray, surfels: Surfels) -> Orientation:
    """Return outward normals at `points` (n, 3), those of the surfels blended, found on coarser ones if need be.

    That a sheet is open is for the caller to tell.

    Raises
    ------
    OrientationError
        If there are no sides to tell apart.
    """
    if surfels.scale.full:
        raise OrientationError(
            f"cloud: its points show no surface at any scale, they fill a volume or lie along lines (neighborhoods "
            f"are {surfels.scale.flatness:.2f} as thick as wide); give the points of a surface, with less noise"
        )
    coarser_scales = int(np.log2(COARSER * surfels.scale.flattest / surfels.scale.thinning))
    first, *more = progress.split(*(coarser_scales + 1) * [1])
    with first:
        sides = find_sides(surfels)
        middle = middle_of(points, surfels, sides.normals)
    if (close := _close_sheets(points, surfels, sides, middle)) is not None:
        return close
    finest = surfels, sides
    for part in more:
        with part:
            coarser = _coarser(surfels, points) if sides.contradictory else None
            if coarser is None:
                break
            surfels = coarser
            sides = find_sides(surfels)
            middle = middle_of(points, surfels, sides.normals)
    if sides.contradictory:
        return _orient_apart(points, *finest)
    found = _of_sheets(surfels, sides, middle)
    if middle.is_of_two or found.is_open:
        return found
    normals, notes = settle_doubts(points, surfels, sides.normals, found.normals)
    return Orientation(normals, (*found.notes, *notes))


def _close_sheets(points: FloatArray, surfels: Surfels, sides: Sides, middle: Middle) -> Orientation | None:
    """Return the normals (n, 3) of sheets so close that neighbors take them for one or join them, or None.

    The wall of a vessel is such, though its middle encloses something, the hollow. What seems to enclose nothing is
    asked as a whole before it is coarsened: wires beside one another are no sheet, though at a distance they look it.
    """
    if middle.is_of_two and not sides.contradictory:
        found = _of_sheets(surfels, sides, middle)
        if sides.enclosed < OPEN:
            return found
        return found._replace(normals=settle_sheets(points, surfels.spacing, found.normals))
    if sides.enclosed < OPEN:
        anew = close_anew(points, surfels, sides.normals, middle.normals, thin=middle.is_within_noise)
        return None if anew is None else Orientation(*anew)
    return None


def _orient_apart(points: FloatArray, surfels: Surfels, sides: Sides) -> Orientation:
    """Return normals (n, 3) of sheets cut apart along the lines where those of a whole contradict one another.

    The points within `CUT` spacings of a line go, and the others are oriented anew, up to three times.
    """
    cut = np.zeros(len(points), bool)
    for _ in range(CUTS):
        left = np.flatnonzero(~cut)
        line = points[left][on_seams(surfels.points, sides.normals, surfels.rows)[surfels.group]]
        near = query(cKDTree(line), points[left])[0] <= CUT * surfels.spacing
        cut[left[near]] = True
        rest = points[~cut]
        if cut.mean() > MAX_CUT or len(rest) < MIN_POINTS:
            break
        with progress.silent():
            surfels = Surfels.of(rest, nearest_neighbors(cKDTree(rest)).row)
            sides = find_sides(surfels)
        if not sides.contradictory:
            found = _of_sheets(surfels, sides, middle_of(rest, surfels, sides.normals))
            normals = np.zeros_like(points)
            normals[~cut] = found.normals
            normals[cut] = found.normals[cKDTree(rest).query(points[cut])[1]]
            note = CUT_NOTE.format(cut.sum(), tell_share(cut.mean()), tell_middle(points[cut], points))
            return Orientation(normals, (*found.notes, note), cut, found.is_open)
    raise OrientationError(
        f"cloud: its normals contradict one another along lines throughout, as where sheets branch or touch, around "
        f"{tell_middle(points[cut], points)}; cut the cloud there, or give normals"
    )


def _coarser(surfels: Surfels, points: FloatArray) -> Surfels | None:
    with progress.silent():
        return surfels.coarser(points)


def _of_sheets(surfels: Surfels, sides: Sides, middle: Middle) -> Orientation:
    """Return the normals (n, 3) of one sheet or of two, whose middle encloses something or nothing."""
    normals, notes = split_sheets(middle)
    groups = len(surfels.group) / len(surfels.points)
    if groups > 1:
        notes = (
            f"noise is too large to orient single points: groups of {groups:.0f} points were oriented together",
            *notes,
        )
    return Orientation(normals, notes, is_open=sides.enclosed < OPEN and not middle.is_of_two)
