"""Progress by context: work reports to the part that is running, and listeners are notified.

::

    covering, fitting = progress.split(1, 3)  # about how long each takes
    with covering:
        cover = ...
    with fitting:
        run_blocks(task, count, size, reports=True)

Nothing is passed down, and without a listener nothing is done. Worker threads report nothing: `run_blocks` does it
for them, from the thread that called it.
"""

import itertools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from contextvars import ContextVar, Token

Listener = Callable[[int, int], None]
"""Called as ``listener(done, total)`` from the thread that works, never with less than before."""

WHOLE = 100_000
"""What work is reported in: finer than any bar."""


class Part:
    """A share of the work that is running: inside ``with part:`` all reports are of it; at the end it is done."""

    def __init__(self, parent: "Part | None", start: float, share: float) -> None:
        self.parent, self.start, self.share = parent, start, share
        self._token: Token[Part | None] | None = None

    def __enter__(self) -> None:
        self._token = _running.set(self)

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._token is not None:
            _running.reset(self._token)
        if kind is None:
            self.advance(1.0)

    def advance(self, done: float) -> None:
        """Report the share of this part that is done, from 0 to 1."""
        if self.parent:
            self.parent.advance(self.start + self.share * done)


class _Whole(Part):
    """The whole work that a listener is notified of."""

    def __init__(self, listener: Listener) -> None:
        super().__init__(None, 0.0, 1.0)
        self.listener, self.reported = listener, -1

    def advance(self, done: float) -> None:
        now = round(WHOLE * done)
        if now > self.reported:
            self.reported = now
            self.listener(now, WHOLE)


_running: ContextVar[Part | None] = ContextVar("o3dleaf.progress", default=None)


def split(*shares: float) -> tuple[AbstractContextManager[None], ...]:
    """Return a part for each of the steps that the running part consists of, to be entered one after another.

    What a step leaves unreported counts as done at its end.

    Parameters
    ----------
    *shares : float
        About how long each step takes, in any unit; 0 where it takes next to nothing.
    """
    running = _running.get()
    if running is None:
        return tuple(nullcontext() for _ in shares)
    whole = sum(shares) or 1.0
    ends = itertools.accumulate(shares)
    return tuple(Part(running, (end - share) / whole, share / whole) for share, end in zip(shares, ends, strict=True))


def report(done: int, total: int) -> None:
    """Report that `done` of `total` is done of the part that is running."""
    running = _running.get()
    if running:
        running.advance(done / total if total else 1.0)


def is_heard() -> bool:
    """Return whether somebody listens to what this thread does."""
    return _running.get() is not None


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Report all that is done inside to a listener.

    Parameters
    ----------
    listener : callable
        ``listener(done, total)``, called from the thread that works, never with less than before.
    """
    with _Whole(listener):
        yield


@contextmanager
def silent() -> Iterator[None]:
    """Report nothing of what is done inside, such as steps whose number nobody knows."""
    token = _running.set(None)
    try:
        yield
    finally:
        _running.reset(token)
