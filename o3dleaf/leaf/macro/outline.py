"""The outline of the blade in the (along, across) plane: an α-shape (Edelsbrunner and Mücke 1994)."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import Delaunay, QhullError, cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points, as_sites
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.blade.outline_area import in_polygon
from o3dleaf.surface.mesh.topology import label_nodes

BLUR = 2.0
"""Width of the Gaussian that a closed leaf's rim is smoothed by, in median spacings: the resolution of the scan."""
MANY = 40_000
"""Triangles, those of 20,000 points, beyond which their union is made of their boundary, in a tenth of the time; its
ring may then begin at another vertex, from which a closed leaf's rim is sampled."""
MAX_FRAGMENTS = 0.01
"""Share of the shrunk outline's area that may lie in other components than the largest."""


@checked
class AlphaShape:
    """The union of the Delaunay triangles of planar points whose circumradius is at most α, in one piece.

    Attributes
    ----------
    points : (n, 2) ndarray
    alpha : float
        The largest circumradius kept, in the points' unit.
    automatic : bool
        Whether α was chosen: the least at which one edge-connected component has every point, without
        a neck narrower than two median spacings, where a mesh of that step would come apart.
    triangles : (m, 3) int ndarray
        The triangles kept: those of the largest edge-connected component.
    pieces : int
        Number of edge-connected components at this α, the kept one included.
    """

    def __init__(self, points: npt.ArrayLike, alpha: Positive | None = None) -> None:
        """Build the α-shape of (n, 2) points; without `alpha` it is the least that makes one piece of all the points.

        Raises
        ------
        InputError
            If there are fewer than three points, they lie on a line, or no triangle is as small as α.
        """
        self.points = as_sites(points, "points", dim=2, least=3)
        try:
            delaunay = Delaunay(self.points)
        except QhullError as cause:
            raise InputError("points: lie on one line; give points that cover an area") from cause
        radii = circumradii(self.points, delaunay.simplices)
        self.automatic = alpha is None
        self.alpha = _least_alpha(delaunay, radii) if alpha is None else require_positive(alpha, "alpha")
        kept = np.flatnonzero(radii <= self.alpha)
        if not len(kept):
            raise InputError(
                f"alpha: {self.alpha:.4g} is below every circumradius (least {radii.min():.4g}); enlarge it"
            )
        self.pieces, labels = _components(delaunay.neighbors, kept)
        areas = np.bincount(labels, triangle_areas(self.points, delaunay.simplices[kept]))
        self.triangles: IntArray = delaunay.simplices[kept[labels == np.argmax(areas)]].astype(np.int64)

    def __repr__(self) -> str:
        chosen = " (automatic)" if self.automatic else ""
        return f"AlphaShape({len(self.points):,} points, alpha {self.alpha:.4g}{chosen}, area {self.area:.4g})"

    def state(self) -> dict[str, Any]:
        """Return what the shape is made of, for `o3dleaf.io.models.model_file`."""
        return {"points": self.points, "alpha": self.alpha}

    @cached_property
    def polygon(self) -> shapely.Polygon:
        """The outline as a polygon, gaps of the scan inside the blade filled."""
        polygon = _filled_union(self.points, self.triangles)
        shapely.prepare(polygon)
        return polygon

    @cached_property
    def rounded(self) -> shapely.Polygon:
        """The outline as a smooth curve: blurred by a Gaussian along it, less where the curve would cross itself."""
        spacing = float(np.median(cKDTree(self.points).query(self.points, k=2)[0][:, 1]))
        ring = self.polygon.exterior
        step = ring.length / max(3, round(ring.length / (spacing / 4)))
        points = shapely.get_coordinates(ring.interpolate(np.arange(0, ring.length - step / 2, step)))
        width = BLUR * spacing / step
        while not (rounded := shapely.Polygon(gaussian_filter1d(points, width, axis=0, mode="wrap"))).is_valid:
            width /= 2
        shapely.prepare(rounded)
        return rounded

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) bounding box of the outline."""
        return np.array(self.polygon.bounds).reshape(2, 2)

    @property
    def area(self) -> float:
        """Area of the outline in the plane, gaps filled."""
        return float(self.polygon.area)

    def contains(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return for each of the (n, 2) points whether it lies in the outline or on it."""
        return in_polygon(self.polygon, as_points(points, dim=2))


def triangle_areas(points: FloatArray, triangles: npt.NDArray[np.integer]) -> FloatArray:
    """Return the (m,) areas of planar triangles."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice: FloatArray = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.abs(twice) / 2


def circumradii(points: FloatArray, triangles: npt.NDArray[np.integer]) -> FloatArray:
    """Return the (m,) circumradii of planar triangles: product of sides over four times the area; ∞ for flat ones."""
    corners = points[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = triangle_areas(points, triangles)
    return np.where(area > 0, sides.prod(axis=1) / (4 * np.where(area > 0, area, 1.0)), np.inf)


def _components(neighbors: npt.NDArray[np.integer], kept: IntArray) -> tuple[int, IntArray]:
    """Return the number of edge-connected components of the kept triangles and the component of each."""
    place = np.full(len(neighbors) + 1, -1)
    place[kept] = np.arange(len(kept))
    other = place[neighbors[kept]]
    row, side = np.nonzero(other >= 0)
    labels = label_nodes(np.ascontiguousarray(row), other[row, side], len(kept))
    return int(labels.max(initial=-1)) + 1, labels


def _filled_union(points: FloatArray, triangles: IntArray) -> shapely.Polygon:
    """Return the union of edge-connected triangles (m, 3) without its holes; of many, from their boundary alone."""
    if len(triangles) > MANY:
        return _filled_boundary(points, triangles)
    return shapely.Polygon(_largest(shapely.union_all(shapely.polygons(points[triangles]))).exterior)


def _filled_boundary(points: FloatArray, triangles: IntArray) -> shapely.Polygon:
    """Return the same from their boundary, as a ring that may begin at another vertex."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    # Delaunay's triangles overlap nowhere: an edge of one triangle alone is the boundary.
    keys, uses = np.unique(edges @ [len(points), 1], return_counts=True)
    boundary = np.stack(np.divmod(keys[uses == 1], len(points)), axis=1)
    faces = shapely.get_parts(shapely.polygonize(shapely.linestrings(points[boundary])))
    return shapely.Polygon(_largest(shapely.union_all(faces)).exterior)


def _largest(shape: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(shape), key=lambda part: part.area)


def _least_alpha(delaunay: Delaunay, radii: FloatArray) -> float:
    """Return the least α at which the largest component has every point and no narrow neck."""
    candidates = np.unique(radii[np.isfinite(radii)])
    if not len(candidates):
        raise InputError("points: lie on one line; give points that cover an area")
    points = delaunay.points
    reachable = len(np.unique(delaunay.simplices[np.isfinite(radii)]))
    spacing = float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))

    def largest(number: int) -> IntArray:
        kept = np.flatnonzero(radii <= candidates[number])
        _, labels = _components(delaunay.neighbors, kept)
        return np.asarray(delaunay.simplices[kept[labels == np.argmax(np.bincount(labels))]], dtype=np.int64)

    def contains_all(number: int) -> bool:
        held = np.zeros(len(points), dtype=bool)
        held[largest(number)] = True
        return int(held.sum()) == reachable

    def has_no_neck(number: int) -> bool:
        # Shrunk by a spacing, a blade with a narrow neck falls apart; single triangles at its rim may go.
        core = _filled_boundary(points, largest(number)).buffer(-spacing)
        return bool(core.is_empty or _largest(core).area >= (1 - MAX_FRAGMENTS) * core.area)

    last = len(candidates) - 1
    return float(candidates[_first(_first(0, last, contains_all), last, has_no_neck)])


def _first(start: int, last: int, is_true: Callable[[int], bool]) -> int:
    """Return the first index from `start` at which a condition is true, or `last`: strides double, then halve."""
    low, step = start - 1, 1
    high = start
    while high < last and not is_true(high):
        low, step = high, 2 * step
        high = min(start + step, last)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_true(middle) else (middle, high)
    return high
