"""Headers of DICOM files, looked over before GDCM, which trusts them, reads the file.

Every element is walked, to the file's end and into sequences: its length stays within what it is in, and the pixels are
as many as rows, columns and frames say.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from o3dleaf.core.errors import InputError

START = 128
"""Where DICM stands, and what is stated of the file begins behind it."""
IMPLICIT, EXPLICIT, SWAPPED = "1.2.840.10008.1.2", "1.2.840.10008.1.2.1", "1.2.840.10008.1.2.2"
PACKED = ("1.2.840.10008.1.2.4.", "1.2.840.10008.1.2.5")
"""How elements are written: without or with their kind, high byte first; or with packed pixels (JPEG, runs)."""
LONG = b"OB OD OF OL OV OW SQ SV UC UN UR UT UV".split()
SHORT = b"AE AS AT CS DA DS DT FD FL IS LO LT PN SH SL SS ST TM UI UL US".split()
"""Kinds of values whose length takes four and two bytes."""
OPEN = 0xFFFFFFFF
"""Length of what ends by a mark."""
ITEM, ITEM_END, SEQUENCE_END = (0xFFFE, 0xE000), (0xFFFE, 0xE00D), (0xFFFE, 0xE0DD)
PIXELS = (0x7FE0, 0x0010)
OTHER_PIXELS = ((0x7FE0, 0x0008), (0x7FE0, 0x0009))
"""Of floating point, which GDCM does not read."""
DEEPEST = 16
"""Sequences in sequences."""
MAX_TEXT = 1024
"""Bytes of a value that is looked at."""
SERIES, PLACE, TURN, NUMBER = (0x0020, 0x000E), (0x0020, 0x0032), (0x0020, 0x0037), (0x0020, 0x0013)
SYNTAX, SAMPLES, FRAMES = (0x0002, 0x0010), (0x0028, 0x0002), (0x0028, 0x0008)
ROWS, COLUMNS, BITS = (0x0028, 0x0010), (0x0028, 0x0011), (0x0028, 0x0100)
KEPT = (SYNTAX, SERIES, PLACE, TURN, NUMBER, FRAMES, SAMPLES, ROWS, COLUMNS, BITS)
"""What is said of the pixels, by the tags of the standard."""

Tag = tuple[int, int]


@dataclass(frozen=True)
class Slice:
    """The header of a file with pixels.

    Attributes
    ----------
    file : Path
    series : str
        The identifier of the series that it belongs to.
    packed : bool
        Whether its pixels go through a codec.
    bytes : int
        What its pixels take, unpacked.
    order : tuple of float
        By which the slices of a series are sorted: how far along their normal, and their number.
    place : tuple of float
        Of the first pixel, in millimeters; empty where it is not said.
    """

    file: Path
    series: str
    packed: bool
    bytes: int
    order: tuple[float, float]
    place: tuple[float, ...]


def is_dicom(file: Path) -> bool:
    """Return whether a file begins as DICOM does."""
    with file.open("rb") as stream:
        return stream.read(START + 4)[START:] == b"DICM"


def look_over(file: Path) -> Slice | None:
    """Return what the header of a file says; None if it has no pixels, as an index of a disk.

    Raises
    ------
    InputError
        If it is damaged, cut off, or written in a way that is not read.
    """
    if not is_dicom(file):
        raise InputError(f"{file}: does not begin as DICOM does; export it again")
    try:
        with file.open("rb") as stream:
            return _slice_of(file, Walk(stream, file.stat().st_size))
    except (ValueError, KeyError, IndexError, struct.error) as cause:
        raise InputError(
            f"{file}: is truncated, its header is damaged, or of a kind that is not read ({cause}); export it again"
        ) from cause


class Walk:
    """A walk over the elements of a file, which notes what they say of its pixels."""

    def __init__(self, stream: BinaryIO, size: int) -> None:
        self.stream, self.size = stream, size
        self.values: dict[Tag, bytes] = {}
        self.pixels: int | None = None
        self.order, self.explicit = "<", True
        stream.seek(START + 4)
        self.elements(size, 0, stop=lambda tag: tag[0] != 2)
        self.syntax = self.text(SYNTAX)
        if self.syntax not in {IMPLICIT, EXPLICIT, SWAPPED} and not self.syntax.startswith(PACKED):
            raise ValueError(f"transfer syntax {self.syntax[:64]!r}")
        self.explicit, self.order = self.syntax != IMPLICIT, ">" if self.syntax == SWAPPED else "<"
        self.elements(size, 0)

    def text(self, tag: Tag) -> str:
        """Return what a text says; "" if there is none."""
        return self.values.get(tag, b"").decode("latin-1").strip("\0 ")

    def numbers(self, tag: Tag) -> list[float]:
        """Return the numbers in a text; none if there is none."""
        return [float(word) for word in self.text(tag).split("\\") if word.strip()]

    def count(self, tag: Tag, default: int | None = None) -> int:
        """Return a count."""
        if tag not in self.values and default is not None:
            return default
        return int(struct.unpack(f"{self.order}H", self.values[tag])[0])

    def elements(self, end: int, depth: int, stop: Callable[[Tag], bool] = lambda _: False) -> None:
        """Walk over elements up to a place, to the mark of an item's end, or to a tag."""
        if depth > DEEPEST:
            raise ValueError("sequences without end")
        while self.stream.tell() < end:
            begin = self.stream.tell()
            tag = self._tag(end)
            if stop(tag):
                self.stream.seek(begin)
                return
            if tag == ITEM_END:
                self._number("I", end)
                return
            self._element(tag, end, depth)

    def _element(self, tag: Tag, end: int, depth: int) -> None:
        """Walk over the value of an element, and keep what it says of the pixels."""
        if tag in OTHER_PIXELS:
            raise ValueError("pixels of floating point")
        kind, length = self._length(end)
        if tag == PIXELS and length == OPEN:
            size = self._fragments(end)
            self.pixels = self.pixels if depth else size
        elif length == OPEN:
            self._sequence(end, depth, explicit=self.explicit and kind != b"UN")
        elif kind == b"SQ":
            self._sequence(self._within(length, end), depth, explicit=self.explicit)
        else:
            after = self._within(length, end)
            if depth == 0 and tag in KEPT:
                if tag in self.values:
                    raise ValueError(f"the element {tag[0]:04x},{tag[1]:04x} twice")
                self.values[tag] = self.stream.read(min(length, MAX_TEXT))
            if depth == 0 and tag == PIXELS:
                self.pixels = length
            self.stream.seek(after)

    def _sequence(self, end: int, depth: int, *, explicit: bool) -> None:
        """Walk over the items of a sequence, up to a place or to its mark."""
        before, self.explicit = self.explicit, explicit
        while self.stream.tell() < end:
            tag, length = self._tag(end), self._number("I", end)
            if tag == SEQUENCE_END:
                break
            if tag != ITEM:
                raise ValueError("a sequence of no items")
            self.elements(end if length == OPEN else self._within(length, end), depth + 1)
        self.explicit = before

    def _fragments(self, end: int) -> int:
        """Walk over packed pixels, and return how many bytes they are."""
        total = 0
        while True:
            tag, length = self._tag(end), self._number("I", end)
            if tag == SEQUENCE_END:
                return total
            if tag != ITEM:
                raise ValueError("pixels in no items")
            self.stream.seek(self._within(length, end))
            total += length

    def _tag(self, end: int) -> Tag:
        return self._number("H", end), self._number("H", end)

    def _length(self, end: int) -> tuple[bytes, int]:
        """Return the kind of a value, "" where it is not written, and its length."""
        if not self.explicit:
            return b"", self._number("I", end)
        kind = self._read(2, end)
        if kind in SHORT:
            return kind, self._number("H", end)
        if kind not in LONG:
            raise ValueError(f"a value of kind {kind!r}")
        self._read(2, end)
        return kind, self._number("I", end)

    def _number(self, kind: str, end: int) -> int:
        return int(struct.unpack(self.order + kind, self._read(struct.calcsize(kind), end))[0])

    def _read(self, count: int, end: int) -> bytes:
        self._within(count, end)
        return self.stream.read(count)

    def _within(self, length: int, end: int) -> int:
        """Return where a value ends."""
        after = self.stream.tell() + length
        if after > end:
            raise ValueError(f"{length} bytes where {end - self.stream.tell()} are left")
        return after


def _slice_of(file: Path, walk: Walk) -> Slice | None:
    """Return what a walk found; None without pixels."""
    if walk.pixels is None:
        return None
    frames, bits = int(walk.text(FRAMES) or 1), walk.count(BITS)
    if frames < 1 or bits not in {8, 16, 32} or walk.count(SAMPLES, 1) != 1:
        raise ValueError(f"{frames} frames of {walk.count(SAMPLES, 1)} samples of {bits} bits")
    size = walk.count(ROWS) * walk.count(COLUMNS) * frames * bits // 8
    packed = walk.syntax.startswith(PACKED)
    if not size or (walk.pixels < size and not packed):
        raise ValueError(f"{walk.pixels} bytes of pixels where {size} are expected")
    place = walk.numbers(PLACE)
    order = _order(place, walk.numbers(TURN), walk)
    return Slice(file, walk.text(SERIES), packed, size, order, tuple(place) if len(place) == 3 else ())


def _order(place: list[float], turn: list[float], walk: Walk) -> tuple[float, float]:
    """Return how far a slice is along its normal, if it says so, and its number."""
    along = 0.0
    if len(place) == 3 and len(turn) == 6:
        (a, b, c), (d, e, f) = turn[:3], turn[3:]
        normal = b * f - c * e, c * d - a * f, a * e - b * d
        along = sum(x * n for x, n in zip(place, normal, strict=True))
    number = next(iter(walk.numbers(NUMBER)), 0.0)
    if not all(map(math.isfinite, (along, number, *place))):
        raise ValueError("a place that is none")
    return along, number
