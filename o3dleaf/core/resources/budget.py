"""The memory and the time that may be used, known by context.

::

    with memory_limit("2GB"), time_limit("10min"):
        ...

The memory that may be used is the least of what the shell (``ulimit``), the container or the scheduler allow, and of
what was stated or, where nothing was, what the machine has available. Time is limited only where it is stated.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from o3dleaf.core.parallel import get_num_threads
from o3dleaf.core.resources import machine
from o3dleaf.core.resources.durations import parse_duration
from o3dleaf.core.resources.machine import Limit
from o3dleaf.core.resources.sizes import parse_size, size_in_words

KEPT = 1 / 128
"""Of the memory that was stated, which the allocator may keep of what each thread freed: one array of dozens, as it
were."""


class _Stated:
    """What was stated for the whole process."""

    limit: int | None = None


_within: ContextVar[int | None] = ContextVar("o3dleaf.memory", default=None)
_seconds: ContextVar[float | None] = ContextVar("o3dleaf.time", default=None)


def set_memory_limit(size: str | int | None) -> None:
    """Set how much memory this process may hold in all, such as "2GB"; None is what the machine has.

    Work that is predicted to need more raises `MemoryBudgetError` before it begins. Limits of the shell, of a
    container or a scheduler hold in any case.

    Raises
    ------
    InputError
        If it is no size.
    """
    _Stated.limit = None if size is None else parse_size(size)
    _hold_allocator()


def get_memory_limit() -> int | None:
    """Return the bytes that were stated, here or for the whole process; None where nothing was."""
    within = _within.get()
    return _Stated.limit if within is None else within


@contextmanager
def memory_limit(size: str | int | None) -> Iterator[None]:
    """Hold what runs inside to so much memory of the process in all, such as "2GB"; None changes nothing.

    Raises
    ------
    InputError
        If it is no size.
    """
    if size is None:
        yield
        return
    token = _within.set(parse_size(size))
    _hold_allocator()
    try:
        yield
    finally:
        _within.reset(token)
        _hold_allocator()


def _hold_allocator() -> None:
    """Hold the allocator, which the whole process shares, to its part of what is stated."""
    stated = get_memory_limit()
    machine.keep_freed(machine.MAX_KEPT if stated is None else KEPT * stated)


def usable_memory() -> Limit | None:
    """Return what may still be used, and who limits it; None where nobody says."""
    stated = get_memory_limit()
    if stated is None:
        soft = machine.available()
    else:
        # What the allocator keeps would count as held, though nothing lies in it.
        machine.release_heap()
        held = machine.resident()
        soft = Limit(
            stated - held,
            f"of the {size_in_words(stated)} that were stated, {size_in_words(held)} being held",
            "state more (--memory) if there is more",
        )
    limits = [*machine.hard_limits(get_num_threads()), *([soft] if soft else [])]
    return min(limits, key=lambda limit: limit.free, default=None)


@contextmanager
def time_limit(duration: str | float | None) -> Iterator[None]:
    """Refuse what runs inside if it is predicted to take longer than a time, such as "10min"; None changes nothing.

    What has begun goes on, however long it takes.

    Raises
    ------
    InputError
        If it is no duration.
    """
    token = _seconds.set(_seconds.get() if duration is None else parse_duration(duration))
    try:
        yield
    finally:
        _seconds.reset(token)


def get_time_limit() -> float | None:
    """Return the seconds that were stated; None where nothing was."""
    return _seconds.get()
