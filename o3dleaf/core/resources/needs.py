"""What some work will take of memory and time, predicted, and refused before it begins if there is less.

::

    require_resources(80 * count, f"fill_particles: {count:,} particles", "give a larger step")

A need is a prediction: measured by `scripts/measure_costs.py`, and a third more. Time is that of the machine on which
it was measured; others are up to a few times faster or slower.
"""

import math
from dataclasses import dataclass

from o3dleaf.core.errors import MemoryBudgetError, TimeBudgetError
from o3dleaf.core.parallel import get_num_threads
from o3dleaf.core.resources.budget import get_memory_limit, get_time_limit, usable_memory
from o3dleaf.core.resources.durations import duration_in_words
from o3dleaf.core.resources.measured import Cost
from o3dleaf.core.resources.sizes import about, size_in_words

SAFETY = 1.3
"""Times as much as was measured: other data, other libraries."""
SMALL = 50_000_000
"""Bytes that are not asked after where no memory was stated: whatever runs at all has them."""
MAX_TOLD, MAX_DIGITS = 1e30, 1e12
"""Bytes and seconds beyond which all are alike, and numbers that are not written out."""


@dataclass(frozen=True)
class Need:
    """What some work takes at its peak, beyond what is held before, and how long.

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
    seconds : float
        Of processor time, shared by all threads; 0 where it is not known.
    """

    bytes: int
    what: str
    cure: str
    step: float | None = None
    power: int = 2
    seconds: float = 0.0

    @property
    def elapsed(self) -> float:
        """Seconds that it lasts on the threads there are."""
        return self.seconds / get_num_threads()

    def __str__(self) -> str:
        memory = f"{self.what}: {about(self.bytes)}"
        return f"{memory}, about {duration_in_words(self.elapsed)}" if self.seconds else memory

    def require(self) -> None:
        """Raise `MemoryBudgetError` or `TimeBudgetError` if less may be used."""
        room = None if self.bytes <= SMALL and get_memory_limit() is None else usable_memory()
        if room is not None and self.bytes > room.free:
            raise MemoryBudgetError(
                f"{self.what} need {about(self.bytes)} of memory, and {size_in_words(max(room.free, 0))} more may be "
                f"used {room.name}; {self._cure(self.bytes, room.free)}, or {room.cure}"
            )
        allowed = get_time_limit()
        if allowed is not None and self.elapsed > allowed:
            raise TimeBudgetError(
                f"{self.what} take about {duration_in_words(self.elapsed)}, and {duration_in_words(allowed)} are "
                f"allowed; {self._cure(self.elapsed, allowed)}, or allow more (--time)"
            )

    def _cure(self, needed: float, free: float) -> str:
        """Return what would take less, and the step that takes no more than there is."""
        if self.step is None or free <= 0 or needed >= MAX_TOLD:
            return self.cure
        return f"{self.cure}, {_rounded_up(self.step * (needed / free) ** (1 / self.power)):.2g} or more"


def require_resources(cost: float | Cost, what: str, cure: str, *, step: float | None = None, power: int = 2) -> None:
    """Raise `MemoryBudgetError` or `TimeBudgetError` if some work takes more than may be used.

    Parameters
    ----------
    cost : float or Cost
        Bytes, or bytes and seconds, as measured: a third more is asked for.
    what, cure : str
        Of the message: "step: 4,000,000,000 particles" and "give a larger one".
    step, power
        Of `Need`.
    """
    need_of(cost, what, cure, step=step, power=power).require()


def need_of(cost: float | Cost, what: str, cure: str, *, step: float | None = None, power: int = 2) -> Need:
    """Return the need of work that was measured to hold so many bytes, or to cost so much."""
    cost = cost if isinstance(cost, Cost) else Cost(cost)
    seconds = SAFETY * min(cost.seconds, MAX_TOLD)
    return Need(round(SAFETY * min(cost.bytes, MAX_TOLD)), what, cure, step, power, seconds)


def in_words(count: float) -> str:
    """Return a number of things as a message has it: 1,200,000, or 1e+36."""
    return f"{count:,.0f}" if count < MAX_DIGITS else f"{count:.2g}"


def _rounded_up(step: float) -> float:
    """Return two digits of a step, not below it."""
    unit = 10.0 ** (math.floor(math.log10(step)) - 1)
    return math.ceil(step / unit) * unit
