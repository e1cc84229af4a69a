"""Constraints that share their points' errors: left out together, and what "gcv" makes of it."""

import numpy as np
import pytest
from scipy.linalg import null_space

import reference
from o3dleaf.core.checks import as_rows
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
from o3dleaf.fitting.rbf.kernels import polyharmonic
from o3dleaf.fitting.rbf.shared_error_loops import shared_squares
from o3dleaf.fitting.rbf.spectrum_loops import held_out_squares
from o3dleaf.fitting.rbf.tail import tail_exponents
from tolerances import ONE_KRYLOV_SPACE, OWNERS_REFIT

AMOUNTS = np.array([1e-3, 1e-1, 10.0])


def bundle(d, count=60, seed=2):
    """A third of the points with two companions, one with a single one; one constraint whose point is elsewhere."""
    rng = np.random.default_rng(seed)
    owners = np.concatenate([np.arange(count), np.repeat(np.arange(0, count, 3), 2), [1, -1]])
    points = rng.uniform(-1, 1, (len(owners), d))
    points[count:-1] = points[owners[count:-1]] + 0.1 * rng.standard_normal((len(owners) - count - 1, d))
    values = np.sin(2 * points).sum(axis=1) + 0.1 * rng.standard_normal(count)[owners]
    return points, values, owners, rng.uniform(0.2, 2, len(owners))


@pytest.mark.parametrize(("m", "d"), [(2, 2), (3, 3)])
def test_points_left_out_with_all_their_constraints_are_missed_as_by_a_refit_without_them(m, d):
    points, values, owners, trust = bundle(d)
    kernel, degree = polyharmonic(m, d), m - 1
    room = np.zeros((3, len(AMOUNTS), 3, 3)), np.zeros(3)
    exponents = tail_exponents(d, degree)
    squares, judged = held_out_squares(
        points.T.copy(), values, np.sqrt(trust), exponents, kernel.power, owners, AMOUNTS, *room
    )
    expected = np.zeros(len(AMOUNTS))
    for owner in range(60):
        out = owners == owner
        for at, amount in enumerate(AMOUNTS):
            options = {"kernel": kernel, "degree": degree, "smoothing": amount, "weights": trust[~out]}
            missed = values[out] - RBFInterpolant.fit(points[~out], values[~out], **options)(points[out])
            expected[at] += trust[out] @ missed**2
    np.testing.assert_allclose(squares, expected, rtol=OWNERS_REFIT)
    assert judged == pytest.approx(trust[owners >= 0].sum(), rel=OWNERS_REFIT)


@pytest.mark.parametrize(("m", "d"), [(2, 2), (3, 3)])
def test_one_krylov_space_gives_the_errors_of_dense_inverses_with_mean_blocks(m, d):
    points, values, owners, trust = bundle(d)
    kernel, roots = polyharmonic(m, d), np.sqrt(trust)
    gaps = reference.distances(points, points)
    free = null_space((roots[:, np.newaxis] * reference.polynomials(points, m - 1)).T)
    radial = free.T @ (roots[:, np.newaxis] * kernel(gaps) * roots) @ free
    groups = [np.flatnonzero(owners == owner) for owner in range(60)]
    means, pulled = np.tile(np.eye(3), (3, len(AMOUNTS), 1, 1)), []
    for at, amount in enumerate(AMOUNTS):
        inverse = amount * free @ np.linalg.inv(radial + amount * np.eye(len(radial))) @ free.T
        pulled.append(inverse @ (roots * values))
        for size in (1, 2, 3):
            blocks = [inverse[np.ix_(rows, rows)] for rows in groups if len(rows) == size]
            means[size - 1, at, :size, :size] = np.mean(blocks, axis=0)
    inverses = np.linalg.inv(means)
    expected = [
        sum(np.sum((inverses[len(r) - 1, at, : len(r), : len(r)] @ pulled[at][r]) ** 2) for r in groups)
        for at in range(len(AMOUNTS))
    ]
    system = points.T.copy(), values, roots, tail_exponents(d, m - 1), kernel.power, owners, AMOUNTS
    squares, judged = shared_squares(*system, inverses)
    np.testing.assert_allclose(squares, expected, rtol=ONE_KRYLOV_SPACE)
    assert judged == pytest.approx(trust[owners >= 0].sum(), rel=OWNERS_REFIT)


def half_flat(count=1600):
    """A noisy height, flat on the left and rough on the right, and its companions above and below a fourth of it."""
    rng = np.random.default_rng(11)
    points = rng.random((count, 2)) * [2, 1]
    height = np.where(points[:, 0] > 1, 0.1 * np.sin(20 * (points[:, 0] - 1)) * np.sin(20 * points[:, 1]), 0.0)
    sites = np.column_stack([points, height + 0.02 * rng.standard_normal(count)])
    base = np.arange(0, count, 4)
    owners = np.concatenate([np.arange(count), base, base])
    values = np.repeat([0.0, -0.05, 0.05], [count, len(base), len(base)])
    sites = sites[owners] - values[:, np.newaxis] * [0, 0, 1]
    return sites, values, owners, np.column_stack([points, height])


def test_a_flat_half_is_smoothed_more_than_a_rough_one_and_both_come_nearer_to_the_truth():
    sites, values, owners, truth = half_flat()
    fits = [
        PUInterpolant.fit(sites, values, smoothing=rule, owners=owners, points_per_ball=(100, 200))
        for rule in ("gcv", "gcv-per-ball")
    ]
    one, own = (np.sqrt(np.mean(fit(truth) ** 2)) for fit in fits)
    assert own < one
    amounts, across = fits[1].local.amounts, fits[1].cover.centres[:, 0]
    reach = fits[1].cover.radii
    flat, rough = amounts[across + reach < 1.1], amounts[across - reach > 0.9]
    assert len(flat) > 3
    assert len(rough) > 3
    assert np.median(flat) > 10 * np.median(rough)


def test_without_noise_each_ball_takes_the_amount_of_all():
    sites, _, owners, truth = half_flat()
    values = np.sin(3 * truth).sum(axis=1)[owners]
    fit = PUInterpolant.fit(sites[:1600], values[:1600], smoothing="gcv-per-ball", owners=owners[:1600])
    one = PUInterpolant.fit(sites[:1600], values[:1600], smoothing="gcv", owners=owners[:1600])
    np.testing.assert_array_equal(fit.local.amounts, one.local.smoothing.amount)


def noisy(count=400, d=2):
    rng = np.random.default_rng(7)
    points = rng.random((count, d))
    return points, np.sin(5 * points).sum(axis=1) + 0.1 * rng.standard_normal(count)


def test_points_that_own_themselves_are_left_out_one_by_one():
    """The score is the mean square of the leave-one-out errors that `appraise` finds for the amount chosen."""
    points, values = noisy()
    field = PUInterpolant.fit(points, values, smoothing="gcv", owners=np.arange(400), points_per_ball=400)
    alone = field.appraise().leave_one_out
    assert field.local.smoothing.score == pytest.approx(float(alone[0]) ** 2, rel=OWNERS_REFIT)


def test_errors_that_constraints_share_are_not_taken_for_shape():
    """Three constraints a point with its error: a rule that takes them for three witnesses follows the noise."""
    rng = np.random.default_rng(3)
    points, _ = noisy(300)
    truth, error = np.sin(5 * points).sum(axis=1), 0.3 * rng.standard_normal(300)
    owners = np.tile(np.arange(300), 3)
    sites = points[owners] + 0.005 * rng.standard_normal((900, 2))
    values = np.sin(5 * sites).sum(axis=1) + error[owners]

    def missed(rule):
        options = {"kernel": "thin_plate_spline", "points_per_ball": 300}
        return np.sqrt(
            np.mean((PUInterpolant.fit(sites, values, smoothing="gcv", **options, **rule)(points) - truth) ** 2)
        )

    assert missed({"owners": owners}) < 0.5 * missed({})


@pytest.mark.parametrize(
    "owners", [[0, 1, 2, 4], [-1, 0, 1, 2], [0, 1, 2], [0.0, 1.0, 2.0, 3.0], [[0, 1], [2, 3]]], ids=str
)
def test_owners_must_be_a_row_for_each_constraint(owners):
    with pytest.raises(InputError, match=r"owners: is .*; give one row number from 0 to 3 each"):
        as_rows(owners, 4)


@pytest.mark.parametrize("rule", ["gcv", "gcv-per-ball"])
def test_the_number_of_threads_does_not_change_a_bit_of_what_owners_make_balls_choose(rule):
    points, values = noisy(1200)
    owners = np.concatenate([np.arange(600), np.arange(600)])
    before, found = get_num_threads(), []
    try:
        for threads in (1, 3):
            set_num_threads(threads)
            field = PUInterpolant.fit(points, values, smoothing=rule, owners=owners, points_per_ball=60)
            found.append((field.local.smoothing.score, field.local.diagonals.tobytes(), field.local.weights.tobytes()))
    finally:
        set_num_threads(before)
    assert found[0] == found[1]
