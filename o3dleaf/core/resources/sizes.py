"""Sizes of memory in words and from words: "2 GB"."""

import math
import re

from o3dleaf.core.errors import InputError

DECIMAL = {"B": 0, "KB": 1, "MB": 2, "GB": 3, "TB": 4}
"""Powers of 1000."""
BINARY = {"KIB": 1, "MIB": 2, "GIB": 3, "TIB": 4}
"""Powers of 1024."""
FORM = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*([A-Za-z]+)\s*")
MAX_SIZE = 999e12
MIN_SIZE = 1_000_000
"""Bytes below which a limit is mistyped: nothing runs in less than a megabyte."""


def parse_size(size: str | int) -> int:
    """Return the bytes of a size such as "2GB", "500 MB" or "1.5GiB", or of a number of bytes.

    Raises
    ------
    InputError
        If it is no size, has no unit, or is below a megabyte.
    """
    count = _bytes_of(size) if isinstance(size, str) else _whole(size)
    if count is None:
        raise InputError(f"memory: is {size!r}; give a size with its unit, such as 2GB or 500MB")
    if count < MIN_SIZE:
        raise InputError(f"memory: {size!r} is below a megabyte; give a size such as 2GB or 500MB")
    return count


def about(count: float) -> str:
    """Return a predicted size: "about 5.3 GB"."""
    return size_in_words(count) if count >= MAX_SIZE else f"about {size_in_words(count)}"


def size_in_words(count: float) -> str:
    """Return bytes as a text of two or three digits: "5.3 GB"; what is beyond all memory is "over 999 TB"."""
    if count >= MAX_SIZE:
        return "over 999 TB"
    for unit, power in reversed(DECIMAL.items()):
        if count >= 1000**power or unit == "MB":
            value = count / 1000**power
            digits = max(1 - math.floor(math.log10(value)), 0) if value > 0 else 0
            return f"{value:,.{min(digits, 1)}f} {unit}"
    raise AssertionError(count)  # pragma: no cover - the loop ends at megabytes


def _bytes_of(text: str) -> int | None:
    """Return the bytes that a text states, or None."""
    parts = FORM.fullmatch(text)
    if parts is None:
        return None
    unit = parts[2].upper()
    unit = unit if len(unit) > 1 or unit == "B" else f"{unit}B"  # 2G is 2 GB
    if unit in DECIMAL:
        return round(float(parts[1]) * 1000.0 ** DECIMAL[unit])
    return round(float(parts[1]) * 1024.0 ** BINARY[unit]) if unit in BINARY else None


def _whole(number: object) -> int | None:
    return number if isinstance(number, int) and not isinstance(number, bool) else None
