"""What a surface is fitted to, and what a fit hands on: the surface, the sheet laid onto it, the feet of the points."""

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, cast

import igl
import numpy as np
import shapely

from o3dleaf.core.arguments.kinds import SmoothingValue
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.pu.interpolant import OVERLAP, PUInterpolant
from o3dleaf.fitting.rbf.kernels import Polyharmonic, as_kernel
from o3dleaf.leaf.chart.carry import carry_chart
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet, rim_first
from o3dleaf.leaf.macro.robust import HUBER, widest_bandwidth
from o3dleaf.leaf.parametric.local_smoothing import LocalChoice, choose_by_place
from o3dleaf.leaf.parametric.surface import ChartSurface

RobustSmoothing: TypeAlias = SmoothingValue | Literal["robust"]

KERNEL = "cubic"
"""r³: twice differentiable at its data, as the curvature of the blade needs."""
MIN_CORNER = 0.125
"""Corner of Huber's loss at least, in spacings: without noise the surface misses the crests of steep ruffles by more
than the noise about planes, and follows them the less. A quarter of the points that lies off moves a surface by a third
of its corner: by a twenty-fourth of a spacing."""
FIRST_BANDWIDTH = 0.125
"""Bandwidth of the first surface, of the blade's mean width: it follows curls, and no pass of the scan."""
COLLAR = 4.0
"""How far the surface reaches past its outermost points, in spacings: the margin is half of one beyond them."""


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

    def polygon(self, pinch: float) -> shapely.Polygon:
        """Return what it covers of its chart, the largest part where that is tangled.

        It is opened by `pinch`: where the outline is tangled, it may meet itself in single points.
        """
        rings = rim_first(require_sheet(self.vertices, self.triangles))
        outline, *holes = (shapely.make_valid(shapely.Polygon(self.chart[ring])) for ring in rings)
        area = outline.difference(shapely.union_all(holes)).buffer(-pinch).buffer(pinch)
        return max(shapely.get_parts(area), key=shapely.area)

    def parameters(self, points: FloatArray) -> FloatArray:
        """Return (u, v) of (n, 3) points near the sheet, which goes on past its rim: `carry_chart`."""
        return carry_chart(self.vertices, self.triangles, self.chart, points)

    def distances(self, plane: FloatArray) -> FloatArray:
        """Return the distances (n,) of places (n, 2) of the chart from the sheet laid flat."""
        flat, places = (np.column_stack([each, np.zeros(len(each))]) for each in (self.chart, plane))
        return np.asarray(np.sqrt(igl.point_mesh_squared_distance(places, flat, self.triangles)[0]))


@dataclass(frozen=True, eq=False)
class SurfaceProblem:
    """What is fitted: sites (n, 3), and the smoothing and weights that were chosen for them."""

    sites: FloatArray
    area: float
    width: float
    unit: str | None
    smoothing: float = 0.0
    choice: LocalChoice | None = None
    weights: FloatArray | None = None

    @property
    def kernel(self) -> Polyharmonic:
        """The kernel, in the plane."""
        return as_kernel(KERNEL, 2)

    @property
    def spacing(self) -> float:
        """Square root of the area that a site stands for."""
        return float(np.sqrt(self.area / len(self.sites)))

    def first_smoothing(self, near: FloatArray) -> float:
        """Return the smoothing of a surface that follows the blade's curls, but no pass of the scan."""
        bandwidth = min(FIRST_BANDWIDTH * self.width, widest_bandwidth(_cover(near)))
        return self.kernel.smoothing_for(bandwidth, 1 / self.spacing**2)

    def fit(self, near: FloatArray, smoothing: float | None = None) -> ChartSurface:
        """Return the surface through the sites at their parameters (n, 2)."""
        collar = COLLAR * self.spacing
        return ChartSurface.fit(
            near,
            self.sites,
            smoothing=self.smoothing if smoothing is None else smoothing,
            weights=self.weights,
            points_per_ball=POINTS_PER_BALL,
            bounds=np.array([near.min(axis=0) - collar, near.max(axis=0) + collar]),
            unit=self.unit,
        )

    def choose(
        self, base: ChartSurface, plane: FloatArray, heights: FloatArray, smoothing: RobustSmoothing | None
    ) -> "SurfaceProblem":
        """Return the problem with the smoothing chosen for sites at feet (n, 2) and heights over a surface."""
        if smoothing is None or smoothing == "robust":
            flat = np.column_stack([plane, heights])
            choice = choose_by_place(_cover(plane), flat, self.kernel, self.width / 2, self.sites, base.normals(plane))
            return replace(self, smoothing=choice.smoothing, choice=choice, weights=choice.factors * choice.weights)
        fit = PUInterpolant.fit(plane, heights, kernel=self.kernel, degree=1, smoothing=smoothing)
        return replace(self, smoothing=float(np.median(cast("LocalSplines", fit.local).diagonals)))

    def with_sites(self, sites: FloatArray, like: IntArray) -> "SurfaceProblem":
        """Return the problem with further sites (k, 3), each of the weight of one that there is, by its row (k,).

        The spacing stays, and weights are no longer found anew.
        """
        weights = None if self.weights is None else np.concatenate([self.weights, self.weights[like]])
        area = self.area * (1 + len(sites) / len(self.sites))
        return replace(self, sites=np.concatenate([self.sites, sites]), area=area, weights=weights, choice=None)

    def stiffened(self, factors: FloatArray) -> "SurfaceProblem":
        """Return the problem with the smoothing at each site times a factor (n,), if smoothing was chosen."""
        if self.choice is None or self.weights is None:
            return self
        choice = replace(self.choice, factors=self.choice.factors / factors)
        return replace(self, choice=choice, weights=self.weights / factors)

    def reweighted(self, heights: FloatArray) -> "SurfaceProblem":
        """Return the problem with Huber's weights for the distances (n,) of the sites from the surface."""
        if self.choice is None:
            return self
        corner = max(HUBER * self.choice.noise, MIN_CORNER * self.spacing)
        return replace(
            self, weights=self.choice.factors * np.minimum(1.0, corner / np.maximum(np.abs(heights), corner))
        )


def _cover(plane: FloatArray) -> Cover:
    """Return the balls over parameters (n, 2)."""
    return Cover.fit(plane, np.array([plane.min(axis=0), plane.max(axis=0)]), POINTS_PER_BALL, OVERLAP)


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A surface fitted to a scan.

    Attributes
    ----------
    surface : ChartSurface
    mesh : ChartMesh
        The sheet laid onto the surface, its chart as little stretched as it can be.
    points : (n, 3) ndarray
        Of the scan.
    feet : (n, 2) ndarray
        (u, v) of the foot of every point of the scan.
    heights : (n,) ndarray
        Signed distances of the points from the surface, along its normal.
    problem : SurfaceProblem
        What was fitted, with its smoothing and weights.
    near : (s, 2) ndarray
        (u, v) of the problem's sites.
    notes : tuple of str
        What was decided about the fit, one line each.
    """

    surface: ChartSurface
    mesh: ChartMesh
    points: FloatArray
    feet: FloatArray
    heights: FloatArray
    problem: SurfaceProblem
    near: FloatArray
    notes: tuple[str, ...] = ()
