"""The blade's surface fitted to a scan: Huber's loss, smoothing judged on held-out stretches, parameters that are feet.

A point's parameters (u, v) are those of its foot on the surface; as the surface is fitted to the points at their
parameters, both are corrected in turn. The sheet of the first chart only says where the search begins.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.chart.flattening.embedding import relax_rigidly, relax_without_flips
from o3dleaf.leaf.chart.flattening.stretch import chart_areas
from o3dleaf.leaf.parametric.fitted import ChartMesh, RobustSmoothing, SurfaceFit, SurfaceProblem
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.parametric.tight_bends import Bend, tightest_bend
from o3dleaf.surface.cloud.downsample import thin
from o3dleaf.surface.cloud.surfels import thinned

ROUNDS = 3
"""Fits before the last one, each at feet on the one before and in a chart flattened on it."""
MAX_POINTS = 20_000
"""Points that the surface is fitted to; of more, means in voxels: see `leaf.paper_pipeline`."""
FOLDED = 1 / np.pi
"""Radius of a bend in spacings below which the surface turns back on itself from one point to the next: what no scan
shows. A crease is a bend less tight than that, and stays."""
STIFFER = 4.0
"""Factor of the smoothing from one fit to the next where the surface is folded: the bandwidth's is its fifth root."""
MOST_RAISES = 4
"""Fits with more smoothing at most: the bandwidth has then become three times as wide."""


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
        settled, notes = _without_folds(problem, mesh, near)
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


@dataclass(frozen=True, eq=False)
class _Settled:
    """A surface whose sites are at their feet (n, 2), in a chart flattened on it."""

    problem: SurfaceProblem
    surface: ChartSurface
    mesh: ChartMesh
    near: FloatArray

    @property
    def fold(self) -> Bend | None:
        """The tightest bend on the sheet, if the surface turns back there on itself within a spacing."""
        bend = tightest_bend(self.surface, self.mesh, self.near, self.problem.spacing)
        return bend if bend is not None and bend.radius < FOLDED * self.problem.spacing else None


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

    Each begins at the first sheet, not at a folded one. A smoothing that was asked for by its number is kept. If
    folds stay, it is the surface of the least tight ones.
    """
    settled = _settle(problem, mesh, near)
    first = fold = settled.fold
    if first is None or problem.choice is None:
        return settled, ()
    raised, best, radius = 1.0, settled, first.radius
    for raises in range(1, MOST_RAISES + 1):
        settled = _settle(replace(problem, smoothing=STIFFER**raises * problem.smoothing), mesh, near)
        fold = settled.fold
        if fold is None or fold.radius > radius:
            raised, best, radius = STIFFER**raises, settled, np.inf if fold is None else fold.radius
        if fold is None:
            break
    return best, (_said(first, raised, problem.spacing, left=fold is not None),)


def _said(bend: Bend, raised: float, spacing: float, *, left: bool) -> str:
    """Return the line that says why there is more smoothing, and whether it was enough."""
    place = " ".join(f"{x:.4g}" for x in bend.place)
    why = f"around {place} the surface bent to a radius of {bend.radius:.2g}, where points are {spacing:.2g} apart"
    done = f"smoothing raised by {raised:g}" if raised > 1 else "smoothing kept, as more of it does not help"
    return f"{done}: {why}{'; some folds are left' if left else ''}"


def _flatten_again(surface: ChartSurface, mesh: ChartMesh, near: FloatArray) -> tuple[ChartMesh, FloatArray]:
    """Return the sheet laid onto the surface, its chart relaxed there, and the parameters (n, 2) in that chart."""
    laid = replace(mesh, vertices=surface.jet(mesh.chart, 0)[0])
    single, of_vertex = _without_doubles(laid)
    chart = relax_rigidly(single.vertices, single.triangles, single.chart)
    if (chart_areas(chart, single.triangles) <= 0).any():
        chart = relax_without_flips(single.vertices, single.triangles, single.chart)
    relaxed = replace(laid, chart=_turned_onto(chart[of_vertex], laid.chart))
    return relaxed, relaxed.parameters(surface.jet(near, 0)[0])


def _without_doubles(mesh: ChartMesh) -> tuple[ChartMesh, IntArray]:
    """Return a mesh with one vertex at each place of its chart, and which of them (n,) each vertex is.

    Vertices of a rough sheet that lie behind one corner of the mesh that was laid flat are carried there both.
    """
    _, first, of_vertex = np.unique(mesh.chart, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(mesh.chart):
        return mesh, np.arange(len(first))
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    of_vertex = rank[of_vertex.ravel()]
    triangles = of_vertex[mesh.triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    return ChartMesh(mesh.vertices[first[order]], triangles, mesh.chart[first[order]]), of_vertex


def _turned_onto(chart: FloatArray, other: FloatArray) -> FloatArray:
    """Return a chart turned and shifted onto another one, which it then is nearest to (Kabsch 1976)."""
    middle, aim = chart.mean(axis=0), other.mean(axis=0)
    left, _, right = np.linalg.svd((chart - middle).T @ (other - aim))
    turn = left @ np.diag([1.0, np.linalg.det(left @ right)]) @ right
    return np.ascontiguousarray((chart - middle) @ turn + aim)
