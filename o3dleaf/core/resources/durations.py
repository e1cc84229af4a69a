"""Durations in words and from words: "10 min"."""

import re

from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}
"""Of each unit."""
FORM = re.compile(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(s|min|h|d)\s*")
MAX_SECONDS = 1000.0 * 86400.0


def parse_duration(duration: str | float) -> float:
    """Return the seconds of a duration such as "90s", "10 min" or "2h", or of a number of seconds.

    Raises
    ------
    InputError
        If it is no duration, has no unit, or is not above zero.
    """
    if not isinstance(duration, str | bool):
        return require_positive(duration, "time")
    parts = FORM.fullmatch(str(duration))
    if parts is None or not float(parts[1]) > 0:
        raise InputError(f"time: is {duration!r}; give a duration with its unit, such as 10min or 2h")
    return float(parts[1]) * SECONDS[parts[2]]


def duration_in_words(seconds: float) -> str:
    """Return seconds as a text of one to three digits: "40 s", "12 min", "1.5 h"."""
    if seconds >= MAX_SECONDS:
        return "over 1000 d"
    unit = [unit for unit in SECONDS if unit == "s" or seconds >= 2 * SECONDS[unit]][-1]
    value = seconds / SECONDS[unit]
    return f"{value:.0f} {unit}" if value >= 10 else f"{max(value, 0.1):.1f} {unit}"
