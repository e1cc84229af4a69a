"""Progress on the terminal while a command runs: a bar for each stage, and a line now and then."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from o3dleaf.core.journal import Journal
from o3dleaf.core.progress import Listener


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


@contextmanager
def shown(*, quiet: bool) -> Iterator[None]:
    """Open a journal for what is done inside, shown on the terminal unless `quiet`."""
    if quiet:
        with Journal():
            yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as bars:
        try:
            with BarJournal(bars):
                yield
        except BaseException:
            # Of a run that failed, the one line that says why is what should be left to read.
            bars.live.transient = True
            raise
