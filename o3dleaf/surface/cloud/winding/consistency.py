"""Normals found from the winding number of the whole, where neighbors alone leave them in doubt."""

from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.places import tell_middle
from o3dleaf.core.units import tell_share
from o3dleaf.surface.cloud.normals import SEAM, find_opposed, longest_seam
from o3dleaf.surface.cloud.surfels import DROWNED, Surfels
from o3dleaf.surface.cloud.winding.dipole_tree import DipoleTree

ROUNDS = 6
"""Of descent and turning, where most sides are right: ten change a hundredth of the doubtful points more."""
WIDEST = 2.0
"""Width of the dipoles, in spacings, in the first round: patches of a few points feel what encloses them."""
WIDEST_OF_DOUBTS = 1.3
"""The same where most sides are known: of the slope at a sheet, one that faces it two spacings away leaves more than
four fifths; of dipoles two spacings wide it leaves less than two thirds, and narrow gaps fill up in places."""
NARROWEST = 0.5
"""The same in the last round on clean points: the radius of the disc that a point stands for is 0.56 spacings."""
NOISE_WIDTH = 3.0
"""Standard deviations of the noise that the last width is at least, within 2/3 of it on both sides
of a sheet, where 95 % of the points lie then, the number falls at half its greatest slope or more."""
QUIET = 0.25
"""Quantile of the thickness of neighborhoods that is taken for the noise: thin parts and edges only add to it."""
TILT = 1.5
"""Standard deviations of the noise, over the spacing, up to which the slope of the winding number is tilted against a
normal by noise alone; what agrees as well keeps its direction, which more points were averaged for."""
OFF_HALF = 0.25
"""Difference of the winding number from 1/2, half way to what it is on either side, from which a point is in doubt."""


UNCLEAR = 0.25
"""Slope of the winding number along a normal, over that at a sheet that lies alone, below which its side is uncertain:
another sheet, as near as the dipoles are wide, makes up for three quarters of it."""


UNCERTAIN = 1e-3
"""Share of the points whose sides may be uncertain without a word."""
DOUBTFUL = 0.01
"""Share of uncertain sides up to which what two close sheets enclose is believed: of bowls, pipes and vases 1.3 to 1.7
spacings thick heights leave 1 to 4 % wrong and this 0.1 to 1 %; with 2 to 11 % uncertain it is the other way round."""
MAX_TURNED = 0.1
"""Share of the sides that it may turn: it turns 1 to 4 %, and of sheets half a spacing apart 40 %."""
UNCERTAIN_NOTE = (
    "the sides of {:,} points ({}) remain uncertain, where sheets lie closer than their points tell apart, "
    "around {}; give normals, or where they were scanned from"
)

TORN_NOTE = (
    "what the normals enclose contradicts their neighbors along a line, as where a sheet is rolled up or parts touch: "
    "their sides are those that neighbors agree on"
)


class Consistent(NamedTuple):
    """Unit normals (n, 3) made consistent.

    Attributes
    ----------
    normals : (n, 3) ndarray
    uncertain : (n,) ndarray of bool
        Points whose sides remain uncertain.
    off_half : float
        Root of the mean square of the winding number's difference from 1/2, of the normals as they were given.
    """

    normals: FloatArray
    uncertain: npt.NDArray[np.bool_]
    off_half: float


def settle_doubts(
    points: FloatArray, surfels: Surfels, sides: FloatArray, normals: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the normals (n, 3) of a closed surface made consistent, and a note where they remain uncertain.

    In doubt are planes that are no planes, and normals that a neighbor's opposes. Directions that are as they should be
    but for noise are kept. So are all normals where others would contradict their neighbors along a line on a sheet:
    a sheet that is rolled up encloses something, but not by its sides. Where so many sides were wrong that the winding
    number was off 1/2 by what puts a point in doubt in the mean of all, what is in doubt then is settled once more.

    Parameters
    ----------
    points : (n, 3) ndarray
    surfels : Surfels
    sides : (m, 3) ndarray
        Outward normals of the surfels.
    normals : (n, 3) ndarray
        The same at the points.
    """
    across, along = np.sqrt(surfels.planes.variance[:, :2]).T
    rough = across > DROWNED * along
    noise = float(np.quantile(across, QUIET))
    doubtful = (rough | find_opposed(surfels.points, sides, surfels.rows))[surfels.group]
    settle = partial(make_consistent, points, spacing=surfels.spacing, noise=noise, widest=WIDEST_OF_DOUBTS)
    found = settle(normals, doubtful=doubtful)
    if found.off_half > OFF_HALF:
        found = settle(found.normals, doubtful=found.uncertain)
    if tears(surfels, sides, found.normals):
        return normals, (TORN_NOTE,)
    along_both = np.einsum("ij,ij->i", found.normals, normals)
    alike = np.abs(along_both) * np.hypot(1.0, TILT * noise / surfels.spacing) >= 1
    settled = np.where(alike[:, np.newaxis], np.sign(along_both)[:, np.newaxis] * normals, found.normals)
    return settled, uncertain_notes(points, found)


def settle_sheets(points: FloatArray, spacing: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the normals (n, 3) of two close sheets as what they enclose has them, or those given where it is in doubt.

    Heights over the middle leave a few percent wrong, at rims and where the middle bends: what turns more is no
    correction, but dipoles too wide for sheets so close.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
    spacing : (n,) ndarray
        1/√(points per unit area), of which each sheet has half.
    """
    wide = np.sqrt(2) * spacing
    found = make_consistent(points, normals, wide, 0.0, np.zeros(len(points), bool))
    turned = np.einsum("ij,ij->i", found.normals, normals) < 0
    return found.normals if found.uncertain.mean() <= DOUBTFUL and turned.mean() <= MAX_TURNED else normals


def uncertain_notes(points: FloatArray, found: Consistent) -> tuple[str, ...]:
    """Return the note on how many sides at `points` (n, 3) remain uncertain, and where, if that is worth a word."""
    share, some = found.uncertain.mean(), points[found.uncertain]
    if share <= UNCERTAIN:
        return ()
    return (UNCERTAIN_NOTE.format(len(some), tell_share(share), tell_middle(some, points)),)


def tears(surfels: Surfels, before: FloatArray, after: FloatArray) -> bool:
    """Return whether normals contradict their neighbors along a longer line on a sheet than they did before.

    Parameters
    ----------
    surfels : Surfels
    before : (m, 3) ndarray
        Normals of the surfels.
    after : (n, 3) ndarray
        Normals at the cloud's points.
    """
    across, along = np.sqrt(surfels.planes.variance[:, :2]).T
    sheet = across <= DROWNED * along
    mean = np.column_stack([surfels.total(after[:, a]) for a in range(3)])
    unit = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), np.finfo(float).tiny)
    old, new = (longest_seam(surfels.points, each, surfels.rows, sheet) for each in (before, unit))
    return new > max(old, SEAM)


def make_consistent(
    points: FloatArray,
    normals: FloatArray,
    spacing: FloatArray,
    noise: float,
    doubtful: npt.NDArray[np.bool_],
    *,
    rounds: int = ROUNDS,
    widest: float = WIDEST,
) -> Consistent:
    r"""Return the normals of a closed surface, with those in doubt turned to where its own winding number falls.

    Doubtful are besides the points given those where the winding number w is not about 1/2, and what shares a leaf of
    the tree with them. Their dipoles f take steps down :math:`\sum_i (w(x_i) - 1/2)^2`, whose length is the best
    along its slope, and after each the direction of :math:`-∇w`; the dipoles' width shrinks from round to round.
    Directions follow too, so that a plane through points of two sheets does no harm. (A large flat patch that is turned
    as a whole makes nothing on itself, and is in doubt at its border only.)

    Parameters
    ----------
    points, normals : (n, 3) ndarray
        Normals that are right for the most part.
    spacing : (n,) ndarray
        1/√(points per unit area).
    noise : float
        Standard deviation across the surface.
    doubtful : (n,) ndarray of bool
    rounds : int
        At least two.
    widest : float
        Width of the dipoles in the first round, in spacings.

    References
    ----------
    Lin et al. (2022), ACM Trans. Graph. 42, 18 (w = 1/2 at the points); Lin et al. (2024), ACM Trans. Graph. 43, 55
    (normals made consistent with the gradient of w).
    """
    tree = DipoleTree(points)
    wide = spacing[tree.order]
    area = wide[:, np.newaxis] ** 2
    flux = np.ascontiguousarray(normals[tree.order] * area)
    narrowest = np.maximum(NOISE_WIDTH * noise, NARROWEST * wide)
    first = np.maximum(widest * wide, narrowest)
    off = tree.winding(flux, np.maximum(narrowest, wide), np.ones(len(points), bool))[:, 0] - 0.5
    off_half = float(np.sqrt(np.mean(off**2)))
    wanted = tree.with_leaves(doubtful[tree.order] | (np.abs(off) > OFF_HALF))
    if not wanted.any():
        return Consistent(normals, wanted, off_half)
    for left, part in zip(reversed(range(rounds)), progress.split(*rounds * [1]), strict=True):
        with part:
            share = left / (rounds - 1)
            flux = _improved(tree, flux, share * first + (1 - share) * narrowest, wanted)
    rows, consistent, uncertain = tree.order[wanted], normals.copy(), np.zeros(len(points), bool)
    consistent[rows] = flux[wanted] / np.linalg.norm(flux[wanted], axis=1, keepdims=True)
    fall = -np.einsum("ij,ij->i", tree.winding(flux, narrowest, wanted)[wanted, 1:], consistent[rows])
    uncertain[rows] = fall < UNCLEAR / (2 * narrowest[wanted])  # w = (1 - h/sqrt(h^2 + s^2))/2 at height h over a plane
    return Consistent(consistent, uncertain, off_half)


def _improved(tree: DipoleTree, flux: FloatArray, width: FloatArray, wanted: npt.NDArray[np.bool_]) -> FloatArray:
    """Return dipoles (n, 3) after a step down the error of the winding number, turned to where it falls."""
    now = tree.winding(flux, width, wanted)
    error = np.where(wanted, 0.5 - now[:, 0], 0.0)
    slope = tree.pull(error, width, wanted)
    change = tree.winding(slope, width, wanted)
    curvature = float(change[:, 0] @ change[:, 0])
    length = float(error @ change[:, 0]) / curvature if curvature > 0 else 0.0
    size = np.linalg.norm(flux + length * slope, axis=1, keepdims=True)
    fall = -(now[:, 1:] + length * change[:, 1:])
    steepness = np.linalg.norm(fall, axis=1, keepdims=True)
    turned = wanted & (steepness[:, 0] > 0)
    return np.where(turned[:, np.newaxis], size * fall / np.where(steepness > 0, steepness, 1.0), flux)
