"""Stretch of a sheet by its chart: the singular values of its map from the plane, triangle by triangle."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas

TAILS = (0.01, 0.99)
"""Shares of the area at which the worst stretch is told either way: single triangles at a rough margin say little."""


@dataclass(frozen=True)
class Stretch:
    """Length in the chart over length on the sheet: exceeded on 99 % of the area, and on 1 %.

    Attributes
    ----------
    least, most : float
        Quantiles, by area, of the smaller and of the larger singular value; 1 where the chart is isometric.
    """

    least: float
    most: float


def triangle_stretch(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> FloatArray:
    """Return the (m, 2) singular values, the larger first, of the affine maps from the triangles to the chart.

    Lengths in the chart over lengths on the sheet, along the directions that are stretched most and least;
    both NaN for a triangle without area (Sander et al. 2001, Proc. SIGGRAPH, for the other direction).

    Parameters
    ----------
    vertices : (n, 3) ndarray
        On the sheet.
    triangles : (m, 3) ndarray of int
    chart : (n, 2) ndarray
        In the vertices' unit.
    """
    metric = jacobians(vertices, triangles, chart)
    # Singular values of [[a, b], [c, d]]: half the sum and half the difference of |(a+d, c-b)| and |(a-d, b+c)|.
    (a, b), (c, d) = metric[:, 0].T, metric[:, 1].T
    turn, shear = np.hypot(a + d, c - b), np.hypot(a - d, b + c)
    return np.asarray(np.stack([turn + shear, np.abs(turn - shear)], axis=1) / 2)


def jacobians(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> FloatArray:
    """Return the (m, 2, 2) maps from each triangle's own plane, seen from outside, to the chart; NaN without area."""
    length, along, height = laid_down(vertices, triangles)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (chart[triangles[:, 1]] - chart[triangles[:, 0]]) / length[:, np.newaxis]
        y = (chart[triangles[:, 2]] - chart[triangles[:, 0]] - along[:, np.newaxis] * x) / height[:, np.newaxis]
    flat = np.stack([x, y], axis=2)
    return np.where(np.isfinite(flat), flat, np.nan)


def laid_down(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return length of the first side, and foot along it and height over it of the third corner, (m,) each."""
    first, second, third = (vertices[triangles[:, corner]] for corner in range(3))
    edge, other = second - first, third - first
    length = np.linalg.norm(edge, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.einsum("ij,ij->i", edge, other) / length
        height = np.linalg.norm(np.cross(edge, other), axis=1) / length
    return length, along, height


def chart_areas(chart: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m,) areas of the triangles in the chart, negative where one is flipped."""
    first, second, third = (chart[triangles[:, corner]] for corner in range(3))
    a, b = second - first, third - first
    return np.asarray((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2)


def stretch_quantiles(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> Stretch:
    """Return the stretch that 99 % and 1 % of the sheet's area exceed."""
    values, area = triangle_stretch(vertices, triangles, chart), triangle_areas(vertices, triangles)
    known = np.isfinite(values).all(axis=1)
    return Stretch(
        _quantile(values[known, 1], area[known], TAILS[0]), _quantile(values[known, 0], area[known], TAILS[1])
    )


def _quantile(values: FloatArray, weights: FloatArray, share: float) -> float:
    """Return the value at a share of the whole weight, in rising order."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(reached, share * reached[-1]), len(values) - 1)])
