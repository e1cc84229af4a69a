"""Queries of k-d trees, on as many threads as they are worth."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.parallel import get_num_threads

WORTH = 1 << 10
"""Neighbors that a thread must find to be worth its start: SciPy starts threads anew for each query, which takes half a
millisecond, and finds a neighbor in half a microsecond."""


def query(
    tree: cKDTree, places: npt.ArrayLike, k: int | Sequence[int] | npt.NDArray[np.int64] = 1, **options: Any
) -> Any:
    """Return what ``tree.query(places, k, **options)`` does, the same on any number of threads."""
    neighbors = len(np.asarray(places)) * (int(k) if isinstance(k, int | np.integer) else len(k))
    return tree.query(places, k, workers=threads_for(neighbors), **options)


def threads_for(neighbors: int) -> int:
    """Return how many threads the search for so many neighbors is worth, of those that compiled loops run on."""
    return max(1, min(get_num_threads(), neighbors // WORTH))
