"""The thread pool: every block once, errors and Ctrl-C out, progress to the end, alive after a fork."""

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

from o3dleaf.core import parallel, progress
from o3dleaf.core.errors import InputError
from o3dleaf.core.journal import Journal
from o3dleaf.core.parallel import (
    blocks,
    get_num_threads,
    look_for_stop,
    run_blocks,
    run_together,
    set_num_threads,
    single_threaded_blas,
)
from o3dleaf.fitting.rbf.interpolant import RBFInterpolant

forks = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
limits_blas = pytest.mark.skipif(
    sys.platform == "darwin", reason="NumPy's BLAS is Apple's there, whose threads threadpoolctl cannot set"
)


@pytest.fixture(autouse=True)
def _two_threads():
    before = get_num_threads()
    set_num_threads(2)
    yield
    set_num_threads(before)


@given(count=st.integers(0, 100), size=st.integers(1, 30))
def test_blocks_cover_every_item_once_in_order(count, size):
    pairs = list(blocks(count, size))
    assert [i for start, stop in pairs for i in range(start, stop)] == list(range(count))
    assert all(0 < stop - start <= size for start, stop in pairs)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize(("count", "size"), [(0, 3), (2, 3), (3, 3), (100, 7)])
def test_every_item_is_done_once_and_progress_reaches_the_total(threads, count, size):
    set_num_threads(threads)
    assert get_num_threads() == threads
    done, seen = np.zeros(count, dtype=int), []

    def task(start, stop):
        done[start:stop] += 1

    with progress.listening(lambda *heard: seen.append(heard)):
        run_blocks(task, count, size, reports=True)
        last = seen[-1:]
    assert np.all(done == 1)
    assert len(seen) == max(len(list(blocks(count, size))), 1)
    assert sorted(seen) == seen
    assert last == ([(progress.WHOLE, progress.WHOLE)] if count else [])


def test_progress_is_called_from_the_calling_thread_while_the_work_goes_on():
    callers, ahead = set(), []

    def listener(done, total):
        callers.add(threading.current_thread())
        ahead.append(done < total)

    with progress.listening(listener):
        run_blocks(lambda start, stop: time.sleep(0.002), 20, 1, reports=True)
    assert callers == {threading.current_thread()}
    assert ahead[0]


def test_the_blocks_run_side_by_side():
    meeting = threading.Barrier(2, timeout=10)
    run_blocks(lambda start, stop: meeting.wait(), 2, 1)


@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_comes_out_and_cancels_what_has_not_started(threads):
    set_num_threads(threads)
    started = []

    def task(start, stop):
        started.append(start)
        if start == 3:
            raise ValueError("block three")
        time.sleep(0.002)

    with pytest.raises(ValueError, match="block three"):
        run_blocks(task, 1000, 1)
    count = len(started)
    assert count < 100
    time.sleep(0.02)
    assert len(started) == count


def test_nothing_runs_any_more_when_the_error_arrives():
    """A caller who catches the error may touch the arrays again."""
    running = []

    def task(start, stop):
        if start == 0:
            raise ValueError("at once")
        running.append(start)
        time.sleep(0.1)
        running.remove(start)

    for _ in range(3):
        with pytest.raises(ValueError, match="at once"):
            run_blocks(task, 50, 1)
        assert not running


def test_an_error_in_progress_comes_out_too():
    def listener(done, total):
        raise ValueError("bar")

    def work():
        with progress.listening(listener):
            run_blocks(lambda start, stop: None, 10, 1, reports=True)

    with pytest.raises(ValueError, match="bar"):
        work()


@pytest.mark.parametrize("threads", [1, 2])
def test_an_interrupt_in_a_task_comes_out(threads):
    set_num_threads(threads)

    def task(start, stop):
        if start == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_blocks(task, 20, 1)


@pytest.fixture
def _no_garbage():
    """Python drops an interrupt that arrives inside a destructor."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("_no_garbage")
def test_ctrl_c_stops_the_work():
    """The main thread notices it while it waits for the blocks, though the signal came to another one."""
    started = []

    def task(start, stop):
        started.append(start)
        if start == 20:
            signal.raise_signal(signal.SIGINT)
        time.sleep(0.005)

    with pytest.raises(KeyboardInterrupt):
        run_blocks(task, 1000, 1)
    assert len(started) < 500


def test_the_pool_works_on_after_an_error():
    with pytest.raises(ZeroDivisionError):
        run_blocks(lambda start, stop: 1 // start, 10, 1)
    done = np.zeros(10)
    run_blocks(lambda start, stop: done.__setitem__(slice(start, stop), 1), 10, 1)
    assert done.all()


@pytest.mark.parametrize("threads", [1, 2])
def test_tasks_that_run_together_give_their_results_in_order(threads):
    set_num_threads(threads)
    sums = np.zeros((3, 50))

    def caller(row):
        run_blocks(lambda start, stop: sums.__setitem__((row, start), start + row), 50, 1)
        return row

    assert run_together(*(lambda row=row: caller(row) for row in range(3))) == [0, 1, 2]
    np.testing.assert_array_equal(sums, np.arange(50.0) + np.arange(3.0)[:, np.newaxis])


def test_tasks_run_side_by_side_in_the_context_of_the_caller():
    meeting, heard = threading.Barrier(2, timeout=10), []

    def task():
        meeting.wait()
        with np.errstate(invalid="ignore"), Journal() as journal, journal.stage("inner"):
            pass
        assert np.geterr()["invalid"] == "raise"
        progress.report(1, 2)

    with progress.listening(lambda done, total: heard.append(done / total)), np.errstate(invalid="raise"):
        run_together(task, task)
        assert heard == [0.5]


@pytest.mark.parametrize("cause", [ValueError("first"), KeyboardInterrupt()])
def test_what_ends_one_task_ends_the_others_at_their_next_block_and_comes_out(cause):
    started = []

    def work():
        for _ in range(500):
            run_blocks(lambda start, stop: started.append(time.sleep(0.002)), 4, 1)

    def fail():
        while not started:
            time.sleep(0.001)
        raise cause

    with pytest.raises(type(cause)):
        run_together(work, fail)
    count = len(started)
    assert count < 500
    time.sleep(0.02)
    assert len(started) == count


def test_a_task_without_blocks_ends_where_it_looks():
    rounds = []

    def work():
        for _ in range(500):
            rounds.append(time.sleep(0.002))
            look_for_stop()

    def fail():
        while not rounds:
            time.sleep(0.001)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_together(work, fail)
    assert len(rounds) < 500
    look_for_stop()  # nothing is to be stopped here


@pytest.mark.usefixtures("_no_garbage")
def test_ctrl_c_stops_tasks_that_run_together():
    started = []

    def work():
        for number in range(500):
            run_blocks(lambda start, stop: started.append(time.sleep(0.002)), 4, 1)
            if number == 5:
                signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run_together(work)
    assert len(started) < 500


@forks
def test_a_block_may_use_the_pool_itself():
    """A Field asked from inside a block runs blocks of its own; on the same two threads it would wait for ever."""

    def nested():
        done = np.zeros((8, 5), dtype=int)

        def outer(start, stop):
            run_blocks(lambda first, last: done.__setitem__((start, slice(first, last)), 1), 5, 1)

        run_blocks(outer, 8, 1)
        os._exit(0 if done.all() else 1)

    child = multiprocessing.get_context("fork").Process(target=nested, daemon=True)
    child.start()
    child.join(20)
    waiting = child.is_alive()
    child.kill()
    assert not waiting
    assert child.exitcode == 0


def test_several_callers_share_the_pool():
    sums = np.zeros((6, 50))

    def caller(row):
        run_blocks(lambda start, stop: sums.__setitem__((row, start), start), 50, 1)

    callers = [threading.Thread(target=caller, args=(row,)) for row in range(6)]
    for thread in callers:
        thread.start()
    for thread in callers:
        thread.join(20)
    np.testing.assert_array_equal(sums, np.arange(50.0) * np.ones((6, 1)))


def test_the_cost_of_a_block_does_not_grow_with_their_number(monkeypatch):
    """Threads fetch their blocks: of a future for each, all that are pending would be looked at for every one."""
    submit, futures = parallel._pool.submit, []
    monkeypatch.setattr(parallel._pool, "submit", lambda *given: (submit(*given), futures.extend(given[-1])))
    done = []
    run_blocks(lambda start, stop: done.append(start), 20_000, 1)
    assert len(futures) == 2
    assert sorted(done) == list(range(20_000))


def test_the_number_of_threads_may_change_while_others_work():
    """Every caller's items are all done, whatever the pool that they began in."""
    counts, stop = [], threading.Event()

    def caller():
        while not stop.is_set():
            done = np.zeros(64, dtype=int)

            def task(start, end, done=done):
                done[start:end] += 1

            run_blocks(task, len(done), 4)
            counts.append((done == 1).all())

    before = get_num_threads()
    with ThreadPoolExecutor(3) as callers:
        jobs = [callers.submit(caller) for _ in range(3)]
        try:
            for turn in range(60):
                set_num_threads(2 + turn % 3)
        finally:
            stop.set()
            set_num_threads(before)
        for job in jobs:
            job.result()
    assert len(counts) > 3
    assert all(counts)


def test_fewer_than_one_thread_is_refused():
    for threads in (0, -3):
        with pytest.raises(InputError, match="at least 1"):
            set_num_threads(threads)


def fit_and_ask():
    rng = np.random.default_rng(0)
    points = rng.random((200, 3))
    return RBFInterpolant.fit(points, points.sum(axis=1) ** 2)(rng.random((5000, 3)))


@forks
def test_a_forked_child_computes_the_same_bits():
    expected = fit_and_ask().tobytes()
    child = os.fork()
    if child == 0:  # nothing but os._exit may end this branch
        signal.alarm(60)
        os._exit(0 if fit_and_ask().tobytes() == expected else 1)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0


@forks
def test_a_multiprocessing_child_of_either_kind_computes_the_same_bits():
    expected = fit_and_ask()
    context = multiprocessing.get_context("fork")
    there, here = context.Pipe()
    child = context.Process(target=lambda: there.send(fit_and_ask()), daemon=True)
    child.start()
    assert here.poll(60)
    np.testing.assert_array_equal(here.recv(), expected)
    child.join(20)
    assert child.exitcode == 0


def blas_threads():
    return {found["filepath"]: found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}


@pytest.fixture
def blas():
    """BLAS at two threads, whatever the machine, so that a limit of one is seen."""
    with single_threaded_blas():
        pass  # what this loads stays loaded
    with threadpool_limits(limits=2, user_api="blas"):
        yield blas_threads()


@limits_blas
def test_the_blas_limit_holds_inside_and_is_lifted_outside(blas):
    assert set(blas.values()) == {2}
    with single_threaded_blas():
        assert set(blas_threads().values()) == {1}
    assert blas_threads() == blas


@limits_blas
def test_a_library_that_comes_later_does_not_escape_the_limit():
    """Numba calls SciPy's BLAS, which is loaded at its first use: inside the limit, if nobody did before."""
    code = """
from threadpoolctl import threadpool_info
from o3dleaf.core.parallel import single_threaded_blas
with single_threaded_blas():
    import scipy.linalg
    print({found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"})
"""
    child = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert child.stdout.strip() == "{1}"


@limits_blas
def test_a_library_that_comes_between_two_limits_does_not_escape_the_second(tmp_path):
    """Libraries are looked for where a module was imported since the last search."""
    code = """
import ctypes, shutil, sys
from threadpoolctl import threadpool_info
from o3dleaf.core.parallel import single_threaded_blas

def blas():
    return {found["filepath"]: found["num_threads"] for found in threadpool_info() if found["user_api"] == "blas"}

with single_threaded_blas():
    before = blas()
ctypes.CDLL(shutil.copy(next(iter(before)), sys.argv[1]))
import tabnanny  # any module that was not there
with single_threaded_blas():
    after = blas()
print(len(before), len(after), set(after.values()))
"""
    child = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    before, after, threads = child.stdout.split(maxsplit=2)
    assert int(after) == int(before) + 1
    assert threads.strip() == "{1}"


@limits_blas
def test_nested_limits_are_lifted_by_the_last(blas):
    with single_threaded_blas():
        with single_threaded_blas():
            pass
        assert set(blas_threads().values()) == {1}
    assert blas_threads() == blas


@limits_blas
def test_the_limit_is_lifted_after_an_error(blas):
    with pytest.raises(ValueError, match="inside"), single_threaded_blas():
        raise ValueError("inside")
    assert blas_threads() == blas


@limits_blas
def test_concurrent_limits_are_lifted_by_the_last(blas):
    inside, leave, seen = threading.Barrier(3, timeout=10), [threading.Event() for _ in range(2)], []

    def user(number):
        with single_threaded_blas():
            inside.wait()
            leave[number].wait(10)
            seen.append(set(blas_threads().values()))

    users = [threading.Thread(target=user, args=(number,)) for number in range(2)]
    for thread in users:
        thread.start()
    inside.wait()
    for number, thread in enumerate(users):
        leave[number].set()
        thread.join(10)
    assert seen == [{1}, {1}]
    assert blas_threads() == blas
