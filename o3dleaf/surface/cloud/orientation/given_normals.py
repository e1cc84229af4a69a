"""Normals that came with a cloud: completed, and repaired where points and neighbors contradict them."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import OrientationError
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.places import tell_middle
from o3dleaf.core.units import tell_count
from o3dleaf.surface.cloud.neighbors import IndexArray, fit_planes
from o3dleaf.surface.cloud.normals import opposed_share, repair_normals
from o3dleaf.surface.cloud.orientation.contradictions import tell_contradictions
from o3dleaf.surface.cloud.orientation.orientation import Orientation, orient_surfels
from o3dleaf.surface.cloud.orientation.sides import OPEN
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import Surfels
from o3dleaf.surface.cloud.winding.closed import imbalance
from o3dleaf.surface.cloud.winding.dipole_tree import DipoleTree
from o3dleaf.surface.cloud.winding.dipoles import Dipoles

CONTRADICTED = 0.03
"""Share of opposed neighbors from which on sides are found anew, unless what they enclose contradicts fewer, or what
repaired ones do is no worse: Homer, whose parts nearly touch, has 0.001; of n % wrong normals, all over, it is 2 n."""
AGREED = 0.7
"""Length of the mean of a group's unit normals from which on one that opposes it is wrong."""
CLOSED = 0.01
"""Length of the mean of a closed surface's normals, which is zero but for how well its areas are known: solids and
figures sampled at random have 0.002 to 0.01, noise included, a room with a door 0.016 and without a ceiling 0.3."""
SURE = 2.0
"""Standard deviations of that length that a closed surface may have: areas are known to 0.3 at single points, about
thirteen of which share their errors, so that of n points it has about 1/sqrt(n)."""
KEPT_NOTE = "normals contradict one another, but enclose a volume: they were kept"
SPLIT_NOTE = "two sheets lie within the noise: normals were kept as they are"
MAJORITY_NOTE = "the cloud encloses no volume: outside is where most of the given normals point, piece by piece"
INWARD_NOTE = (
    "normals point into what the surface encloses, and were kept: it is open, as a room scanned from inside is"
)
ASIDE = 0.5
"""Spacings in front of a point and behind it where the whole is asked for its side: nearer than another sheet is."""
BETTER = 0.9
"""Error of the winding number with sides found anew, over that with those given, below which these are wrong. Where
noise nearly fills thin parts, right normals contradict one another, and others do about as well: 0.98 to 1.2; with a
twentieth of the points on the wrong side it is 0.65 to 0.94."""
SAMPLE = 256
"""Places whose mean winding number says whether a cloud encloses a volume, and from which side: it is known to 0.01."""
SPLIT = 0.5
"""Distance between the points of either side, over their spread, from which on they are two sheets within the noise,
and their normals no mistake."""

ACROSS = 0.5
"""Cosine between a normal and that of the plane through its neighbors below which it lies across them: 60°."""
SURE_PLANE = 0.04
"""Variance across a neighborhood over that along it up to which its plane is that of the surface: a standard deviation
of a fifth, as of clean pieces."""
UNFIT = 0.1
"""Share of normals across the planes from which on they are not the surface's: right ones of solids, figures, towns and
plates have 0 to 0.01, also where they are taken over corners; one direction for all has half on a ball, 0.14 on a town,
and normals of chance have half. Asked only where half of the planes are sure."""


def without_infinite(given: FloatArray) -> FloatArray:
    """Return normals (n, 3) of any length, zero where they are missing: not finite, or their square is not."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = np.einsum("ij,ij->i", given, given)
    return np.where(np.isfinite(square)[:, np.newaxis], given, 0.0)


def without_unfit(cloud: OrientedCloud, given: FloatArray) -> tuple[FloatArray | None, tuple[str, ...]]:
    """Return normals (n, 3) as they were given, or None where they are not those of the surface, and a line on it.

    They are not where too many lie across the planes of a clean cloud, as one direction for all does. Where few planes
    are sure nothing is known of that.
    """
    planes = cloud.surfels.planes
    if len(planes.normal) != len(given):
        return given, ()
    length = np.linalg.norm(given, axis=1)
    sure = planes.variance[:, 0] < SURE_PLANE * planes.variance[:, 1]
    known = sure & (length > 0)
    if not sure.mean() > 0.5 or not known.any():
        return given, ()
    along = np.abs(np.einsum("ij,ij->i", planes.normal, given))
    across = np.mean(along[known] < ACROSS * length[known])
    if across < UNFIT:
        return given, ()
    said = f"{across:.0%} of the given normals lie across the planes of their neighbors: all were estimated anew"
    return None, (said,)


def check_normals(cloud: OrientedCloud, given: FloatArray, *, orient: bool) -> Orientation:
    """Return unit normals (n, 3) out of those given, repaired where points and neighbors contradict them.

    Parameters
    ----------
    cloud : OrientedCloud
    given : (n, 3) ndarray
        Of any length, or zero where they are missing.
    orient : bool
        Whether sides may be changed.
    """
    points, rows, surfels = cloud.points, cloud.neighbors.row, cloud.surfels
    unit, missing = _completed(points, given, rows)
    notes = (f"{missing} normals were missing and were estimated",) if missing else ()
    if not orient:
        return Orientation(unit, notes)
    found = repair_normals(points, unit, rows)
    repaired = _with_the_whole(points, surfels.spacing, unit, _with_groups(surfels, found.normals))
    if found.conflict > CONTRADICTED:
        sided = _oriented_anew(points, unit, surfels)
    elif found.conflict and found.before > CONTRADICTED:
        sided = _beyond_repair(cloud, unit, repaired)
    else:
        sided = _repaired(points, unit, repaired)
    unit, more = sided.normals, sided.notes
    if _point_inward(surfels, unit):
        closed = imbalance(unit, surfels.spacing) < max(CLOSED, SURE / np.sqrt(len(points)))
        unit = -unit if closed else unit
        more += ("all normals pointed inward and were flipped" if closed else INWARD_NOTE,)
    return Orientation(unit, notes + more + tell_contradictions(cloud, unit), is_open=sided.is_open)


def _group_means(surfels: Surfels, unit: FloatArray) -> FloatArray:
    """Return the mean (m, 3) of the cloud's unit normals over each surfel."""
    count = surfels.total(np.ones(len(unit)))
    return np.column_stack([surfels.total(unit[:, a]) for a in range(3)]) / count[:, np.newaxis]


def _with_groups(surfels: Surfels, unit: FloatArray) -> FloatArray:
    """Return unit normals (n, 3), turned where the others of their group agree on the other side."""
    mean = _group_means(surfels, unit)
    agreed = (np.linalg.norm(mean, axis=1) > AGREED)[surfels.group]
    wrong = agreed & (np.einsum("ij,ij->i", unit, mean[surfels.group]) < 0)
    return np.where(wrong, -1.0, 1.0)[:, np.newaxis] * unit


def _with_the_whole(points: FloatArray, spacing: FloatArray, unit: FloatArray, repaired: FloatArray) -> FloatArray:
    """Return repaired normals (n, 3), but as they were given where the rest of the cloud does not contradict them.

    At the rim of a thin part most neighbors lie on its other sides. But matter is behind a point: without those that
    neighbors contradict, the winding number is greater there than in front.
    """
    turned = np.flatnonzero(np.einsum("ij,ij->i", repaired, unit) < 0)
    if not len(turned):
        return repaired
    flux = unit * spacing[:, np.newaxis] ** 2
    flux[turned] = 0.0
    rest = Dipoles.of(points, flux)
    width = ASIDE * spacing[turned]
    step = width[:, np.newaxis] * unit[turned]
    front, behind = (rest.winding_at(points[turned] + way, width) for way in (step, -step))
    kept = turned[front < behind]
    result = repaired.copy()
    result[kept] = unit[kept]
    return result


def _winding(points: FloatArray, spacing: FloatArray, unit: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the winding number (n,) that unit normals make at their points (n, 3), and its slope along them (n,)."""
    tree = DipoleTree(points)
    wide, along = spacing[tree.order], unit[tree.order]
    found = tree.winding(np.ascontiguousarray(along * wide[:, np.newaxis] ** 2), wide, np.ones(len(points), bool))
    return found[:, 0], np.einsum("ij,ij->i", found[:, 1:], along)


def _error_of_sides(number: FloatArray) -> float:
    """Return the mean square of the winding number's (n,) difference from 1/2, either way round."""
    return float(min(np.mean((number - 0.5) ** 2), np.mean((number + 0.5) ** 2)))


def _contradicted(number: FloatArray, slope: FloatArray) -> float:
    """Return the share of points that what all normals enclose puts on the other side.

    The winding number (n,) rises along a single normal that is on the wrong side; on a patch that is turned as a whole
    it falls, but from about 0 to −1.
    """
    return float(np.mean((slope > 0) | (number < 0)))


def _point_inward(surfels: Surfels, unit: FloatArray) -> bool:
    """Return whether unit normals (n, 3) of the cloud's points enclose a volume from the wrong side."""
    area = surfels.total(surfels.spacing**2)
    dipoles = Dipoles.of(surfels.points, _group_means(surfels, unit) * area[:, np.newaxis])
    some = dipoles.tree.order[even_rows(len(area), SAMPLE)]
    disc = np.sqrt(area[some] / (2 * np.pi))
    return float(dipoles.winding_at(surfels.points[some], disc).mean()) < -OPEN


def _completed(points: FloatArray, given: FloatArray, rows: IndexArray) -> tuple[FloatArray, int]:
    """Return unit normals, the missing ones those of planes through neighbors, and how many were."""
    length: FloatArray = np.asarray(np.linalg.norm(given, axis=1))
    known = length > 0
    unit = np.where(known[:, np.newaxis], given, 0.0) / np.where(known, length, 1.0)[:, np.newaxis]
    missing = np.flatnonzero(~known)
    if len(missing):
        with progress.silent():
            plane = fit_planes(points, rows[missing]).normal
        agreement = np.einsum("ia,ija->i", plane, unit[rows[missing]])  # missing ones are zero and do not count
        unit[missing] = np.where(agreement < 0, -1.0, 1.0)[:, np.newaxis] * plane
    return unit, len(missing)


def _are_split(points: FloatArray, surfels: Surfels, unit: FloatArray) -> bool:
    """Return whether groups of points are of two sheets: each lies to the side of its normal from their middle."""
    height = np.einsum("ij,ij->i", points - surfels.points[surfels.group], unit)
    return bool(2 * height.mean() > SPLIT * np.sqrt(np.mean(height**2)))


def _oriented_anew(points: FloatArray, unit: FloatArray, surfels: Surfels) -> Orientation:
    """Return normals that contradict one another with sides found anew, unless they are of two sheets in the noise.

    Right normals of thin noisy parts contradict one another too, but not what they enclose.
    """
    number, slope = _winding(points, surfels.spacing, unit)
    if _contradicted(number, slope) <= CONTRADICTED:
        return Orientation(unit, (SPLIT_NOTE if _are_split(points, surfels, unit) else KEPT_NOTE,))
    anew = _sides_anew(points, unit, surfels)
    if anew.normals is unit or anew.is_open:
        return anew
    before, after = (_error_of_sides(each) for each in (number, _winding(points, surfels.spacing, anew.normals)[0]))
    return anew if after <= BETTER * before else Orientation(unit, (KEPT_NOTE,))


def _repaired(points: FloatArray, unit: FloatArray, repaired: FloatArray) -> Orientation:
    """Return the repaired normals (n, 3), and how many of those given were turned, and where."""
    turned = np.einsum("ij,ij->i", repaired, unit) < 0
    if not turned.any():
        return Orientation(repaired, ())
    place = tell_middle(points[turned], points)
    count = tell_count(int(turned.sum()), "normal")
    note = f"flipped to agree with their neighbors: {count}, one of them at {place}"
    return Orientation(repaired, (note,))


def _beyond_repair(cloud: OrientedCloud, unit: FloatArray, repaired: FloatArray) -> Orientation:
    """Return the sides found anew or, where these do not enclose a volume better, repaired normals (n, 3).

    Where many were wrong, they are the majority in places, and neighbors repair none there. On an open sheet, which
    encloses nothing, those found anew are taken where fewer neighbors oppose one another.
    """
    points, rows, surfels = cloud.points, cloud.neighbors.row, cloud.surfels
    anew = _sides_anew(points, unit, surfels)
    if anew.normals is unit:
        return _repaired(points, unit, repaired)
    if anew.is_open:
        after, before = (opposed_share(points, each, rows) for each in (anew.normals, repaired))
    else:
        after, before = (
            _error_of_sides(_winding(points, surfels.spacing, each)[0]) for each in (anew.normals, repaired)
        )
    return anew if after < before else _repaired(points, unit, repaired)


def _sides_anew(points: FloatArray, unit: FloatArray, surfels: Surfels) -> Orientation:
    """Return unit normals (n, 3) on the sides that the points have without them, or as they are, with the reason."""
    try:
        outward, notes, cut, is_open = orient_surfels(points, surfels)
    except OrientationError as problem:
        return Orientation(unit, (f"normals contradict one another and were kept as they are ({problem})",))
    if cut is not None:
        return Orientation(unit, ("normals contradict one another along a line and were kept as they are",))
    turned = np.asarray(np.einsum("ij,ij->i", unit, outward) < 0)
    if len(surfels.points) < len(points) and 0 < turned.sum() < len(points):
        height = np.einsum("ij,ij->i", points - surfels.points[surfels.group], outward)
        apart = float(np.mean(height[~turned]) - np.mean(height[turned]))
        if apart > SPLIT * float(np.std(height)):
            return Orientation(unit, (SPLIT_NOTE,))
    if is_open:
        turned ^= _mostly(turned, surfels)
        notes = (MAJORITY_NOTE, *notes)
    found = np.where(turned, -1.0, 1.0)[:, np.newaxis] * unit
    said = f"normals contradicted one another: {turned.sum()} of {len(unit)} were flipped"
    return Orientation(found, (said, *notes), is_open=is_open)


def _mostly(turned: npt.NDArray[np.bool_], surfels: Surfels) -> npt.NDArray[np.bool_]:
    """Return for each point (n,) whether most points of its connected piece are turned."""
    rows = surfels.rows
    ends = np.repeat(np.arange(len(rows)), rows.shape[1]), rows.ravel()
    graph = coo_array((np.ones(rows.size, np.int8), ends), shape=(len(rows), len(rows)))
    piece = connected_components(graph, directed=False)[1][surfels.group]
    mostly = np.bincount(piece, turned) > np.bincount(piece) / 2
    return np.asarray(mostly[piece])
