"""Tasks on the workers of a Dask cluster: one of this machine, or one that runs elsewhere.

A task belongs to a function of a module and arguments that can be pickled; it is done again elsewhere when the process
that did it is lost. Results come as they are ready.
"""

import logging
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

from o3dleaf.core import journal
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.parallel import get_num_threads

T = TypeVar("T")
R = TypeVar("R")

AHEAD, MIN_AHEAD = 3, 16
"""Tasks on their way at once for each thread of the workers, and the least of all, as workers may yet come."""
EXTRA = "cluster"
SECONDS = "20s"
"""That a scheduler has to answer."""


class Cluster:
    """Workers that a Dask client knows; made by `cluster_of`."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def processes(self) -> list[int]:
        """Return the numbers of the workers' processes, each on its own machine."""
        return list(self._client.run(os.getpid).values())

    def map(self, task: Callable[[T], R], arguments: Iterable[T]) -> Iterator[tuple[int, R | O3DLeafError]]:
        """Yield the number of each argument and what the task returned of it, as they are ready.

        A task that is lost with its worker goes to another one; after the third an error stands in its place. A few
        tasks for each worker are on their way at once, so that neither arguments nor results pile up.
        """
        distributed = import_module("distributed")
        todo, places = iter(enumerate(arguments)), dict[str, int]()

        def submitted(count: int) -> list[Any]:
            futures = []
            for number, each in islice(todo, count):
                futures.append(self._client.submit(task, each, pure=False))
                places[futures[-1].key] = number
            return futures

        ahead = max(MIN_AHEAD, AHEAD * sum(self._client.nthreads().values()))
        ready = distributed.as_completed(submitted(ahead), loop=self._client.loop)
        for future in ready:
            lost = future.exception()
            if isinstance(lost, distributed.KilledWorker):
                result: R | O3DLeafError = O3DLeafError(
                    "its worker died three times, for want of memory perhaps; give fewer workers"
                )
            else:
                result = future.result()
            ready.update(submitted(1))
            yield places.pop(future.key), result


def share_of(workers: int | None) -> int | None:
    """Return the threads of each of so many workers on this machine; None of workers elsewhere, which have theirs."""
    return None if workers is None else max(1, get_num_threads() // workers)


@contextmanager
def cluster_of(workers: int | None = None, scheduler: str | None = None) -> Iterator[Cluster]:
    """Give the workers of a scheduler, or a number of processes on this machine, which end with the context.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine; one a core by default. They are restarted when they die.
    scheduler : str, optional
        Address, such as tcp://10.0.0.1:8786.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers there.
    """
    try:
        distributed = import_module("distributed")
    except ImportError as cause:
        raise InputError(f"workers, scheduler: need distributed; run: pip install 'o3dleaf[{EXTRA}]'") from cause
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=SECONDS, set_as_default=False)
        except (OSError, ValueError) as cause:
            raise InputError(f"scheduler: nothing answers at {scheduler} ({cause}); start `dask scheduler`") from cause
        with client:
            journal.note(f"{len(client.scheduler_info()['workers'])} workers, dashboard at {client.dashboard_link}")
            yield Cluster(client)
        return
    local = distributed.LocalCluster(
        n_workers=workers or os.cpu_count() or 1,
        threads_per_worker=1,
        dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
    )
    with local, distributed.Client(local, set_as_default=False) as client:
        journal.note(f"dashboard at {client.dashboard_link}")
        try:
            yield Cluster(client)
        except KeyboardInterrupt:
            _kill(local.workers.values())
            raise


def _kill(nannies: Iterable[Any]) -> None:
    """End worker processes at once: Dask would wait some seconds for what they are doing, and then kill them."""
    logging.getLogger("distributed.batched").setLevel(logging.CRITICAL)  # of connections that break off
    for nanny in nannies:
        nanny.auto_restart = False
        os.kill(nanny.pid, getattr(signal, "SIGKILL", signal.SIGTERM))
