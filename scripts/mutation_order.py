"""A plugin of pytest for mutate.py: the order of the tests, the processor time that each may take, and what each took.

What is near to a mutant and cheap comes first: each step away from it counts as twice the time. A test that takes far
longer than without a mutant ends the process by SIGXCPU; compiling is not counted, up to a limit of its own.
"""

import json
import os
import resource
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba.core import event

PATIENCE = 3.0
"""Times that a test may take of the processor time that it takes without a mutant."""
BEGINNING = 20.0
"""Seconds of processor time that every test has besides: the first ones import and load."""
COLLECTING = 100.0
"""Seconds of processor time for importing and collecting all tests."""
LONGEST = 600.0
"""Seconds of processor time that a test may take of which nothing is known."""
COMPILING = 240.0
"""Seconds of processor time that compiling one function may take."""


class Order(event.Listener):
    """The tests in order, under limits, with their times; and what compiles meanwhile."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        given = json.loads((folder / "given.json").read_text())
        self.steps: dict[str, int] = given["steps"]
        self.known: dict[str, float] = given["seconds"]
        self.seconds: dict[str, float] = {}
        self.compiled: list[str] = []
        self.failed = ""
        self.depth, self.started, self.end = 0, 0.0, COLLECTING
        self.allow(self.end)

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Sort them; tests that share what a module's fixture makes stay together."""
        cost: Counter[str] = Counter()
        for item in items:
            cost[group(item)] += self.known.get(item.nodeid, 0.1) * 2.0 ** self.steps[item.nodeid.partition("::")[0]]
        items.sort(key=lambda item: (cost[group(item)], group(item)))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Give a test its time, and note what it took."""
        before = time.process_time()
        self.end = before + BEGINNING + PATIENCE * self.known.get(item.nodeid, LONGEST)
        self.allow(self.end)
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = round(time.process_time() - before, 3)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note which one failed."""
        if report.failed:
            self.failed = report.nodeid

    def pytest_sessionfinish(self) -> None:
        """Write it all."""
        self.allow(time.process_time() + LONGEST)
        told = {"seconds": self.seconds, "failed": self.failed, "compiled": self.compiled}
        (self.folder / "told.json").write_text(json.dumps(told))

    def allow(self, end: float) -> None:
        """Let the process end at some processor time."""
        resource.setrlimit(resource.RLIMIT_CPU, (int(end) + 1, resource.RLIM_INFINITY))

    def on_start(self, event: event.Event) -> None:
        """Stop the clock while something is compiled, and what it calls."""
        if not self.depth:
            self.started = time.process_time()
            self.allow(self.started + COMPILING)
        self.depth += 1
        self.compiled.append(event.data["dispatcher"].py_func.__qualname__)

    def on_end(self, event: event.Event) -> None:  # noqa: ARG002 - as Numba calls it
        """Let it go on."""
        self.depth -= 1
        if not self.depth:
            self.end += time.process_time() - self.started
            self.allow(self.end)


def group(item: pytest.Item) -> str:
    """Return the file of a test that shares a fixture with others of it, or the test itself."""
    fixtures = item._fixtureinfo.name2fixturedefs.values()  # noqa: SLF001 - pytest has no other
    shares = any(each[-1].scope in {"module", "class"} for each in fixtures)
    return item.nodeid.partition("::")[0] if shares else item.nodeid


def pytest_configure(config: pytest.Config) -> None:
    """Begin."""
    order = Order(Path(os.environ["MUTATION_FOLDER"]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    config.pluginmanager.register(order)
    event.register("numba:compile", order)
