"""Several columns of values at once are each what it is alone, at the price of one factorization."""

import time

import numpy as np
import pytest
from scipy.stats.qmc import Halton

from o3dleaf import PUInterpolant, RBFInterpolant, TiledField, extract_isosurface, load, set_num_threads
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import get_num_threads
from o3dleaf.fitting.local.fields import FieldPerBall
from o3dleaf.fitting.pu import blend
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from tolerances import COLUMN, COLUMN_SHARE, GCV_CHOICE, ROUNDING

BALLS = (25, 50)


def scattered(d=3, count=300):
    rng = np.random.default_rng(0)
    points = 3 * Halton(d, rng=rng).random(count) - 1
    columns = [np.sin(2 * points).sum(axis=1), points[:, 0] ** 2, 1e3 * np.cos(points[:, -1])]
    return points, np.column_stack(columns), rng.uniform(-1.6, 2.6, (80, d))  # outside the box, too


def close(found, expected, share=COLUMN):
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


@pytest.mark.few
@pytest.mark.parametrize("options", [{}, {"smoothing": 0.1}, {"rho": 1e-4, "weights": True}], ids=str)
@pytest.mark.parametrize(("power", "d"), [(1, 3), (2, 2), (3, 1), (3, 3), (4, 2), (5, 3)])
def test_every_column_is_what_it_is_alone(power, d, options):
    points, values, queries = scattered(d)
    options = options | {"kernel": Polyharmonic(power, d), "points_per_ball": BALLS}
    if Polyharmonic(power, d).theta is None and "rho" in options:
        pytest.skip("no energy, no rho")
    if "weights" in options:
        options["weights"] = np.linspace(0.5, 2, len(points))
    field = PUInterpolant.fit(points, values, **options)
    assert field.columns == 3
    assert field(queries).shape == (len(queries), 3)
    for k in range(3):
        alone = PUInterpolant.fit(points, values[:, k], **options)
        assert alone.columns is None
        np.testing.assert_array_equal(field.local.ranks, alone.local.ranks)
        close(field(queries)[:, k], alone(queries))
        close(field.gradient(queries)[:, k], alone.gradient(queries))
        if power >= 3:
            close(field.hessian(queries)[:, k], alone.hessian(queries))
            for found, expected in zip(field.jets(queries, 2), alone.jets(queries, 2), strict=True):
                close(found[:, k], expected)


def test_coinciding_points_are_averaged_column_by_column():
    points, values, queries = scattered()
    points[10:20] = points[:10]
    values[10:20] = values[:10]
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS)
    assert field.local.dropped.max() > 0
    for k in range(3):
        close(field(queries)[:, k], PUInterpolant.fit(points, values[:, k], points_per_ball=BALLS)(queries))


def test_one_ball_chooses_the_smoothing_of_a_single_interpolant_of_the_same_columns():
    points, values, queries = scattered()
    noisy = values / [1, 1, 1e3] + 0.1 * np.random.default_rng(1).standard_normal(values.shape)
    single = RBFInterpolant.fit(points, noisy, smoothing="gcv")
    assert single.columns == 3
    for word in ("gcv", "gcv-per-ball"):
        field = PUInterpolant.fit(points, noisy, smoothing=word, points_per_ball=len(points))
        assert len(field.cover.radii) == 1
        assert field.local.diagonals[0] == pytest.approx(single.smoothing.value, rel=GCV_CHOICE)
        close(field(queries), single(queries))


def test_points_fewer_than_the_tail_has_terms():
    points, values = np.eye(3), np.arange(6.0).reshape(3, 2)
    field = PUInterpolant.fit(points, values, smoothing=0.1)
    close(field(points), values)


def test_it_comes_back_from_a_file(tmp_path):
    points, values, queries = scattered()
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS, smoothing="gcv-per-ball")
    field.save(tmp_path / "columns.o3l")
    again = load(tmp_path / "columns.o3l")
    np.testing.assert_array_equal(again(queries), field(queries))
    np.testing.assert_array_equal(again.local.diagonals, field.local.diagonals)
    assert "3 columns" in repr(again)


def test_threads_and_blocks_do_not_matter():
    points, values, queries = scattered()
    before, found = get_num_threads(), []
    try:
        for threads in (1, 3):
            set_num_threads(threads)
            found.append(PUInterpolant.fit(points, values, points_per_ball=BALLS).gradient(queries))
    finally:
        set_num_threads(before)
    np.testing.assert_array_equal(*found)
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS)
    np.testing.assert_array_equal(np.concatenate([field.gradient(one) for one in queries]), found[0])


def test_chunks_of_queries_do_not_matter(monkeypatch):
    points, values, queries = scattered()
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS)
    whole = field.jets(queries, 2)
    monkeypatch.setattr(blend, "BATCH_SIZE", 3 * 7)
    for found, expected in zip(field.jets(queries, 2), whole, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_single_precision():
    points, values, queries = scattered()
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS, smoothing=1.0)
    found = field(queries, dtype=np.float32)
    assert found.dtype == np.float32
    for k in range(3):
        alone = PUInterpolant.fit(points, values[:, k], points_per_ball=BALLS, smoothing=1.0)
        close(found[:, k], alone(queries, dtype=np.float32), 1e8 * ROUNDING)


@pytest.mark.slow
def test_eight_columns_cost_about_one():
    points = np.random.default_rng(0).random((6000, 3))
    values = np.random.default_rng(1).random((6000, 8))

    def seconds(data):
        taken = []
        for _ in range(3):
            start = time.process_time()
            PUInterpolant.fit(points, data)
            taken.append(time.process_time() - start)
        return min(taken)

    assert seconds(values) < COLUMN_SHARE * 8 * seconds(values[:, 0])


@pytest.mark.parametrize("fit", [PUInterpolant.fit, RBFInterpolant.fit])
def test_what_is_no_column_of_real_numbers_is_refused(fit):
    points, values, _ = scattered()
    with pytest.raises(InputError, match="complex; give real numbers"):
        fit(points, values[:, 0] + 1j)
    with pytest.raises(InputError, match="one value per point"):
        fit(points, values[:, :, np.newaxis])
    with pytest.raises(InputError, match="one value per point"):
        fit(points, values[:-1])
    with pytest.raises(InputError, match="one value per point"):
        fit(points, values[:, :0])


def test_what_needs_one_value_says_so():
    points, values, queries = scattered()
    field = PUInterpolant.fit(points, values, points_per_ball=BALLS)
    for use in (
        lambda: extract_isosurface(field, 0.5),
        lambda: TiledField(field),
        lambda: field.on_lattice(field.bounds, 0.5),
        field.diagnostics,
        lambda: extract_isosurface(RBFInterpolant.fit(points, values), 0.5),
    ):
        with pytest.raises(InputError, match="the field has 3 columns of values; fit one"):
            use()
    with pytest.raises(InputError, match="leave out local"):
        PUInterpolant.fit(points, values, local=FieldPerBall(RBFInterpolant.fit))
    with pytest.raises(InputError, match="groups"):
        PUInterpolant.fit(points, values, smoothing="gcv", groups=np.arange(len(points)))
    assert PUInterpolant.fit(points, values, smoothing=1.0, groups=np.arange(len(points)))(queries).shape[1] == 3
