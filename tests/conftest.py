"""What every test runs under: NumPy's errors raised, hypothesis repeatable, real scans found or skipped.

Tests marked `slow` are left out, and their number said, but with `--slow`, which says what it ran of them.
"""

import gc
import inspect
import os
import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.entropy import deterministic_PRNG
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from threadpoolctl import threadpool_limits

from o3dleaf.core.parallel import get_num_threads, set_num_threads
from repeats import find_repeats

if sys.platform != "win32":
    import fcntl

pytest_plugins = ["called_functions"]

REAL_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

# Examples follow from the test's source alone, so a failure here is a failure everywhere; and no
# deadline, because the first call of a compiled function compiles it.
settings.register_profile("repeatable", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("repeatable")
# Nor from numbers in whatever modules of ours are loaded by then: each worker would read all, for seconds.
providers.is_local_module_file = lambda path: False


SLOW_LEFT_OUT = pytest.StashKey[int]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the one option of ours."""
    parser.addoption("--slow", action="store_true", help="run the tests marked slow, too, and say which they were")


def pytest_configure(config: pytest.Config) -> None:
    """Give BLAS one thread, since there is a worker a core, and let workers share what Numba compiles.

    BLAS threads that find no core free wait for one another in circles of their own: an eigenvalue problem of 4 s takes
    130 s. Our own loops run on a worker's share of the cores, too: tests that more threads change nothing ask for them,
    and commands run on all. Each worker would also compile each function for itself; now one does, and the others wait
    and read it. Windows has no such lock: each worker compiles what `o3dleaf warm-up` did not compile before.

    A shell that starts the tests in the background has them ignore Ctrl-C, and their children, too: not so here.

    Of what is imported and collected next nothing is garbage: to look for some would take a sixth of that time.
    """
    gc.disable()
    with deterministic_PRNG():  # where it is first entered it goes through all that there is: here that is little
        pass
    config.addinivalue_line("markers", "slow: takes long, and runs with --slow only")
    config.addinivalue_line(
        "markers",
        "few(argument=n, ...): cases that repeat values of arguments, or have others than the first n, are slow",
    )
    for mark in ("skip_xp_backends", "uses_xp_capabilities"):
        config.addinivalue_line(
            "markers", f"{mark}: of SciPy's tests, which tests/fitting/rbf/test_scipy_suite.py runs"
        )
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # what workers and programs load
    threadpool_limits(1, user_api="blas")  # what is loaded
    if hasattr(config, "workerinput") and sys.platform != "win32":
        folder = Path(config.getoption("basetemp")).parent / "compiling"
        folder.mkdir(exist_ok=True)
        Dispatcher.compile = alone(Dispatcher.compile, folder)
    set_num_threads(max(1, get_num_threads() // workers_beside(config)))


def workers_beside(config: pytest.Config) -> int:
    """Return how many processes run the tests."""
    return int(getattr(config, "workerinput", {}).get("workercount", 1))


def alone(compile_here: Callable[..., object], folder: Path) -> Callable[..., object]:
    """Return Numba's `compile` under a lock a function, a file in `folder`.

    No two wait for one another: the lock of a function is held while those that it calls are compiled, never the other
    way round, and by no thread but the one that Numba lets compile.
    """

    def compile_alone(function: Dispatcher, signature: object) -> object:
        if function.stats.cache_path is None:  # not kept on disk, so nothing to read
            return compile_here(function, signature)
        name = f"{type(function).__name__}.{function.py_func.__module__}.{function.py_func.__qualname__}"
        with global_compiler_lock, (folder / name).open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            try:
                return compile_here(function, signature)
            finally:
                fcntl.flock(lock, fcntl.LOCK_UN)  # by name: a child that was forked meanwhile would keep it

    return compile_alone


class LastFirst(pytest.Dir):
    """A folder whose tests are collected from its end."""

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """Yield what is in the folder."""
        yield from [*super().collect()][::-1]


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Let every other worker begin at the end: of what pytest makes of test files and keeps, each makes half."""
    is_other = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "13579"
    collector: pytest.Collector | None = LastFirst.from_parent(parent, path=path) if is_other else None
    return collector


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with what stands highest in the tree: the more a test runs at once, the longer the others wait for it.

    Slow tests are left out, unless they are asked for.
    """
    items.sort(key=lambda item: (len(item.path.parts), item.path))
    for item in [*find_repeats(item for item in items if not is_slow(item))]:
        item.add_marker("slow")
    config.stash[SLOW_LEFT_OUT] = 0
    if not config.option.slow:
        left_out = [item for item in items if is_slow(item)]
        items[:] = [item for item in items if not is_slow(item)]
        config.stash[SLOW_LEFT_OUT] = len(left_out)
        config.hook.pytest_deselected(items=left_out)


def pytest_collection_finish() -> None:
    """Leave what was imported and collected, a million objects, alone: to go through it takes a twentieth of all.

    And look for garbage every ten thousand objects instead of every 700: hypothesis listens to each look.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)
    gc.enable()


def is_slow(item: pytest.Item) -> bool:
    """Return whether we marked it so: SciPy's tests, which we run in full, have a mark of that name."""
    function = getattr(item, "function", None)
    return item.get_closest_marker("slow") is not None and not getattr(function, "__module__", "").startswith("scipy.")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Let a worker tell how many it has left out; all collect the same."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["slow_left_out"] = session.config.stash.get(SLOW_LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object) -> None:
    """Hear it."""
    config = node.config  # type: ignore[attr-defined]  # of pytest-xdist
    told = getattr(node, "workeroutput", {}).get("slow_left_out", 0)
    config.stash[SLOW_LEFT_OUT] = max(config.stash.get(SLOW_LEFT_OUT, 0), told)


def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> None:
    """Mark the results of slow tests, for the list at the end: it knows results, not tests."""
    if call.when == "setup" and is_slow(item):
        item.user_properties.append(("slow", True))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Say how many slow tests were left out, or which ran, by file, how they ended and how long they took."""
    left_out = config.stash.get(SLOW_LEFT_OUT, 0)
    if left_out:
        terminalreporter.write_line(f"slow tests left out: {left_out} (scripts/test --slow runs them)")
    ends: dict[str, Counter[str]] = {}
    seconds: Counter[str] = Counter()
    for outcome in ("passed", "failed", "error", "skipped", "xfailed"):
        for report in terminalreporter.stats.get(outcome, ()):
            if ("slow", True) in getattr(report, "user_properties", ()):
                file = report.nodeid.split("::")[0]
                ends.setdefault(file, Counter())[outcome] += 1
                seconds[file] += report.duration
    if ends:
        terminalreporter.section("slow tests")
    for file, counts in sorted(ends.items()):
        words = ", ".join(f"{number} {outcome}" for outcome, number in counts.items())
        terminalreporter.write_line(f"{file}: {words}, {seconds[file]:.0f} s")


@pytest.fixture(autouse=True)
def _numpy_errors_raise() -> Iterator[None]:
    """Raise on division by zero, overflow and invalid operations.

    Underflow stays silent: a weight or a kernel that fades to zero is meant to get there.
    """
    with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
        yield


@pytest.fixture(autouse=True)
def _threads_are_given_back() -> Iterator[None]:
    """Set the number of threads that a test, or a command in it, has changed to what it was."""
    before = get_num_threads()
    yield
    if get_num_threads() != before:
        set_num_threads(before)


@pytest.fixture(scope="session")
def real_scan() -> Callable[[str], Path]:
    """Return a function that gives the path of a real scan, or skips the test that asks for it."""

    def find(name: str) -> Path:
        path = REAL_DATA / name
        if not path.is_file():
            pytest.skip(f"the real scan {name} is not in ../shared/data (made by others, kept outside the project)")
        return path

    return find


@pytest.fixture
def small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw with a sixteenth of the pixels, for tests to which a picture is one file among others: each costs light.

    An inset has a quarter of the steps along each side, likewise.
    """
    from o3dleaf.output.view import leaf_picture
    from o3dleaf.output.view.maps import render_residuals
    from o3dleaf.output.view.picture import draw_page, render

    for draw in (render, render_residuals, leaf_picture.render_pieces):
        monkeypatch.setitem(inspect.unwrap(draw).__kwdefaults__, "size", (400, 250))
    monkeypatch.setattr(draw_page, "__defaults__", ((), (400, 250), None))
    monkeypatch.setattr(leaf_picture, "STEPS", leaf_picture.STEPS // 4)


@pytest.fixture(scope="session")
def parsers() -> Callable[..., object]:
    """Make the parser of a command line once: typer makes those of all commands anew for each call of one."""
    from typer.main import get_command

    return cache(get_command)


@pytest.fixture
def run(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, parsers: Callable[..., object]
) -> Callable[..., CompletedProcess[str]]:
    """Return a function that calls the command line, in this process: a process each would import all of it anew.

    What C++ prints is captured too. An exception that the program does not turn into a line leaves it as it is.
    """
    monkeypatch.setattr("typer.main.get_command", parsers)
    from o3dleaf.commands.cli import main

    def call(*arguments: object) -> CompletedProcess[str]:
        words = ["o3dleaf", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", words)
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        code = stop.value.code
        return CompletedProcess(words, 0 if code is None else code, *capfd.readouterr())

    return call
