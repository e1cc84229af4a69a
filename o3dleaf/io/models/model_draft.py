"""A model file that is being made: its coefficients lie in it before the rest is known."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.atomic_files import claim, require_writable, whole_file
from o3dleaf.core.resources.scratch import placing

LARGE = 1 << 24
"""Bytes of an array from which on it comes first in its file."""
HEAD = 1 << 16
"""Bytes of the head of such a file, or a multiple of them."""


class ModelDraft:
    """A model file under its temporary name, whose largest array lies in it before the rest is known.

    Attributes
    ----------
    target, temporary : Path
    array : ndarray or None
        Mapped from the file.
    is_whole : bool
        Whether the model has been written.
    """

    def __init__(self, target: Path, temporary: Path) -> None:
        self.target, self.temporary = target, temporary
        self.array: np.ndarray[Any, Any] | None = None
        self.is_whole = False

    def place(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> np.ndarray[Any, Any] | None:
        """Return an array to be filled, in the file; None if it is a small one, or not the first."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        # Windows does not rename a file that is mapped.
        if self.array is not None or size < LARGE or sys.platform == "win32":
            return None
        with self.temporary.open("w+b") as stream:
            claim(stream, HEAD + size)
            stream.truncate(HEAD + size)
            self.array = np.asarray(np.memmap(stream, dtype=dtype, mode="r+", offset=HEAD, shape=shape))
        return self.array

    def holds(self, target: Path, array: np.ndarray[Any, Any] | None, head: int) -> bool:
        """Return whether it is the file to be written, and the array lies in it, behind a head of so many bytes."""
        if self.array is None or array is None or self.is_whole or head != HEAD:
            return False
        same = self.array.ctypes.data == array.ctypes.data and self.array.nbytes == array.nbytes
        return same and target == self.target


_draft: ContextVar[ModelDraft | None] = ContextVar("o3dleaf.draft", default=None)


class _UnusedError(Exception):
    """Raised to leave nothing of a draft."""


@contextmanager
def model_draft(path: str | PathLike[str]) -> Iterator[None]:
    """Let the large array of a model that is made inside, and written to `path`, lie in its file from the start.

    The file appears at the end, as whole as by `write_model` and with the same bytes; without it nothing is left.
    """
    target = require_writable(path)
    with suppress(_UnusedError), whole_file(target) as temporary:
        draft = ModelDraft(target, temporary)
        token = _draft.set(draft)
        try:
            with placing(draft.place):
                yield
        finally:
            _draft.reset(token)
        if not draft.is_whole:
            raise _UnusedError


def current_draft() -> ModelDraft | None:
    """Return the draft of the model that is being made, if any."""
    return _draft.get()
