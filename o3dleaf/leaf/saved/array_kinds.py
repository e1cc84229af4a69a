"""Requirements on an array from a file: its type, its shape beside other arrays', its range."""

from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.resources.scratch import ROWS

Sizes = dict[str, int]

MAX_INT64 = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Array:
    """An array of a model: its type, its shape in letters that mean the same throughout an object, and its range.

    A letter that is new stands for any size. `most` is one of them or a number; where an array is `rising`, it begins
    with 0, never falls, and ends with `most`.
    """

    kind: type[np.generic]
    shape: tuple[str, ...]
    least: int = 0
    most: int | str = MAX_INT64
    rising: bool = False
    optional: bool = False

    def check(self, array: Any, name: str, sizes: Sizes) -> None:
        """Raise `InputError` unless an array is as it must be; learn the sizes that are new."""
        if array is None and self.optional:
            return
        if not isinstance(array, np.ndarray) or array.ndim != len(self.shape) or array.dtype != np.dtype(self.kind):
            raise InputError(f"{name}: is no array of {self.kind.__name__} with {len(self.shape)} axes")
        for letters, size in zip(self.shape, array.shape, strict=True):
            if size != (sizes.setdefault(letters, size) if letters.isalpha() else _evaluated(letters, sizes)):
                raise InputError(f"{name}: has shape {array.shape}, which does not fit the other arrays")
        if self.kind is np.float64:
            if not everywhere(len(array), lambda start, stop: np.isfinite(array[start:stop])):
                raise InputError(f"{name}: has values that are NaN or infinite")
            return
        most = self.most if isinstance(self.most, int) else _evaluated(self.most, sizes)
        if array.size and not (self.least <= array.min() and array.max() <= most):
            raise InputError(f"{name}: has values from {array.min()} to {array.max()}, not from {self.least} to {most}")
        if self.rising and (array[0] != 0 or array[-1] != most or not never_falls(array)):
            raise InputError(f"{name}: do not rise from 0 to {most}")


def everywhere(count: int, holds: Callable[[int, int], Any]) -> bool:
    """Return whether something holds of all rows, asked of some at a time: what is mapped stays in its file."""
    return all(bool(np.all(holds(*part))) for part in blocks(count, ROWS))


def never_falls(array: IntArray) -> bool:
    """Return whether no number is less than the one before."""
    return everywhere(len(array) - 1, lambda start, stop: array[start:stop] <= array[start + 1 : stop + 1])


def _evaluated(letters: str, sizes: Sizes) -> int:
    """Return the value of a sum of products, such as "2*n" or "k+1"; -1 takes one off."""
    return sum(
        prod(sizes[each] if each.isalpha() else int(each) for each in term.split("*")) for term in letters.split("+")
    )


def floats(*shape: str, optional: bool = False) -> Array:
    """Return an array of float64."""
    return Array(np.float64, shape, optional=optional)


def whole(*shape: str, least: int = 0, most: int | str = MAX_INT64) -> Array:
    """Return an array of int64 within a range."""
    return Array(np.int64, shape, least, most)


def rising(count: str, total: str) -> Array:
    """Return offsets: `count` + 1 of them, from 0 to `total`."""
    return Array(np.int64, (f"{count}+1",), 0, total, rising=True)
