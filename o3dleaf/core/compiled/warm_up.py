"""Compiling before the first job: all that the main jobs or the tests need, on all cores, in processes of their own."""

import gc
import multiprocessing
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path

from o3dleaf.core import progress

MAX_PROCESSES = 61
"""Processes that one can wait for on Windows."""


def warm_up(folder: Path | None = None, workers: int | None = None, jobs: str = "all") -> int:
    """Compile the listed functions that are not on disk yet, and return how many there were to compile.

    Parameters
    ----------
    folder : path, optional
        Where to; by default code is kept where Numba keeps it.
    workers : int, optional
        Processes; by default one a core, but no more than `MAX_PROCESSES`.
    jobs : {"all", "demo", "tests"}
        Whose functions: of all main jobs, as a package brings them, of the demo, or of the tests, too.
    """
    from o3dleaf.core.compiled.signatures import listed

    compiled, lines = 0, listed(jobs)
    # Functions of one module share most of what they call: one process compiles that once.
    groups = [list(group) for _, group in groupby(sorted(lines), _module)]
    with _processes(folder, workers) as pool:
        tasks = [pool.submit(_compile, group) for group in sorted(groups, key=len, reverse=True)]
        done = 0
        for task in as_completed(tasks):
            lines_there, new = task.result()
            done, compiled = done + lines_there, compiled + new
            progress.report(done, len(lines))
    return compiled


@contextmanager
def _processes(folder: Path | None, workers: int | None) -> Iterator[ProcessPoolExecutor]:
    context = multiprocessing.get_context("spawn")
    count = workers or min(os.cpu_count() or 1, MAX_PROCESSES)
    with ProcessPoolExecutor(count, context, initializer=_start, initargs=(folder,)) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _module(line: str) -> str:
    return line.partition(" ")[0].rpartition(".")[0]


def _start(folder: Path | None) -> None:
    """Set up a child process: code goes into `folder`, if that is given."""
    gc.set_threshold(100_000, 50, 50)  # a compiler makes many objects that live: an eighth of the time
    if folder is not None:
        from o3dleaf.core.compiled import code_cache

        code_cache.keep_in(folder)


def _compile(lines: list[str]) -> tuple[int, int]:
    """Compile or load the functions of some lines; return how many there are, and how many were not on disk."""
    from o3dleaf.core.compiled.signatures import read

    compiled = 0
    for line in lines:
        function, signature = read(line)
        function.compile(signature)
        compiled += function.stats.cache_misses[signature]
    return len(lines), compiled


def _ship(folder: Path) -> None:
    """Fill a folder that a package brings: what Python calls, and what it was made for."""
    from o3dleaf.core.compiled.code_cache import MADE_FOR, made_for
    from o3dleaf.core.compiled.numba_target import LevelDispatcher

    warm_up(folder)
    for path in folder.glob("*.callee"):
        path.unlink()
    generator = LevelDispatcher.targetdescr.target_context.codegen()
    (folder / MADE_FOR).write_text(made_for(generator), encoding="utf-8")


if __name__ == "__main__":
    _ship(Path(sys.argv[1]))
