"""The blade's surface fitted to a scan: Huber's loss, smoothing judged on held-out stretches, parameters that are feet.

A point's parameters (u, v) are those of its foot on the surface; as the surface is fitted to the points at their
parameters, both are corrected in turn. The sheet of the first chart only says where the search begins.
"""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_share
from o3dleaf.leaf.chart.carry import carry_chart
from o3dleaf.leaf.chart.flatten import LARGEST_FLAP, STEPPED, require_low_distortion
from o3dleaf.leaf.chart.flattening.embedding import relax_rigidly, relax_without_flips
from o3dleaf.leaf.chart.flattening.one_layer import relax_in_one_layer
from o3dleaf.leaf.chart.flattening.overlap import find_overlap
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.untangle import untangle
from o3dleaf.leaf.margin.margin import Margin, carry_margin
from o3dleaf.leaf.margin.sheet_mesh import triangulate
from o3dleaf.leaf.parametric.contacts import triangulated
from o3dleaf.leaf.parametric.fitted import COLLAR, ChartMesh, RobustSmoothing, SurfaceFit, SurfaceProblem
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.parametric.tight_bends import FOLDED, Bends, tight_bends_on_sheet
from o3dleaf.surface.cloud.downsample import thin
from o3dleaf.surface.cloud.surfels import thinned

ROUNDS = 3
"""Fits before the last one, each at feet on the one before and in a chart flattened on it."""
ROUNDS_AGAIN = 2
"""Of ten steps without flips, in which a chart that was at rest on the surface before is relaxed on the next: more of
them take most of a ruffled leaf's time."""
RELEASES_AGAIN = 2
"""Of a margin that is held so that the chart does not lie over itself: the chart was at rest on a surface before."""
MAX_DOUBLE = 1.0
"""Triangles' worth of area that may lie double in a chart: corners of single ones at a rough margin do."""
MAX_POINTS = 20_000
"""Points that the surface is fitted to; of more, means in voxels: see `leaf.paper_pipeline`."""
STIFFER = 4.0
"""Factor of the smoothing from one fit to the next where the surface is folded: the bandwidth's is its fifth root."""
MAX_RAISES = 8
"""Fits with more smoothing at most."""
MAX_RAISED = 3
"""How often it is raised at one place at most: the bandwidth is then 2.3 times as wide. Where a fold stays, what lies
around it must give way: more at that place alone stretches the chart there until holes open between the points."""
LOST = 3.0
"""Noise deviations from a surface, and a spacing at least, beyond which it has let go of a point."""
WIDER = 2**0.5
"""Factor of the distance around folds up to which it is raised, from one fit to the next: a ball's radius at first, at
last eleven."""
MAX_STRETCHED = 0.5
"""Share of a folded surface that may be stretched below a half or above twice, for more smoothing to be tried: if most
of it is, no fold is what is wrong."""
COARSER = 1.4
"""Side in spacings of the triangles on which a finished surface is relaxed: half as many vertices as points. Through
these the surface is the same to a few thousandths of a spacing, as its smoothing leaves nothing finer."""
PINCH = 0.25
"""Half width in spacings up to which parts of a sheet that is triangulated anew hang together by nothing."""
SAME = 0.25
"""Spacings that a surface may move by where its chart is relaxed. Found 0.04 to 0.12; where two stretches of a margin
come to lie side by side, as in a crumpled leaf, it has no room to go from one to the other: 0.3 to 2."""


def fit_chart_surface(
    points: FloatArray, mesh: ChartMesh, *, smoothing: RobustSmoothing | None = "robust", unit: str | None = None
) -> SurfaceFit:
    r"""Return the surface through points that has the least of Huber's loss and of bending, the points at their feet.

    .. math:: \min_S \sum_k c_k\,\mathrm{huber}_δ(|x_k - S(u_k, v_k)|) + s\,θ J(S)

    Parameters
    ----------
    points : (n, 3) ndarray
        The points of the scan that belong to the blade.
    mesh : ChartMesh
        A sheet near the points, its u along the midrib.
    smoothing : "robust", float or "gcv"
        As in `HeightMap.fit`: of the distances from a smooth surface through the points.
    unit : str, optional

    Raises
    ------
    ReconstructionError
        If the surface is folded and most of it is stretched beyond one half or twice; with the place.
    """
    first, choosing, fitting = progress.split(1, 20, 6)
    sites = thin(points, MAX_POINTS).points
    near = mesh.parameters(sites)
    problem = SurfaceProblem(sites, mesh.area, mesh.width, unit)
    with first:
        base = problem.fit(near, problem.first_smoothing(near))
        near, heights, _ = base.feet(sites, near)
    with choosing:
        problem = problem.choose(base, near, heights, smoothing)
    with fitting:
        settled, notes = _without_folds(problem, _without_tangles(mesh, base, problem.spacing), near)
    mesh = settled.mesh
    feet, heights, _ = settled.surface.feet(points, mesh.parameters(points))
    return SurfaceFit(settled.surface, mesh, points, feet, heights, settled.problem, settled.near, notes)


def extend_fit(fit: SurfaceFit, points: FloatArray, near: FloatArray) -> SurfaceFit:
    """Return the fit to further points beyond the sheet as well; smoothing and chart stay.

    Parameters
    ----------
    fit : SurfaceFit
    points : (k, 3) ndarray
    near : (k, 2) ndarray
        Their parameters, nearly: the chart goes on as they say, and is not relaxed there.
    """
    whole = np.concatenate([fit.points, points])
    some = thinned(len(points), max(1, round(len(fit.points) / len(fit.problem.sites))))
    like = query(cKDTree(fit.near), near[some])[1]
    problem = fit.problem.with_sites(points[some], like)
    sites = np.concatenate([fit.near, near[some]])
    surface = problem.fit(sites)
    feet, heights, _ = surface.feet(whole, np.concatenate([fit.feet, near]))
    mesh = replace(fit.mesh, vertices=surface.jet(fit.mesh.chart, 0)[0])
    return replace(
        fit, surface=surface, mesh=mesh, points=whole, feet=feet, heights=heights, problem=problem, near=sites
    )


def relax_chart(surface: ChartSurface, margin: Margin, spacing: float) -> tuple[ChartSurface, Margin]:
    """Return the same surface in a chart relaxed on it up to its margin, and the margin there.

    Smoothing moves a surface along itself as well, towards lines of the chart that bend less, so that the last fit
    stretches its chart by a few per cent where the leaf is bent; and past the rim of the sheet, on which charts are
    relaxed in the rounds before, it is held by nothing else. So the surface is laid flat once more and interpolated.
    All stays as it is where the relaxed chart would lie over itself, or the surface would be another one.

    Parameters
    ----------
    surface : ChartSurface
    margin : Margin
    spacing : float
        Of the points that the surface was fitted to.
    """
    plane, triangles = triangulate(margin.polygon, COARSER * spacing)
    space = surface.jet(plane, 0)[0]
    relaxed = untangle(relax_rigidly(space, triangles, plane), triangles)
    if relaxed is None:
        return surface, margin
    chart = _turned_onto(relaxed, plane)
    moved = carry_margin(margin, partial(_carried, plane, triangles, chart))
    if not moved.polygon.is_valid:
        return surface, margin
    same = _interpolated(surface, space, chart, spacing)
    before, after = (
        part.jet(np.concatenate([places[triangles].mean(axis=1), edge.ring, *edge.hole_rings]), 0)[0]
        for part, places, edge in ((surface, plane, margin), (same, chart, moved))
    )
    off = np.linalg.norm(after - before, axis=1).max()
    return (same, moved) if off <= SAME * spacing else (surface, margin)


def _carried(plane: FloatArray, triangles: IntArray, chart: FloatArray, places: FloatArray) -> FloatArray:
    """Return where a mesh takes places (k, 2) on it or beside it from one chart (n, 2) to another one."""
    flat, beside = (np.column_stack([each, np.zeros(len(each))]) for each in (plane, places))
    return carry_chart(flat, triangles, chart, beside)


def _interpolated(surface: ChartSurface, space: FloatArray, chart: FloatArray, spacing: float) -> ChartSurface:
    """Return the surface through points (n, 3) of another one, at parameters (n, 2)."""
    collar = COLLAR * spacing
    bounds = np.array([chart.min(axis=0) - collar, chart.max(axis=0) + collar])
    same = ChartSurface.fit(chart, space, smoothing=0.0, bounds=bounds, unit=surface.unit)
    # What is told of the surface is how it was smoothed, not that it was then interpolated.
    return replace(same, local=replace(same.local, smoothing=surface.local.smoothing))


@dataclass(frozen=True, eq=False)
class _Settled:
    """A surface whose sites are at their feet (n, 2), in a chart flattened on it."""

    problem: SurfaceProblem
    surface: ChartSurface
    mesh: ChartMesh
    near: FloatArray

    @cached_property
    def folds(self) -> Bends:
        """Where on the sheet the surface turns back on itself within a spacing."""
        return tight_bends_on_sheet(self.surface, self.mesh, self.near, self.problem.spacing, FOLDED)

    @cached_property
    def lost(self) -> BoolArray:
        """Which sites (n,) the surface has let go of."""
        heights = self.surface.feet(self.problem.sites, self.near)[1]
        noise = 0.0 if self.problem.choice is None else self.problem.choice.noise
        return np.asarray(np.abs(heights) > max(LOST * noise, self.problem.spacing))

    @cached_property
    def cost(self) -> int:
        """How many sites are lost, or within a spacing of a fold or of a crossing of the surface on its sheet."""
        spacing = self.problem.spacing
        plane, _, triangles, crosses = triangulated(self.surface, self.mesh.polygon(PINCH * spacing), spacing)
        bad = np.concatenate([self.folds.places, plane[triangles[crosses]].mean(axis=1)])
        beside = query(cKDTree(bad), self.near)[0] <= spacing if len(bad) else np.zeros(len(self.near), dtype=bool)
        return int((self.lost | beside).sum())

    def nearness(self, places: FloatArray, plane: FloatArray, reach: float) -> FloatArray:
        """Return how near the sites (n,) are to places (k, 2) of the chart: 1 there, 0 from a reach on (Wendland 1995).

        Distances are those in another chart, in which the sites have the parameters `plane` (n, 2).
        """
        nearest = np.unique(query(cKDTree(self.near), places)[1])
        away = np.minimum(query(cKDTree(plane[nearest]), plane)[0] / reach, 1.0)
        return np.asarray((1 - away) ** 4 * (4 * away + 1))


def _settle(problem: SurfaceProblem, mesh: ChartMesh, near: FloatArray) -> _Settled:
    """Return the surface found in `ROUNDS`, from a sheet and the sites' parameters (n, 2) in its chart."""
    for round_ in range(1, ROUNDS + 1):
        surface = problem.fit(near)
        near, heights, _ = surface.feet(problem.sites, near)
        problem = problem.reweighted(heights)
        mesh, near = _flatten_again(surface, mesh, near)
        progress.report(round_, ROUNDS)
    surface = problem.fit(near)
    return _Settled(problem, surface, replace(mesh, vertices=surface.jet(mesh.chart, 0)[0]), near)


def _without_folds(problem: SurfaceProblem, mesh: ChartMesh, near: FloatArray) -> tuple[_Settled, tuple[str, ...]]:
    """Return the surface with as little more smoothing as leaves no fold between points of the scan, and a note.

    It is raised around the folds, and again and farther around those that stay: all over it would take the leaf's waves
    with it, and parts of a crumpled leaf that lie off the rest. So it is the surface with the fewest points that lie
    far off it or beside folds and crossings: see `_Settled.cost`. Each fit begins at the first sheet, not at a folded
    one. A smoothing that was asked for by its number is kept. Of what is stretched for the most part none is tried: see
    `MAX_STRETCHED`.
    """
    first = best = settled = _settle(problem, mesh, near)
    if not len(first.folds.radii) or problem.choice is None:
        return first, ()
    laid = first.mesh
    require_low_distortion(laid.vertices, laid.triangles, laid.chart, MAX_STRETCHED, STEPPED, mesh.vertices)
    ball = float(np.median(first.surface.cover.radii))
    raised = np.zeros(len(near))
    for raises in range(MAX_RAISES):
        around = settled.nearness(settled.folds.places, near, ball * WIDER**raises)
        raised = np.minimum(raised + around, MAX_RAISED)
        settled = _settle(problem.stiffened(STIFFER**raised), mesh, near)
        best = min(best, settled, key=lambda each: each.cost)
        if not len(settled.folds.radii) or settled.lost.sum() >= best.cost:
            break
    return best, (_said(first, best, left=bool(len(best.folds.radii))),)


def _said(first: _Settled, best: _Settled, *, left: bool) -> str:
    """Return the line that says why there is more smoothing, how much and where, and whether it was enough."""
    problem = first.problem
    why = first.folds.tell(first.surface, problem.sites, problem.spacing)
    done = "smoothing kept, as more of it does not help"
    if best is not first and problem.choice is not None and best.problem.choice is not None:
        raised = problem.choice.factors / best.problem.choice.factors
        share = tell_share(float((raised >= np.sqrt(raised.max())).mean()))
        done = f"smoothing raised by up to {raised.max():.3g} around {share} of the points"
    return f"{done}: {why}{'; some folds are left' if left else ''}"


def _flatten_again(surface: ChartSurface, mesh: ChartMesh, near: FloatArray) -> tuple[ChartMesh, FloatArray]:
    """Return the sheet laid onto the surface, its chart relaxed there, and the parameters (n, 2) in that chart."""
    laid = replace(mesh, vertices=surface.jet(mesh.chart, 0)[0])
    relaxed = replace(laid, chart=_turned_onto(_relaxed(laid), mesh.chart))
    return relaxed, relaxed.parameters(surface.jet(near, 0)[0])


def _relaxed(mesh: ChartMesh) -> FloatArray:
    """Return the chart (n, 2) of a mesh relaxed on it, which is not tangled and does not become so.

    Nor does it come to lie over itself, but by less than a triangle: S would have to go through both layers at one
    place. More than `LARGEST_FLAP` is no ruffles, but a surface between two things.
    """
    chart = untangle(relax_rigidly(mesh.vertices, mesh.triangles, mesh.chart), mesh.triangles)
    if chart is None:
        chart = relax_without_flips(mesh.vertices, mesh.triangles, mesh.chart, ROUNDS_AGAIN)
    rings = require_sheet(mesh.vertices, mesh.triangles)
    overlap = find_overlap(chart, mesh.triangles, rings)
    if overlap is None or not MAX_DOUBLE / len(mesh.triangles) <= overlap.share <= LARGEST_FLAP:
        return chart
    return relax_in_one_layer(mesh.vertices, mesh.triangles, mesh.chart, rim_first(rings), RELEASES_AGAIN)


def _without_tangles(mesh: ChartMesh, base: ChartSurface, spacing: float) -> ChartMesh:
    """Return a sheet whose chart is one to one around each place: some vertices moved, or all of it triangulated anew.

    Where a sheet is rough, vertices may be carried to one place of the chart, or past each other. On a tangled mesh a
    chart is not relaxed, but crumpled, and the surface with it.

    Parameters
    ----------
    mesh : ChartMesh
    base : ChartSurface
        Near the sheet, in its chart: a mesh that is triangulated anew lies on it.
    spacing : float
        Of the points that are fitted.
    """
    chart = untangle(mesh.chart, mesh.triangles)
    if chart is not None:
        return replace(mesh, chart=chart)
    plane, triangles = triangulate(mesh.polygon(PINCH * spacing), COARSER * spacing)
    return ChartMesh(base.jet(plane, 0)[0], triangles, plane)


def _turned_onto(chart: FloatArray, other: FloatArray) -> FloatArray:
    """Return a chart turned and shifted onto another one, which it then is nearest to (Kabsch 1976)."""
    middle, aim = chart.mean(axis=0), other.mean(axis=0)
    left, _, right = np.linalg.svd((chart - middle).T @ (other - aim))
    turn = left @ np.diag([1.0, np.linalg.det(left @ right)]) @ right
    return np.ascontiguousarray((chart - middle) @ turn + aim)
