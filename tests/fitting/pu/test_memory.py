"""Evaluation works in bounded memory: it grows with the result, not with the number of queries."""

import tracemalloc

import numpy as np
import pytest

from o3dleaf import PUInterpolant, get_num_threads, set_num_threads
from o3dleaf.fitting.pu import blend

ODDS_AND_ENDS = 1 << 17
"""Bytes of Python's own: futures, views, the tracer's tables; a chunk's arrays are ten times this and more."""

SCRATCH = 1 << 17
"""Bytes that one thread works in; see `o3dleaf.fitting.local.blend_loops.workspace`."""

THREADS = 4


@pytest.fixture(autouse=True)
def _four_threads():
    before = get_num_threads()
    set_num_threads(THREADS)
    yield
    set_num_threads(before)


@pytest.fixture(scope="module")
def field():
    points = np.random.default_rng(0).random((300, 3))
    field = PUInterpolant.fit(points, np.sin(5 * points).sum(axis=1), points_per_ball=(30, 60))
    for call in (field, field.gradient, field.hessian):  # compiled, and the single precision copy made
        for dtype in (np.float64, np.float32):
            call(points, dtype=dtype)
    return field


def working_memory(call, queries, dtype):
    """Bytes that a call holds at most beside its arguments and its result, Numba's arrays included."""
    tracemalloc.start()
    try:
        result = call(queries, dtype=dtype)
        return tracemalloc.get_traced_memory()[1] - result.nbytes
    finally:
        tracemalloc.stop()


@pytest.mark.few
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", ["__call__", "gradient", "hessian"])
def test_it_does_not_grow_with_the_number_of_queries(field, name, dtype, monkeypatch):
    """Six chunks of queries need what two need, and that is what is stated, scaled to the smaller chunk."""
    chunk = 1 << 14
    share = chunk / blend.BATCH_SIZE
    monkeypatch.setattr(blend, "BATCH_SIZE", chunk)
    queries = np.random.default_rng(1).random((6 * chunk, 3))
    few, many = (working_memory(getattr(field, name), queries[: n * chunk], dtype) for n in (2, 6))
    assert few > 40 * chunk  # folded points, leaves and order alone are that much: the tracer sees NumPy
    assert many <= few + THREADS * SCRATCH + ODDS_AND_ENDS  # four chunks kept would be 2.6 MB and more
    assert many <= blend.WORKING_MEMORY * share + THREADS * SCRATCH + ODDS_AND_ENDS


@pytest.mark.slow
def test_it_stays_below_what_is_stated(field):
    queries = np.random.default_rng(1).random((blend.BATCH_SIZE * 9 // 8, 3))
    needed = working_memory(field.hessian, queries, np.float64)
    assert 0.5 * blend.WORKING_MEMORY < needed <= blend.WORKING_MEMORY
