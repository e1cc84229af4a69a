"""Blocks of one job on the workers of a cluster, known by context.

::

    with spreading(cluster) as spread:
        spread.know(volume.data, reader)  # how a worker comes by it
        ...
        for arrays in each_block(function, arguments):  # there, or here where nothing is spread
            ...

A block belongs to a function of a module, or an object that can be pickled, and to an argument. What is large is not
sent: workers read it from where `Spread.know` says it lies.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from typing import Any, TypeVar

import numpy as np

from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.core.processes.cluster import Cluster, cluster_of, share_of
from o3dleaf.core.resume.blocks import Arrays, kept_block

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True, eq=False)
class Spread:
    """Workers, and how they come by what is not sent to them.

    Attributes
    ----------
    cluster : Cluster
    threads : int or None
        Of each worker; None to leave theirs as they are.
    known : list of (object, stand-in)
        What was told to `know`.
    """

    cluster: Cluster
    threads: int | None = None
    known: list[tuple[Any, Any]] = field(default_factory=list)

    def know(self, thing: Any, stand_in: Any) -> None:
        """Send the stand-in, which can be pickled, where a worker needs a thing."""
        self.known.append((thing, stand_in))

    def stand_in(self, thing: Any) -> Any:
        """Return what is sent in place of a thing, None where nobody said."""
        return next((other for one, other in self.known if _is_same(one, thing)), None)

    def each(self, function: Callable[[T], R], arguments: Iterable[T]) -> Iterator[tuple[int, R]]:
        """Yield the number of each argument and what the function returned of it there, as they are ready.

        Raises
        ------
        O3DLeafError
            If a block was lost with its worker three times.
        """
        for number, result in self.cluster.map(partial(_on_threads, self.threads, function), arguments):
            if isinstance(result, O3DLeafError):
                raise result
            yield number, result


_spread: ContextVar[Spread | None] = ContextVar("o3dleaf.spread", default=None)


def current_spread() -> Spread | None:
    """Return the workers that blocks go to, None where they are done here."""
    return _spread.get()


@contextmanager
def spreading(workers: int | None, scheduler: str | None) -> Iterator[Spread]:
    """Let the blocks of what is done inside go to the workers of `cluster_of`, which share the threads of this machine.

    Parameters
    ----------
    workers, scheduler
        As of `cluster_of`.
    """
    with cluster_of(workers, scheduler) as cluster:
        spread = Spread(cluster, share_of(workers))
        token = _spread.set(spread)
        try:
            yield spread
        finally:
            _spread.reset(token)


def each_block(function: Callable[[T], Arrays], arguments: Iterable[T]) -> Iterator[Arrays]:
    """Yield what a function returns of each argument, in their order: kept before, made here, or made by workers."""
    spread = current_spread()
    if spread is None:
        for each in arguments:
            yield kept_block(partial(function, each))
        return
    waiting, number = dict[int, Arrays](), 0
    for place, result in spread.each(function, arguments):
        waiting[place] = result
        while number in waiting:
            yield waiting.pop(number)
            number += 1


def _on_threads(threads: int | None, function: Callable[[T], R], argument: T) -> R:
    """Return what a function returns in a worker."""
    if threads is not None and threads != get_num_threads():
        set_num_threads(threads)
    return function(argument)


def _is_same(one: Any, other: Any) -> bool:
    """Return whether two are one object, or arrays of the same numbers in memory."""
    if not isinstance(one, np.ndarray) or not isinstance(other, np.ndarray):
        return one is other
    places = [(each.ctypes.data, each.shape, each.strides, each.dtype) for each in (one, other)]
    return places[0] == places[1]
