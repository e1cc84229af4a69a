"""Numbers that lie in a temporary file, mapped, where memory would hold too little beside them."""

import math
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.budget import usable_memory
from o3dleaf.core.resources.machine import release_pages

SHARE = 0.25
"""Of the memory that may be used, which one large array may take: voxels, coefficients."""
EACH = SHARE / 32
"""The same of an array of which there are dozens: one number a ball, a column, an edge."""
ALWAYS = 1 << 20
"""Bytes that lie in memory, whatever may be used."""
PART = 1 << 26
"""Bytes that are copied at once, about."""
ROWS = 1 << 15
"""Rows that are made at once: what making them takes does not grow with the array."""


def is_held(size: float, share: float = SHARE) -> bool:
    """Return whether so many bytes lie in memory, and not in a file: if they take no more than a share of it."""
    room = None if size <= ALWAYS else usable_memory()
    return room is None or size <= share * room.free


def scratch_array(
    shape: tuple[int, ...], dtype: npt.DTypeLike = np.float64, *, share: float = EACH
) -> npt.NDArray[Any]:
    """Return an array to be filled: in memory, or in a file of the temporary folder, which goes with it.

    Raises
    ------
    O3DLeafError
        If it is to lie in a file, and the disk has no room.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if is_held(size, share):
        return np.empty(shape, dtype)
    with placing_on_disk(size), tempfile.TemporaryFile(prefix="o3dleaf-") as file:
        claim(file, size)
        file.truncate(size)
        return np.asarray(np.memmap(file, dtype=dtype, mode="r+", shape=shape))


def made_by_rows(
    shape: tuple[int, ...], make: Callable[[int, int], npt.NDArray[Any]], dtype: npt.DTypeLike = np.float64
) -> npt.NDArray[Any]:
    """Return a scratch array, ``make(start, stop)`` being its rows from start to stop."""
    array = scratch_array(shape, dtype)
    for start in range(0, len(array), ROWS):
        stop = min(start + ROWS, len(array))
        array[start:stop] = make(start, stop)
    return array


def offsets_of(counts: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return where the parts of so many rows each (n,) begin, and where the last one ends: a scratch array (n + 1,)."""
    offsets = scratch_array((len(counts) + 1,), np.int64)
    offsets[0] = 0
    np.cumsum(counts, out=offsets[1:])
    return offsets


def order_of(keys: npt.NDArray[np.integer[Any]], rows: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return rows (n,) in the order of their keys, small numbers from 0 on, those of one key as they come.

    They are counted and put in place some at a time, so that no copy of them is held.
    """
    kinds, order = int(keys.max(initial=-1)) + 1, scratch_array(rows.shape, np.int64)
    counts = [np.bincount(keys[start:stop], minlength=kinds) for start, stop in blocks(len(keys), ROWS)]
    heads = np.cumsum(total := np.sum(counts, axis=0, dtype=np.int64)) - total
    for start, stop in blocks(len(rows), ROWS):
        some = rows[start:stop]
        within = np.argsort(keys[some], kind="stable")
        key = keys[some[within]]
        order[heads[key] + np.arange(len(key)) - np.searchsorted(key, key)] = some[within]
        heads += np.bincount(key, minlength=kinds)
    return order


Place = Callable[[tuple[int, ...], npt.DTypeLike], npt.NDArray[Any] | None]
"""``place(shape, dtype)`` returns an array to be filled where it is to stay, or None."""
_place: ContextVar[Place | None] = ContextVar("o3dleaf.place", default=None)


@contextmanager
def placing(place: Place) -> Iterator[None]:
    """Let the large array of a result lie where it is to stay, such as in the file that the result is written to."""
    token = _place.set(place)
    try:
        yield
    finally:
        _place.reset(token)


def result_array(shape: tuple[int, ...], dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
    """Return the large array of a result, to be filled: where it is to stay, if that is known, else a scratch array."""
    place = _place.get()
    array = None if place is None else place(shape, dtype)
    return scratch_array(shape, dtype, share=SHARE) if array is None else array


class GrowingArray:
    """An array that comes part by part: in memory, or in a temporary file once it would take too much of it.

    Parameters
    ----------
    dtype : data type
    row : tuple of int
        Shape of what one row holds.
    """

    def __init__(self, dtype: npt.DTypeLike, row: tuple[int, ...] = ()) -> None:
        self.dtype, self.row = np.dtype(dtype), row
        self.rows = 0
        self._held: list[npt.NDArray[Any]] = []
        self._file: IO[bytes] | None = None
        self._asked = 0

    def __repr__(self) -> str:
        return f"GrowingArray({self.rows:,} rows of {self.dtype}{self.row or ''}, {'file' if self._file else 'memory'})"

    def append(self, part: npt.NDArray[Any]) -> None:
        """Add rows (n, *row).

        Raises
        ------
        O3DLeafError
            If they are to lie in a file, and the disk has no room.
        """
        self.rows += len(part)
        self._held.append(np.asarray(part, dtype=self.dtype))
        size = self.rows * math.prod(self.row) * self.dtype.itemsize
        # Asked whenever it has grown by a quarter: what is free is read from files of the system.
        if self._file is None and 4 * size > 5 * self._asked:
            self._asked = size
            if not is_held(size, EACH):
                self._file = tempfile.TemporaryFile(prefix="o3dleaf-")  # noqa: SIM115 - until all of it is there
        if self._file is not None:
            with placing_on_disk(size):
                for each in self._held:
                    self._file.write(np.ascontiguousarray(each).data)
            self._held.clear()

    def whole(self) -> npt.NDArray[Any]:
        """Return all rows as one array, which may be written to; the parts are let go, and nothing can be added."""
        if self._file is None:
            whole, start = np.empty((self.rows, *self.row), self.dtype), 0
            self._held.reverse()
            while self._held:
                # One at a time: all of them beside the whole would be twice as much.
                part = self._held.pop()
                whole[start : start + len(part)] = part
                start += len(part)
            return whole
        with self._file as file, placing_on_disk(file.tell()):
            file.flush()
            return np.asarray(np.memmap(file, dtype=self.dtype, mode="r+", shape=(self.rows, *self.row)))


@contextmanager
def placing_on_disk(size: float) -> Iterator[None]:
    """Raise `O3DLeafError` where what is written inside to the temporary folder, of so many bytes, finds no place."""
    try:
        yield
    except OSError as cause:
        raise O3DLeafError(
            f"memory: {1e-9 * size:.3g} GB are to lie on the disk, and find no place in {tempfile.gettempdir()} "
            f"({cause.strerror}); set TMPDIR to a folder of a larger disk, or state more memory (--memory)"
        ) from cause


def load_array(stored: Any) -> npt.NDArray[Any]:
    """Return a copy of an array that is read by slices: in memory, or part by part in a file, as `scratch_array`."""
    size = math.prod(stored.shape) * stored.dtype.itemsize
    if is_held(size):
        return np.asarray(stored[...])
    array = scratch_array(stored.shape, stored.dtype, share=SHARE)
    chunk = (getattr(stored, "chunks", None) or (1,))[0]
    rows = chunk * max(1, int(PART * len(array) // (size * chunk)))
    for first in range(0, len(array), rows):
        array[first : first + rows] = stored[first : first + rows]
        release_pages(array)
    return array
