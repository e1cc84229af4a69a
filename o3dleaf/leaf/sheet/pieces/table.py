"""A table, or a wall, that was scanned with a leaf: a plane that goes on around what rises from one side of it."""

from typing import NamedTuple

import numpy as np
import shapely
from scipy import ndimage

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.pieces.leftovers import FEWEST, LINK, groups_of
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import thinned

MAX_POINTS = 5000
"""Points by which a plane and its noise are found, at most."""
TRIALS, SAMPLE = 200, 2000
"""Planes through three points that are tried, and points that each is judged by: of a plane that holds a quarter of
them 200 trials miss it once in twenty times, of half of them never (0.875^200)."""
LOOSE = 1 / 100
"""Of the scan's size, that a plane's points may lie off it at first: a table may be bowed by half of that."""
MAX_BEND = 1 / 50
"""Sagitta of a table over its width, at most: of a leaf as flat one that lies over it makes it one."""
DEVIATIONS, SPACINGS = 3.0, 0.5
"""Of noise, and of the spacing, within which points are on the table: the larger."""
MIN_SHARE = 0.25
"""Of the scan's points, that are on a table at least."""
MIN_POINTS = 100
"""Points over a table that can be a leaf, at least: ten spacings across."""
RELIEF = 0.2
"""Height of what is joined over a plane's width from which on it is no relief of a leaf that lies flat."""
MOSTLY = 0.5
"""Share of its points."""
MAX_BELOW = 0.05
"""Points under the table over those above it, at most: nothing is seen through a table."""
CELL = 3.0
"""Spacings that a random scan leaves no gap of: what has no points in such a cell is not table."""


class Table(NamedTuple):
    """A plane of a scan and what rises from it, in rows of its points.

    Attributes
    ----------
    on : (k,) ndarray of int64
        Points of the plane.
    apart : tuple of (k,) ndarrays
        What lies over it and hangs together with it nowhere.
    joined : tuple of (k,) ndarrays
        What rises out of it, the largest first: it goes on around the foot of one of them at least.
    near, height, width : float
        From the plane, within which points are its own; of the highest point of what it goes on around; of the plane.
    """

    on: IntArray
    apart: tuple[IntArray, ...]
    joined: tuple[IntArray, ...]
    near: float
    height: float
    width: float

    @property
    def is_sure(self) -> bool:
        """Whether something stands apart, or what is joined is too tall for the relief of a leaf that lies flat."""
        return bool(self.apart) or self.height > RELIEF * self.width

    def is_in(self, held: IntArray) -> bool:
        """Return whether a sheet, some rows (k,), holds most of the plane."""
        return bool(np.isin(self.on, held).mean() > MOSTLY)

    @property
    def parts(self) -> tuple[IntArray, ...]:
        """Rows of the plane and of each thing that is joined with it; nothing where there is none."""
        return (self.on, *self.joined) if self.joined else ()

    def said(self) -> str:
        """Return what was found."""
        over = sum(map(len, self.apart + self.joined))
        return (
            f"{len(self.on):,} points lie within {tell_length(self.near)} of one plane {tell_length(self.width)} wide, "
            f"and {over:,} over one side of it, as a leaf over a table does"
        )

    def tell(self, held: IntArray, pieces: str) -> str:
        """Return a line on what is joined with it, how much of that a sheet holds, by rows (k,), and the `pieces`."""
        lesser = len(np.intersect1d(held, np.concatenate(self.joined)))
        return f"{self.said()}: taken as one sheet, with {lesser:,} of these; `piece` takes one of {pieces}"


class _BowedPlane(NamedTuple):
    """A plane, nearly: z over x and y of a frame (3, 3) at an origin, a polynomial of second degree in x, y / size."""

    origin: FloatArray
    frame: FloatArray
    size: float
    terms: FloatArray = np.zeros(6)

    def local(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the places (n, 2) of points (n, 3) in the plane, and their heights (n,) over it, bowed."""
        place = (points - self.origin) @ self.frame.T
        return place[:, :2], place[:, 2] - self.powers(place[:, :2]) @ self.terms

    def powers(self, place: FloatArray) -> FloatArray:
        """Return the terms (n, 6) at places (n, 2)."""
        x, y = (place / self.size).T
        return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)

    def fitted(self, points: FloatArray, near: float) -> "_BowedPlane":
        """Return the plane through those points (n, 3) that lie near this one."""
        place, height = self.local(points)
        on = np.abs(height) <= near
        more = np.linalg.lstsq(self.powers(place[on]), height[on], rcond=None)[0]
        return self._replace(terms=self.terms + more)

    def bend(self, place: FloatArray) -> float:
        """Return how far it lies off a true plane over places (n, 2), from lowest to highest."""
        powers = self.powers(place)
        height = powers[:, 3:] @ self.terms[3:]
        flat = powers[:, :3] @ np.linalg.lstsq(powers[:, :3], height, rcond=None)[0]
        return float(np.ptp(height - flat))


def find_table(scan: FloatArray, rows: IntArray) -> Table | None:
    """Return the table or wall among the points of a scan (n, 3) in some `rows` (k,), and what rises from it, or None.

    It is a plane within the noise, but for a slight bow, that holds a quarter of the points or more, and nothing lies
    under it. A leaf that is as flat, as one that was pressed, is none: nothing hangs over it, and what rises from it,
    as a midrib, goes on to its margin.
    """
    if len(rows) < 2 * MIN_POINTS:
        return None
    some = scan[rows[thinned(len(rows), -(-len(rows) // MAX_POINTS))]]
    plane = _largest_plane(some)
    if plane is None:
        return None
    cloud = OrientedCloud.of(some)
    try:
        spacing, noise = cloud.spacing, cloud.noise
    except InputError:  # they show no surface
        return None
    spacing *= float(np.sqrt(len(some) / len(rows)))
    near = max(DEVIATIONS * noise, SPACINGS * spacing)
    for tolerance in (LOOSE * plane.size + near, LOOSE * plane.size / 2 + near, near, near):
        plane = plane.fitted(some, tolerance)
    place, height = plane.local(some)
    own = place[np.abs(height) <= near]
    if len(own) < MIN_SHARE * len(some) or MAX_BEND * _width(own) < plane.bend(own):
        return None
    return _with_what_rises(scan, rows, plane, near, spacing)


def _largest_plane(points: FloatArray) -> _BowedPlane | None:
    """Return the plane that most points (n, 3) are near, by trial, or None if it holds too few."""
    sample = points[thinned(len(points), -(-len(points) // SAMPLE))]
    size = float(np.ptp(points, axis=0).max())
    corners = sample[np.random.default_rng(0).integers(len(sample), size=(TRIALS, 3))]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = np.abs((sample @ across.T) - np.einsum("ij,ij->i", corners[:, 0], across))
    held = (height <= LOOSE * size * np.linalg.norm(across, axis=1)) & (across != 0).any(axis=1)
    best = int(held.sum(axis=0).argmax())
    if held[:, best].mean() < MIN_SHARE:
        return None
    origin = sample[held[:, best]].mean(axis=0)
    return _BowedPlane(origin, np.linalg.svd(sample[held[:, best]] - origin, full_matrices=False)[2], size)


def _with_what_rises(scan: FloatArray, rows: IntArray, plane: _BowedPlane, near: float, spacing: float) -> Table | None:
    """Return the table in a plane, and what of a scan's points in some rows rises from it, or None."""
    place, height = plane.local(scan)
    on = np.abs(height) <= near
    groups = groups_of(scan, rows, LINK * spacing)
    main = max(groups, key=lambda group: int(on[group].sum()))
    own = main[on[main]]
    hull = shapely.MultiPoint(place[own]).convex_hull
    # No more cells than points, about, where the table is much sparser than the leaf.
    cell = max(CELL * spacing, float(np.sqrt(hull.area / len(own))))
    hull = hull.buffer(-CELL * spacing)
    shapely.prepare(hull)
    over = shapely.contains_xy(hull, *place.T) & (np.abs(height) > 2 * near)
    side = np.sign(height[rows[over[rows]]].sum())
    up, down = over & (height * side > 0), over & (height * side < 0)
    if down[rows].sum() > MAX_BELOW * up[rows].sum():
        return None
    apart = tuple(group for group in groups if group is not main and up[group].sum() >= MIN_POINTS)
    rising = tuple(group for group in groups_of(scan, main[~on[main]], LINK * spacing) if len(group) >= FEWEST)

    def stands(group: IntArray) -> bool:
        foot = place[group[np.abs(height[group]) <= LINK * spacing]]
        return up[group].sum() >= MIN_POINTS and _goes_around(place[own], foot, cell)

    standing = [group for group in rising if stands(group)]
    if not apart and not standing:
        return None
    tallest = max((float(np.abs(height[group]).max()) for group in standing), default=0.0)
    return Table(own, apart, rising if standing else (), near, tallest, _width(place[own]))


def _width(places: FloatArray) -> float:
    """Return the width of an area in which places (n, 2) lie, of a strip as wide as they scatter."""
    return float(np.sqrt(12 * np.linalg.eigvalsh(np.cov(places.T))[0]))


def _goes_around(table: FloatArray, foot: FloatArray, cell: float) -> bool:
    """Return whether from the places (k, 2) of a foot no way leads out but over those (n, 2) of a table."""
    both = np.concatenate([table, foot])
    low = both.min(axis=0)
    shape = tuple((np.ptp(both, axis=0) / cell).astype(int) + 7)

    def cells(places: FloatArray) -> BoolArray:
        held = np.zeros(shape, dtype=bool)
        held[tuple(((places - low) / cell).astype(int).T + 3)] = True
        return held

    own = cells(foot)
    inside = ndimage.binary_fill_holes(cells(table) | own)
    return not bool((ndimage.binary_dilation(own, iterations=2) & ~inside).any())
