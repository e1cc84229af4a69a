"""An even sample of rows: the same ones at every run, from the first row to the last."""

import numpy as np
import numpy.typing as npt


def even_rows(count: int, size: int) -> npt.NDArray[np.int64]:
    """Return `size` of the numbers below `count`, rising and evenly spread; all of them where there are fewer."""
    return np.unique(np.linspace(0, count - 1, size).round().astype(np.int64))
