"""A fragment of another sheet on a leaf, told from the leaf's own end where that is rolled up over it."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.layers.widths import noise_width
from o3dleaf.leaf.sheet.open_sheets import OpenSheets
from o3dleaf.leaf.sheet.pieces.minimum_cut import LINK, Links
from o3dleaf.surface.mesh.topology import EdgeTable, find_holes

OVER = 0.5
"""Share of the points of a part that lie over or under the leaf, from which on it does. Of a pass of the same leaf more
lies where the other one is not seen."""
ON_RIM = 0.65
"""Share of a seam on the outer rim of the leaf, from which on the leaf may end there: of its own end nearly all is, of
a fragment that comes down beside the rim some."""
ON_HOLE = 0.75
"""The same on the rims of holes, from which on the part hides what is below it."""


def is_fragment(
    points: FloatArray, noise: float, links: Links, part: BoolArray, layered: BoolArray, spacing: float
) -> bool:
    """Return whether a part of a cloud is a fragment of another sheet than the rest, on which it lies.

    It is where it hangs on nothing. Else it hangs on a seam where the sheet of the rest goes on, while a leaf whose own
    end is rolled up over it ends there; and it lies over that sheet for the most part, or over a hole in it.

    Parameters
    ----------
    points : (n, 3) ndarray
        As scanned.
    noise : float
    links : Links
        Between the points, averaged for their noise.
    part, layered : (n,) ndarrays of bool
        Which points are the part's, and which lie over or under others.
    spacing : float
    """
    seam = links.kept(part[links.one] != part[links.other])
    if not len(seam.worth):
        return True
    rest = np.flatnonzero(~part)
    sheets = OpenSheets.of(points[rest], np.full(len(rest), noise_width(noise, spacing)), spacing)
    ends = np.where(part[seam.one], seam.other, seam.one)
    on_rim, on_hole = _on_boundary(sheets, sheets.points[np.searchsorted(rest, ends)], seam.worth)
    lies_over = np.count_nonzero(part & layered) >= OVER * np.count_nonzero(part)
    return on_rim < ON_RIM and bool(lies_over or on_hole >= ON_HOLE)


def _on_boundary(sheets: OpenSheets, places: FloatArray, worth: IntArray) -> tuple[float, float]:
    """Return what share of places (k, 3), by worth (k,), is on the outer rim of the largest sheet, and on holes."""
    vertices, triangles = sheets.sheet()
    edges = EdgeTable.of(triangles)
    loops = find_holes(vertices, triangles, edges)
    if not len(loops.edges):  # a closed sheet
        return 0.0, 0.0
    middles = vertices[edges.ends[loops.edges]].mean(axis=1)
    away, nearest = query(cKDTree(middles), places)
    on_it, of_rim = away <= LINK * sheets.spacing, loops.is_rim[loops.of_edge[nearest]]
    return float(np.average(on_it & of_rim, weights=worth)), float(np.average(on_it & ~of_rim, weights=worth))
