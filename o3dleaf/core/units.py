"""Lengths: one unit an object, named where files are read and converted once at the border; and lengths in words."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from o3dleaf.core.errors import UnitError

METERS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
"""Length of each known unit in meters; "µm" is accepted for "um"."""

UNITS = f"one of {', '.join(METERS)} (an inch is 25.4 mm)"
"""What a unit may be, in messages."""

POWERS = {1: "", 2: "²", 3: "³"}
"""What follows the unit of a length, an area and a volume."""
DIGITS = 4
"""Significant digits of a figure that is read, not calculated with."""
OWN_UNIT = (1e-2, 1e5)
"""Figures that are printed in the object's own unit, so that a report has few units: they need five places at most."""


def check_unit(unit: str | None) -> str | None:
    """Return the canonical name of a unit of length (None: no unit stated), or raise `UnitError`."""
    if unit is None:
        return None
    if not is_unit(unit):
        raise UnitError(f"unit: unknown {unit!r}; choose {UNITS}")
    return _plain_name(unit)


def is_unit(name: str) -> bool:
    """Return whether a unit of length has that name."""
    return _plain_name(name) in METERS


def _plain_name(unit: str) -> str:
    return unit.replace("µ", "u").replace("μ", "u")


def unit_scale(source: str | None, target: str | None) -> float:
    """Return the factor that turns lengths in `source` into lengths in `target`.

    Two objects without a unit go together; one with and one without do not.

    Raises
    ------
    UnitError
        If exactly one of the two is unknown.
    """
    source, target = check_unit(source), check_unit(target)
    if source == target:
        return 1.0
    if source is None or target is None:
        raise UnitError(
            f"unit: {source} cannot be converted to {target}; name the unit of both (for example unit='mm')"
        )
    return METERS[source] / METERS[target]


def in_unit(unit: str) -> str:
    """Return a unit as it is printed."""
    return "µm" if unit == "um" else unit


def name_length(length: float, unit: str | None) -> str:
    """Return a round length in words, in the largest unit up to its own that makes it 1 or more: 0.2 mm is 200 µm."""
    if unit is None:
        return f"{length:g}"
    meters = length * METERS[unit]
    usual = [name for name in METERS if name != "cm" or name == unit]
    name = next((name for name in usual if METERS[name] <= METERS[unit] and meters >= 0.999 * METERS[name]), "nm")
    return f"{meters / METERS[name]:.6g} {in_unit(name)}"


def measure_in_words(
    value: float | Sequence[float], unit: str | None, *, power: int = 1, digits: int = DIGITS, join: str = ", "
) -> str:
    """Return a length, an area or a volume in words, in a unit that makes it a number to read: 0.0003 m² is 3 cm².

    Parameters
    ----------
    value : float or sequence of float
        In `unit` to the power; of several, which are printed in one unit, the largest determines it.
    unit : str or None
        Unit of length of the object; it is kept for figures from 0.01 to 100,000. None prints bare numbers.
    power : {1, 2, 3}
        1: a length, 2: an area, 3: a volume.
    digits : int
        Significant digits, of the largest value; digits before the point are never rounded off.
    join : str
        What stands between several values.
    """
    values = [float(each) for each in value] if isinstance(value, Sequence) else [float(value)]
    size = max(map(abs, values), default=0.0)
    shown, factor = unit, 1.0
    if unit is not None:
        shown = _readable_unit(size, check_unit(unit) or unit, power)
        factor = unit_scale(unit, shown) ** power
    elif not OWN_UNIT[0] <= size < OWN_UNIT[1]:
        return join.join(f"{each:.{digits}g}" for each in values)
    places = _places(size * factor, digits)
    numbers = join.join(_plain(each * factor, places) for each in values)
    return numbers if shown is None else f"{numbers} {in_unit(shown)}{POWERS[power]}"


@contextmanager
def lengths_in(unit: str | None) -> Iterator[None]:
    """State the unit of the lengths that messages inside tell (`tell_length`); None: it is not known."""
    token = _of_messages.set(unit)
    try:
        yield
    finally:
        _of_messages.reset(token)


NEARLY_WHOLE = 0.995
"""Share that two digits would round to the whole."""

_of_messages: ContextVar[str | None] = ContextVar("o3dleaf.unit", default=None)


def tell_length(value: float | Sequence[float], power: int = 1, *, digits: int = 3, join: str = ", ") -> str:
    """Return what `measure_in_words` says of a length, or of an area, in the unit that `lengths_in` states."""
    return measure_in_words(value, _of_messages.get(), power=power, digits=digits, join=join)


def tell_count(count: int, noun: str, plural: str = "") -> str:
    """Return a number of things in words, "1 point" or "2,000 points"; a plural is given where it is no added s."""
    return f"{count:,} {noun if count == 1 else plural or noun + 's'}"


def tell_share(share: float) -> str:
    """Return a share in percent, with two significant digits and no exponent; next to the whole with four."""
    percent = 100 * share
    return f"{_plain(percent, _places(abs(percent), 4 if NEARLY_WHOLE <= share < 1 else 2))} %"


def _readable_unit(size: float, unit: str, power: int) -> str:
    """Return the unit to print a figure of `unit` in: its own, or the largest in which it is 1 or more."""
    if size == 0 or not math.isfinite(size) or OWN_UNIT[0] <= size < OWN_UNIT[1]:
        return unit
    known = [name for name in METERS if name != "cm" or power > 1]  # lengths of a leaf are told in m and mm
    return next((name for name in known if size * unit_scale(unit, name) ** power >= 1), "nm")


def _places(size: float, digits: int) -> int:
    """Return the digits after the point that leave `digits` significant ones."""
    return max(0, digits - 1 - math.floor(math.log10(size))) if size > 0 and math.isfinite(size) else 0


def _plain(value: float, places: int) -> str:
    """Return a number without an exponent or needless zeros, thousands apart."""
    text = f"{value:,.{places}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in {"-0", ""} else text
