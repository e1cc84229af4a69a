"""The rigid turn of a chart that lays the midrib along u, with the side that faces up on top."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.axis.sections import reached
from o3dleaf.leaf.chart.midline import Midline

UP = np.array([0.0, 0.0, 1.0])
UNDECIDED = 0.1
"""Of the mean normal's component along `up`: below it, either side of the blade faces up on half of its area."""
STRAIGHT = 0.1
"""Of the width, that the midrib may leave v = 0 by without a word."""


def facing(vertices: FloatArray, triangles: IntArray, up: FloatArray | None) -> tuple[bool, str]:
    """Return whether a sheet's triangles face up on the mean of its area, and how clearly."""
    first, second, third = (vertices[triangles[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    way = UP if up is None else np.asarray(up, dtype=np.float64) / np.linalg.norm(up)
    share = float(normals.sum(axis=0) @ way / np.linalg.norm(normals, axis=1).sum())
    name = "world's z" if up is None else "direction given"
    if abs(share) < UNDECIDED:
        return share >= 0, f"which side faces up is undecided: by the {name} the two sides differ by {abs(share):.2f}"
    return share >= 0, f"the upper side is the one that faces the {name}"


def turn_chart(chart: FloatArray, midline: Midline, *, mirrored: bool) -> tuple[FloatArray, Midline, str | None]:
    """Return chart and midline with the midrib along +u, its base at u = 0 and its mean line on v = 0; and a note.

    A rigid motion of the plane, mirrored or not: nothing is stretched, and a midrib that bends still does.
    """
    curve = midline.curve
    step = np.gradient(reached(curve))
    middle = step @ curve / step.sum()
    spread = curve - middle
    _, axes = np.linalg.eigh((spread * step[:, np.newaxis]).T @ spread)
    along = axes[:, 1]
    chord = curve[-1] - curve[0]
    if abs(along @ chord) < 0.5 * np.linalg.norm(chord):
        along = chord / np.linalg.norm(chord)
    along = along if along @ chord >= 0 else -along
    across = np.array([-along[1], along[0]]) * (-1 if mirrored else 1)
    turn = np.stack([along, across], axis=1)
    origin = np.array([curve[0] @ along, middle @ across])

    def moved(points: FloatArray) -> FloatArray:
        return np.asarray(points @ turn - origin)

    turned = Midline(moved(curve), midline.widths, moved(midline.base), moved(midline.tip), midline.notes)
    off = float(np.abs(turned.curve[:, 1]).max())
    note = f"the midrib bends in the blade: it leaves its straight line by {tell_length(off)}"
    return moved(chart), turned, note if off > STRAIGHT * midline.width else None
