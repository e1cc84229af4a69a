"""What a fit to a scan hands on: the surface, the sheet laid onto it with its chart, and the feet of the points."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.leaf.chart.flatten import carry
from o3dleaf.leaf.parametric.local_smoothing import LocalChoice
from o3dleaf.leaf.parametric.surface import ChartSurface


@dataclass(frozen=True, eq=False)
class ChartMesh:
    """A triangulated sheet and its chart.

    Attributes
    ----------
    vertices : (n, 3) ndarray
        In the world.
    triangles : (m, 3) ndarray of int64
    chart : (n, 2) ndarray
        (u, v) of the vertices.
    """

    vertices: FloatArray
    triangles: IntArray
    chart: FloatArray

    @property
    def area(self) -> float:
        """Area of the sheet, in the square of the world's unit."""
        return float(triangle_areas(self.vertices, self.triangles).sum())

    @property
    def width(self) -> float:
        """Mean width: the area over the longer extent of the chart."""
        return self.area / float(np.ptp(self.chart, axis=0).max())

    def parameters(self, points: FloatArray) -> FloatArray:
        """Return (u, v) of the point of the sheet nearest to each of the (n, 3) points."""
        return carry(self.vertices, self.triangles, self.chart, points)


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A surface fitted to a scan.

    Attributes
    ----------
    surface : ChartSurface
    mesh : ChartMesh
        The sheet laid onto the surface, its chart as little stretched as it can be.
    feet : (n, 2) ndarray
        (u, v) of the foot of every point of the scan.
    heights : (n,) ndarray
        Signed distances of the points from the surface, along its normal.
    choice : LocalChoice or None
        Smoothing, bandwidth, noise and weights of the sites, where they were judged on held-out stretches.
    notes : tuple of str
        What was decided about the fit, one line each.
    """

    surface: ChartSurface
    mesh: ChartMesh
    feet: FloatArray
    heights: FloatArray
    choice: LocalChoice | None
    notes: tuple[str, ...] = ()
