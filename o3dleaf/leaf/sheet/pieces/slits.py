"""Slits of a leaf that is rolled up: gaps without points between margins that a sheet's triangles joined."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, triangle_areas
from o3dleaf.core.places import tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count, tell_length
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes, label_nodes, label_triangles

GAPS = ((2.0, 1.2, -3.3), (1.7, 2.4, 0.0), (1.5, 4.0, 3.5))
"""Spacings w across a gap, and a and b: among n random points the longest gap as wide is no longer than a ln n - b
spacings in 49 of 50 draws, of 500 to 20,000 points (`scripts/measure_gaps.py`). It grows as the logarithm, for where
wide ways do not percolate, long ones are rarer exponentially."""
WIDEST = GAPS[0][0]
NEAR = 48
"""Triangles around one that tell the density there: those of 24 points."""
MEDIAN = 0.376
"""Median area of the Delaunay triangles of random points, in squared spacings."""
MIN_IN_ONE_PIECE = 2 / 3
"""Share of the area at least that stays in one piece; less, and the gaps are those between scan lines."""


class Slits(NamedTuple):
    """Which triangles (m,) of a sheet stay when it is cut along its slits, and a line of the read-out."""

    kept: BoolArray
    note: str


def find_slits(vertices: FloatArray, triangles: IntArray) -> Slits | None:
    """Return the slits of a sheet through points, or None of one that has none or that they would cut to pieces.

    Triangles of a Delaunay mesh whose circumscribed circle is at least w across, joined over edges as long, are the
    places that an empty disc of that diameter can be moved to. Among random points it gets short ways only: what discs
    around them leave free does not percolate where they are wider than 1.2 spacings (Meester and Roy 1996). Between the
    margins of a leaf that is rolled up it goes along the leaf, or from one rim of the tube to the other. A gap is a
    slit if it is longer than chance has it for one of `GAPS`, or joins two rims at the widest w. It is cut on where it
    is narrower, unless that cuts the sheet to pieces.

    Parameters
    ----------
    vertices : (n, 3) ndarray
        The points.
    triangles : (m, 3) ndarray of int
        An oriented manifold sheet.
    """
    sheet = Sheet.of(vertices, triangles)
    is_sure, found = np.zeros(len(triangles), bool), None
    for wide, growth, less in GAPS:
        gaps, long = sheet.gaps(wide), growth * np.log(len(triangles) / 2) - less
        for rows in gaps:
            is_sure[rows] |= sheet.length_of(rows) >= long or (wide == WIDEST and sheet.joins_rims(rows, wide))
        slits = [rows for rows in gaps if is_sure[rows].any()]
        if slits:
            kept = _largest(triangles, sheet.area, np.concatenate(slits))
            if sheet.area[kept].sum() >= MIN_IN_ONE_PIECE * sheet.area.sum():
                found = Slits(kept, _told(sheet, slits))
    return found


def _told(sheet: "Sheet", slits: list[IntArray]) -> str:
    each = ", ".join(
        f"{tell_length(sheet.extent(rows))} long at {tell_middle(sheet.middles[rows], sheet.middles)}" for rows in slits
    )
    return f"rolled up: cut along {tell_count(len(slits), 'gap')} between margins that hold no points, {each}"


def _largest(triangles: IntArray, area: FloatArray, without: IntArray) -> BoolArray:
    """Return which (m,) triangles are the largest piece without some (k,)."""
    rows = np.delete(np.arange(len(triangles)), without)
    piece = label_triangles(triangles[rows])
    kept = np.zeros(len(triangles), bool)
    kept[rows[piece == np.bincount(piece, area[rows], minlength=1).argmax()]] = True
    return kept


@dataclass(frozen=True, eq=False)
class Sheet:
    """Triangles with what is measured of them.

    Lengths of their `sides` (m, 3), `area` (m,), `middles` (m, 3), 1/√density around them (`spacing`, m), and the `rim`
    that each side lies on (m, 3), -1 for none.
    """

    edges: EdgeTable
    sides: FloatArray
    area: FloatArray
    middles: FloatArray
    spacing: FloatArray
    rim: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, triangles: IntArray) -> "Sheet":
        """Return what is measured of the triangles of vertices (n, 3)."""
        edges, area = EdgeTable.of(triangles), triangle_areas(vertices, triangles)
        middles = vertices[triangles].mean(axis=1)
        # From the median area of triangles near, of which a gap has few.
        near = query(cKDTree(middles), middles, k=[*range(1, 1 + min(NEAR, len(area)))])[1]
        spacing = np.sqrt(np.median(area[near], axis=1) / MEDIAN)
        loops = find_holes(vertices, triangles, edges)
        rim = np.full(len(edges.ends), -1)
        rim[loops.edges] = loops.of_edge
        length = np.linalg.norm(vertices[edges.ends[:, 1]] - vertices[edges.ends[:, 0]], axis=1)
        sides, rims = (each[edges.of_half].reshape(-1, 3) for each in (length, rim))
        return cls(edges, sides, area, middles, spacing, rims)

    def gaps(self, wide: float) -> list[IntArray]:
        """Return the triangles of each place that an empty disc of a diameter in spacings can be moved about in."""
        least = wide * self.spacing
        empty = self.sides.prod(axis=1) >= 2 * least * self.area  # a b c / 2 A is the diameter of the circle
        inner = np.flatnonzero(self.edges.count == 2)
        half, opposite = (self.edges.order[self.edges.first(inner) + side].astype(np.int64) for side in range(2))
        one, other = half // 3, opposite // 3
        joined = empty[one] & empty[other] & (self.sides.ravel()[half] >= np.minimum(least[one], least[other]))
        label = label_nodes(one[joined], other[joined], len(self.area))
        rows = np.flatnonzero(empty)
        rows = rows[np.argsort(label[rows], kind="stable")]
        return np.split(rows, np.flatnonzero(np.diff(label[rows])) + 1) if len(rows) else []

    def extent(self, rows: IntArray) -> float:
        """Return the diagonal of the box around some triangles."""
        return float(np.linalg.norm(np.ptp(self.middles[rows], axis=0)))

    def length_of(self, rows: IntArray) -> float:
        """Return the extent in spacings of the place."""
        return self.extent(rows) / float(np.median(self.spacing[rows]))

    def joins_rims(self, rows: IntArray, wide: float) -> bool:
        """Return whether a disc of a diameter in spacings leaves a gap over two rims."""
        open_ = (self.rim[rows] >= 0) & (self.sides[rows] >= wide * self.spacing[rows, np.newaxis])
        return len(np.unique(self.rim[rows][open_])) > 1
