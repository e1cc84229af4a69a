"""The two ends of a blade in its chart, and the first axis between them."""

from typing import Any

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.leaf.chart.axis.sections import leave_along
from o3dleaf.leaf.chart.flattening.geodesics import Ways
from o3dleaf.surface.mesh.topology import label_nodes

ELONGATED = 3.0
"""Square of the greatest distance over the area from which on a blade's ends are where it is longest: a disc has 1.3, a
rectangle of 2:1 2.5. A compact blade has its axis of best symmetry; the curve that follows is drawn alike."""
SLICES = 40
"""Of equal distance from one end, whose middles are the first axis of a long blade."""
ANGLES = 90
"""Directions that are tried for the axis of symmetry: 2° apart, finer than a margin's own asymmetry."""
AS_GOOD = 0.03
"""Share of the outline by which a mirror image may fit worse for an axis to be as good: the longest one is taken."""
CONE = np.radians(15.0)
"""About the axis, within which the farthest point of the outline is the tip."""


def long_axis(ways: Ways, area: FloatArray) -> FloatArray | None:
    """Return the (k, 2) middles of slices between the ends of an elongated blade; None if it is compact.

    Parameters
    ----------
    ways : Ways
        Of the chart.
    area : (m,) ndarray
        Of its triangles.
    """
    start, end = ways.far_ends()
    distance = ways.from_vertex(start)
    if distance[end] ** 2 < ELONGATED * area.sum():
        return None
    return slice_axis(ways, area, start)


def slice_axis(ways: Ways, area: FloatArray, start: int) -> FloatArray:
    """Return the (k, 2) middles of slices of equal distance from a vertex, the vertex and the farthest one added.

    Where a slice is in several parts, as where a tip is forked, it is the one on the shortest way to the far end.
    """
    distance = ways.from_vertex(start)
    end = int(np.argmax(distance))
    middle, at = ways.vertices[ways.triangles].mean(axis=1), distance[ways.triangles].mean(axis=1)
    slices = np.minimum((at / distance.max() * SLICES).astype(np.int64), SLICES - 1)
    part = _parts_of_slices(ways.triangles, slices)
    # How much longer a way to the far end is that passes through a triangle.
    detour = (at + ways.from_vertex(end)[ways.triangles].mean(axis=1)) - distance[end]
    nearest = np.lexsort((detour, slices))
    _, first = np.unique(slices[nearest], return_index=True)
    held = np.isin(part, part[nearest[first]])
    weight = np.bincount(slices[held], weights=area[held], minlength=SLICES)
    sums = [np.bincount(slices[held], weights=(area * middle[:, axis])[held], minlength=SLICES) for axis in range(2)]
    some = weight > 0
    means = np.stack(sums, axis=1)[some] / weight[some, np.newaxis]
    return np.concatenate([ways.vertices[[start]], means, ways.vertices[[end]]])


def _parts_of_slices(triangles: IntArray, slices: IntArray) -> IntArray:
    """Return the (m,) labels of the pieces of triangles that hang together by vertices within one slice."""
    own, corner = np.unique(slices[:, np.newaxis] * (triangles.max() + 1) + triangles, return_inverse=True)
    rows = np.repeat(np.arange(len(triangles)), 3)
    return label_nodes(rows, len(triangles) + corner.ravel(), len(triangles) + len(own))[: len(triangles)]


def symmetry_axis(outline: Any, through: FloatArray | None = None) -> FloatArray:
    """Return the (2, 2) ends of the longest axis about which a mirror image of the outline fits as well as any.

    Parameters
    ----------
    outline : shapely.Polygon
    through : (2,) ndarray, optional
        A point of the axis, its first end; the middle of the outline if left out.
    """
    coarse = outline.simplify(0.005 * float(np.sqrt(outline.area)))
    center = np.asarray(outline.centroid.coords)[0] if through is None else through
    angles = np.arange(ANGLES) * np.pi / ANGLES
    fits = np.array([_mirror_fit(coarse, center, angle) for angle in angles])
    axes = []
    for angle in angles[fits >= fits.max() - AS_GOOD]:
        way = np.array([np.cos(angle), np.sin(angle)])
        axes.append(np.stack([leave_along(outline, center, -way), leave_along(outline, center, way)]))
    best = max(axes, key=lambda axis: round(float(np.linalg.norm(axis[1] - axis[0])), 9))
    if through is None:
        return best
    far = best[int(np.argmax(np.linalg.norm(best - center, axis=1)))] - center
    rim = np.asarray(shapely.get_coordinates(outline)) - center
    away = np.linalg.norm(rim, axis=1)
    inside = rim @ far >= np.cos(CONE) * away * np.linalg.norm(far)
    tip = rim[np.argmax(np.where(inside, away, -1.0))] if inside.any() else far
    return np.stack([center, center + tip])


def _mirror_fit(outline: Any, center: FloatArray, angle: float) -> float:
    """Return the share of the outline's area that its mirror image about an axis covers."""
    cos, sin = np.cos(2 * angle), np.sin(2 * angle)
    turn = np.array([[cos, sin], [sin, -cos]])
    image = shapely.transform(outline, lambda xy: (xy - center) @ turn.T + center)
    return float(shapely.intersection(image, outline).area / outline.area)
