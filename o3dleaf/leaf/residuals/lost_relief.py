"""Relief that a blade is too smooth for, veins and ruffles, and the area that it lacks by that."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, UniqueRows
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_share
from o3dleaf.leaf.residuals.places import Place, find_places, tell_places

WINDOW = 64
"""Points around one over which the blade's own relief stands out of a quadric, 4.5 spacings to each side: about what a
fit smooths over, and little enough for the bends of a leaf."""
LAGS = (1.25, 1.5, 2.0)
"""Spacings up to which points are paired: short lags see narrow relief, long ones, which have more pairs, weak one."""
SHORT_LAGS = (0.5, 0.75, 1.0)
"""Those for what only nearest neighbors have in common."""
APART = 0.75
"""Spacings beyond which relief of about two and a half spacings and more shows as well. What only nearest neighbors
share is shorter, or noise, as along one line of a scanner that crosses others, or in voxels."""
SECTORS = 8
"""Of directions of pairs, each with a covariance C₀ of its own: that of noise which the points of a scan line have in
common is one along the line and none across it, at any lag. Lines as far apart as the points along them, or farther,
have pairs in directions 45° off and more up to about the longest lag: two sectors' width."""
MIN_SPANNED = 0.05
"""Share of what pairs tell of G in the best known direction, at least, in one that is taken: of pairs all around it is
half. Along scan lines nearest neighbors tell nothing of slopes across, which are ≥ 0 and are left out of the bound."""
BEYOND_CHANCE = 3.0
"""Deviations by which an area must be missing: of smooth leaves one in 740 seems to lack that by chance."""
BEYOND_SHORT = 4.0
"""Deviations by which it must be by one of `SHORT_LAGS`: there are three, and a deviation of few pairs is itself not
known well."""
MAX_LOST = 0.01
"""Share of the area above which it is told: to what a blade's area is asked to be right."""
MOST = 1.5
"""Times the mean share that is lacking where most of it is lost."""
DENSEST = 1e-3
"""Spacings that points lie apart, at least, where many have one place of the chart."""
RIDGE = 1e-9
"""Of windows whose points lie on a line, in squares of their sizes."""
GROUPS = (4, 64)
"""Squares of the chart, at least and at most, that are taken to err independently."""
OF_GROUP = 32
"""Points of a square, at least: it is then nearly three times as wide as the longest lag."""
MIN_POINTS = 256
"""Points of which four windows may be made, at least: fewer tell nothing."""
MIN_PAIRS = 256
"""Pairs of points, at least: four to each of the squares, of which a deviation is known."""
MAX_POINTS = 20_000
"""Points that are paired with those around them; of more, as many, evenly."""
BATCH = 2_000


class LostRelief(NamedTuple):
    """Area that a blade lacks as it smooths relief away.

    Attributes
    ----------
    share, deviation : float
        Of the blade's area, and the standard deviation of that.
    is_short : bool
        Whether only pairs of points nearer than `APART` show it: the relief is shorter than about two and a half
        spacings, or it is noise that neighbors have in common.
    places : tuple of Place
    """

    share: float
    deviation: float
    is_short: bool
    places: tuple[Place, ...]

    @property
    def told(self) -> bool:
        """Whether it is more than chance and more than a hundredth."""
        return self.share > max(MAX_LOST, BEYOND_CHANCE * self.deviation)


class _Pairs(NamedTuple):
    """Pairs of points: rows of the first (m,), lags (m, 2), products of heights (m,) in its spacing, weights (m,)."""

    first: IntArray
    lag: FloatArray
    product: FloatArray
    weight: FloatArray


class _Missing(NamedTuple):
    """A share M, its deviation, and what each point adds to it (n,)."""

    share: float
    deviation: float
    adds: FloatArray


def find_lost_relief(plane: FloatArray, feet: FloatArray, distance: FloatArray, spacing: float) -> LostRelief:
    r"""Return the area that the relief of a scan has more than its blade's.

    Of heights z over the plane the area is :math:`\tfrac12 \operatorname{E}|∇z|^2` more than flat. With
    :math:`z = S + h`, S the blade and h the residuals, the covariances at a lag r fall as

    .. math:: \operatorname{E}[z z' - S S'] = \operatorname{E}[h h' + h S' + S h'] = C_0 - \tfrac12 r^T G r + O(r^4)

    and tr G / 2 is the share M that is lacking, of steep relief √(1 + 2 M) − 1, as of one slope. Noise of single points
    has no covariance at r > 0, whether the blade follows it or not; that of whole scan lines has the same one at any r
    along them, and none in other directions, so that each of `SECTORS` directions has a C₀ of its own. As
    :math:`J_0(k r) - J_0(k t) ≤ k^2 (t^2 - r^2) / 4`, waves as short as the lags count for less than they have: the
    share is a lower bound, and of `LAGS` the one whose bound is highest is taken, if without pairs nearer than `APART`
    area is missing as well. If not, relief shorter than that, or noise of neighbors, shows by `SHORT_LAGS`, of which
    the bound is of `BEYOND_SHORT` deviations.

    Parameters
    ----------
    plane : (n, 2) ndarray
        (along, across) of the points.
    feet : (n, 3) ndarray
        On the blade, in the world.
    distance : (n,) ndarray
        Signed, of the points from the blade.
    spacing : float

    Returns
    -------
    LostRelief
        Of fewer than `MIN_POINTS` points nothing, with a deviation of all.
    """
    if len(plane) < MIN_POINTS:
        return LostRelief(0.0, 1.0, is_short=False, places=())
    pairs = _pair(plane, feet, distance, DENSEST * spacing)
    group = _squares(plane)
    lost = _missing(pairs, APART, max(LAGS), group)
    if _bound(lost, BEYOND_CHANCE) > 0:
        lost, is_short = _highest(pairs, LAGS, BEYOND_CHANCE, group), False
    else:
        short = _highest(pairs, SHORT_LAGS, BEYOND_SHORT, group)
        is_short = _bound(short, BEYOND_SHORT) > 0
        lost = short if is_short else lost
    longer = float(np.sqrt(1 + 2 * max(lost.share, 0.0)))
    share = longer - 1 if lost.share > 0 else lost.share
    found = LostRelief(share, lost.deviation / longer, is_short=is_short, places=())
    return found._replace(places=find_places(feet, _most(lost, group), spacing)) if found.told else found


def tell_lost_relief(lost: LostRelief, area: str) -> str:
    """Return the line that says how much is lacking, given in words as well, and where."""
    where = f"most on {tell_places(lost.places)}" if len(lost.places) > 1 else tell_places(lost.places)
    where, share = where if lost.places else "all over it", tell_share(lost.share)
    if lost.is_short:
        return (
            f"nearest neighbors lie off the blade alike, {where}: relief shorter than about two and a half spacings, "
            f"by which it lacks about {share} of its area, {area}, or noise that neighbors have in common"
        )
    return (
        f"the blade lacks about {share} of its area, {area}, {where}: relief too fine for it to follow, as of veins "
        "and ruffles, or noise that neighbors have in common"
    )


def _pair(plane: FloatArray, feet: FloatArray, distance: FloatArray, least: float) -> _Pairs:
    """Return the pairs of points up to the longest lag, in spacings around the first, no less than `least`."""
    rows = np.arange(0, len(plane), -(-len(plane) // MAX_POINTS))
    tree, parts = cKDTree(plane), []
    for some in np.array_split(rows, -(-len(rows) // BATCH)):
        near = query(tree, plane[some], k=[*range(1, WINDOW + 1)])[1]
        beside, height = _over_quadric(plane[near] - plane[some][:, np.newaxis], feet[near] - feet[some][:, np.newaxis])
        # A window is a disc as wide as its largest coordinate, nearly; beside a margin half of one.
        spacing = np.maximum(np.sqrt(np.pi / WINDOW) * np.abs(beside).max(axis=(1, 2)), least)
        h, lag = distance[near] / spacing[:, np.newaxis], beside / spacing[:, np.newaxis, np.newaxis]
        height /= spacing[:, np.newaxis]
        product = h[:, :1] * (h + height) + height[:, :1] * h
        first, second = np.nonzero(np.hypot(lag[..., 0], lag[..., 1]) <= max(LAGS))
        first, second = first[second > 0], second[second > 0]
        parts.append((some[first], lag[first, second], product[first, second], spacing[first] ** 2))
    return _Pairs(*(np.concatenate(each) for each in zip(*parts, strict=True)))


def _over_quadric(flat: FloatArray, space: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (n, k, 2) in the tangent plane and heights (n, k) of points over the quadric through each window.

    Parameters
    ----------
    flat, space : (n, k, 2), (n, k, 3) ndarrays
        In the chart and in the world, from the window's first point.
    """
    size = np.maximum(np.abs(flat).max(axis=(1, 2)), 1e-300)[:, np.newaxis, np.newaxis]
    u, v = np.moveaxis(flat / size, -1, 0)
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    turned = np.swapaxes(terms, 1, 2)
    solved = np.linalg.solve(turned @ terms + RIDGE * np.eye(6), turned @ space)
    first, second = solved[:, 1] / size[:, 0], solved[:, 2] / size[:, 0]
    cross = np.cross(first, second)
    normal = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)
    height = np.einsum("nkc,nc->nk", space - terms @ solved, normal)
    # The chart's axes in the tangent plane: Gram and Schmidt, of the first as it is.
    along = np.maximum(np.linalg.norm(first, axis=1), 1e-300)
    shear = np.einsum("nc,nc->n", first, second) / along
    across = np.linalg.norm(cross, axis=1) / along
    places = (along * flat[..., 0].T + shear * flat[..., 1].T, across * flat[..., 1].T)
    return np.stack([part.T for part in places], axis=-1), height


def _squares(plane: FloatArray) -> IntArray:
    """Return the square of the chart (n,) that each place lies in, by number."""
    least, most = GROUPS
    count = min(max(len(plane) // OF_GROUP, least), most)
    extent = np.ptp(plane, axis=0)
    side = max(float(np.sqrt(np.prod(extent) / count)), float(extent.max()) / count)
    cells = np.floor((plane - plane.min(axis=0)) / (side or 1.0)).astype(np.int64)
    return UniqueRows.of(cells).number


def _highest(pairs: _Pairs, lags: tuple[float, ...], beyond: float, group: IntArray) -> _Missing:
    """Return what is missing by that of the lags whose bound is highest."""
    return max((_missing(pairs, 0.0, lag, group) for lag in lags), key=lambda missing: _bound(missing, beyond))


def _bound(missing: _Missing, beyond: float) -> float:
    """Return what is missing beyond chance, of so many deviations."""
    return missing.share - beyond * missing.deviation


def _missing(pairs: _Pairs, least: float, most: float, group: IntArray) -> _Missing:
    """Return what is missing by the pairs of some lags, of few pairs nothing; its deviation is that of groups (n,)."""
    size = np.hypot(*pairs.lag.T)
    near = (least <= size) & (size <= most)
    if np.count_nonzero(near) < MIN_PAIRS:
        return _Missing(0.0, 1.0, np.zeros(len(group)))
    (u, v), weight = pairs.lag[near].T, pairs.weight[near] / (pairs.weight[near].sum() or 1.0)
    sector = np.floor(np.arctan2(v, u) / np.pi * SECTORS).astype(np.int64) % SECTORS
    terms = _centered(np.column_stack([u * u, 2 * u * v, v * v]), sector, weight)
    # Least squares of −G/2, of which the trace is wanted: a weighted sum of the products.
    inverse = np.linalg.pinv((terms.T * weight) @ terms, rcond=MIN_SPANNED, hermitian=True)
    trace = -weight * (terms @ (inverse[:, 0] + inverse[:, 2]))
    product = pairs.product[near]
    fitted = terms @ (inverse @ (terms.T @ (weight * product)))
    left = _centered(product[:, np.newaxis], sector, weight)[:, 0] - fitted
    by_group = np.bincount(group[pairs.first[near]], trace * left)
    adds: FloatArray = np.bincount(pairs.first[near], trace * product, len(group)).astype(np.float64)
    return _Missing(float(adds.sum()), float(np.linalg.norm(by_group)), adds)


def _centered(values: FloatArray, sector: IntArray, weight: FloatArray) -> FloatArray:
    """Return values (m, k) less their weighted mean in each sector."""
    of = np.maximum(np.bincount(sector, weight, SECTORS), 1e-300)
    mean = np.stack([np.bincount(sector, weight * each, SECTORS) / of for each in values.T], axis=1)
    return values - mean[sector]


def _most(missing: _Missing, group: IntArray) -> BoolArray:
    """Return which points (n,) lie in squares that lack clearly more than the whole does."""
    points = np.bincount(group)
    local = np.bincount(group, missing.adds) * len(group) / points
    chance = 2 * missing.deviation * np.sqrt(len(group) / points)
    return np.asarray((local > MOST * missing.share + chance)[group])
