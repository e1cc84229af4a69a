import igl
import numpy as np
import pytest

from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.leaf.chart.flattening.anderson import LOOK, MEMORY, accelerated_descent
from o3dleaf.leaf.chart.flattening.embedding import AT_REST, convex_chart, relax_rigidly
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet
from o3dleaf.leaf.chart.flattening.stretch import RigidEnergy, chart_areas, triangle_stretch
from tests import tolerances as tol
from tests.sheet_shapes import ellipse, triangulated


@pytest.fixture(scope="module")
def ellipse_sheet():
    """A sheet that is bent both ways, so that no chart is without stretch."""
    flat, triangles = triangulated(ellipse(30.0, 20.0), 3.0)
    return np.column_stack([flat, 0.02 * (flat**2).sum(axis=1)]), triangles


def never(energy):
    """Only what does not fall at all is at rest."""
    return 0.0


def contraction(dimension, seed=0):
    """A linear step towards the origin, slower in some directions than in others, and a place to start."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(dimension, dimension)))[0]
    matrix = turn @ np.diag(np.geomspace(0.05, 1.0, dimension)) @ turn.T
    return lambda point: point - matrix @ point, rng.normal(size=(dimension, 1))


@pytest.mark.parametrize("dimension", [1, 2, 4, MEMORY - 1])
def test_of_a_linear_step_in_n_directions_n_plus_two_steps_find_the_fixed_point(dimension):
    """As GMRES does (Walker and Ni 2011, SINUM 49:1715), where no energy forbids it; the plain step takes hundreds."""
    step, start = contraction(dimension)
    found = accelerated_descent(step, lambda point: 0.0, start, at_rest=never, most=dimension + 2)
    assert np.linalg.norm(found) <= tol.KRYLOV * np.linalg.norm(start)


def test_the_energy_of_what_is_kept_never_rises_and_the_last_is_returned():
    """Of a step whose pull is all but linear, so that many combinations overshoot."""
    kept = []

    def energy(point):
        return float(np.sum(np.log(np.cosh(3 * point)) * np.geomspace(0.01, 1, point.size)[:, None]))

    def step(point):
        return point - 0.3 * np.tanh(3 * point) * np.geomspace(0.01, 1, point.size)[:, None]

    def noted(point):
        kept.append(energy(point))
        return kept[-1]

    start = np.random.default_rng(1).normal(size=(40, 1))
    # The same path, ever longer.
    ends = [energy(accelerated_descent(step, noted, start, at_rest=never, most=most)) for most in range(1, 40)]
    assert np.all(np.diff(ends) <= 0)
    assert np.any(np.diff(kept[-39:]) > 0)  # what was tried on it did rise


def test_it_ends_where_the_fall_of_ten_steps_is_enough():
    step, start = contraction(50)
    seen = []

    def energy(point):
        seen.append(float(np.square(point).sum()))
        return seen[-1]

    accelerated_descent(step, energy, start, at_rest=lambda energy: 0.5 * seen[0], most=1000)
    assert 2 * LOOK <= len(seen) <= 4 * LOOK


def test_a_chart_is_relaxed_at_least_as_far_as_by_hundreds_of_plain_steps(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    start = convex_chart(sheet, triangles, require_sheet(sheet, triangles))
    data = igl.ARAPData()
    data.max_iter = 400
    igl.arap_precomputation(sheet, triangles, 2, triangles[:1, 0].astype(np.int32), data)
    plain = igl.arap_solve(start[triangles[0, 0]][np.newaxis], data, start)
    energy = RigidEnergy(sheet, triangles)
    assert energy(start) > 10 * energy(np.ascontiguousarray(plain))
    found = energy(relax_rigidly(sheet, triangles, start))
    assert found <= (1 + AT_REST) * energy(np.ascontiguousarray(plain))


def test_the_energy_is_that_of_the_stretches_and_a_flip_counts_by_its_mirror_image(ellipse_sheet):
    sheet, triangles = ellipse_sheet
    chart = sheet[:, :2] + np.random.default_rng(0).normal(scale=0.8, size=(len(sheet), 2))
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
