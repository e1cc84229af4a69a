"""Annotations that tell a range, or have names of their own: `Positive` is a number above zero."""

from typing import Annotated, Literal

from o3dleaf.core.arguments.allowed import Allowed, is_number, is_whole
from o3dleaf.core.checks.scalars import LARGEST
from o3dleaf.core.errors import UnitError
from o3dleaf.core.units import UNITS, is_unit


def between(low: float, high: float, words: str) -> Allowed:
    """Return the rule of a number within limits, for `Annotated`."""
    return Allowed(lambda value: is_number(value) and low <= float(value) <= high, words)


Positive = Annotated[float, between(1 / LARGEST, LARGEST, f"a number above zero, {1 / LARGEST:.0e} to {LARGEST:.0e}")]
"""A length, or a factor."""
NotNegative = Annotated[float, between(0, LARGEST, f"a number of at least zero, up to {LARGEST:.0e}")]
"""A length that may be none."""
Finite = Annotated[float, between(-LARGEST, LARGEST, f"a number of at most {LARGEST:.0e}")]
Limit = Annotated[float, between(1 / LARGEST, float("inf"), "a number above zero, or infinity")]
"""A factor beyond which something counts as too far; infinite, nothing does."""
Share = Annotated[float, between(0, 1, "a number from 0 to 1")]
PartialShare = Annotated[float, between(0, 0.99, "a number from 0 to 0.99")]
"""A share that leaves something."""
Unit = Annotated[str, Allowed(lambda value: isinstance(value, str) and is_unit(value), UNITS, UnitError)]
Order = Annotated[int, Allowed(lambda value: is_whole(value) and 0 <= value <= 2, "0, 1 or 2")]
"""Of the highest derivative."""
Count = Annotated[int, Allowed(lambda value: is_whole(value) and value >= 1, "a whole number of at least 1")]
Whole = Annotated[int, Allowed(lambda value: is_whole(value) and value >= 0, "a whole number of at least 0")]
SmoothingValue = NotNegative | Literal["gcv", "gcv-per-ball"]
"""A number >= 0, or "gcv" to have it chosen by generalized cross-validation, for all balls or for each of its own."""
