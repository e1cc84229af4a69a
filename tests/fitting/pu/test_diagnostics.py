"""What a fit says of its balls is what brute force says: refits without a point, dense matrices, data never seen."""

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats.qmc import Halton

import o3dleaf as o3l
import reference
from o3dleaf import PUInterpolant
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import GCV_EFFICIENCY, GCV_TWIN, LEAVE_ONE_OUT


def noisy(d, count=120, seed=4):
    """Points, no two of which nearly coincide, a truth, noisy values and weights."""
    rng = np.random.default_rng(seed)
    points = Halton(d, rng=rng).random(count)
    truth = np.sin(5 * points).sum(axis=1)
    return points, truth, truth + 0.1 * rng.standard_normal(count), rng.uniform(0.2, 2, count)


CASES = [(1, 1, 0), (3, 1, 1), (2, 2, 1), (3, 2, 1), (1, 3, 0), (3, 3, 2)]


@pytest.mark.few
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("smoothing", [0.0, 1e-3, 0.3])
@pytest.mark.parametrize(("power", "d", "degree"), CASES)
def test_every_number_is_that_of_brute_force(power, d, degree, smoothing, weighted):
    points, _, values, weights = noisy(d)
    weights = weights if weighted else np.ones(len(points))
    kernel = Polyharmonic(power, d)
    field = PUInterpolant.fit(
        points,
        values,
        kernel=kernel,
        degree=degree,
        smoothing=smoothing,
        points_per_ball=(30, 60),
        weights=weights if weighted else None,
    )
    found = field.diagnostics()
    rows = np.split(field.cover.members, field.cover.offsets[1:-1])
    assert len(found.balls) == len(rows) > 1
    for ball, r in enumerate(rows[:6]):
        x, f, w = points[r], values[r], weights[r]
        errors = reference.left_out(x, f, power, degree, smoothing / w)
        assert found.leave_one_out[ball] == pytest.approx(np.sqrt(np.average(errors**2, weights=w)), rel=LEAVE_ONE_OUT)
        influence = reference.influence_matrix(x, power, degree, smoothing / w)
        assert found.degrees_of_freedom[ball] == pytest.approx(np.trace(influence), rel=LEAVE_ONE_OUT)
        if smoothing:
            score = reference.gcv(x, f, power, degree, smoothing, w)
            assert found.score[ball] == pytest.approx(score, rel=GCV_TWIN)
        P = np.sqrt(w)[:, None] * reference.polynomials(x - x.mean(axis=0), degree)
        free = null_space(P.T)
        A = np.sqrt(np.outer(w, w)) * reference.PHI[power](reference.distances(x, x))
        e = np.linalg.eigvalsh(free.T @ A @ free)
        assert found.condition[ball] == pytest.approx((e[-1] + smoothing) / (e[0] + smoothing), rel=1e-6)
        assert (found.points[ball], found.rank[ball], found.dropped[ball]) == (len(r), P.shape[1], 0)
        assert found.smoothing[ball] == smoothing
    theta = kernel.theta
    expected = np.full(len(rows), np.nan) if theta is None else smoothing * theta / field.cover.counts
    np.testing.assert_allclose(found.rho, expected, rtol=GCV_TWIN)


def test_the_score_of_an_interpolant_is_the_limit_of_vanishing_smoothing():
    points, _, values, _ = noisy(3)
    exact, nearly = (
        PUInterpolant.fit(points, values, smoothing=s, points_per_ball=60).diagnostics() for s in (0, 1e-9)
    )
    np.testing.assert_allclose(exact.score, nearly.score, rtol=1e-3)
    np.testing.assert_allclose(exact.leave_one_out, nearly.leave_one_out, rtol=1e-3)


@pytest.mark.parametrize("rule", [{"rho": 2e-4}, {"rho": "gcv"}, {"rho": "gcv-per-ball"}], ids=str)
def test_rho_is_reported_as_it_was_given_or_chosen(rule):
    points, _, values, _ = noisy(3, 400)
    field = PUInterpolant.fit(points, values, points_per_ball=60, **rule)
    local = field.local
    expected = local.smoothing.value if local.smoothing_per_ball is None else local.smoothing_per_ball
    np.testing.assert_allclose(field.diagnostics().rho, expected, rtol=GCV_TWIN)


def test_a_loaded_model_says_the_same_and_a_few_balls_can_be_asked(tmp_path):
    points, _, values, weights = noisy(3, 400)
    field = PUInterpolant.fit(points, values, points_per_ball=60, rho="gcv-per-ball", weights=weights)
    field.save(tmp_path / "model.o3l")
    seen = []
    every = field.diagnostics()
    with progress.listening(lambda *done: seen.append(done)):
        few = o3l.load(tmp_path / "model.o3l").diagnostics([5, 2])
        assert seen[-1][0] == seen[-1][1]
    np.testing.assert_array_equal(few.balls, [5, 2])
    for name in ("score", "degrees_of_freedom", "condition", "leave_one_out", "rho", "points"):
        np.testing.assert_array_equal(getattr(few, name), getattr(every, name)[[5, 2]])
    least, median, greatest = every.summary()["leave_one_out"]
    assert least == every.leave_one_out.min() < median < greatest == every.leave_one_out.max()


@pytest.mark.filterwarnings("ignore::o3dleaf.core.errors.DataWarning")
@pytest.mark.filterwarnings("error")
def test_what_the_numbers_cannot_tell_is_nan():
    points, _, values, _ = noisy(3)
    twice = PUInterpolant.fit(np.vstack([points, points[:3]]), np.append(values, values[:3] + 1), points_per_ball=200)
    found = twice.diagnostics()
    assert found.dropped[0] == 3
    assert np.isnan(found.score[0])
    assert np.isnan(found.leave_one_out[0])
    assert found.degrees_of_freedom[0] == pytest.approx(len(points))  # as many values as there are places
    assert np.isfinite(found.condition[0])
    few = PUInterpolant.fit(points[:7], values[:7], rho=1.0).diagnostics()
    assert (few.degrees_of_freedom[0], few.rank[0]) == (7, 7)
    assert all(np.isnan(getattr(few, name)[0]) for name in ("score", "condition", "leave_one_out"))
    assert "score" not in few.summary()
    assert np.isnan(PUInterpolant.fit(points[:, :2], values, kernel="cubic", smoothing=0.1).diagnostics().rho).all()


def test_a_point_that_the_tail_cannot_do_without_is_not_left_out():
    """Thirty points on a line and one beside it: without that one nothing across the line is known."""
    rng = np.random.default_rng(0)
    points = np.vstack([np.column_stack([rng.random(30), np.zeros(30)]), [[0.5, 0.3]]])
    values = np.append(np.sin(6 * points[:30, 0]), 5.0)
    found = PUInterpolant.fit(points, values, kernel="thin_plate_spline", smoothing=0.01).diagnostics()
    alone = reference.left_out(points[:30], values[:30], 2, 0, 0.01)
    assert found.leave_one_out[0] < 2 * np.sqrt(np.mean(alone**2))


@pytest.mark.slow
def test_leave_one_out_and_gcv_agree_about_the_error():
    """The amount of least leave-one-out error and the one that GCV takes are both within a tenth of the best."""
    for seed in range(4):
        points, truth, values, _ = noisy(3, 300, seed)
        chosen = PUInterpolant.fit(points, values, rho="gcv", points_per_ball=300)
        trials = [
            PUInterpolant.fit(points, values, rho=chosen.local.smoothing.value * x, points_per_ball=300)
            for x in np.geomspace(0.01, 100, 25)
        ]
        errors = np.array([np.sqrt(np.mean((field(points) - truth) ** 2)) for field in trials])
        left_out = [field.diagnostics().leave_one_out[0] for field in trials]
        assert errors[np.argmin(left_out)] < GCV_EFFICIENCY * errors.min()
        assert np.sqrt(np.mean((chosen(points) - truth) ** 2)) < GCV_EFFICIENCY * errors.min()


def test_what_cannot_be_judged_is_refused():
    points, _, values, _ = noisy(3)
    field = PUInterpolant.fit(points, values)
    for bad in (-1, len(field.cover.radii), 0.5, "a"):
        with pytest.raises(InputError, match=f"give whole numbers from 0 to {len(field.cover.radii) - 1}"):
            field.diagnostics([bad])
    other = PUInterpolant.fit(points, values, local=o3l.RBFInterpolant.fit)
    with pytest.raises(InputError, match="are no splines"):
        other.diagnostics()
