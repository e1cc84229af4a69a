"""Models on disk: one file with a header and plain arrays, which is mapped into memory when read.

Layout: 8 bytes of magic, 8 of the header's length, 4 of its CRC-32, a JSON header, and the arrays, each
aligned to 64 bytes, a large one first. The header is a tree of plain values; an array in it is a place in the file
with its own CRC-32, an object is the name of its class and its state. Nothing is executed in reading: no pickle,
and only classes that the reader names can come out.
"""

import json
import math
import os
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np

from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.machine import release_pages
from o3dleaf.io.models import model_draft

SUFFIX = ".o3l"
MAGIC = b"o3dleaf\n"
FORMAT = 4
"""Raised when an older reader could not make sense of a newer file, or a newer one of an older file."""
OLDEST = 2
"""The oldest format that can still be read."""
UNSUMMED = 3
"""The last format without sums of its arrays."""
PREFIX = struct.Struct("<8sQI")
ALIGNMENT = 64
PART = 1 << 26
"""Bytes of an array that are summed at once."""
KINDS = "biuf"
"""Kinds of numbers that arrays may hold: no objects."""
MAX_AXES = 8


def write_model(model: object, path: str | PathLike[str]) -> None:
    """Write an object as one file, whole or not at all.

    An object is a dataclass, saved field by field, or has ``state() -> dict`` to return its parts. What was renamed
    after files had been written keeps its name there: a field by ``field(metadata={"stored": "name in the file"})``, a
    class by an attribute ``stored_class = "name in the file"`` of its own.
    """
    target = require_writable(path)
    arrays: list[np.ndarray[Any, Any]] = []
    tree = _pack(model, arrays)
    order = list(range(len(arrays)))
    largest = max(order, key=lambda n: arrays[n].nbytes, default=0)
    large = bool(arrays) and arrays[largest].nbytes >= model_draft.LARGE
    if large:
        # Behind a head of a known size: it may lie there before the rest is known.
        order.insert(0, order.pop(largest))
    header: dict[str, Any] = {"format": FORMAT, "o3dleaf": version("o3dleaf"), "model": tree}
    blocks, offset = [dict[str, Any]() for _ in arrays], 0
    for n in order:
        array = arrays[n]
        blocks[n] = {"dtype": array.dtype.str, "shape": array.shape, "offset": offset, "crc": _checksum(array)}
        offset += -(-array.nbytes // ALIGNMENT) * ALIGNMENT
    header |= {"arrays": blocks, "bytes": offset}
    text = json.dumps(header, ensure_ascii=False).encode()
    text += b" " * (-(PREFIX.size + len(text)) % (model_draft.HEAD if large else ALIGNMENT))
    head = PREFIX.pack(MAGIC, len(text), zlib.crc32(text)) + text
    draft = model_draft.current_draft()
    if draft is not None and draft.holds(target, arrays[largest] if large else None, len(head)):
        with draft.temporary.open("r+b") as stream:
            _write(stream, head, [arrays[n] for n in order], already=1)
        draft.is_whole = True
        return
    with whole_file(target, len(head) + offset) as temporary, temporary.open("wb") as stream:
        _write(stream, head, [arrays[n] for n in order])


def _checksum(array: np.ndarray[Any, Any]) -> int:
    """Return the CRC-32 of an array; of a mapped one, a part is in memory at a time."""
    if not array.nbytes:
        return 0
    checksum, content = 0, array.reshape(-1).view(np.uint8).data
    for start in range(0, len(content), PART):
        checksum = zlib.crc32(content[start : start + PART], checksum)
        if len(content) > PART:
            release_pages(array)
    return checksum


def _write(stream: IO[bytes], head: bytes, arrays: list[np.ndarray[Any, Any]], already: int = 0) -> None:
    """Write the head and the arrays, of which the first ones may be there `already`."""
    stream.write(head)
    for number, array in enumerate(arrays):
        if number < already:
            stream.seek(array.nbytes, os.SEEK_CUR)
        else:
            stream.write(array.data if array.nbytes else b"")
        stream.write(b"\0" * (-array.nbytes % ALIGNMENT))


def read_model(
    path: str | PathLike[str], classes: Mapping[str, Callable[..., Any]], check: Callable[[object], None]
) -> Any:
    """Return the object of a model file; its arrays are looked over once and stay on disk until they are used.

    Parameters
    ----------
    path : path-like
    classes : mapping of str to callable
        What makes the objects that may come out of their state: their classes, by the names that files have for them.
    check : callable
        Called with every object that was made, its parts first; raises `InputError` unless its arrays fit one another.

    Raises
    ------
    InputError
        If the file is no model, was damaged or cut off, or was written by a later version.
    """
    file = require_file(path)
    header, start = _read_header(file)
    if file.stat().st_size != start + header["bytes"]:
        raise InputError(
            f"{file}: is {file.stat().st_size} bytes long, not {start + header['bytes']}; it was cut off, copy it again"
        )
    # Copy on write: nothing reaches the disk, and Numba takes the arrays for ordinary ones.
    data = np.memmap(file, dtype=np.uint8, mode="c", offset=start) if header["bytes"] else np.empty(0, np.uint8)
    try:
        arrays = [_array(data, block, header["format"]) for block in header["arrays"]]
        return _unpack(header["model"], arrays, classes, check)
    except MemoryError:
        raise
    except Exception as cause:  # whatever it is, the file made it
        raise InputError(f"{file}: is damaged, or no whole model ({cause}); save the model again") from cause


def _array(data: np.ndarray[Any, Any], block: Mapping[str, Any], version_of_file: int) -> np.ndarray[Any, Any]:
    """Return an array of a file, or raise `ValueError` where it is not what its place says."""
    dtype, shape, offset = np.dtype(block["dtype"]), tuple(block["shape"]), block["offset"]
    if dtype.kind not in KINDS or len(shape) > MAX_AXES or any(not isinstance(n, int) or n < 0 for n in shape):
        raise ValueError(f"an array of {dtype} {shape}")
    size = dtype.itemsize * math.prod(shape)
    if not 0 <= offset <= offset + size <= len(data):
        raise ValueError("an array lies outside the file")
    flat = np.asarray(data[offset : offset + size])
    if version_of_file > UNSUMMED and zlib.crc32(flat.data) != block["crc"]:
        raise ValueError("the sum of an array is not that in the header")
    array: np.ndarray[Any, Any] = flat.view(dtype).reshape(shape)
    return array


def _read_header(file: Path) -> tuple[dict[str, Any], int]:
    """Return the header and where the arrays begin, or raise `InputError`."""
    with file.open("rb") as stream:
        prefix = stream.read(PREFIX.size)
        if len(prefix) < PREFIX.size or not prefix.startswith(MAGIC):
            raise InputError(f"{file}: is no o3dleaf model; give a file that save() or -o wrote")
        _, length, checksum = PREFIX.unpack(prefix)
        if length > file.stat().st_size:
            raise InputError(f"{file}: is too short for its header; it was cut off, copy it again")
        text = stream.read(length)
    if zlib.crc32(text) != checksum:
        raise InputError(f"{file}: its header is damaged; save the model again")
    try:
        header: dict[str, Any] = json.loads(text)
        whole = isinstance(header["format"], int) and isinstance(header["bytes"], int) and header["bytes"] >= 0
        whole = whole and isinstance(header["arrays"], list) and {"model", "o3dleaf"} <= header.keys()
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        whole = False
    if not whole:
        raise InputError(f"{file}: its header is none of a model; save the model again")
    if header["format"] > FORMAT:
        raise InputError(
            f"{file}: was written by o3dleaf {header['o3dleaf']} in format {header['format']}, "
            f"this version reads up to {FORMAT}; update o3dleaf"
        )
    if header["format"] < OLDEST:
        raise InputError(
            f"{file}: was written by o3dleaf {header['o3dleaf']} in format {header['format']}, before a release; "
            "fit and save the model again"
        )
    return header, PREFIX.size + length


def _pack(value: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    """Return a tree of plain values, its arrays moved to the list."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.ndarray):
        arrays.append(np.ascontiguousarray(value))
        return {"array": len(arrays) - 1}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple | list):
        return [_pack(item, arrays) for item in value]
    if not type(value).__module__.startswith("o3dleaf."):
        raise InputError(f"save: a {type(value).__name__} cannot be saved; only o3dleaf's own models can")
    if hasattr(value, "state"):
        state = value.state()
    elif is_dataclass(value):
        state = {name: getattr(value, field) for name, field in _stored_names(type(value)).items()}
    else:
        raise InputError(f"save: a {type(value).__name__} has no state to save")
    return {"class": stored_class(type(value)), "state": {name: _pack(part, arrays) for name, part in state.items()}}


def _unpack(
    tree: Any,
    arrays: list[np.ndarray[Any, Any]],
    classes: Mapping[str, Callable[..., Any]],
    check: Callable[[object], None],
) -> Any:
    """Return what `_pack` was given; lists come back as tuples."""
    if isinstance(tree, list):
        return tuple(_unpack(item, arrays, classes, check) for item in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if tree["class"] not in classes:
        raise InputError(f"contains a {tree['class']}, which this version does not know; update o3dleaf")
    kind = classes[tree["class"]]
    names = _stored_names(kind) if is_dataclass(kind) and not hasattr(kind, "state") else {}
    state = {names.get(name, name): _unpack(part, arrays, classes, check) for name, part in tree["state"].items()}
    made = kind(**state)
    check(made)
    return made


def stored_class(kind: type[Any]) -> str:
    """Return the name that files have for a class; a subclass does not inherit it."""
    return str(vars(kind).get("stored_class", kind.__name__))


def _stored_names(kind: type[Any]) -> dict[str, str]:
    """Return the fields of a dataclass by the names that they have in files."""
    return {field.metadata.get("stored", field.name): field.name for field in fields(kind)}
