"""Both sides of a leaf that is a few point distances thick, moved to the middle between them."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.residuals.two_layers import APART, BETWEEN, LESSER, MOST, SEEN
from o3dleaf.leaf.sheet.layers.widths import PARALLEL, STEEP, WIDEST
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, nearest_layers
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

NEAREST = 64, 256, 1024
"""Points around a place that its tangent plane is found from: of two sides they reach both where these are up to 4, 8
and 17 spacings apart."""
NEARLY = 0.9
"""Share of the most two-sided places, from which on fewer points around places do: the leaf bends less there."""
TRIED = (100, MOST / 2), (400, MOST)
"""Places at which sides are sought first, and the share of two-sided ones below which there are none: first at few, of
which by chance half of that share is five deviations away."""
MAX_PLACES = 5_000
"""Places at which the middle is found, from which points have their own."""
AGREEING = 7
"""Places of whose middles a point is moved to the median: beside a margin quadrics of single places lean."""
SPANNED = 1e-12
"""Squared length, of such as are about 1, up to which it may be rounding alone, which is 1e-15."""
ROUNDS = 6
"""Times that points are given to the nearer of two quadrics, which are fitted anew."""
TWICE = 0.5
"""Share of an open sheet over which it lies twice from which on it is that of a leaf folded in two or rolled up: 0.8
and more of those, and next to none of two sides, of which each is a sheet. Up to `WIDEST` spacings apart triangles may
join sides, but so that they face one way; a leaf folded in two faces away from itself."""
REACH = 1.5
"""Times the distance of the sides within which the sheet is seen to lie twice."""
MAX_SHEET_POINTS = 20_000
BATCH_SIZE = 512


class BothSides(NamedTuple):
    """A scan of both sides of a leaf: its points (n, 3) moved to the middle, how far apart the sides are, their share.

    The share is that of the places at which both sides are seen.
    """

    points: FloatArray
    apart: float
    share: float

    def tell(self) -> str:
        """Return a line on what was found and done."""
        return (
            f"both sides of the leaf, {tell_length(self.apart)} apart on {100 * self.share:.3g} % of the scan, around "
            f"{tell_middle(self.points, self.points)}: the blade runs midway between them; if the leaf is folded or "
            "rolled up instead, one_sheet=False keeps its layers apart"
        )


class _Places(NamedTuple):
    """Two parallel quadrics at places of a cloud.

    Origins (m, 3); axes (m, 3, 3), in columns the normal and two tangents; radii (m,); coefficients (m, 7) over 1, x,
    y, x², xy, y² of tangential coordinates in radii, and the height of the upper one over the lower; which are
    `two_sided` (m,).
    """

    origin: FloatArray
    axes: FloatArray
    radius: FloatArray
    coefficients: FloatArray
    two_sided: BoolArray

    @property
    def apart(self) -> FloatArray:
        """Distances (m,) of the sides."""
        return np.abs(self.coefficients[:, 6])

    def only(self, chosen: BoolArray) -> "_Places":
        """Return some (m,) of the places."""
        kept = (self.origin[chosen], self.axes[chosen], self.radius[chosen], self.coefficients[chosen])
        return _Places(*kept, self.two_sided[chosen])


def find_both_sides(points: FloatArray) -> BothSides | None:
    """Return the points of a scan (n, 3) of both sides of a thin leaf, moved to the middle; None of any other scan.

    Heights h of points around a place, seen along the normal, are fitted by two parallel quadrics,

    .. math:: h ≈ q(x, y) + d s,  s ∈ {0, 1},

    each point given to the nearer one in turn. Where they leave much less than one quadric does they are the sides of a
    leaf of thickness d, and points move by ± d/2 along the normal. A scan of which one open sheet goes through both, as
    of a leaf folded in two or rolled up, is none.
    """
    if len(points) < 2 * SEEN:
        return None
    tree = cKDTree(points)
    for some, least in TRIED:
        rows = even_rows(len(points), some)
        tried = [_fit_places(points, tree, rows, min(count, len(points))) for count in NEAREST]
        shares = np.array([np.mean(places.two_sided) for places in tried])
        if shares.max() < least:
            return None
    best = int(np.argmax(shares >= NEARLY * shares.max()))
    if _is_folded(points, float(np.median(tried[best].apart[tried[best].two_sided]))):
        return None
    rows = even_rows(len(points), MAX_PLACES)
    places = _fit_places(points, tree, rows, min(NEAREST[best], len(points)))
    double = places.only(places.two_sided)
    return BothSides(_moved(points, double), float(np.median(double.apart)), float(shares[best]))


def _fit_places(points: FloatArray, tree: cKDTree, rows: IntArray, count: int) -> _Places:
    """Return two quadrics at each of some points, by the `count` nearest."""
    parts = [_fit_some(points, tree, rows[i:j], count) for i, j in blocks(len(rows), BATCH_SIZE)]
    origin, axes, radius, coefficients = (np.concatenate([part[i] for part in parts]) for i in range(4))
    return _Places(origin, axes, radius, coefficients, np.concatenate([part.two_sided for part in parts]))


def _fit_some(points: FloatArray, tree: cKDTree, rows: IntArray, count: int) -> _Places:
    near = points[query(tree, points[rows], k=count)[1]]
    centered = near - near.mean(axis=1, keepdims=True)
    axes = np.linalg.eigh(centered.mT @ centered)[1]
    local = (near - points[rows][:, np.newaxis]) @ axes
    beside = local[..., 1] ** 2 + local[..., 2] ** 2
    seen = np.argsort(beside, axis=1, kind="stable")[:, :SEEN]
    local = np.take_along_axis(local, seen[..., np.newaxis], axis=1)
    radius = np.sqrt(np.take_along_axis(beside, seen[:, -1:], axis=1)[:, 0])
    radius = np.where(radius > 0, radius, 1.0)
    basis, weights = _orthonormal(_quadric(local[..., 1:] / radius[:, np.newaxis, np.newaxis]))
    height = local[..., 0]
    left = _beside(basis, height)
    sides = (left > _split(left)[:, np.newaxis]).astype(np.float64)
    for _ in range(ROUNDS):
        # Least squares by both: what no quadric has of the sides, fitted to what none has of the heights.
        own = _beside(basis, sides)
        length = (own**2).sum(axis=1)
        apart = np.divide((own * left).sum(axis=1), length, out=np.zeros_like(length), where=length > SPANNED)
        step = apart[:, np.newaxis]
        lower, rest, over = height - step * sides, left - step * own, left + step * (sides - own)
        sides = (np.abs(over) > np.abs(over - step)).astype(np.float64)
    coefficients = np.column_stack([(weights @ (basis.mT @ lower[..., np.newaxis]))[..., 0], apart])
    two_sided = (rest**2).sum(axis=1) <= BETWEEN * (left**2).sum(axis=1)
    two_sided &= np.minimum(sides.mean(axis=1), 1 - sides.mean(axis=1)) >= LESSER
    two_sided &= np.abs(coefficients[:, 6]) >= APART * radius * np.sqrt(np.pi / SEEN)
    return _Places(points[rows], axes, radius, coefficients, two_sided)


def _quadric(place: FloatArray) -> FloatArray:
    """Return the monomials (..., 6) of places (..., 2)."""
    x, y = place[..., 0], place[..., 1]
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return orthonormal columns (m, k, c) that span those given (m, k, c), and the weights (m, c, c) that make them.

    Where those given depend on one another some are 0.
    """
    values, vectors = np.linalg.eigh(columns.mT @ columns)
    spanned = values > SPANNED * values[:, -1:]
    weights = vectors * np.where(spanned, 1 / np.sqrt(np.where(spanned, values, 1.0)), 0.0)[:, np.newaxis]
    return columns @ weights, weights


def _beside(basis: FloatArray, values: FloatArray) -> FloatArray:
    """Return what of values (m, k) orthonormal columns (m, k, c) do not span."""
    return values - (basis @ (basis.mT @ values[..., np.newaxis]))[..., 0]


def _split(values: FloatArray) -> FloatArray:
    """Return the value (m,) up to which one of two groups of each row (m, k) reaches, their variances the least."""
    rising = np.sort(values, axis=1)
    below = np.arange(1, values.shape[1])
    above = values.shape[1] - below
    sums = np.cumsum(rising, axis=1)[:, :-1]
    difference = sums / below - (rising.sum(axis=1, keepdims=True) - sums) / above
    last = np.argmax(difference**2 * below * above, axis=1)
    return np.asarray(rising[np.arange(len(values)), last])


def _is_folded(points: FloatArray, apart: float) -> bool:
    """Return whether one open sheet goes through both sides, so far apart; round all of a margin it is closed."""
    cloud = OrientedCloud.of(points[thinned(len(points), -(-len(points) // MAX_SHEET_POINTS))])
    sheets = OpenSheets.of(cloud.points, np.zeros(len(cloud)), cloud.spacing)
    if sheets.is_closed:
        return False
    vertices, triangles = sheets.sheet()
    layers = nearest_layers(vertices, vertex_normals(vertices, triangles), REACH * apart, STEEP)
    twice = np.isfinite(layers.distance)
    if apart <= WIDEST * cloud.spacing:
        twice &= layers.facing <= -PARALLEL
    return bool(np.mean(twice.any(axis=1)) > TWICE)


def _moved(points: FloatArray, places: _Places) -> FloatArray:
    """Return points (n, 3) moved to the middle of the sides: the median of where the nearest places have it."""
    count = min(AGREEING, len(places.radius))
    distance, nearest = query(cKDTree(places.origin), points, k=[*range(1, count + 1)])
    moves = np.stack([_move(points, places, column) for column in nearest.T], axis=1)
    far = distance[:, 0] > 2 * places.radius[nearest[:, 0]]
    return np.asarray(np.where(far[:, np.newaxis], points, points + np.median(moves, axis=1)))


def _move(points: FloatArray, places: _Places, row: IntArray) -> FloatArray:
    """Return by how much points (n, 3) lie off the middle of the sides at one place (n,) each."""
    axes, coefficients, radius = places.axes[row], places.coefficients[row], places.radius[row]
    local = np.einsum("ni,nij->nj", points - places.origin[row], axes)
    x, y = local[:, 1:].T / radius
    over = local[:, 0] - np.einsum("ni,ni->n", _quadric(np.column_stack([x, y])), coefficients[:, :6])
    _, first, second, xx, xy, yy = coefficients[:, :6].T
    slope = np.column_stack([first + 2 * xx * x + xy * y, second + xy * x + 2 * yy * y]) / radius[:, np.newaxis]
    upright = np.column_stack([np.ones(len(points)), -slope])
    apart = coefficients[:, 6]
    side = np.where(np.abs(over) > np.abs(over - apart), 0.5, -0.5)
    # Heights are upright in the frame of the place; along the quadric's normal sides are nearer by its cosine.
    step = -side * apart / (upright**2).sum(axis=1)
    return np.asarray(np.einsum("nij,nj->ni", axes, upright) * step[:, np.newaxis])
