"""Constraints off the surface: points on both sides of it with their signed distances."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, NotNegative, Positive
from o3dleaf.core.checks.arrays import FloatArray, as_row
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import cloud_loops
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.neighbors import IndexArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

DISTANCE = 0.5
"""Distance of the constraints in spacings, where the cloud is clean: farther, tips of few points bulge between them."""
DISTANCE_OF_NOISY = 0.7
"""The same where it is not: nearer, the errors of normals count for more."""
DISTANCE_OF_MEANS = 1.0
"""The same where points are means of several: their noise was as thick as the spacing."""
EVEN = 2.0
"""Times the median that the spacing around a point may be, or one over it, and count as the cloud's: of even random
clouds, thin parts among them, it is 0.62 to 1.38 times the median."""
EVERY = 2
"""One point in so many has constraints off the surface: they only distinguish inside from outside."""
ROUNDING = 1e-9
"""Share of a distance that is no shortening of it."""
ROOM = 2 / 3
"""Share of the radius of the empty ball, so that a site keeps to a third of the thickness of a sheet."""
SAME_SHEET = 0.5
"""Cosine between normals above which two points belong to one sheet, whatever noise does to their places."""
FLOOR = 0.1
"""Share of the distance wanted below which a site adds nothing and is left out."""
PAIRS = 400
"""Points tested for each point: of more, every second, third, ... is."""
CELLS_A_BLOCK = 64
SIDES = {"both": (0, 1), "outside": (0,), "inside": (1,)}


class OffsetConstraints(NamedTuple):
    """Constraints off the surface.

    Attributes
    ----------
    sites : (m, 3) ndarray
    values : (m,) ndarray
        Signed distance, larger inside: −d for a site outside, +d inside.
    base : (m,) ndarray
        The row of the point that each site stands off from; points and sides that are not there had no room.
    """

    sites: FloatArray
    values: FloatArray
    base: IndexArray

    def __repr__(self) -> str:
        return f"OffsetConstraints({len(self.sites):,} sites)"


@checked
def offset_constraints(
    cloud: CloudLike,
    distance: Positive | npt.ArrayLike | None = None,
    *,
    every: Count = EVERY,
    sides: str = "both",
    floor: NotNegative = FLOOR,
) -> OffsetConstraints:
    """Return sites x_i ± d_i n_i with values ∓d_i that stay on their own side of every other sheet.

    The ball that touches the surface at x_i along n_i and reaches a point x_j of another sheet has the radius

        r_ij = |x_j − x_i|² / (2 |(x_j − x_i) · n_i|),

    and d_i = min(distance, ⅔ min_j r_ij): no point of another sheet is nearer to the site than x_i, and between
    two parallel sheets it keeps to a third of what is between them. Another sheet begins where normals turn by
    60°, so that noise, which moves points off their own sheet, takes no room.

    Parameters
    ----------
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        With normals.
    distance : float or (n,) array_like, optional
        The distance d wanted, in the unit of the points; left out, half a spacing of the cloud, 0.7 where it is noisy,
        or one where points are means of several. Where points are more than twice as far apart, or as close together,
        as most of them, so much more than twice is that distance longer, or shorter.
    every : int
        One point in so many, at random but the same ones each time, has constraints, and besides all those whose
        constraints are nearer than wanted, so that each of close sheets has its own.
    sides : {"both", "outside", "inside"}
        Which offsets are made; all outer ones come first, in the order of the points.
    floor : float
        A site nearer than this share of `distance` is left out.

    Raises
    ------
    InputError
        If the cloud has no normals, or a distance is not above zero.

    References
    ----------
    Carr et al. (2001), SIGGRAPH, 67-76 (off-surface points); Ma, Bae & Choi (2012), The Visual Computer 28, 7-19
    (the ball that touches a point along its normal).
    """
    whole = OrientedCloud.of(cloud)
    x, n, chosen_sides = whole.points, whole.require_normals(), SIDES[require_choice(sides, SIDES, "sides")]
    if distance is None:
        distance = _spacings(whole) * whole.spacing * _unevenness(whole)
    wanted = as_row(distance, "distance", count=len(x))
    for each in (wanted.min(initial=1.0), wanted.max(initial=1.0)):
        require_positive(each, "distance")
    if np.any(wanted <= 0):
        raise InputError(f"distance: {np.sum(wanted <= 0)} are not above zero; give a length, for instance the spacing")
    step = np.minimum(wanted[:, np.newaxis], ROOM * _empty_balls(x, n, 3 * float(wanted.max())))
    chosen = np.zeros(len(x), dtype=bool)
    chosen[np.random.default_rng(0).permutation(len(x))[: max(len(x) // every, 1)]] = True
    large = [step[:, side] >= floor * wanted for side in chosen_sides]
    for side, kept in zip(chosen_sides, large, strict=True):
        chosen |= kept & (step[:, side] < (1 - ROUNDING) * wanted)
    rows = [np.flatnonzero(kept & chosen) for kept in large]
    value = [(1.0 if side else -1.0) * step[some, side] for side, some in zip(chosen_sides, rows, strict=True)]
    base, values = np.concatenate(rows), np.concatenate(value)
    return OffsetConstraints(x[base] - values[:, np.newaxis] * n[base], values, base)


def _spacings(cloud: OrientedCloud) -> float:
    """Return the distance that constraints of a cloud have, in spacings."""
    if (cloud.weights > 1).any():
        return DISTANCE_OF_MEANS
    return DISTANCE if cloud.is_measurable and cloud.is_clean else DISTANCE_OF_NOISY


def _unevenness(cloud: OrientedCloud) -> FloatArray:
    """Return by how much (n,) the spacing around each point is other than most, 1 where that is within `EVEN` times."""
    if not cloud.is_measurable:
        return np.ones(len(cloud))
    relative = cloud.point_spacing / np.median(cloud.point_spacing)
    return np.asarray(relative / np.clip(relative, 1 / EVEN, EVEN))


def _empty_balls(points: FloatArray, normals: FloatArray, reach: float) -> FloatArray:
    """Return the (n, 2) radii, outward and inward, of balls that touch each point and no other sheet within `reach`.

    Where many points lie within reach only some are tested, and all of them within a half, a quarter, ... of it.
    """
    radius = np.full((len(points), 2), np.inf)
    thinning = 2
    while thinning > 1:
        thinning = _shrink_balls(points, normals, reach, radius)
        reach /= 2
    return radius


def _shrink_balls(points: FloatArray, normals: FloatArray, reach: float, radius: FloatArray) -> int:
    """Shrink the (n, 2) radii to what lies within `reach`, and return the thinning of what was tested."""
    cells = Cells.sort(points, reach)
    x, n = points[cells.order], normals[cells.order]
    # A point sees the nine or so cells of its sheet that surround it.
    crowd = 9 * float(np.median(np.repeat(cells.last - cells.first, cells.last - cells.first)))
    thinning = max(1, round(crowd / PAIRS))
    sampled = np.arange(0, len(x), thinning)
    shrunk = np.empty((len(x), 2))

    def task(start: int, stop: int) -> None:
        stretch = cells.first, cells.last, cells.number, sampled, cells.shape
        cloud_loops.empty_balls(x, n, *stretch, SAME_SHEET, start, stop, shrunk)

    run_blocks(task, len(cells.number), CELLS_A_BLOCK)
    radius[cells.order] = np.minimum(radius[cells.order], shrunk)
    return thinning
