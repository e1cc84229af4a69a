"""One thread pool for every compiled loop of the package, with progress, interruption and fixed blocks.

Compiled functions are serial and release the GIL; this module drives them over fixed blocks. A
block's result never depends on the number of threads, so neither does any result of the package.
"""

import importlib
import itertools
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from typing import Any

from threadpoolctl import LibController, OpenBLASController, get_cached_controller

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count
from o3dleaf.core.errors import InputError
from o3dleaf.core.progress import is_heard, report

PERIOD = 0.02
"""Seconds between two looks at what has finished, and for Ctrl-C, which on Windows ends no wait.

Often enough for a bar, too seldom to keep a thread from its work.
"""


class _Here(threading.local):
    """State of the calling thread."""

    is_worker = False

    def enter(self) -> None:
        self.is_worker = True


_here = _Here()


class _Pool:
    """The executor, made at first use, and made anew after a fork or a change of the thread count."""

    def __init__(self) -> None:
        self.threads = os.cpu_count() or 1
        self.executor: ThreadPoolExecutor | None = None
        self.lock = threading.Lock()

    def submit(self, work: Callable[[], None], count: int, jobs: list[Future[None]]) -> None:
        """Add futures of some work to a list, all of one executor."""
        with self.lock:
            executor = self.executor or ThreadPoolExecutor(self.threads, "o3dleaf", initializer=_here.enter)
            self.executor = executor
            jobs += (executor.submit(work) for _ in range(min(self.threads, count)))

    def resize(self, threads: int) -> None:
        with self.lock:
            old, self.executor, self.threads = self.executor, None, threads
        if old is not None:
            old.shutdown(wait=not _here.is_worker)  # what has been submitted is done before

    def forget(self) -> None:
        """Begin anew in a child: its parent's threads are not there, and one of them may have held the lock."""
        self.executor, self.lock = None, threading.Lock()


_pool = _Pool()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.forget)


class _Stopped(BaseException):
    """Raised in the tasks of `run_together` that another one's error ends."""


_stop: ContextVar[threading.Event | None] = ContextVar("o3dleaf.stop", default=None)
"""Set when one of the tasks that run together has failed."""


def get_num_threads() -> int:
    """Return the number of threads that compiled loops run on."""
    return _pool.threads


@checked
def set_num_threads(threads: Count) -> None:
    """Set the number of threads for compiled loops (default: all cores); results do not depend on it.

    Raises
    ------
    InputError
        If `threads` is below 1.
    """
    if threads < 1:
        raise InputError(f"threads: is {threads}; give 1 or more")
    _pool.resize(threads)


def blocks(count: int, size: int) -> Iterator[tuple[int, int]]:
    """Yield (start, stop) of consecutive blocks of `size` (the last may be shorter) that cover `count`."""
    for start in range(0, count, size):
        yield start, min(start + size, count)


def look_for_stop() -> None:
    """End a task of `run_together` here if Ctrl-C, or another one's error, has made it useless.

    `run_blocks` looks for it between blocks; what goes round without blocks for longer looks itself.
    """
    stop = _stop.get()
    if stop is not None and stop.is_set():
        raise _Stopped


def run_blocks(task: Callable[[int, int], Any], count: int, size: int, *, reports: bool = False) -> None:
    """Call ``task(start, stop)`` for every block of `size` out of `count`, on all threads.

    The task writes its own rows of a shared array; nothing is reduced across blocks, so that the
    result is the same for any number of threads. Ctrl-C, or an error in a block, cancels the blocks
    that have not started, waits for those that have, and is raised here. Inside a block the blocks
    of another call run one after another, in the block's own thread.

    Parameters
    ----------
    task : callable
        Compiled with ``nogil``, or any function of (start, stop).
    count, size : int
        Number of items and items in a block.
    reports : bool
        Whether finished blocks are reported as progress of the part that is running, see `o3dleaf.core.progress`.
    """
    look_for_stop()
    reports = reports and is_heard()
    todo = list(blocks(count, size))
    if len(todo) <= 1 or _pool.threads == 1 or _here.is_worker:
        for start, stop in todo:
            task(start, stop)
            if reports:
                report(stop, count)
        return
    numbers, finished, stopped = itertools.count(), list[int](), threading.Event()

    def work() -> None:
        # Threads fetch their blocks: a future each would cost more than a small block, under the one lock of Python.
        while (number := next(numbers)) < len(todo) and not stopped.is_set():
            try:
                task(*todo[number])
            except BaseException:
                stopped.set()
                raise
            finished.append(todo[number][1] - todo[number][0])

    jobs = list[Future[None]]()
    try:
        _pool.submit(work, len(todo), jobs)
        _watch(jobs, finished, count, reports=reports)
    finally:
        stopped.set()
        for job in jobs:
            job.cancel()
        wait(jobs)


def _watch(jobs: list[Future[None]], finished: list[int], count: int, *, reports: bool) -> None:
    """Wait for the jobs, report what has `finished` while they run, and raise what they raised."""
    done, reported = 0, 0
    pending = True
    while pending:
        pending = bool(wait(jobs, PERIOD).not_done)
        look_for_stop()
        while reports and reported < len(finished):
            done += finished[reported]
            reported += 1
            report(done, count)
    for job in jobs:
        job.result()


def run_together(*tasks: Callable[[], Any]) -> list[Any]:
    """Call tasks side by side, each in a thread of its own, and return their results in the same order.

    For steps that do not depend on one another and are serial in part: their blocks (`run_blocks`) share the threads
    of the pool, and the serial part of one leaves them to the others. Each has a copy of the caller's context, so that
    journal and progress are the caller's. On one thread, or inside a block, they are called one after another.

    Ctrl-C, or an error in one, ends the others at their next blocks (`look_for_stop`), and is raised here when all have
    ended.
    """
    if _pool.threads == 1 or _here.is_worker:
        return [task() for task in tasks]
    stop = threading.Event()

    def guarded(task: Callable[[], Any]) -> Any:
        _stop.set(stop)
        try:
            return task()
        except BaseException:
            stop.set()
            raise

    with ThreadPoolExecutor(len(tasks), "o3dleaf-task") as threads:
        jobs = [threads.submit(copy_context().run, guarded, task) for task in tasks]
        try:
            while wait(jobs, PERIOD).not_done:
                pass
        except BaseException:
            stop.set()
            raise
    # Those that were stopped come last: what stopped them is what went wrong.
    for job in sorted(jobs, key=lambda job: isinstance(job.exception(), _Stopped)):
        job.result()
    return [job.result() for job in jobs]


class _BlasLimit:
    """One process-wide limit, shared by nested and concurrent users, lifted by the last of them."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.users = 0
        self.before: list[tuple[LibController, int]] = []

    def enter(self) -> None:
        with self.lock:
            if self.users == 0:
                # Numba's linear algebra is SciPy's: a library that is not loaded yet would escape the limit.
                importlib.import_module("scipy.linalg")
                # A search takes a millisecond: it is done anew where a module was imported since the last one.
                libraries = get_cached_controller().select(user_api="blas").lib_controllers
                self.before = [(library, library.get_num_threads()) for library in libraries]
                self._set([(library, 1) for library in libraries])
            self.users += 1

    def leave(self) -> None:
        with self.lock:
            self.users -= 1
            if self.users == 0:
                self._set(self.before)

    @staticmethod
    def _set(limits: list[tuple[LibController, int]]) -> None:
        # threadpoolctl ignores every thread but the first to set a limit; our last user may be another one.
        OpenBLASController.clear_controlling_thread(force=True)
        for library, threads in limits:
            library.set_num_threads(threads)
        OpenBLASController.clear_controlling_thread()


_blas = _BlasLimit()


@contextmanager
def single_threaded_blas() -> Iterator[None]:
    """Hold BLAS at one thread: its last bits depend on the thread count, and our pool has the cores."""
    _blas.enter()
    try:
        yield
    finally:
        _blas.leave()
