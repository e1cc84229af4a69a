"""Constraints that share their points' errors: left out together, and what "gcv" makes of it."""

import numpy as np
import pytest
from scipy.linalg import null_space

import reference
from o3dleaf import PUInterpolant, RBFInterpolant, get_num_threads, load, polyharmonic, set_num_threads
from o3dleaf.core.checks.attributes import as_rows
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.ball_loops import Balls
from o3dleaf.fitting.local.fit_loops import WeightedValues, ball_held_out_squares, ball_shared_squares, decompose_ball
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.smoothing_selection import SharedErrors, robust_mean
from o3dleaf.fitting.local.splines import Splines, fit_splines
from o3dleaf.fitting.rbf.tail import tail_exponents
from tolerances import (
    BALLS_OF_OUTLIERS,
    CONJUGATE_GRADIENTS,
    GROUPS_REFIT,
    ONE_KRYLOV_SPACE,
    PART_OF_NOISE,
    ROUNDING,
    SLOPE_OF_PLANE,
)

TRIALS = np.array([1e-3, 1e-1, 10.0])


def bundle(d, count=60, seed=2):
    """A third of the points with two companions, one with a single one; one constraint whose point is elsewhere."""
    rng = np.random.default_rng(seed)
    groups = np.concatenate([np.arange(count), np.repeat(np.arange(0, count, 3), 2), [1, -1]])
    points = rng.uniform(-1, 1, (len(groups), d))
    points[count:-1] = points[groups[count:-1]] + 0.1 * rng.standard_normal((len(groups) - count - 1, d))
    values = np.sin(2 * points).sum(axis=1) + 0.1 * rng.standard_normal(count)[groups]
    return points, values, groups, rng.uniform(0.2, 2, len(groups))


def one_ball(points, values, weights, kernel, degree):
    """What compiled loops take of a ball, here of radius 1 about the origin, with all points: its units are theirs."""
    count, d = points.shape
    balls = Balls(np.zeros((1, d)), np.ones(1), np.array([0, count]), np.arange(count), np.empty((0, d, d)))
    return 0, WeightedValues(points, values, weights), balls, tail_exponents(d, degree), kernel.power


def held_out(system, groups, share):
    """What the compiled loops make of the groups left out, by a factor."""
    decomposed = decompose_ball(*system, groups, share)
    return ball_held_out_squares(*system[:3], decomposed, groups, share, TRIALS, 3)


@pytest.mark.parametrize(("m", "d"), [(2, 2), (3, 3)])
def test_points_left_out_with_all_their_constraints_are_missed_as_by_a_refit_without_them(m, d):
    points, values, groups, weights = bundle(d)
    kernel, degree = polyharmonic(m, d), m - 1
    system = one_ball(points, values, weights, kernel, degree)
    squares, total, _, _ = held_out(system, groups, 0.0)
    expected = np.zeros(len(TRIALS))
    for name in range(60):
        out = groups == name
        for at, trial in enumerate(TRIALS):
            options = {"kernel": kernel, "degree": degree, "smoothing": trial, "weights": weights[~out]}
            missed = values[out] - RBFInterpolant.fit(points[~out], values[~out], **options)(points[out])
            expected[at] += weights[out] @ missed**2
    np.testing.assert_allclose(squares, expected, rtol=GROUPS_REFIT)
    assert total == pytest.approx(weights[groups >= 0].sum(), rel=GROUPS_REFIT)


def covariance(groups, share, weights):
    """C: the part `share` of the variance is a group's, the rest its rows' own."""
    same = groups[:, np.newaxis] == groups
    return ((1 - share) * np.eye(len(groups)) + share * same) / np.sqrt(weights[:, np.newaxis] * weights)


def shared_fit(points, values, kernel, degree, covariances):
    """The paper's equation (2) with any matrix D: λ and the tail's coefficients, and the field."""
    tail = reference.polynomials(points, degree)
    empty = np.zeros((tail.shape[1], tail.shape[1]))
    system = np.block([[kernel(reference.distances(points, points)) + covariances, tail], [tail.T, empty]])
    solved = np.linalg.solve(system, np.append(values, np.zeros(len(empty))))
    weights, coefficients = solved[: len(points)], solved[len(points) :]

    def field(places):
        near = kernel(reference.distances(places, points)) @ weights
        return near + reference.polynomials(places, degree) @ coefficients

    return weights, field


@pytest.mark.parametrize("share", [0.3, 0.8])
def test_where_errors_are_shared_the_measured_point_is_missed_as_by_a_refit_over_the_slope_that_is_left(share):
    points, values, groups, own = bundle(2)
    values[60:-1] += np.resize([0.2, -0.3], len(values) - 61)
    kernel, weights = polyharmonic(2, 2), own[groups]
    spread = covariance(groups, share, weights)
    squares, total, _, _ = held_out(one_ball(points, values, weights, kernel, 1), groups, share)
    for at, trial in enumerate(TRIALS):
        missed, slope, rises = 0.0, 0.0, 0.0
        for name in range(60):
            out = groups == name
            kept = np.ix_(~out, ~out)
            _, field = shared_fit(points[~out], values[~out], kernel, 1, trial * spread[kept])
            foretold, rise = field(points[out]), values[out] - values[name]
            missed += weights[name] * (values[name] - foretold[0]) ** 2
            slope += weights[name] * rise @ (foretold - foretold[0])
            rises += weights[name] * rise @ rise
        assert squares[at] == pytest.approx(missed / max(slope / rises, 0.01) ** 2, rel=GROUPS_REFIT)
    assert total == pytest.approx(weights[:60].sum(), rel=GROUPS_REFIT)


@pytest.mark.parametrize(("m", "d"), [(2, 2), (3, 3)])
def test_one_krylov_space_gives_the_errors_of_dense_inverses_with_mean_blocks(m, d):
    points, values, groups, weights = bundle(d)
    kernel, roots = polyharmonic(m, d), np.sqrt(weights)
    gaps = reference.distances(points, points)
    free = null_space((roots[:, np.newaxis] * reference.polynomials(points, m - 1)).T)
    radial = free.T @ (roots[:, np.newaxis] * kernel(gaps) * roots) @ free
    members = [np.flatnonzero(groups == name) for name in range(60)]
    means, pulled = np.tile(np.eye(3), (3, len(TRIALS), 1, 1)), []
    for at, trial in enumerate(TRIALS):
        inverse = trial * free @ np.linalg.inv(radial + trial * np.eye(len(radial))) @ free.T
        pulled.append(inverse @ (roots * values))
        for size in (1, 2, 3):
            blocks = [inverse[np.ix_(rows, rows)] for rows in members if len(rows) == size]
            means[size - 1, at, :size, :size] = np.mean(blocks, axis=0)
    inverses = np.linalg.inv(means)
    expected = [
        sum(np.sum((inverses[len(r) - 1, at, : len(r), : len(r)] @ pulled[at][r]) ** 2) for r in members)
        for at in range(len(TRIALS))
    ]
    system = one_ball(points, values, weights, kernel, m - 1)
    squares, total = ball_shared_squares(*system, groups, 0.0, TRIALS, inverses)
    np.testing.assert_allclose(squares, expected, rtol=ONE_KRYLOV_SPACE)
    assert total == pytest.approx(weights[groups >= 0].sum(), rel=GROUPS_REFIT)


def half_flat(count=1600):
    """A noisy height, flat on the left and rough on the right, and its companions above and below a fourth of it."""
    rng = np.random.default_rng(11)
    points = rng.random((count, 2)) * [2, 1]
    height = np.where(points[:, 0] > 1, 0.1 * np.sin(20 * (points[:, 0] - 1)) * np.sin(20 * points[:, 1]), 0.0)
    sites = np.column_stack([points, height + 0.02 * rng.standard_normal(count)])
    base = np.arange(0, count, 4)
    groups = np.concatenate([np.arange(count), base, base])
    values = np.repeat([0.0, -0.05, 0.05], [count, len(base), len(base)])
    sites = sites[groups] - values[:, np.newaxis] * [0, 0, 1]
    return sites, values, groups, np.column_stack([points, height])


def test_a_flat_half_is_smoothed_more_than_a_rough_one_and_both_come_nearer_to_the_truth():
    sites, values, groups, truth = half_flat()
    fits = [
        PUInterpolant.fit(sites, values, smoothing=rule, groups=groups, points_per_ball=(100, 200))
        for rule in ("gcv", "gcv-per-ball")
    ]
    one, own = (np.sqrt(np.mean(fit(truth) ** 2)) for fit in fits)
    assert own < one
    chosen, across = fits[1].local.smoothing_per_ball, fits[1].cover.centers[:, 0]
    reach = fits[1].cover.radii
    flat, rough = chosen[across + reach < 1.1], chosen[across - reach > 0.9]
    assert len(flat) > 3
    assert len(rough) > 3
    assert np.median(flat) > 10 * np.median(rough)


@pytest.mark.few
@pytest.mark.parametrize("share", [0.0, 0.5])
@pytest.mark.parametrize("weighted", [False, True])
def test_a_ball_that_chooses_on_its_way_to_its_fit_is_fitted_with_what_it_would_have_chosen_before(weighted, share):
    """The Krylov space in which it chooses is gone on with, for that value alone, to what a factor gives."""
    sites, values, groups, _ = half_flat()
    weights = np.random.default_rng(5).uniform(0.2, 2, len(groups))[groups] if weighted else None
    options = {"smoothing": "gcv-per-ball", "groups": groups, "weights": weights, "share": share}
    field = PUInterpolant.fit(sites, values, points_per_ball=(100, 200), **options)
    data, model = (
        ScatteredData.of(sites, values, weights=weights, groups=groups, share=share),
        Splines(smoothing="gcv-per-ball").model(3),
    )
    choice = SharedErrors(field.cover, data, model, np.full(len(field.cover.radii), len(model.exponents)))
    before = choice.each(choice.agreed()[1])
    np.testing.assert_array_equal(field.local.smoothing_per_ball, before)
    assert len(np.unique(before)) > 3
    known = [
        fit_splines(field.cover.only(np.array([ball])), data, Splines(smoothing=float(value)).model(3))
        for ball, value in enumerate(before)
    ]
    for name in ("weights", "tails"):
        expected = np.concatenate([getattr(each, name) for each in known])
        atol = CONJUGATE_GRADIENTS * np.abs(expected).max()
        np.testing.assert_allclose(getattr(field.local, name), expected, rtol=0, atol=atol)


def test_balls_with_new_points_choose_anew_among_the_same_values_in_a_field_that_was_read_too(tmp_path):
    """Values above the flat half that it does not go on to: its balls were smoothed for it to be flat."""
    sites, values, groups, _ = half_flat()
    field = PUInterpolant.fit(
        sites, values, smoothing="gcv-per-ball", groups=groups, share=0.5, points_per_ball=(100, 200)
    )
    above = np.column_stack([np.full(6, 0.5), np.linspace(0.3, 0.7, 6), np.full(6, 0.2)])
    data = ScatteredData(
        np.concatenate([sites, above]),
        np.append(values, np.full(6, 0.2)),
        groups=np.append(groups, len(sites) + np.arange(6)),
        share=0.5,
    )
    changed = field.with_points(data, 6)
    again = np.diff(changed.cover.offsets) > np.diff(field.cover.offsets)
    before, after = field.local.smoothing_per_ball, changed.local.smoothing_per_ball
    np.testing.assert_array_equal(after[~again], before[~again])
    assert (after[again] < before[again]).any()
    model = Splines(smoothing="gcv-per-ball").model(3)
    balls = changed.cover.only(np.flatnonzero(again))
    choice = SharedErrors(balls, data, model, np.full(again.sum(), len(model.exponents)))
    np.testing.assert_array_equal(after[again], choice.each(field.local.trials))
    field.save(tmp_path / "field.o3l")
    from_file = load(tmp_path / "field.o3l").with_points(data, 6)
    for name in ("smoothing_per_ball", "weights", "tails"):
        np.testing.assert_array_equal(getattr(from_file.local, name), getattr(changed.local, name))


def test_without_noise_each_ball_takes_the_value_of_all():
    sites, _, groups, truth = half_flat()
    values = np.sin(3 * truth).sum(axis=1)[groups]
    fit = PUInterpolant.fit(sites[:1600], values[:1600], smoothing="gcv-per-ball", groups=groups[:1600])
    one = PUInterpolant.fit(sites[:1600], values[:1600], smoothing="gcv", groups=groups[:1600])
    np.testing.assert_array_equal(fit.local.smoothing_per_ball, one.local.smoothing.value)
    # So little smoothing takes conjugate gradients too long: a factor solves.
    atol = GROUPS_REFIT * np.abs(one.local.weights).max()
    np.testing.assert_allclose(fit.local.weights, one.local.weights, rtol=0, atol=atol)


def test_fit_and_diagnostics_where_errors_are_shared_are_those_of_a_dense_system():
    points, values, groups, own = bundle(2)
    points, values, groups, weights = points[:-1], values[:-1], groups[:-1], own[groups[:-1]]
    options = {"kernel": "thin_plate_spline", "smoothing": 0.02, "weights": weights, "groups": groups, "share": 0.6}
    field = PUInterpolant.fit(points, values, points_per_ball=200, **options)
    spread = 0.02 * covariance(groups, 0.6, weights)
    _, known = shared_fit(points, values, polyharmonic(2, 2), 1, spread)
    places = np.random.default_rng(1).uniform(-0.9, 0.9, (50, 2))
    np.testing.assert_allclose(field(places), known(places), rtol=0, atol=GROUPS_REFIT)
    squares = []
    for left in range(len(points)):
        kept = np.arange(len(points)) != left
        own = spread[np.ix_(kept, kept)]
        coefficients, rest = shared_fit(points[kept], values[kept], polyharmonic(2, 2), 1, own)
        # What the others of its group are missed by tells of its own error.
        foretold = rest(points[left : left + 1])[0] + spread[left, kept] @ coefficients
        squares.append((values[left] - foretold) ** 2)
    expected = np.sqrt(np.average(squares, weights=weights))
    assert field.diagnostics().leave_one_out[0] == pytest.approx(expected, rel=GROUPS_REFIT)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("smoothing", ["fixed", "gcv-per-ball"])
@pytest.mark.parametrize("even", [0.0, 0.4, 0.8, 1.0])
def test_what_smoothing_leaves_of_measured_values_on_average_is_taken_off_but_for_chance(even, smoothing, weighted):
    """Two noisy sheets with their middle and sites outside: smoothing rounds the ridge between them off.

    The average is that of the points for which rows with weights stand. Where most sites outside are as far off as the
    middle what remains is ½ σ² F'', as second differences of a dense system have it.
    """
    rng, count = np.random.default_rng(5), 120
    side = np.repeat([-1.0, 1.0], count // 2)
    plane, height = rng.uniform(-1, 1, (count, 2)), 0.1 + 0.02 * rng.standard_normal(count)
    far = np.where(rng.permutation(count) < even * count, 0.1, 0.2)
    heights = (side * height, 0 * side, side * (height + far))
    points = np.concatenate([np.column_stack([plane, each]) for each in heights])
    values, groups = np.concatenate([np.repeat([0.0, 0.1], count), -far]), np.tile(np.arange(count), 3)
    own = np.where(side > 0, 1.0, 4.0) if weighted else np.ones(count)
    options = {"smoothing": 0.5 if smoothing == "fixed" else smoothing, "groups": groups, "share": 0.5}
    options["weights"] = own[groups]
    field = PUInterpolant.fit(points, values, points_per_ball=400, **options)
    amount = field.local.diagonals[0]
    spread = amount * covariance(groups, 0.5, own[groups])
    _, known = shared_fit(points, values, polyharmonic(3, 3), 2, spread)
    left = -known(points[:count])
    mean = np.average(left, weights=own)
    chance = own @ (left - mean) ** 2 / ((count - 1) * own.sum() * mean**2)
    at, middle, outside = known(points).reshape(3, count)[:, far == 0.1] if even else np.zeros((3, 1))
    alike = own[far == 0.1] if even else np.ones(1)
    more = max(2 * own[far == 0.1].sum() / own.sum() - 1, 0.0)
    slope, second = (np.average(each, weights=alike) for each in (middle - outside, middle + outside - 2 * at))
    remains = 0.5 * count * chance * mean**2 * second / max(slope / 2, 1e-3) ** 2 * more
    places = rng.uniform(-0.9, 0.9, (50, 3)) * [1, 1, 0.1]
    atol = GROUPS_REFIT if smoothing == "fixed" else 0.02 * PART_OF_NOISE
    np.testing.assert_allclose(field(places), known(places) + (1 - chance) * mean + remains, rtol=0, atol=atol)
    assert chance < 0.2
    assert (remains != 0) == (more > 0)
    assert abs(field(points[:count]).mean() - remains) < 0.3 * abs(left.mean())


def test_places_that_are_off_make_a_field_flat_and_less_so_where_errors_are_known_to_be_shared():
    """A plane through values v of places that are off by σ has the slope Σ vᵀC⁻¹v/(Σ vᵀC⁻¹v + σ² Σ 1ᵀC⁻¹1)."""
    rng = np.random.default_rng(13)
    points, off, distance = rng.random((900, 2)), 0.03, 0.05
    base = np.arange(0, 900, 2)
    groups = np.concatenate([np.arange(900), base, base])
    values = np.repeat([0.0, -distance, distance], [900, len(base), len(base)])
    sites = np.column_stack([points, off * rng.standard_normal(900)])[groups]
    sites[:, 2] -= values
    inside = np.column_stack([points, np.zeros(900)])[((points > 0.1) & (points < 0.9)).all(axis=1)]
    rise = np.array([0.0, -distance, distance])
    for share in (0.0, 0.5, 0.8):
        field = PUInterpolant.fit(sites, values, smoothing="gcv-per-ball", groups=groups, share=share)
        inverse, one = np.linalg.inv(covariance(np.zeros(3), share, np.ones(3))), np.ones(3)
        signal, noise = rise @ inverse @ rise, off**2 * (one @ inverse @ one + 1)  # every other point stands alone
        slope = -field.gradient(inside)[:, 2]
        assert np.median(slope) == pytest.approx(signal / (signal + noise), rel=SLOPE_OF_PLANE)


def noisy(count=400, d=2):
    rng = np.random.default_rng(7)
    points = rng.random((count, d))
    return points, np.sin(5 * points).sum(axis=1) + 0.1 * rng.standard_normal(count)


def test_points_that_own_themselves_are_left_out_one_by_one():
    """The score is the mean square of the leave-one-out errors that `diagnostics` finds for the value chosen."""
    points, values = noisy()
    field = PUInterpolant.fit(points, values, smoothing="gcv", groups=np.arange(400), points_per_ball=400)
    alone = field.diagnostics().leave_one_out
    assert field.local.smoothing.score == pytest.approx(float(alone[0]) ** 2, rel=GROUPS_REFIT)


def test_errors_that_constraints_share_are_not_taken_for_shape():
    """Three constraints a point with its error: a rule that takes them for three witnesses follows the noise."""
    rng = np.random.default_rng(3)
    points, _ = noisy(300)
    truth, error = np.sin(5 * points).sum(axis=1), 0.3 * rng.standard_normal(300)
    groups = np.tile(np.arange(300), 3)
    sites = points[groups] + 0.005 * rng.standard_normal((900, 2))
    values = np.sin(5 * sites).sum(axis=1) + error[groups]

    def missed(rule):
        options = {"kernel": "thin_plate_spline", "points_per_ball": 300}
        return np.sqrt(
            np.mean((PUInterpolant.fit(sites, values, smoothing="gcv", **options, **rule)(points) - truth) ** 2)
        )

    assert missed({"groups": groups}) < 0.5 * missed({})


@pytest.mark.parametrize(
    "groups", [[0, 1, 2, 4], [-1, 0, 1, 2], [0, 1, 2], [0.0, 1.0, 2.0, 3.0], [[0, 1], [2, 3]]], ids=str
)
def test_groups_must_be_a_row_for_each_constraint(groups):
    with pytest.raises(InputError, match=r"groups: is .*; give one row number from 0 to 3 each"):
        as_rows(groups, 4)


@pytest.mark.parametrize("rule", ["gcv", "gcv-per-ball"])
def test_the_number_of_threads_does_not_change_a_bit_of_what_groups_make_balls_choose(rule):
    points, values = noisy(1200)
    groups = np.concatenate([np.arange(600), np.arange(600)])
    before, found = get_num_threads(), []
    try:
        for threads in (1, 3):
            set_num_threads(threads)
            field = PUInterpolant.fit(points, values, smoothing=rule, groups=groups, points_per_ball=60)
            found.append((field.local.smoothing.score, field.local.diagonals.tobytes(), field.local.weights.tobytes()))
    finally:
        set_num_threads(before)
    assert found[0] == found[1]


@pytest.mark.parametrize(("values", "groups"), [(np.zeros(40), None), (np.zeros((40, 2)), np.arange(40))])
def test_a_share_without_groups_or_of_several_columns_is_refused(values, groups):
    points = np.random.default_rng(0).uniform(size=(40, 3))
    with pytest.raises(InputError, match="share: is of the points of a group"):
        PUInterpolant.fit(points, values, groups=groups, share=0.5)


def test_balls_that_err_alike_agree_by_their_mean():
    errors, weights = np.random.default_rng(0).uniform(0.5, 2, 20), np.random.default_rng(1).uniform(50, 100, 6)
    found = robust_mean(weights[:, np.newaxis] * errors, weights, 0.0)
    np.testing.assert_allclose(found, errors, rtol=ROUNDING)


@pytest.mark.parametrize("larger", [1.0, 1e3, 1e9])
def test_no_ball_chooses_for_all_by_how_far_it_errs(larger):
    """However far, by which factor its errors differ counts to the power of its weight at most."""
    means, weights = np.ones((6, 2)), np.random.default_rng(2).uniform(50, 100, 6)
    means[0] = larger, 3 * larger
    least, most = robust_mean(weights[:, np.newaxis] * means, weights, 0.0) + 4.0
    assert 1 < most / least < 3 ** (weights[0] / weights.sum())


def test_balls_whose_errors_are_rounding_have_no_say():
    """As many planes as one likes, whose errors differ a millionfold by the order of sums alone."""
    rng = np.random.default_rng(1)
    one, planes = rng.uniform(0.5, 2, (1, 20)), 10.0 ** rng.uniform(-45, -39, (40, 20))
    found = robust_mean(np.concatenate([one, planes]), np.ones(41), 1e-20)
    np.testing.assert_allclose(found, robust_mean(np.concatenate([one, 0 * planes]), np.ones(41), 1e-20), rtol=ROUNDING)
    np.testing.assert_array_equal(np.argsort(found), np.argsort(one[0]))


@pytest.mark.parametrize("corners", [1, 2, 3])
def test_few_balls_of_outliers_do_not_choose_for_exact_data(corners):
    """Elsewhere it foretells the truth nearly as well as without them."""
    rng = np.random.default_rng(2)
    points = rng.uniform(-1, 1, (2400, 2))
    truth = np.sin(4 * points).sum(axis=1)
    bad = [np.abs(points - 0.8 * np.array(corner)).max(axis=1) < 0.1 for corner in ((1, 1), (1, -1), (-1, 1))[:corners]]
    outliers = np.where(np.any(bad, axis=0), rng.choice([-1.0, 1.0], 2400), 0.0)
    places = rng.uniform(-0.4, 0.4, (1000, 2))

    def error(values):
        options = {"kernel": "thin_plate_spline", "points_per_ball": (30, 60), "smoothing": "gcv"}
        field = PUInterpolant.fit(points, values, groups=np.arange(2400), **options)
        return np.sqrt(np.mean((field(places) - np.sin(4 * places).sum(axis=1)) ** 2))

    assert error(truth + outliers) < BALLS_OF_OUTLIERS * error(truth)


def test_rounding_of_planes_does_not_choose_for_what_bends():
    """Values of a plane but in one corner: errors in the last digits of the plane change nothing."""
    points = np.random.default_rng(3).uniform(-1, 1, (2400, 2))
    plane, bent = points @ [0.3, 0.7], np.maximum(points.min(axis=1) - 0.5, 0.0)
    rounding = 1e-12 * np.random.default_rng(4).standard_normal(2400)

    def chosen(values):
        options = {"kernel": "thin_plate_spline", "points_per_ball": (30, 60), "smoothing": "gcv"}
        return PUInterpolant.fit(points, values, groups=np.arange(2400), **options).local.smoothing.value

    assert chosen(plane + bent + rounding) == chosen(plane + bent)
