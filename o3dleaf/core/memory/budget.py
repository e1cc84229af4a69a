"""The memory that may be used, known by context, and what needs more refused before the work.

::

    with memory_limit("2GB"):
        ...
        require_memory(80 * count, f"fill_particles: {count:,} particles", "give a larger step")

What may be used is the least of what the shell (``ulimit``), the container or the scheduler allow, and of what was
stated or, where nothing was, what the machine has available. A need is a prediction: measured by
`scripts/measure_memory.py`, and a third more.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from o3dleaf.core.errors import MemoryBudgetError
from o3dleaf.core.memory import machine
from o3dleaf.core.memory.machine import Limit
from o3dleaf.core.memory.sizes import about, parse_size, size_in_words
from o3dleaf.core.parallel import get_num_threads

SAFETY = 1.3
"""Times as much as was measured: other data, other libraries."""
SMALL = 50_000_000
"""Bytes that are never refused, and asked after: whatever runs at all has them."""


MOST, MOST_DIGITS = 1e30, 1e12
"""Bytes beyond which all are alike, and numbers that are not written out."""


class _Stated:
    """What was stated for the whole process."""

    limit: int | None = None


_within: ContextVar[int | None] = ContextVar("o3dleaf.memory", default=None)


@dataclass(frozen=True)
class MemoryNeed:
    """What some work takes at its peak, beyond what is held before.

    Attributes
    ----------
    bytes : int
    what : str
        The work and its size: "reconstruct: 2,000,000 points".
    cure : str
        What would take less.
    step : float, optional
        Whose `power` the need falls with: the message says how large it must be.
    power : int
    """

    bytes: int
    what: str
    cure: str
    step: float | None = None
    power: int = 2

    def __str__(self) -> str:
        return f"{self.what}: {about(self.bytes)}"

    def require(self) -> None:
        """Raise `MemoryBudgetError` if less may be used."""
        if self.bytes <= SMALL:
            return
        room = usable_memory()
        if room is not None and self.bytes > room.free:
            free, cure = size_in_words(max(room.free, 0)), self.cure
            if self.step is not None and room.free > 0 and self.bytes < MOST:
                cure += f", {_rounded_up(self.step * (self.bytes / room.free) ** (1 / self.power)):.2g} or more"
            raise MemoryBudgetError(
                f"{self.what} need {about(self.bytes)} of memory, and {free} more may be used "
                f"{room.name}; {cure}, or {room.cure}"
            )


def require_memory(held: float, what: str, cure: str, *, step: float | None = None, power: int = 2) -> None:
    """Raise `MemoryBudgetError` if some work holds more bytes than may be used.

    Parameters
    ----------
    held : float
        As measured: a third more is asked for.
    what, cure : str
        Of the message: "step: 4,000,000,000 particles" and "give a larger one".
    step, power
        Of `MemoryNeed`.
    """
    need_of(held, what, cure, step=step, power=power).require()


def need_of(held: float, what: str, cure: str, *, step: float | None = None, power: int = 2) -> MemoryNeed:
    """Return the need of work that was measured to hold so many bytes."""
    return MemoryNeed(round(SAFETY * min(held, MOST)), what, cure, step, power)


def in_words(count: float) -> str:
    """Return a number of things as a message has it: 1,200,000, or 1e+36."""
    return f"{count:,.0f}" if count < MOST_DIGITS else f"{count:.2g}"


def _rounded_up(step: float) -> float:
    """Return two digits of a step, not below it."""
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    return math.ceil(step / unit) * unit


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
    token = _within.set(_within.get() if size is None else parse_size(size))
    try:
        yield
    finally:
        _within.reset(token)


def usable_memory() -> Limit | None:
    """Return what may still be used, and who limits it; None where nobody says."""
    stated = get_memory_limit()
    if stated is None:
        soft = machine.available()
    else:
        soft = Limit(stated - machine.resident(), "as stated", "state more (--memory) if there is more")
    limits = [*machine.hard_limits(get_num_threads()), *([soft] if soft else [])]
    return min(limits, key=lambda limit: limit.free, default=None)
