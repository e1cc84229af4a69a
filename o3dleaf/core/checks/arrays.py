"""Arrays of numbers: of one type and layout, finite, of a size to calculate with."""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.scalars import LARGEST
from o3dleaf.core.errors import InputError

FloatArray = npt.NDArray[np.float64]

FARTHEST = 1e100
"""Size of coordinates beyond which, and one over which, squares of their distances leave float64."""


def as_floats(array: npt.ArrayLike, name: str) -> FloatArray:
    """Return an array of real numbers as float64 in the layout that loops are compiled for; NaN may be among them."""
    try:
        given = np.asanyarray(_out_of_tensor(array))
        what = _no_numbers(given)
        floats = given if what else np.require(given, np.float64, ["C", "A", "W", "E"])
    except (TypeError, ValueError, OverflowError) as cause:
        raise InputError(f"{name}: not an array of numbers ({cause}); give an array of real numbers") from cause
    if what:
        raise InputError(f"{name}: {what}")
    return floats


def as_array(array: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Return an array of any type as it is; nothing is masked in it."""
    try:
        given = np.asanyarray(_out_of_tensor(array))
    except ValueError as cause:
        raise InputError(f"{name}: is no array ({cause}); give rows of one length") from cause
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise InputError(f"{name}: {np.ma.count_masked(given)} are masked; give an array without them")
    return np.asarray(given)


def _out_of_tensor(array: Any) -> Any:
    """Return the numbers of a tensor of any device, with a gradient or without, of which NumPy knows nothing."""
    if not (hasattr(array, "cpu") and hasattr(array, "numpy")):
        return array
    # Open3D's has no gradient; PyTorch gives no numbers of one that has.
    return (array.detach() if hasattr(array, "detach") else array).cpu().numpy()


def _no_numbers(array: npt.NDArray[Any]) -> str:
    """Return why an array has no real numbers, and what to do, or nothing."""
    if array.dtype.kind == "c":
        return "are complex; give real numbers, real and imaginary parts as two columns"
    if array.dtype.kind in "mMUS":
        what = "times" if array.dtype.kind in "mM" else "text"
        return f"not an array of numbers ({what}); give an array of real numbers"
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        return f"{np.ma.count_masked(array)} are masked; give an array without them"
    return ""


def as_row(values: npt.ArrayLike, name: str, *, count: int | None = None) -> FloatArray:
    """Return `values` as a finite (n,) array, one number as n of them or, where n is not known, as one."""
    array = as_floats(values, name)
    if array.ndim == 0:
        array = np.full(count or 1, array)
    if array.ndim != 1 or len(array) != (len(array) if count is None else count):
        raise InputError(
            f"{name}: has shape {array.shape}; give a row of numbers, ({'n' if count is None else count},)"
        )
    return require_finite(array, name)


def as_lengths(values: npt.ArrayLike, name: str) -> FloatArray:
    """Return lengths of any shape, one as (1,), finite and at most `LARGEST`, or raise `InputError`."""
    lengths = require_finite(np.atleast_1d(as_floats(values, name)), name)
    if lengths.size and np.abs(lengths).max() > LARGEST:
        raise InputError(f"{name}: reach {np.abs(lengths).max():.3g}; give lengths of at most {LARGEST:.0e}")
    return lengths


def as_pairs(first: npt.ArrayLike, second: npt.ArrayLike, names: tuple[str, str]) -> tuple[FloatArray, FloatArray]:
    """Return two rows of lengths as (n,) each, one of either for all of the other, or raise `InputError`."""
    a, b = (as_lengths(values, name) for values, name in zip((first, second), names, strict=True))
    if a.ndim > 1 or b.ndim > 1 or (len(a) != len(b) and 1 not in {len(a), len(b)}):
        raise InputError(f"{names[0]}, {names[1]}: have shapes {a.shape} and {b.shape}; give rows of one length")
    both = np.broadcast_arrays(a, b)
    return both[0], both[1]


def require_finite(array: FloatArray, name: str) -> FloatArray:
    """Return `array` if all of it is finite, else raise `InputError` with the count and the first place."""
    finite = np.isfinite(array)
    if not finite.all():
        bad = np.argwhere(~finite)
        raise InputError(
            f"{name}: {len(bad)} values are NaN or infinite, the first at index {tuple(bad[0].tolist())}; remove them"
        )
    return array


def require_moderate(values: npt.NDArray[Any], name: str) -> npt.NDArray[Any]:
    """Return values of any shape if all are finite and none is beyond `FARTHEST`, else raise `InputError`."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    if not (np.isfinite(low) and np.isfinite(high)):
        require_finite(values, name)
    if max(-low, high) > FARTHEST:
        raise InputError(
            f"{name}: reach {max(-low, high):.3g}; give them in a unit in which they stay below {FARTHEST:.0e}"
        )
    return values
