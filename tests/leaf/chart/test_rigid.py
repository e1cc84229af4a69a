"""Charts as rigid as possible: the energy, its derivatives, and a rest that no rounding moves."""

import igl
import numpy as np
import pytest
import shapely

from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.chart.flattening.embedding import convex_chart, relax_rigidly
from o3dleaf.leaf.chart.flattening.rigid_energy import RigidEnergy
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet
from o3dleaf.leaf.chart.flattening.stretch import chart_areas, triangle_stretch
from tests import tolerances as tol
from tests.sheet_shapes import ellipse, triangulated


@pytest.fixture(scope="module")
def ellipse_sheet():
    """A sheet that is bent both ways, so that no chart is without stretch."""
    flat, triangles = triangulated(ellipse(30.0, 20.0), 3.0)
    return np.column_stack([flat, 0.02 * (flat**2).sum(axis=1)]), triangles


def jumbled(sheet):
    """A chart of it with flipped triangles."""
    return sheet[:, :2] + np.random.default_rng(0).normal(scale=0.8, size=(len(sheet), 2))


def test_a_chart_is_relaxed_at_least_as_far_as_by_hundreds_of_plain_steps(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    start = convex_chart(sheet, triangles, require_sheet(sheet, triangles))
    data = igl.ARAPData()
    data.max_iter = 400
    igl.arap_precomputation(sheet, triangles, 2, triangles[:1, 0].astype(np.int32), data)
    plain = igl.arap_solve(start[triangles[0, 0]][np.newaxis], data, start)
    energy = RigidEnergy(sheet, triangles)
    assert energy(start) > 10 * energy(np.ascontiguousarray(plain))
    rest = energy(relax_rigidly(sheet, triangles, start))
    assert rest <= energy(np.ascontiguousarray(plain)) * (1 + tol.ROUNDED_SUM)


def test_a_long_rough_sheet_rests_at_one_place_wherever_it_starts_from():
    """It bends in the plane for next to nothing; where a chart on its way there is stopped, hangs on the way."""
    flat, triangles = triangulated(shapely.box(0, -5, 160, 5), 1.6)
    rng = np.random.default_rng(3)
    sheet = np.column_stack([flat, 4 * np.sin(flat[:, 0] / 15) + 0.15 * rng.normal(size=len(flat))])
    start = flat * [1.02, 1.0]
    rest = relax_rigidly(sheet, triangles, start)
    for scale in (1e-12, 0.05, 0.05, 0.05):
        other = relax_rigidly(sheet, triangles, start + scale * rng.normal(size=flat.shape))
        # As lengths: the chart can be turned.
        ends = np.linalg.norm(rest - rest[0], axis=1), np.linalg.norm(other - other[0], axis=1)
        assert np.abs(ends[0] - ends[1]).max() < tol.ONE_REST


def test_the_derivatives_are_those_of_the_energy(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    energy, chart = RigidEnergy(sheet, triangles), jumbled(sheet)
    way = np.random.default_rng(1).normal(size=chart.shape)
    before, after = chart - tol.CHART_STEP * way, chart + tol.CHART_STEP * way
    slope = (energy(after) - energy(before)) / (2 * tol.CHART_STEP)
    assert np.vdot(energy.gradient(chart), way) == pytest.approx(slope, rel=tol.CHART_DERIVATIVES)
    bend = (energy.gradient(after) - energy.gradient(before)) / (2 * tol.CHART_STEP)
    found, rows = np.empty(way.size), energy.pattern.unknowns
    found[rows] = energy.hessian(chart) @ way.ravel()[rows]
    assert found.reshape(-1, 2) == pytest.approx(bend, abs=tol.CHART_DERIVATIVES * np.abs(bend).max())


def test_where_the_energy_curves_down_the_convex_hessian_does_not(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    energy, chart = RigidEnergy(sheet, triangles), 0.6 * jumbled(sheet)
    own, convex = (np.linalg.eigvalsh(energy.hessian(chart, convex=each).toarray()) for each in (False, True))
    assert own[0] < -1e-3 * own[-1]
    assert convex[0] > -tol.ROUNDED_SUM * convex[-1]


def test_the_energy_is_that_of_the_stretches_and_a_flip_counts_by_its_mirror_image(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    chart = jumbled(sheet)
    larger, smaller = triangle_stretch(sheet, triangles, chart).T
    flipped = chart_areas(chart, triangles) < 0
    assert 0 < flipped.sum() < len(flipped)
    away = (larger - 1) ** 2 + (np.where(flipped, -smaller, smaller) - 1) ** 2
    area = triangle_areas(sheet, triangles)
    assert RigidEnergy(sheet, triangles)(chart) == pytest.approx(away @ area / area.sum(), rel=tol.ROUNDED_SUM)


def test_a_triangle_without_area_does_not_count(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    chart = np.ascontiguousarray(1.1 * sheet[:, :2])
    more = np.concatenate([triangles, [[0, 0, 1], [2, 2, 2]]])
    assert RigidEnergy(sheet, more)(chart) == pytest.approx(RigidEnergy(sheet, triangles)(chart), rel=tol.ROUNDED_SUM)
    rest = relax_rigidly(sheet, triangles, chart)
    assert relax_rigidly(sheet, more, chart) == pytest.approx(rest, abs=tol.ONE_REST)
