"""The items of a PLY file's elements: numbers and lists, binary or text, each counted against the file's size."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.io.polygons.numbers import floats_of, integers_of, no_number

Buffer = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Property:
    """A number of an item, or a list of numbers: its name, NumPy's type, and that of its length, if it is a list."""

    name: str
    kind: np.dtype[Any]
    length: np.dtype[Any] | None = None


@dataclass(frozen=True)
class Element:
    """A kind of items, and how many there are."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Items:
    """The items of an element.

    Attributes
    ----------
    numbers : dict of str to (n,) ndarray
    lists : dict of str to ((n,) ndarray, (m,) ndarray)
        Lengths, and the numbers of all lists, one after another.
    """

    numbers: dict[str, npt.NDArray[Any]] = field(default_factory=dict)
    lists: dict[str, tuple[IntArray, npt.NDArray[Any]]] = field(default_factory=dict)


def read_binary_items(file: Path, start: int, elements: list[Element], wanted: set[str]) -> dict[str, Items]:
    """Return the items of the wanted elements of a binary file, whose first byte is at `start`.

    Raises
    ------
    InputError
        If the file is too short for what its header names.
    """
    if file.stat().st_size <= start:
        return {element.name: _empty(file, element) for element in elements if element.name in wanted}
    data = np.fromfile(file, np.uint8, offset=start)  # not mapped: a file that shrinks would end the process
    found, place, missing = {}, 0, set(wanted)
    for element in elements:
        if not missing:
            break
        items, place = _element(data, place, element, file)
        if element.name in wanted:
            found[element.name] = items
        missing.discard(element.name)
    return found


def _empty(file: Path, element: Element) -> Items:
    if element.count:
        raise _cut_off(file, element)
    return Items({each.name: np.empty(0, each.kind) for each in element.properties if each.length is None})


def _cut_off(file: Path, element: Element) -> InputError:
    return InputError(
        f"{file}: is too short for the {element.count:,} items ({element.name}) of its header; it was cut off, "
        "copy it again"
    )


def _element(data: Buffer, place: int, element: Element, file: Path) -> tuple[Items, int]:
    """Return the items of an element that begins at a place, and the place behind them."""
    if not element.count or not element.properties:
        return Items(), place
    lists = [each for each in element.properties if each.length is not None]
    # As a rule all lists are as long as those of the first item: triangles.
    lengths = _lengths_at(data, place, element)
    record = _record(element, lengths) if lengths is not None else None
    if record is not None and place + record.itemsize * element.count <= len(data):
        rows = data[place : place + record.itemsize * element.count].view(record)
        if all(np.all(rows[f"{each.name} length"] == lengths[each.name]) for each in lists):  # type: ignore[index]
            return _of_rows(rows, element), place + record.itemsize * element.count
    elif not lists or record is None:
        raise _cut_off(file, element)
    return _walk(data, place, element, file)


def _lengths_at(data: Buffer, place: int, element: Element) -> dict[str, int] | None:
    """Return the length of each list of the item at a place, or None where the file ends before."""
    lengths: dict[str, int] = {}
    for each in element.properties:
        kind = each.length or each.kind
        if place + kind.itemsize > len(data):
            return None
        if each.length is not None:
            lengths[each.name] = length = int(data[place : place + kind.itemsize].view(kind)[0])
            place += kind.itemsize + length * each.kind.itemsize
            if length < 0 or place > len(data):
                return None
        else:
            place += kind.itemsize
    return lengths


def _record(element: Element, lengths: dict[str, int]) -> np.dtype[Any]:
    """Return the type of an item whose lists have given lengths."""
    fields: list[tuple[Any, ...]] = []
    for each in element.properties:
        if each.length is None:
            fields.append((each.name, each.kind))
        else:
            fields += [(f"{each.name} length", each.length), (each.name, each.kind, (lengths[each.name],))]
    return np.dtype(fields)


def _of_rows(rows: npt.NDArray[np.void], element: Element) -> Items:
    items = Items()
    for each in element.properties:
        if each.length is None:
            items.numbers[each.name] = rows[each.name]
        else:
            values = rows[each.name]
            items.lists[each.name] = np.full(len(rows), values.shape[1], np.int64), values.reshape(-1)
    return items


def _walk(data: Buffer, place: int, element: Element, file: Path) -> tuple[Items, int]:
    """Go through items one by one, whose lists have different lengths."""
    numbers: dict[str, list[Any]] = {each.name: [] for each in element.properties if each.length is None}
    lists: dict[str, list[Any]] = {each.name: [] for each in element.properties if each.length is not None}
    content: Any = data
    for _ in range(element.count):
        for each in element.properties:
            length = 1
            if each.length is not None:
                if place + each.length.itemsize > len(data):
                    raise _cut_off(file, element)
                length = int(np.frombuffer(content, each.length, 1, place)[0])
                place += each.length.itemsize
            end = place + length * each.kind.itemsize
            if not place <= end <= len(data):
                raise _cut_off(file, element)
            values = np.frombuffer(content, each.kind, length, place) if length else np.empty(0, each.kind)
            if each.length is not None:
                lists[each.name].append(values)
            else:
                numbers[each.name].append(values[0])
            place = end
    items = Items({name: np.array(values) for name, values in numbers.items()})
    for name, rows in lists.items():
        items.lists[name] = np.array([len(row) for row in rows], np.int64), np.concatenate([np.empty(0), *rows])
    return items, place


def read_text_items(file: Path, start: int, elements: list[Element], wanted: set[str]) -> dict[str, Items]:
    """Return the items of the wanted elements of a text, whose first byte is at `start`: one in a line.

    Raises
    ------
    InputError
        If the file is too short for what its header names, or has no number where one belongs.
    """
    found, missing = {}, set(wanted)
    with file.open("rb") as stream:
        stream.seek(start)
        lines = (line for line in stream if not line.isspace())
        for element in elements:
            if not missing:
                break
            items = _text_element(lines, element, file)
            if element.name in wanted:
                found[element.name] = items
            missing.discard(element.name)
    return found


def _text_element(lines: Iterator[bytes], element: Element, file: Path) -> Items:
    if not element.count or not element.properties:
        return Items()
    if any(each.length is not None for each in element.properties):
        return _text_lists([line.split() for line in islice(lines, element.count)], element, file)
    width = len(element.properties)
    try:
        rows = np.loadtxt(islice(lines, element.count), usecols=range(width), comments=None, ndmin=2)
    except ValueError as cause:
        raise no_number(file, cause) from cause
    if len(rows) < element.count:
        raise _cut_off(file, element)
    return Items({each.name: _cast(rows[:, k], each, file) for k, each in enumerate(element.properties)})


def _text_lists(rows: list[list[bytes]], element: Element, file: Path) -> Items:
    """Return items with lists from the words of their lines."""
    if len(rows) < element.count:
        raise _cut_off(file, element)
    places, items = [0] * len(rows), Items()
    for each in element.properties:
        if each.length is None:
            sizes = [1] * len(rows)
        else:
            if any(place >= len(words) for place, words in zip(places, rows, strict=True)):
                raise _cut_off(file, element)
            sizes = integers_of((words[place] for place, words in zip(places, rows, strict=True)), file).tolist()
            places = [place + 1 for place in places]
        ends = [place + size for place, size in zip(places, sizes, strict=True)]
        if any(not place <= end <= len(words) for place, end, words in zip(places, ends, rows, strict=True)):
            raise _cut_off(file, element)
        words_of = (w for place, end, words in zip(places, ends, rows, strict=True) for w in words[place:end])
        values = _cast(floats_of(words_of, file), each, file)
        if each.length is None:
            items.numbers[each.name] = values
        else:
            items.lists[each.name] = np.array(sizes, np.int64), values
        places = ends
    return items


def _cast(values: npt.NDArray[np.float64], each: Property, file: Path) -> npt.NDArray[Any]:
    """Return the numbers of a text in the type that the header gives them; whole ones must be."""
    if each.kind.kind == "f":
        return values
    limits = np.iinfo(each.kind)
    if not np.all((values >= limits.min) & (values <= limits.max) & (values == np.floor(values))):
        raise InputError(
            f"{file}: {each.name} has numbers that are no {each.kind.name}; it is damaged, export it again"
        )
    return values.astype(each.kind)
