"""Gaps among a sample's triangles that a line scanner's planes pass by: the surface lies along them there."""

import numpy as np

from o3dleaf.core.trees import query
from o3dleaf.leaf.margin.sample_lines import SampleLines
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation
from o3dleaf.leaf.margin.scan_planes import Lift, find_scan_planes

PLACES = np.array([[1, 1, 1], [0, 3, 3], [3, 0, 3], [3, 3, 0]]) / [[3], [6], [6], [6]]
"""Places in a triangle, as shares of its corners, at which points may be missing: its middle and those of its sides."""
LIES_ALONG = 0.5
"""Slope against a scanner's planes, of that which is usual, up to which a surface lies along them: where lines are no
farther apart than elsewhere the sample itself says what is a gap."""


def passed_by_planes(mesh: Triangulation, gaps: BoolArray, lines: SampleLines, short: float, lift: Lift) -> BoolArray:
    """Return the triangles (m,) among gaps (m,) that lie along a scanner's planes, and where no point is missing.

    Lines are far apart there, without an end in between. A point is missing at a place that is farther from all points
    than from the nearest line of a plane that the triangle reaches, by more than chance leaves. To that the way is one
    of Newton's steps, and two where the surface touches the plane.
    """
    passed = np.zeros_like(gaps)
    planes = find_scan_planes(lines, lift) if gaps.any() else None
    if planes is None:
        return passed
    corners = mesh.triangles[gaps]
    places = np.einsum("pc,mcd->mpd", PLACES, mesh.points[corners]).reshape(-1, 2)
    height, slope = (each.reshape(-1, len(PLACES)) for each in planes.heights(places))
    away, nearest = (each.reshape(-1, len(PLACES)) for each in query(mesh.near.tree, places, k=[1]))
    reached = np.concatenate([height, np.rint(planes.heights(mesh.points)[0])[corners]], axis=1)
    first, last = np.ceil(reached.min(axis=1, keepdims=True)), np.floor(reached.max(axis=1, keepdims=True))
    above = np.abs(height - np.clip(np.rint(height), first, last))
    missing = slope * (away - short * lines.steps[nearest]) > 2 * above
    along = slope[:, 0] <= LIES_ALONG / np.median(lines.apart[lines.clear])
    passed[gaps] = along & ~missing.any(axis=1)
    return passed
