"""What the benchmarks share: one row of a table, how it is measured, how it is printed and written."""

import json
import mmap
import os
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from o3dleaf.core.atomic_files import whole_file

PAGE_MB = mmap.PAGESIZE / 2**20


@dataclass
class Row:
    """One operation: seconds of ours, of the paper's machine, of the literal baseline, of another package.

    `ratio` is the baseline's or the peer's seconds over ours; errors are root mean squares against the noise-free
    truth; `peak_mb` is what ours needed beyond what was there before. None: does not exist or was not run.
    """

    operation: str
    scale: str
    seconds: float
    paper_seconds: float | None = None
    baseline_seconds: float | None = None
    peer: str | None = None
    peer_seconds: float | None = None
    ratio: float | None = None
    rms_error: float | None = None
    peak_mb: float | None = None
    other_rms_error: float | None = None
    extrapolated_from: str | None = None

    def __post_init__(self):
        other = self.peer_seconds if self.peer else self.baseline_seconds
        if self.ratio is None and other is not None:
            self.ratio = other / self.seconds


def measure(call, repeats=1):
    """Return (result, least seconds of `repeats`, most megabytes beyond those of before)."""
    before = most = resident()
    done = threading.Event()

    def watch():
        nonlocal most
        while not done.wait(0.01):
            most = max(most, resident())

    watcher = threading.Thread(target=watch)
    watcher.start()
    best = float("inf")
    try:
        for _ in range(repeats):
            start = time.perf_counter()
            result = call()
            best = min(best, time.perf_counter() - start)
    finally:
        done.set()
        watcher.join()
    return result, best, max(most, resident()) - before


def resident():
    """Return the resident megabytes of this process, 0 where the system does not say."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_MB
    except OSError:
        return 0.0


def show(title, rows, other):
    """Print the rows; `other` names what ours is compared with. An extrapolated time carries an asterisk."""
    table = Table(title=title)
    for name in (
        "operation",
        "scale",
        "paper [s]",
        f"{other} [s]",
        "ours [s]",
        "ratio",
        "rms error",
        "its error",
        "MB",
    ):
        table.add_column(name, justify="left" if name in ("operation", "scale") else "right")
    for row in rows:
        theirs = row.peer_seconds if row.peer else row.baseline_seconds
        mark = "*" if row.extrapolated_from else ""
        table.add_row(
            row.operation if not row.peer else f"{row.operation} | {row.peer}",
            row.scale,
            number(row.paper_seconds),
            number(theirs) + mark,
            number(row.seconds),
            number(row.ratio),
            number(row.rms_error),
            number(row.other_rms_error),
            number(row.peak_mb, "{:.0f}"),
        )
    console = Console(width=180 if not os.isatty(1) else None)
    console.print(table)
    for row in rows:
        if row.extrapolated_from:
            console.print(f"* {row.operation}: extrapolated from {row.extrapolated_from}")


def number(value, form="{:.3g}"):
    return "-" if value is None else form.format(value)


def write_json(path, rows):
    """Write the rows as one JSON list, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
