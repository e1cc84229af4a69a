"""PCD files, as text, binary or compressed: points, normals and colors, counted against the file's size."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns
from o3dleaf.io.clouds.cut_off import too_short
from o3dleaf.io.clouds.lzf import unpack
from o3dleaf.io.polygons.numbers import no_number

HEADER = 1 << 14
"""Bytes in which the header must end."""
TYPES = {"F": "f", "I": "i", "U": "u"}
SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
MAX_COUNT = 1 << 16
"""Numbers of a field; descriptors of points have hundreds."""
KINDS = ("ascii", "binary", "binary_compressed")
AXES = ("x", "y", "z")
NORMALS = ("normal_x", "normal_y", "normal_z")
COLORS = ("rgb", "rgba")
"""Packed into four bytes, as a whole number or as what looks like a fraction."""


@dataclass(frozen=True)
class PcdHeader:
    """What a header says: fields by name, number of points, kind of data, and where they begin."""

    record: np.dtype[Any]
    count: int
    kind: str
    end: int


def read_pcd(file: Path) -> Columns:
    """Return the points of a PCD file, with normals and colors, if any.

    Raises
    ------
    InputError
        If it is no PCD, was cut off, or is damaged.
    """
    header = _read_header(file)
    fields = _text_fields(file, header) if header.kind == "ascii" else _binary_fields(file, header)
    normals = _columns(fields, NORMALS) if all(name in fields for name in NORMALS) else None
    packed = next((fields[name] for name in COLORS if name in fields and fields[name].dtype.itemsize == 4), None)
    return Columns(_columns(fields, AXES), normals, None if packed is None else _unpacked(packed))


def _columns(fields: dict[str, npt.NDArray[Any]], names: tuple[str, ...]) -> FloatArray:
    with np.errstate(invalid="ignore"):  # a signaling NaN becomes a quiet one
        return np.stack([fields[name].astype(np.float64) for name in names], axis=1)


def _unpacked(packed: npt.NDArray[Any]) -> FloatArray:
    """Return colors, shares of 1, of whole numbers 0xRRGGBB."""
    numbers = np.ascontiguousarray(packed).view(np.uint32)
    return np.stack([numbers >> shift & 255 for shift in (16, 8, 0)], axis=1) / 255.0


def _read_header(file: Path) -> PcdHeader:
    with file.open("rb") as stream:
        head = stream.read(HEADER)
    data = head.find(b"\nDATA ")
    end = head.find(b"\n", data + 1) + 1
    if data < 0 or end == 0:
        raise InputError(f"{file}: has no PCD header that ends with DATA; export it again")
    lines = [line.split() for line in head[:end].decode("ascii", "replace").splitlines() if line[:1] != "#"]
    entries = {words[0]: words[1:] for words in lines if len(words) > 1}
    try:
        names, kind = entries["FIELDS"], entries["DATA"][0]
        sizes, counts = _numbers(entries["SIZE"]), _numbers(entries.get("COUNT", ["1"] * len(names)))
        count = _numbers(entries["POINTS"])[0]
        fields = [_field(*each) for each in zip(names, entries["TYPE"], sizes, counts, strict=True)]
        record = np.dtype(fields)
    except (KeyError, ValueError) as cause:
        raise InputError(f"{file}: its PCD header is damaged or not complete ({cause}); export it again") from cause
    if kind not in KINDS:
        raise InputError(f"{file}: is PCD of an unknown kind, {kind[:20]!r}; export it as {', '.join(KINDS)}")
    if any(name not in (record.names or ()) or record[name].shape for name in AXES):
        raise InputError(f"{file}: its points have no x, y and z; export it again")
    return PcdHeader(record, count, kind, end)


def _numbers(words: list[str]) -> list[int]:
    if not all(word.isascii() and word.isdigit() for word in words):
        raise ValueError(f"{' '.join(words)} are no numbers")
    return [int(word) for word in words]


def _field(name: str, kind: str, size: int, count: int) -> tuple[Any, ...]:
    """Return a field of NumPy's record; only such of one number are looked at."""
    if kind not in TYPES or size not in SIZES[kind] or not 1 <= count <= MAX_COUNT:
        raise ValueError(f"field {name} of type {kind}, size {size}, count {count}")
    return (name, f"<{TYPES[kind]}{size}") if count == 1 else (name, f"<{TYPES[kind]}{size}", (count,))


def _text_fields(file: Path, header: PcdHeader) -> dict[str, npt.NDArray[Any]]:
    """Return the fields of one number of a text, one point in a line."""
    places, column = {}, 0
    for name in header.record.names or ():
        if not header.record[name].shape:
            places[name] = column
        column += int(np.prod(header.record[name].shape, dtype=np.int64))
    if header.count > file.stat().st_size:
        raise too_short(file, header.count)
    with file.open("rb") as stream:
        stream.seek(header.end)
        try:
            rows = np.loadtxt(stream, usecols=range(column), comments=None, ndmin=2, max_rows=header.count or None)
        except ValueError as cause:
            raise no_number(file, cause) from cause
    if len(rows) < header.count:
        raise too_short(file, header.count)
    # A text has more digits than the type that its header names, but colors are the bits of theirs.
    return {
        name: _cast(rows[:, place], header.record[name]) if name in COLORS else rows[:, place]
        for name, place in places.items()
    }


def _cast(values: FloatArray, kind: np.dtype[Any]) -> npt.NDArray[Any]:
    if kind.kind == "f":
        return values.astype(kind)
    limits = np.iinfo(kind)
    return np.clip(np.nan_to_num(values), limits.min, limits.max).astype(kind)


def _binary_fields(file: Path, header: PcdHeader) -> dict[str, npt.NDArray[Any]]:
    """Return the fields of one number, point by point or, where they are compressed, field by field."""
    expected, size = header.record.itemsize * header.count, file.stat().st_size - header.end
    names = [name for name in header.record.names or () if not header.record[name].shape]
    if header.kind == "binary":
        if size < expected:
            raise too_short(file, header.count)
        rows = np.fromfile(file, header.record, header.count, offset=header.end)
        return {name: rows[name] for name in names}
    with file.open("rb") as stream:
        stream.seek(header.end)
        sizes = np.frombuffer(stream.read(8).ljust(8, b"\0"), "<u4")
        if size < 8 + int(sizes[0]) or int(sizes[1]) != expected:
            raise too_short(file, header.count)
        content = unpack(stream.read(int(sizes[0])), expected)
    if content is None:
        raise InputError(f"{file}: what is packed in it is damaged; copy or export it again")
    fields, place = {}, 0
    for name in header.record.names or ():
        kind = header.record[name]
        if name in names:
            fields[name] = np.frombuffer(content, kind, header.count, place)
        place += kind.itemsize * header.count
    return fields
