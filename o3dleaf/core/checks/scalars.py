"""Single numbers, and words of which there are some."""

from collections.abc import Iterable

import numpy as np

from o3dleaf.core.errors import InputError

LARGEST = 1e30
"""Size of a cloud's coordinates beyond which, and one over which, tenth powers of lengths leave float64."""


def as_number(value: float, name: str) -> float:
    """Return `value` as a finite float, or raise `InputError`."""
    number = _as_float(value)
    if not np.isfinite(number):
        raise InputError(f"{name}: is {value}; give a finite number")
    return number


def require_positive(value: float, name: str, *, largest: float = LARGEST) -> float:
    """Return `value` as a float if it is above zero and of a size to calculate with, else raise `InputError`."""
    number = _as_float(value)
    if not 1 / largest <= number <= largest:
        raise InputError(f"{name}: is {value}; give a number above zero, {1 / largest:.0e} to {largest:.0e}")
    return number


def _as_float(value: object) -> float:
    """Return `value` as a float, NaN where it is no number at all."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return np.nan


def require_choice(value: str, choices: Iterable[str], name: str) -> str:
    """Return `value` if it is one of `choices`, else raise `InputError` that lists them."""
    known = list(choices)
    if value not in known:
        raise InputError(f"{name}: unknown {value!r}; choose one of {', '.join(known)}")
    return value
