"""Lengths: one unit an object, named where files are read and converted once at the border."""

from o3dleaf.core.errors import UnitError

METERS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
"""Length of each known unit in meters; "µm" is accepted for "um"."""


def check_unit(unit: str | None) -> str | None:
    """Return the canonical name of a unit of length (None: no unit stated), or raise `UnitError`."""
    if unit is None:
        return None
    name = unit.replace("µ", "u").replace("μ", "u")
    if name not in METERS:
        raise UnitError(f"unit: unknown {unit!r}; choose one of {', '.join(METERS)}")
    return name


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
