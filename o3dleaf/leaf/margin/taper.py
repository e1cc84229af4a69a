"""The taper of a blade's thickness towards its margin."""

from functools import cached_property

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.instancing.plane_loops import mark_inside
from o3dleaf.leaf.margin.taper_loops import MarginGrid, MarginSides, fill_taper, list_near

BLOCK = 1 << 14
"""Points that a thread looks at together: half a megabyte."""
MAX_CELLS = 1 << 20
"""Cells of the grid, 9 bytes each: on a blade of more square radii they are larger."""
MAX_LEAST = 0.5
"""Largest floor of the thickness: above it the cubic that leaves the floor would overshoot the circle."""


class Taper:
    r"""The factor τ of a blade's thickness near its margin: a rounded edge.

    .. math:: τ(d) = \sqrt{1 - (1 - d/r)^2}, \qquad d < r

    with d the distance from the margin in the plane (along, across), 1 from the radius r on. A square cut through a
    blade as thick as 2r then becomes a semicircle: half the thickness of the blade is the radius that an edge has
    which is as round as it can be without growing thinner earlier. A sheet without thickness has no two sides that
    could be meshed, and its heights w = height / τ no value; so τ does not fall below `least`, from which it rises
    smoothly: beside the blade and on the margin τ = `least`, level, and a cubic joins the circle where the circle is
    twice as high, with its slope. So τ has no jump of slope but on the ridge of the distance, within r of two
    margins, where d itself has one.

    Attributes
    ----------
    polygon : shapely.Polygon
        The margin, with holes.
    radius, least : float
        In the polygon's unit; a share.
    """

    def __init__(self, polygon: shapely.Polygon, radius: float, least: float = 0.1) -> None:
        """Lay a grid of cells over the polygon that knows the sides near each cell.

        Raises
        ------
        InputError
            If the radius is not above 0, or `least` not above 0 and at most `MAX_LEAST`.
        """
        self.polygon, self.radius = polygon, require_positive(radius, "radius")
        if not 0 < least <= MAX_LEAST:
            raise InputError(f"least: is {least:g}; give a share of the thickness above 0 and at most {MAX_LEAST:g}")
        self.least = float(least)

    def __repr__(self) -> str:
        return f"Taper(radius {self.radius:.4g}, least {self.least:.4g})"

    def values(self, uv: npt.ArrayLike, edge: float = 0.0) -> FloatArray:
        """Return τ (n,) at (n, 2) points of the plane, of which those less than `edge` deep count as on the margin."""
        return self._jet(uv, 1, edge)[:, 0]

    def jet(self, uv: npt.ArrayLike) -> FloatArray:
        """Return τ, ∂τ/∂u and ∂τ/∂v (n, 3) at (n, 2) points of the plane."""
        return self._jet(uv, 3)

    def _jet(self, uv: npt.ArrayLike, count: int, edge: float = 0.0) -> FloatArray:
        """Return the first `count` columns of τ, ∂τ/∂u and ∂τ/∂v."""
        plane = as_points(uv, "uv", dim=2)
        jet, parts = np.empty((len(plane), count)), (self._margin, self._grid)
        # No depth beyond the radius is known.
        shape = self.radius, self.least, self._blend, min(float(edge), self.radius)
        run_blocks(lambda start, stop: fill_taper(start, stop, plane, *parts, shape, jet), len(plane), BLOCK)
        return jet

    @property
    def _blend(self) -> float:
        """Depth, in radii, where the circle is twice as high as the floor, or half-way from it to 1."""
        height = min(2 * self.least, (1 + self.least) / 2)
        return float(1 - np.sqrt(1 - height**2))

    @cached_property
    def _margin(self) -> MarginSides:
        """The sides of all rings, the blade on their left, and the normals at their ends."""
        sides, normals = [], []
        for part in shapely.get_parts(self.polygon):
            # The blade lies to the left of an exterior ring that is counter-clockwise, and of holes that are not.
            for number, ring in enumerate((part.exterior, *part.interiors)):
                corners = shapely.get_coordinates(ring)
                corners = corners[:-1][np.any(np.diff(corners, axis=0) != 0, axis=1)]
                corners = corners if ring.is_ccw == (number == 0) else corners[::-1]
                ends = np.roll(corners, -1, axis=0)
                along = (ends - corners) / np.linalg.norm(ends - corners, axis=1, keepdims=True)
                inward = np.column_stack([-along[:, 1], along[:, 0]])
                sides.append(np.hstack([corners, ends]))
                normals.append(np.hstack([inward + np.roll(inward, 1, axis=0), inward + np.roll(inward, -1, axis=0)]))
        return MarginSides(np.concatenate(sides), np.concatenate(normals))

    @cached_property
    def _grid(self) -> MarginGrid:
        """The cells of the plane, as wide as the radius where they are not too many."""
        sides = self._margin.sides
        low, high = np.reshape(self.polygon.bounds, (2, 2))
        size = max(self.radius, float(np.sqrt((high - low).prod() / MAX_CELLS)))
        corner = low - size
        shape = (np.ceil((high - corner) / size) + 1).astype(np.int64)
        inside = np.zeros(tuple(shape), dtype=bool)
        mark_inside((sides - np.tile(corner, 2)) / size, np.zeros(2, dtype=np.int64), 0.5, inside)
        none = np.empty(0, dtype=np.int32)
        counts = np.zeros(inside.size, dtype=np.int64)
        list_near(sides, MarginGrid(corner, size, counts, none, inside), self.radius, counts, none)
        first = np.concatenate([[0], np.cumsum(counts)])
        numbers, places = np.empty(first[-1], dtype=np.int32), first[:-1].copy()
        list_near(sides, MarginGrid(corner, size, first, none, inside), self.radius, places, numbers)
        return MarginGrid(corner, size, first, numbers, inside)
