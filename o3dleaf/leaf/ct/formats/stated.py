"""The lattice, the order of axes and the type of voxels, as a file states them or is said to have them."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError, O3DLeafError, UnitError
from o3dleaf.core.units import check_unit

SLICES_FIRST = "zyx"
"""The order of axes of pages, rows and columns, the last one fastest: of nearly every file."""
VOXELS = "biuf"
"""NumPy's kinds of numbers that are intensities."""
SPELLINGS = {
    "micron": "um", "microns": "um", "micrometer": "um", "micrometers": "um", "millimeter": "mm", "millimeters": "mm",
    "centimeter": "cm", "centimeters": "cm", "meter": "m", "meters": "m", "nanometer": "nm", "nanometers": "nm",
}  # fmt: skip
"""Words for units in files, and ours."""


@dataclass(frozen=True)
class Stated:
    """The lattice of a volume as its file states it.

    Attributes
    ----------
    spacing : (3,) ndarray or None
        Distance of voxels along (x, y, z), in `unit`; None where it is not stated.
    origin : (3,) ndarray or None
        Center of the first voxel, in `unit`.
    unit : str or None
    axes : str
        Axes of the array in the file, the slowest first: a permutation of "xyz".
    """

    spacing: FloatArray | None = None
    origin: FloatArray | None = None
    unit: str | None = None
    axes: str = SLICES_FIRST


@checked
@dataclass(frozen=True, kw_only=True)
class VoxelLayout:
    """The layout of voxels whose file does not state it; None is not said.

    Attributes
    ----------
    dataset : str
        Name of the array in a file of several (HDF5, Zarr, NPZ).
    axes : str
        Axes of the array in the file, the slowest first: a permutation of "xyz".
    shape : (nx, ny, nz)
        Voxels along (x, y, z) in a file of bare numbers.
    dtype : str
        Type of its numbers, in NumPy's words: uint8, int16, >u2 (high byte first), float32, ...
    offset : int
        Bytes before the first of them.
    """

    dataset: str | None = None
    axes: str | None = None
    shape: tuple[Count, Count, Count] | None = None
    dtype: str | None = None
    offset: Whole | None = None

    def __post_init__(self) -> None:
        if self.axes is not None and sorted(self.axes) != ["x", "y", "z"]:
            raise InputError(f"axes: is {self.axes!r}; give the letters x, y and z in the order of the file, as zyx")
        if self.dtype is not None:
            _number_type(self.dtype)

    @property
    def number_type(self) -> "np.dtype[Any] | None":
        """NumPy's type of the numbers."""
        return None if self.dtype is None else _number_type(self.dtype)


def parse_layout(text: str | VoxelLayout | None) -> VoxelLayout:
    """Return the layout in a text such as "shape=700x700x160 dtype=uint16 offset=512", or raise `InputError`."""
    if isinstance(text, VoxelLayout):
        return text
    given: dict[str, Any] = {}
    for word in (text or "").split():
        name, equals, value = word.partition("=")
        if not equals or name not in {each.name for each in fields(VoxelLayout)} or name in given:
            names = ", ".join(f"{each.name}=" for each in fields(VoxelLayout))
            raise InputError(f"layout: cannot read {word!r}; give some of {names} each once, without blanks in them")
        given[name] = value
    try:
        if "shape" in given:
            given["shape"] = tuple(int(count) for count in given["shape"].lower().split("x"))
        if "offset" in given:
            given["offset"] = int(given["offset"])
    except ValueError as cause:
        raise InputError(f"layout: cannot read {text!r} ({cause}); give counts, as shape=700x700x160") from cause
    return VoxelLayout(**given)


def require_only(layout: VoxelLayout, known: Iterable[str], path: Path) -> None:
    """Raise `InputError` if something is said that the format of a file has no need of."""
    needless = {each.name for each in fields(layout) if getattr(layout, each.name) is not None}.difference(known)
    if needless:
        names = ", ".join(sorted(needless))
        raise InputError(f"layout: {names}: {path} says this itself, or has none; leave it out")


@contextmanager
def reading(path: Path, kind: str) -> Iterator[None]:
    """Raise `InputError` for whatever a library makes of a broken file: OSError, RuntimeError, KeyError, ..."""
    try:
        yield
    except InputError:
        raise
    except Exception as cause:
        raise InputError(f"{path}: cannot be read as {kind} ({cause}); export it again") from cause


def import_reader(module: str, path: Path) -> Any:
    """Return the module that reads a file, or raise `InputError` with the line that installs its package."""
    try:
        return import_module(module)
    except ImportError as cause:
        raise InputError(f"{path}: needs {module}; run: pip install 'o3dleaf[formats]'") from cause


def turn_to_xyz(array: npt.NDArray[Any], axes: str = SLICES_FIRST) -> npt.NDArray[Any]:
    """Return a view of an array whose axes lie along (x, y, z), given the order that they have; no other place turns.

    The turn of "zyx" is its own inverse.
    """
    return array.transpose([axes.index(axis) for axis in "xyz"])


class TurnedVoxels:
    """Voxels along (x, y, z) of an array in a file, read where they are asked for; leading axes have length 1."""

    def __init__(self, array: Any, axes: str, path: Path) -> None:
        self.array, self.axes, self.path = array, axes, path
        self.lead = array.ndim - 3 if hasattr(array, "ndim") else 0

    def _turned(self, numbers: tuple[int, ...]) -> tuple[int, int, int]:
        x, y, z = (numbers[self.lead + self.axes.index(axis)] for axis in "xyz")
        return x, y, z

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (x, y, z)."""
        return self._turned(self.array.shape)

    @property
    def chunks(self) -> tuple[int, int, int] | None:
        """The shape of what the file keeps in one piece, if it does."""
        chunks = getattr(self.array, "chunks", None)
        return None if chunks is None else self._turned(chunks)

    @property
    def dtype(self) -> Any:
        """Type of the numbers."""
        return self.array.dtype

    def close(self) -> None:
        """Close the file of an HDF5 dataset; others are open only while they are read."""
        file: Any = getattr(self.array, "file", None)
        if hasattr(file, "close"):
            file.close()

    def __getitem__(self, where: tuple[slice, ...]) -> npt.NDArray[Any]:
        stored = tuple(where["xyz".index(axis)] for axis in self.axes)
        try:
            return turn_to_xyz(np.asarray(self.array[(0,) * self.lead + stored]), self.axes)
        except O3DLeafError:
            raise
        except Exception as cause:  # whatever the format's library makes of a damaged part
            reason = " ".join(str(cause).split())
            raise InputError(f"{self.path}: is damaged there ({reason}); export it again") from cause


def only_array(names: list[str], wanted: str | None, path: Path) -> str:
    """Return the name of the array that is wanted, or of the only one, or raise `InputError` that lists them."""
    listed = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    if wanted is not None and wanted.strip("/") not in names:
        raise InputError(f"{path}: has no array {wanted!r} of three dimensions; it has {listed or 'none'}")
    if wanted is None and len(names) != 1:
        raise InputError(f"{path}: has {len(names)} arrays of three dimensions ({listed}); say which: dataset=NAME")
    return names[0] if wanted is None else wanted.strip("/")


def _number_type(name: str) -> "np.dtype[Any]":
    try:
        kind = np.dtype(name)
    except TypeError:
        kind = np.dtype(object)
    if kind.kind not in VOXELS or kind.shape:
        raise InputError(f"dtype: is {name!r}; give a type of numbers: uint8, int16, uint16, >u2, float32, ...")
    return kind


def unit_named(name: str) -> str | None:
    """Return our name of a unit that a file states, None if it states none that is a length."""
    plain = name.strip().replace("\\u00B5", "u").replace("\\u00b5", "u")
    try:
        return check_unit(SPELLINGS.get(plain.lower(), plain))
    except UnitError:
        return None
