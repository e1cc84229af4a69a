"""The journal of a long job: which stage runs, how far it is, and how long each one took.

A job writes ``with stage("fit"): ...`` and ``note("...")`` into the open journal (``with journal: ...``), if any, and
``tell("...", Warning)`` there or, without one, as a warning.
"""

import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar, Token
from typing import Self

from o3dleaf.core.progress import Listener, listening, report, silent

PACKAGE = __name__.partition(".")[0]


def _unheard(done: int, total: int) -> None:
    """Show nothing."""


class Journal:
    """Times the stages of a job; a subclass may show them as they run.

    Attributes
    ----------
    seconds : dict of str to float
        Wall time of each finished stage, in the order in which they ended.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._tokens: list[Token[Journal | None]] = []

    def __enter__(self) -> Self:
        self._tokens.append(_open.set(self))
        return self

    def __exit__(self, *_: object) -> None:
        _open.reset(self._tokens.pop())

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[int, int], None]]:
        """Run a stage: ``with journal.stage("fit"): ...``; the time is kept even if it fails.

        What is reported inside (`o3dleaf.core.progress`) reaches `show` as shares of the stage, and never goes back.
        """
        start = time.perf_counter()
        try:
            with self.show(name) as listener, listening(listener):
                yield report
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def note(self, text: str) -> None:
        """Say something between two stages; here, nothing. A subclass overrides it."""
        del text

    @contextmanager
    def show(self, name: str) -> Iterator[Listener]:
        """Show one stage while it runs; here, nothing. A subclass overrides it."""
        del name
        yield _unheard


_open: ContextVar[Journal | None] = ContextVar("o3dleaf.journal", default=None)


def open_journal() -> Journal | None:
    """Return the journal that is open, if any."""
    return _open.get()


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Run a stage of the journal that is open; without one, unreported: nobody knows its share of the whole."""
    journal = _open.get()
    if journal is None:
        with silent():
            yield
        return
    with journal.stage(name):
        yield


def note(text: str) -> None:
    """Say something in the journal that is open; without one, to nobody."""
    journal = _open.get()
    if journal is not None:
        journal.note(text)


def tell(text: str, category: type[Warning]) -> None:
    """Say something in the journal that is open; without one, warn of it."""
    note(text) if _open.get() is not None else warn(text, category)


def warn(text: str, category: type[Warning]) -> None:
    """Warn at the line that called the package, however deep in it this is said."""
    level, frame = 1, sys._getframe()  # noqa: SLF001 - the one way to the caller; `skip_file_prefixes` is Python 3.12's
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == PACKAGE:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)
