"""Overlaps of a chart with itself, and which of the two layers is the flap."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse
import shapely
from scipy.sparse.csgraph import connected_components

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.chart.flattening.sheet_shape import BoundaryRings, largest_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas


@dataclass(frozen=True, eq=False)
class Overlap:
    """Pairs of triangles of a chart that lie over each other.

    Attributes
    ----------
    pairs : (k, 2) ndarray of int64
        Triangles, the smaller number first.
    areas : (k,) ndarray
        What each pair has in common.
    share : float
        Their sum, of the area of the chart.
    """

    pairs: IntArray
    areas: FloatArray
    share: float

    @property
    def worst(self) -> int:
        """The triangle in the middle of what lies over it most."""
        return int(self.pairs[np.argmax(self.areas), 0])


def find_overlap(chart: FloatArray, triangles: IntArray, rings: BoundaryRings) -> Overlap | None:
    """Return where a chart without flipped triangles lies over itself; None where its boundary crosses nowhere."""
    shell, *holes = (chart[ring] for ring in rim_first(rings))
    if shapely.Polygon(shell, holes).is_valid:
        return None
    shapes = shapely.polygons(chart[triangles])
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    once = first < second
    first, second = first[once], second[once]
    apart = ~(triangles[first][:, :, np.newaxis] == triangles[second][:, np.newaxis, :]).any(axis=(1, 2))
    first, second = first[apart], second[apart]
    common = shapely.area(shapely.intersection(shapes[first], shapes[second]))
    held = common > 0
    if not held.any():
        return None
    pairs = np.stack([first[held], second[held]], axis=1)
    return Overlap(pairs, common[held], float(common[held].sum() / chart_areas(chart, triangles).sum()))


def without_flaps(vertices: FloatArray, triangles: IntArray, overlap: Overlap) -> BoolArray:
    """Return which (m,) triangles are left when of every two layers the one goes that leaves more of the sheet.

    What hangs on the sheet by the removed triangles alone goes with them.
    """
    kept = np.ones(len(triangles), dtype=bool)
    for layer in _layers(triangles, overlap.pairs):
        # A layer may have gone with one before it, or no longer lie over anything.
        rows = overlap.pairs[kept[overlap.pairs].all(axis=1)]
        if not np.isin(rows, layer).any():
            continue
        partner = np.unique(rows[np.isin(rows, layer).any(axis=1)])
        partner = partner[~np.isin(partner, layer)]
        left = [_less(vertices, triangles, kept, gone) for gone in (layer, partner)]
        kept = max(left, key=lambda mask: int(mask.sum()))
    return kept


def _less(vertices: FloatArray, triangles: IntArray, kept: BoolArray, gone: IntArray) -> BoolArray:
    left = kept.copy()
    left[gone] = False
    return largest_sheet(vertices, triangles, left)


def _layers(triangles: IntArray, pairs: IntArray) -> list[IntArray]:
    """Return the connected pieces of the triangles that lie over others, the largest first."""
    rows = np.unique(pairs)
    corners = scipy.sparse.coo_array(
        (np.ones(3 * len(rows)), (np.repeat(np.arange(len(rows)), 3), triangles[rows].ravel()))
    ).tocsr()
    count, label = connected_components(corners @ corners.T, directed=False)
    pieces = [rows[label == piece] for piece in range(count)]
    return sorted(pieces, key=lambda piece: (-len(piece), int(piece[0])))
