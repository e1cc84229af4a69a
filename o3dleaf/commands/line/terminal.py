"""Progress on the terminal while a command runs: a bar for each stage, and a line now and then."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.journal import Journal, stage
from o3dleaf.core.progress import Listener

LOOKS = 3
"""Looks at the bars in a second: Rich's ten take a twelfth of a core, under Python's lock."""


class BarJournal(Journal):
    """A journal that draws a progress bar for the stage that runs."""

    def __init__(self, bars: Any) -> None:
        super().__init__()
        self.bars = bars

    def note(self, text: str) -> None:
        """Print a line above the bars."""
        self.bars.console.print(text, highlight=False)

    @contextmanager
    def show(self, name: str) -> Iterator[Listener]:
        """Show one bar, filled when the stage ends."""
        task = self.bars.add_task(name, total=None)

        def listener(done: int, total: int) -> None:
            self.bars.update(task, completed=done, total=total)

        yield listener
        self.bars.update(task, total=1, completed=1)


@checked
@contextmanager
def show_progress(title: str | None = None, *, quiet: bool = False) -> Iterator[None]:
    """Show a progress bar on the terminal (stderr) for each stage of what is done inside, and what is noted there.

    ::

        with o3l.show_progress():
            mesh, field = o3l.create_from_point_cloud_rbfpu(pcd)
        with o3l.show_progress("fit"):
            field = o3l.PUInterpolant.fit(points, values)

    Parameters
    ----------
    title : str, optional
        Name of one bar for all of it, for a function that has no stages of its own.
    quiet : bool
        Show nothing: decisions about a cloud are then no warnings either.
    """
    if quiet:
        with Journal():
            yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), refresh_per_second=LOOKS) as bars:
        try:
            with BarJournal(bars), stage(title) if title else nullcontext():
                yield
        except BaseException:
            # Of a run that failed, the one line that says why is what should be left to read.
            bars.live.transient = True
            raise
