"""The header of a LAS or LAZ file, counted against the file's size before a library allocates what it names."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from o3dleaf.core.errors import InputError

SIZES = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}
"""Bytes of the public header, by minor version of LAS 1."""
SHORT = struct.Struct("<HII B H I")
"""Header size, offset of the points, variable records, point format, point size, number of points, at `AT`."""
AT = 94
PACKED = 0x80
"""Bit of the point format of LAZ files."""
RECORD, LONG_RECORD = 54, 60
"""Bytes before the content of a variable record: its length stands at 20, of eight bytes in an extended one."""
MAX_RATIO = 2000
"""No scanner's points pack tighter; equal ones might."""
LASZIP = (b"laszip encoded", 22204)
EXTRA = (b"LASF_Spec", 4)
EXTRA_SIZE = 192
ITEMS_AT = 32
VARIABLE = 0xFFFFFFFF


@dataclass(frozen=True)
class VariableRecord:
    """Something that a file says beside its points."""

    owner: bytes
    number: int
    content: bytes


def require_sane_las(file: Path) -> None:
    """Raise `InputError` where a header names more, or something else, than the file has room for."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        try:
            fault = _fault(stream, size)
        except struct.error:
            fault = "it ends in its header"
    if fault is not None:
        raise InputError(f"{file}: cannot be read as LAS ({fault}); it was cut off or damaged, copy or export it again")


def _fault(stream: IO[bytes], size: int) -> str | None:
    """Return what is wrong with a header, or None."""
    head = stream.read(375)
    if not head.startswith(b"LASF") or len(head) < SIZES[0]:
        return "it does not begin with LASF and a header"
    header_size, start, records, kind, point_size, count = SHORT.unpack_from(head, AT)
    minor = head[25]
    if head[24] != 1 or minor not in SIZES or header_size < SIZES[minor] or not header_size <= start <= size:
        return f"version {head[24]}.{minor} with a header of {header_size} bytes and points at byte {start}"
    if minor >= 4:
        extended, extended_count, count = struct.unpack_from("<QIQ", head, 235)
        if extended_count and not _extended_fit(stream, extended, extended_count, size):
            return f"{extended_count} extended records at byte {extended}"
    stream.seek(header_size)
    content = _variable_records(stream.read(start - header_size), records)
    packed = bool(kind & PACKED)
    if content is None:
        return f"{records} variable records before byte {start}"
    if not point_size or count * point_size > (MAX_RATIO if packed else 1) * (size - start):
        return f"{count} points of {point_size} bytes each in {size} bytes"
    fault = _packed_fault(stream, content, (start, size), (count, point_size)) if packed else None
    return fault or _extra_fault(content)


def _extended_fit(stream: IO[bytes], start: int, count: int, size: int) -> bool:
    """Return whether extended variable records end within the file."""
    for _ in range(count):
        if start + LONG_RECORD > size:
            return False
        stream.seek(start + 20)
        start += LONG_RECORD + int(struct.unpack("<Q", stream.read(8))[0])
    return start <= size


def _variable_records(data: bytes, count: int) -> list[VariableRecord] | None:
    """Return the variable records, or None where they reach beyond their place."""
    place, found = 0, []
    for _ in range(count):
        if place + RECORD > len(data):
            return None
        number, length = struct.unpack_from("<HH", data, place + 18)
        content = data[place + RECORD :][:length]
        if len(content) < length:
            return None
        found.append(VariableRecord(data[place + 2 : place + 18].rstrip(b"\0"), number, content))
        place += RECORD + length
    return found


def _packed_fault(
    stream: IO[bytes], records: list[VariableRecord], place: tuple[int, int], points: tuple[int, int]
) -> str | None:
    """Return what is wrong with what LAZ says of its chunks, or None."""
    (start, size), (count, point_size) = place, points
    content = next((each.content for each in records if (each.owner, each.number) == LASZIP), b"")
    (items,) = struct.unpack_from("<H", content, ITEMS_AT)
    sizes = [struct.unpack_from("<HHH", content, ITEMS_AT + 2 + 6 * k)[1] for k in range(items)]
    if sum(sizes) != point_size:
        return f"packed points of {sum(sizes)} bytes where {point_size} are named"
    (chunk,) = struct.unpack_from("<I", content, 12)
    stream.seek(start)
    (table,) = struct.unpack("<q", stream.read(8))
    if table == -1:  # written as a stream: the place stands at the end
        stream.seek(size - 8)
        (table,) = struct.unpack("<q", stream.read(8))
    if not start + 8 <= table <= size - 8:
        return f"a table of chunks at byte {table}"
    stream.seek(table)
    _, chunks = struct.unpack("<II", stream.read(8))
    expected = -(-count // chunk) if chunk not in {0, VARIABLE} else None
    if not chunk or (expected is not None and chunks != expected) or chunks > 8 * (size - table):
        return f"{chunks} chunks of {chunk} points for {count} points"
    return None


def _extra_fault(records: list[VariableRecord]) -> str | None:
    """Return what is wrong with what the file says of extra dimensions, or None."""
    content = b"".join(each.content for each in records if (each.owner, each.number) == EXTRA)
    kinds = [(content[k + 2], content[k + 3]) for k in range(0, len(content) - EXTRA_SIZE + 1, EXTRA_SIZE)]
    if len(content) % EXTRA_SIZE or any(kind > 30 or (kind == 0 and length == 0) for kind, length in kinds):
        return "extra dimensions of no size, or of an unknown type"
    return None
