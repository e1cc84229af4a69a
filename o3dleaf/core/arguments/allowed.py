"""What an argument may be: a test, and words for what passes it."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from o3dleaf.core.errors import InputError

SURROGATE = re.compile("[\ud800-\udfff]")
MAX_SHOWN = 60
"""Letters of a value that a message shows."""


@dataclass(frozen=True)
class Allowed:
    """What an argument may be: a test, and the words for what passes it."""

    allows: Callable[[Any], bool]
    words: str
    error: type[InputError] = InputError


def require(value: object, name: str, rule: Allowed) -> None:
    """Raise `InputError` if a rule does not allow a value."""
    if not rule.allows(value):
        raise rule.error(f"{name}: is {shown(value)}; give {rule.words}")


def shown(value: object) -> str:
    """Return a value as a message shows it: itself if it is short, or what it is."""
    if isinstance(value, str | bytes | int | float | complex | np.number | np.bool_ | None):
        text = repr(value.item() if isinstance(value, np.generic) else value)
        return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."
    if isinstance(value, type):
        return f"the class {value.__name__}"
    return f"of type {type(value).__name__}"


def plain(value: Any) -> Any:
    """Return a number of NumPy's as Python's: single precision and arrays of one make other types of what follows."""
    if not isinstance(value, np.ndarray | np.generic) or value.ndim or value.dtype.kind not in "buif":
        return value
    return float(value) if value.dtype.kind == "f" else value.item()


def is_number(value: Any) -> bool:
    """Return whether a value is a real number, and no NaN; NumPy's numbers and arrays of one are."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "uif" and not np.isnan(value)
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    try:
        return not np.isnan(float(value))
    except OverflowError:
        return False


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number of at most 64 bits."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "ui"
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and abs(int(value)) < 2**63


def _is_path(value: Any) -> bool:
    return isinstance(value, str | PathLike) and "\0" not in str(value) and str(value) != ""


def _is_text(value: Any) -> bool:
    """Return whether a value is text that files and pictures can hold: no NUL, no half of a letter (a surrogate)."""
    return isinstance(value, str) and "\0" not in value and not SURROGATE.search(value)


PATH = Allowed(_is_path, "a path")
SIMPLE: dict[Any, Allowed] = {
    None: Allowed(lambda value: value is None, "None"),
    type(None): Allowed(lambda value: value is None, "None"),
    bool: Allowed(lambda value: isinstance(value, bool | np.bool_), "True or False"),
    int: Allowed(is_whole, "a whole number"),
    float: Allowed(is_number, "a number"),
    str: Allowed(_is_text, "text"),
}
"""What values of the simple types are."""
