"""Lines along which sheets of a cloud meet, and how far from them the sheets are cut."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count
from o3dleaf.surface.cloud.neighbors import IndexArray

NEAREST = 6
"""Places that a point's distance from the lines is measured to: several stand at one station."""

WITHIN = 4.0
"""Clearances from a line within which neighbors may lie on another sheet: 2.3 spacings beyond the cut, and some."""
STRAIGHT = float(np.cos(np.radians(10.0)))
"""Cosine of the angle by which two places farther apart may lie off the line of each: a gap is not bent round."""
MORE = 4
"""Times as many neighbors among which those of the own sheet are sought: as many sheets as may meet, and one."""


@dataclass(frozen=True, eq=False)
class Branchings:
    """Lines along which three or more sheets meet, as places one or two spacings apart, each with a short segment.

    Attributes
    ----------
    places : (k, 3) ndarray
        On the lines.
    directions : (k, 3) ndarray
        Unit vectors along them.
    sheets : (k,) ndarray of int64
        How many sheets meet at each place.
    half : (k,) ndarray
        Half the length of the segment at each place, the distance to its neighbors on the line.
    angle : (k,) ndarray
        Least angle between two of the sheets, in radians.
    clearance : (k,) ndarray
        Distance from the line up to which points are left out and a surface is cut.
    line : (k,) ndarray of int64
        Which line each place is on, from 0 on, that with most places first.
    """

    places: FloatArray
    directions: FloatArray
    sheets: IndexArray
    half: FloatArray
    angle: FloatArray
    clearance: FloatArray
    line: IndexArray

    def __len__(self) -> int:
        return len(self.places)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.places)

    def nearness(self, points: npt.NDArray[np.float64]) -> FloatArray:
        """Return the (n,) distances of points (n, 3) from the nearest line over the clearance there: below 1 is cut.

        Far from all lines, where nothing is cut, it is infinite.
        """
        near = np.full(len(points), np.inf)
        reach = float(np.hypot(self.half.max(), self.clearance.max()))
        row = query(self._tree, points, k=np.arange(1, NEAREST + 1), distance_upper_bound=2 * reach)[1]
        for place in row.T:
            some = np.flatnonzero(place < len(self))
            at = place[some]
            arm = points[some] - self.places[at]
            along = np.clip(np.einsum("ij,ij->i", arm, self.directions[at]), -self.half[at], self.half[at])
            off = np.linalg.norm(arm - along[:, np.newaxis] * self.directions[at], axis=1)
            near[some] = np.minimum(near[some], off / self.clearance[at])
        return near

    def clearance_at(self, points: FloatArray) -> FloatArray:
        """Return the clearance (n,) at the places nearest to points (n, 3)."""
        return np.asarray(self.clearance[query(self._tree, points)[1]])

    def part(self, points: FloatArray, tree: cKDTree, rows: IndexArray) -> IndexArray:
        """Return the neighbors `rows` (n, k) of points (n, 3) without those on another sheet, and more of the own.

        Seen from the line, another sheet is half the least angle or more away.
        """
        some, wanted = np.flatnonzero(self.nearness(points) < WITHIN), rows.shape[1]
        near = query(tree, points[some], k=np.arange(1, min(MORE * wanted, tree.n) + 1))[1]
        at = self._tree.query(points[some])[1]
        own = _across(points[some] - self.places[at], self.directions[at])
        other = _across(points[near] - self.places[at, np.newaxis], self.directions[at, np.newaxis])
        away = np.einsum("ij,ikj->ik", own, other) < np.cos(self.angle[at] / 2)[:, np.newaxis]
        away[:, 0] = False
        parted = rows.copy()
        parted[some] = np.take_along_axis(near, np.argsort(away, axis=1, kind="stable")[:, :wanted], axis=1)
        return parted

    def tell(self, left_out: int, cloud: FloatArray) -> tuple[str, ...]:
        """Return a line of text for each line of places: how many sheets meet, where, and how many points were cut."""
        lines = []
        for number in range(int(self.line.max()) + 1):
            on = self.line == number
            at = tell_middle(self.places[on], cloud)
            lines.append(f"{int(np.median(self.sheets[on]))} sheets meet at {at}")
        counted = f"cut there, {tell_count(left_out, 'point')} left out"
        return (*lines[:-1], f"{lines[-1]}; {counted}")


def _across(arm: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the unit vectors (..., 3) of arms upright to directions (..., 3)."""
    upright = arm - np.einsum("...j,...j->...", arm, direction)[..., np.newaxis] * direction
    return np.asarray(upright / np.maximum(np.linalg.norm(upright, axis=-1, keepdims=True), np.finfo(np.float64).tiny))


def join_places(places: FloatArray, directions: FloatArray, reach: FloatArray) -> IndexArray:
    """Return which line (k,) each of some places is on, the largest first.

    Those within half their `reach` (k,) hang together, and those within all of it that lie on one straight line.
    """
    one, other = _pairs(places, directions, reach)
    graph = coo_array((np.ones(len(one), np.int8), (one, other)), shape=(len(places), len(places)))
    label = connected_components(graph, directed=False)[1]
    order = np.argsort(-np.bincount(label), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return np.asarray(rank[label], np.int64)


def half_gaps(places: FloatArray, directions: FloatArray, reach: FloatArray, least: FloatArray) -> FloatArray:
    """Return half the distance (k,) along the line from each place to the next one, on the side where it is farther.

    The next one is more than `least` (k,) away, and joined as in `join_places`. A place at an end has none: a quarter
    of the reach is what it has seen of its sheets.
    """
    one, other = _pairs(places, directions, reach)
    one, other = np.concatenate([one, other]), np.concatenate([other, one])
    along = np.einsum("ij,ij->i", places[other] - places[one], directions[one])
    half = least.copy()
    for side in (along, -along):
        ahead = side > least[one]
        following = np.full(len(places), np.inf)
        np.minimum.at(following, one[ahead], side[ahead])
        half = np.maximum(half, np.where(np.isinf(following), reach / 2, following) / 2)
    return half


def _pairs(places: FloatArray, directions: FloatArray, reach: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return all pairs of places that are on one line."""
    one, other = cKDTree(places).query_pairs(float(reach.max()), output_type="ndarray").astype(np.int64).T
    arm = places[other] - places[one]
    far, least = np.linalg.norm(arm, axis=1), np.minimum(reach[one], reach[other])
    along = np.minimum(*(np.abs(np.einsum("ij,ij->i", arm, directions[end])) for end in (one, other)))
    joined = (far <= least / 2) | (far <= least) & (along >= STRAIGHT * far)
    return one[joined], other[joined]
