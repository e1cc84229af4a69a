"""Same input, same bits: whatever the number of threads, the blocks, and the order of the queries."""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from o3dleaf.parallel import get_num_threads, set_num_threads
from o3dleaf.pu import index, local
from o3dleaf.pu.interpolant import PUInterpolant


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
    parts = (field.cover.members, field.local.weights, field.local.tails, field(queries), field.gradient(queries))
    return [part.tobytes() for part in parts]


def test_the_number_of_threads_does_not_change_a_bit(threads):
    points, values, queries = data()
    found = []
    for count in (1, 2, 4):
        threads(count)
        with threadpool_limits(limits=count, user_api="blas"):
            found.append(everything(PUInterpolant.fit(points, values, rho="gcv", points_per_ball=150), queries))
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("block", [1, 7, 1000, 10**6])
def test_the_blocks_do_not_change_a_bit(block, monkeypatch):
    points, values, queries = data()
    field = PUInterpolant.fit(points, values, points_per_ball=80)
    before = everything(field, queries)
    monkeypatch.setattr(local, "BLEND_BLOCK", block)
    monkeypatch.setattr(index, "LOCATE_BLOCK", block)
    assert everything(field, queries) == before


def test_the_order_and_the_company_of_queries_do_not_change_a_bit():
    points, values, queries = data()
    field = PUInterpolant.fit(points, values, points_per_ball=80)
    result, slopes = field(queries), field.gradient(queries)
    for order in (np.lexsort(queries.T), np.random.default_rng(1).permutation(len(queries))):
        np.testing.assert_array_equal(field(queries[order]), result[order])
        np.testing.assert_array_equal(field.gradient(queries[order]), slopes[order])
    np.testing.assert_array_equal(np.concatenate([field(q) for q in queries[:50]]), result[:50])


def test_a_second_fit_gives_the_same_bits():
    points, values, queries = data()
    first, second = (PUInterpolant.fit(points, values, smoothing=0.01, points_per_ball=80) for _ in range(2))
    assert everything(first, queries) == everything(second, queries)
