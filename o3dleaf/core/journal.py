"""The journal of a long job: which stage runs, how far it is, and how long each one took."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from o3dleaf.core.parallel import Progress, share_out


def _silent(done: int, total: int) -> None:
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

    @contextmanager
    def stage(self, name: str) -> Iterator[Progress]:
        """Run a stage: ``with journal.stage("fit") as progress: ...``; the time is kept even if it fails.

        What is told to `progress` reaches `show` as shares of the stage, and never goes back.
        """
        start = time.perf_counter()
        try:
            with self.show(name) as progress:
                (told,) = share_out(progress, 1)
                yield told or _silent
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start

    def note(self, text: str) -> None:
        """Say something between two stages; here, nothing. A subclass overrides it."""
        del text

    @contextmanager
    def show(self, name: str) -> Iterator[Progress]:
        """Show one stage while it runs; here, nothing. A subclass overrides it."""
        del name
        yield _silent
