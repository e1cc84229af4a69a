"""Finished blocks of a step, kept in the order in which they are made: a run that was stopped goes on after them.

::

    field = kept("fit.o3l", fit)  # whole, and until then what it keeps of blocks
    with keeping_blocks("surface"):
        ...
        (values,) = kept_block(lambda: (field(points),))  # not asked again where a run before did

Steps are repeatable to the bit, so that the n-th block of a run is that of another one of the same key. What is not
inside such a step, or is done by other threads, is made as ever; so is all where nothing is to be resumed.
"""

import io
import struct
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.resume.parts import current_parts

T = TypeVar("T")
Arrays = tuple[npt.NDArray[Any], ...]

SUFFIX = ".blocks"
PIECES = 32
"""Blocks that a loop over many smaller ones is kept in: a thirty-second of its work is lost at most."""
HEAD = struct.Struct("<QI")
"""Before each block: its bytes, and their CRC."""


class BlockFile:
    """The blocks of a step, one after the other in a file; what a killed run left of one is cut off.

    Parameters
    ----------
    path : Path
        There or not.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.thread = path, threading.get_ident()
        self._end = 0
        self._known = path.exists()

    def next(self) -> Arrays | None:
        """Return the next block that was kept, None where there is no more."""
        if not self._known:
            return None
        with self.path.open("r+b") as file:
            file.seek(self._end)
            head = file.read(HEAD.size)
            if len(head) == HEAD.size:
                size, crc = HEAD.unpack(head)
                content = file.read(size) if size <= self.path.stat().st_size else b""
                if len(content) == size and zlib.crc32(content) == crc:
                    self._end += HEAD.size + size
                    return _arrays_in(content)
            file.truncate(self._end)
        self._known = False
        return None

    def append(self, arrays: Sequence[npt.NDArray[Any]]) -> None:
        """Keep a block that is finished."""
        stream = io.BytesIO()
        for array in arrays:
            np.lib.format.write_array(stream, np.asanyarray(array), allow_pickle=False)
        content = stream.getbuffer()
        with self.path.open("ab") as file:
            file.write(HEAD.pack(len(content), zlib.crc32(content)))
            file.write(content)


_step: ContextVar[BlockFile | None] = ContextVar("o3dleaf.blocks", default=None)


@contextmanager
def keeping_blocks(name: str) -> Iterator[BlockFile | None]:
    """Keep the blocks that are finished inside, in the order in which they are, if the work is to be resumed.

    A step may be done several times in a run, but not at once.
    """
    parts, step = current_parts(), None
    if parts is not None:
        step = BlockFile(parts.path(f"{name}-{parts.steps[name]}{SUFFIX}"))
        parts.steps[name] += 1
    token = _step.set(step)
    try:
        yield step
    finally:
        _step.reset(token)


def kept(name: str, make: Callable[[], T]) -> T:
    """Return what a run before made under this name, or make it, and ``save`` it if the work is to be resumed.

    While it is made its blocks are kept.
    """
    parts = current_parts()
    if parts is None:
        return make()
    path = parts.path(name)
    if path.exists():
        return cast(T, parts.load(path))
    with keeping_blocks(path.stem) as step:
        made: Any = make()
    made.save(path)
    if step is not None:
        step.path.unlink(missing_ok=True)
    return cast(T, made)


def kept_block(make: Callable[[], Arrays]) -> Arrays:
    """Return the arrays of the next block of the step that is running, kept before or made now."""
    step = _current()
    known = None if step is None else step.next()
    if known is not None:
        return known
    made = make()
    if step is not None:
        step.append(made)
    return made


def run_kept_blocks(
    task: Callable[[int, int], Any],
    count: int,
    size: int,
    written: Callable[[int, int], Sequence[npt.NDArray[Any]]],
) -> None:
    """Do what `run_blocks` does, tell how far it is, and keep what was written, a part of the blocks at a time.

    Parameters
    ----------
    task, count, size
        As of `run_blocks`.
    written : callable
        ``written(start, stop)`` returns the views of the arrays that the task writes for these items.
    """
    if _current() is None:
        run_blocks(task, count, size, reports=True)
        return
    pieces = list(blocks(count, size * max(1, -(-count // (size * PIECES)))))
    shares = progress.split(*(stop - start for start, stop in pieces))
    for (start, stop), part in zip(pieces, shares, strict=True):
        views = written(start, stop)

        def make(start: int = start, stop: int = stop, views: Sequence[npt.NDArray[Any]] = views) -> Arrays:
            run_blocks(lambda i, j: task(start + i, start + j), stop - start, size, reports=True)
            return tuple(views)

        with part:
            for view, array in zip(views, kept_block(make), strict=True):
                if view is not array:
                    np.copyto(view, array)


def _current() -> BlockFile | None:
    """Return the file of the step that is running, None on other threads than its own."""
    step = _step.get()
    return step if step is not None and step.thread == threading.get_ident() else None


def _arrays_in(content: bytes) -> Arrays:
    """Return the arrays that lie one after the other in some bytes."""
    stream, arrays = io.BytesIO(content), []
    while stream.tell() < len(content):
        arrays.append(np.lib.format.read_array(stream, allow_pickle=False))
    return tuple(arrays)
