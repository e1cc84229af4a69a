"""Tasks on the workers of a Dask cluster: one of this machine, or one that runs elsewhere.

A task belongs to a function of a module and arguments that can be pickled; it is done again elsewhere when the process
that did it is lost. Results come as they are ready.
"""

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, TypeVar

from o3dleaf.core import journal
from o3dleaf.core.errors import InputError, O3DLeafError

T = TypeVar("T")
R = TypeVar("R")

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

    def map(self, task: Callable[[T], R], arguments: Sequence[T]) -> Iterator[tuple[int, R | O3DLeafError]]:
        """Yield the number of each argument and what the task returned of it, as they are ready.

        A task that is lost with its worker goes to another one; after the third an error stands in its place.
        """
        distributed = import_module("distributed")
        futures = [self._client.submit(task, each, pure=False) for each in arguments]
        places = {future.key: number for number, future in enumerate(futures)}
        for future in distributed.as_completed(futures, loop=self._client.loop):
            lost = future.exception()
            if isinstance(lost, distributed.KilledWorker):
                yield (
                    places[future.key],
                    O3DLeafError("its worker died three times, for want of memory perhaps; give fewer workers"),
                )
                continue
            yield places[future.key], future.result()


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
        dashboard_address=":0",
        silence_logs=logging.CRITICAL,
    )
    with local, distributed.Client(local, set_as_default=False) as client:
        journal.note(f"dashboard at {client.dashboard_link}")
        yield Cluster(client)
