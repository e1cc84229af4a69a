"""Same input, same bits: whatever the number of threads, the blocks, and the order of the queries."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from o3dleaf import PUInterpolant, get_num_threads, set_num_threads
from o3dleaf.fitting.cover import index
from o3dleaf.fitting.local import blending
from o3dleaf.fitting.pu import blend


@pytest.fixture
def threads():
    before = get_num_threads()
    yield set_num_threads
    set_num_threads(before)


def data():
    rng = np.random.default_rng(0)
    points = rng.random((3000, 3))
    return points, np.sin(6 * points).sum(axis=1), rng.random((5000, 3))


def everything(field, queries):
    """All the numbers of a fit and of its evaluation."""
    fitted = field.cover.members, field.local.weights, field.local.tails
    return [part.tobytes() for part in (*fitted, *evaluations(field, queries))]


def evaluations(field, queries):
    """Values, gradients and Hessians, in double and in single precision."""
    calls = field, field.gradient, field.hessian
    return [call(queries, dtype=dtype) for call in calls for dtype in (np.float64, np.float32)]


def test_the_number_of_threads_does_not_change_a_bit(threads):
    points, values, queries = data()
    found = []
    for count in (1, 2, 4):
        threads(count)
        with threadpool_limits(limits=count, user_api="blas"):
            found.append(everything(PUInterpolant.fit(points, values, rho="gcv", points_per_ball=150), queries))
    assert found[0] == found[1] == found[2]


SIZES = [(blending, "BLEND_BLOCK"), (index, "FOLD_BLOCK"), (blend, "FOLD_BLOCK"), (blend, "BATCH_SIZE")]


def test_every_size_of_a_block_of_queries_is_varied_here():
    named = [(m, n) for m in (blend, index, blending) for n in vars(m) if n == "BATCH_SIZE" or n.endswith("BLOCK")]
    assert sorted(named, key=str) == sorted(SIZES, key=str)


@pytest.mark.few
@pytest.mark.parametrize(("module", "name"), SIZES, ids=lambda part: getattr(part, "__name__", part))
@pytest.mark.parametrize("block", [7, 1000])
def test_no_single_size_changes_a_bit(module, name, block, monkeypatch):
    points, values, queries = data()
    field = PUInterpolant.fit(points[:800], values[:800], points_per_ball=80)
    before = everything(field, queries)
    monkeypatch.setattr(module, name, block)
    assert everything(field, queries) == before


@pytest.mark.few(block=3)
@pytest.mark.parametrize("block", [70, 1000, 10**6, 1])
def test_the_blocks_do_not_change_a_bit(block, monkeypatch):
    points, values, queries = data()
    field = PUInterpolant.fit(points, values, points_per_ball=80)
    before = everything(field, queries)
    for module, name in SIZES:
        monkeypatch.setattr(module, name, block)
    assert everything(field, queries) == before


def test_the_order_and_the_company_of_queries_do_not_change_a_bit():
    points, values, queries = data()
    field = PUInterpolant.fit(points, values, points_per_ball=80)
    result = evaluations(field, queries)
    for order in (np.lexsort(queries.T), np.random.default_rng(1).permutation(len(queries))):
        for found, expected in zip(evaluations(field, queries[order]), result, strict=True):
            np.testing.assert_array_equal(found, expected[order])
    alone = [evaluations(field, q) for q in queries[:50]]
    for found, expected in zip(zip(*alone, strict=True), result, strict=True):
        np.testing.assert_array_equal(np.concatenate(found), expected[:50])


def test_a_second_fit_gives_the_same_bits():
    points, values, queries = data()
    first, second = (PUInterpolant.fit(points, values, smoothing=0.01, points_per_ball=80) for _ in range(2))
    assert everything(first, queries) == everything(second, queries)
