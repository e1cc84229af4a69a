"""Headers of MetaImage, NRRD and NIfTI, looked over before SimpleITK, whose readers trust them, reads the file.

Their numbers are counted against the size of the file, packed voxels are unpacked once to see that all are there, and
the file that the voxels of a ``.mhd`` or ``.nhdr`` are in must lie beside it: a header leads nowhere else.
"""

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.stated import unit_named

HEADER = 1 << 16
"""Bytes in which a header must end."""
MAX_LINE = 4000
"""Bytes of a line."""
MAX_VOXELS = 1 << 40
BLOCK = 1 << 20
"""Bytes unpacked at once."""
META_TYPES = {
    "MET_CHAR": 1, "MET_UCHAR": 1, "MET_SHORT": 2, "MET_USHORT": 2, "MET_INT": 4, "MET_UINT": 4, "MET_LONG": 8,
    "MET_ULONG": 8, "MET_LONG_LONG": 8, "MET_ULONG_LONG": 8, "MET_FLOAT": 4, "MET_DOUBLE": 8,
}  # fmt: skip
NRRD_TYPES = {
    1: "signed char, int8, int8_t, uchar, unsigned char, uint8, uint8_t",
    2: "short, short int, signed short, signed short int, int16, int16_t, ushort, unsigned short, unsigned short int, "
    "uint16, uint16_t",
    4: "int, signed int, int32, int32_t, uint, unsigned int, uint32, uint32_t, float",
    8: "longlong, long long, long long int, signed long long, signed long long int, int64, int64_t, ulonglong, "
    "unsigned long long, unsigned long long int, uint64, uint64_t, double",
}
NRRD_SIZES = {name: size for size, names in NRRD_TYPES.items() for name in names.split(", ")}
PATIENT_SPACES = {"right-anterior-superior", "ras", "left-anterior-superior", "las", "left-posterior-superior", "lps"}
"""NRRD's names of spaces that DICOM has in millimeters."""
NIFTI_SIZES = {2: 1, 4: 2, 8: 4, 16: 4, 64: 8, 256: 1, 512: 2, 768: 4, 1024: 8, 1280: 8}
"""Bytes of NIfTI's types by their codes."""
NIFTI_UNITS = (1, 2, 3)
"""Codes, in three bits, of meters, millimeters and micrometers; 0 is unknown."""
NIFTI_HEADER = 348


@dataclass(frozen=True)
class Voxels:
    """Place and size of voxels in a file; if they are packed, zlib's window bits, and the bytes that are packed.

    And the unit of their lattice, None where the header leaves it open.
    """

    file: Path
    start: int
    size: int
    unit: str | None
    packed: int | None = None
    packed_size: int = MAX_VOXELS


def require_sane_header(path: Path) -> str | None:
    """Raise `InputError` where a header makes no sense, leads elsewhere, or names more than there is.

    Returns the unit that it states.
    """
    name = path.name.lower()
    parse = next(parse for suffixes, parse in PARSERS if name.endswith(suffixes))
    try:
        voxels = parse(path)
    except (ValueError, KeyError, IndexError, OverflowError, struct.error) as cause:
        raise InputError(
            f"{path}: its header is damaged, or of a kind that is not read ({cause}); export it again"
        ) from cause
    _require_all(path, voxels)
    return voxels.unit


def _require_all(path: Path, voxels: Voxels) -> None:
    """Raise `InputError` unless all voxels are there."""
    if not voxels.file.is_file():
        raise InputError(f"{path}: its voxels are in {voxels.file.name}, which is not there; copy both")
    size = voxels.file.stat().st_size - voxels.start
    if voxels.packed is not None:
        size = _unpacked_size(voxels)
    if size < voxels.size:
        raise InputError(
            f"{path}: is truncated, {size} bytes where {voxels.size} are expected; copy or export it again"
        )


def _unpacked_size(voxels: Voxels) -> int:
    """Return how many bytes are packed in a file; none that does not end as it should."""
    unpacker, size = zlib.decompressobj(voxels.packed or zlib.MAX_WBITS), 0
    with voxels.file.open("rb") as stream:
        stream.seek(voxels.start)
        left = voxels.packed_size
        rest = stream.read(min(left, BLOCK))
        try:
            while rest and not unpacker.eof and size <= voxels.size:
                size += len(unpacker.decompress(rest, 1 << 22))
                left -= 0 if unpacker.unconsumed_tail else BLOCK
                rest = unpacker.unconsumed_tail or stream.read(min(max(left, 0), BLOCK))
        except zlib.error:
            return 0
    return size if unpacker.eof or size > voxels.size else 0


def _lines(path: Path, end: Callable[[bytes], int]) -> tuple[list[str], int]:
    """Return the lines of a header and where it ends."""
    with path.open("rb") as stream:
        head = stream.read(HEADER)
    stop = end(head)
    if stop <= 0:
        raise ValueError("it does not end")
    if any(byte < 32 and byte not in b"\t\r\n" for byte in head[:stop]):
        raise ValueError("it is no text")
    lines = head[:stop].decode("latin-1").splitlines()
    if any(len(line) > MAX_LINE for line in lines):
        raise ValueError("a line has no end")
    return lines, stop


def _whole(words: str, count: int, name: str) -> list[int]:
    """Return `count` whole numbers above zero."""
    numbers = [int(word) for word in words.split() if word.isascii() and word.isdigit()]
    if len(numbers) != count or len(words.split()) != count or not all(0 < each < MAX_VOXELS for each in numbers):
        raise ValueError(f"{name}: {words[:60]}")
    return numbers


def _finite(words: str, count: int, name: str) -> None:
    """Raise unless there are `count` numbers that are finite."""
    numbers = [float(word) for word in words.split()]
    if len(numbers) != count or not np.all(np.isfinite(numbers)):
        raise ValueError(f"{name}: {words[:60]}")


def _beside(path: Path, name: str) -> Path:
    """Return the file of the voxels, which lies beside its header."""
    if not name or name in {".", ".."} or any(letter in name for letter in "/\\:%"):
        raise ValueError(f"its voxels are in {name[:60]!r}, not in one file beside it")
    return path.parent / name


META_NUMBERS = {"TransformMatrix": 9, "Orientation": 9, "Rotation": 9, "Offset": 3, "Position": 3, "Origin": 3}
META_NUMBERS |= {"CenterOfRotation": 3, "ElementSpacing": 3, "ElementSize": 3}


def _meta(path: Path) -> Voxels:
    """Return where the voxels of a MetaImage are."""

    def end(head: bytes) -> int:
        last = head.find(b"ElementDataFile")
        return head.find(b"\n", last) + 1 or (len(head) if last >= 0 and len(head) < HEADER else 0) if last >= 0 else 0

    lines, stop = _lines(path, end)
    entries: dict[str, str] = {}
    for line in lines:
        key, sign, value = (part.strip() for part in line.partition("="))
        if line.strip() and (not sign or (key in entries and key != "CenterOfRotation")):
            raise ValueError(f"the line {line[:60]!r}")
        entries[key] = value
    if entries.get("ObjectType", "Image") != "Image" or entries["NDims"] != "3":
        raise ValueError("it is no image in three dimensions")
    if entries.get("ElementNumberOfChannels", "1") != "1":
        raise ValueError("it is in color")
    if entries.get("BinaryData", "True").lower() != "true" or entries.get("HeaderSize", "0") not in {"0", "-1"}:
        raise ValueError("its voxels are text, or behind a header of their own")
    for name, count in META_NUMBERS.items():
        if name in entries:
            _finite(entries[name], count, name)
    size = prod(_whole(entries["DimSize"], 3, "DimSize")) * META_TYPES[entries["ElementType"]]
    packed = _truth(entries.get("CompressedData", "False"))
    packed_size = _whole(entries["CompressedDataSize"], 1, "CompressedDataSize")[0] if packed else MAX_VOXELS
    apart = entries["ElementDataFile"]
    where, start = (path, stop) if apart.upper() == "LOCAL" else (_beside(path, apart), 0)
    # Millimeters are what ITK, whose format it is, means by its lengths.
    unit = unit_named(entries.get("DistanceUnits", "mm"))
    return Voxels(where, start, size, unit, zlib.MAX_WBITS if packed else None, packed_size)


def _truth(word: str) -> bool:
    if word.lower() not in {"true", "false"}:
        raise ValueError(f"{word[:20]!r} is neither True nor False")
    return word.lower() == "true"


def _nrrd(path: Path) -> Voxels:
    """Return where the voxels of an NRRD are."""

    def end(head: bytes) -> int:
        ends = [place + len(gap) for gap in (b"\n\n", b"\r\n\r\n") if (place := head.find(gap)) >= 0]
        return min(ends, default=len(head) if path.suffix.lower() == ".nhdr" and len(head) < HEADER else 0)

    lines, stop = _lines(path, end)
    if not (lines[0].startswith("NRRD000") and lines[0][7:].isdigit()):
        raise ValueError("it does not begin with NRRD")
    entries: dict[str, str] = {}
    for line in lines[1:]:
        if not line.strip() or line.startswith("#") or ":=" in line:
            continue
        key, sign, value = line.partition(": ")
        if not sign or key.strip().lower() in entries:
            raise ValueError(f"the line {line[:60]!r}")
        entries[key.strip().lower()] = value.strip()
    if entries["dimension"] != "3":
        raise ValueError("it is not in three dimensions")
    if any(entries.get(each, "0") != "0" for each in ("byte skip", "byteskip", "line skip", "lineskip")):
        raise ValueError("its voxels are behind a header of their own")
    size = prod(_whole(entries["sizes"], 3, "sizes")) * NRRD_SIZES[entries["type"].lower()]
    encodings = {"raw": None, "gzip": 16 + zlib.MAX_WBITS, "gz": 16 + zlib.MAX_WBITS}
    packed = encodings[entries["encoding"].lower()]
    apart = entries.get("data file", entries.get("datafile"))
    where, start = (path, stop) if apart is None else (_beside(path, apart.removeprefix("./")), 0)
    return Voxels(where, start, size, _nrrd_unit(entries), packed)


def _nrrd_unit(entries: dict[str, str]) -> str | None:
    """Return the unit of an NRRD's axes; a patient's space, as `left-posterior-superior`, is in millimeters."""
    words = set(re.findall(r'"([^"]*)"', entries.get("space units", "") + entries.get("units", "")))
    if len(words) > 1:
        raise ValueError(f"its axes are in {', '.join(sorted(words))}")
    return unit_named(words.pop()) if words else "mm" if entries.get("space", "").lower() in PATIENT_SPACES else None


def _nifti(path: Path) -> Voxels:
    """Look over the header of a NIfTI; whether all packed voxels are there is asked by its reader."""
    packed = path.suffix.lower() == ".gz"
    with path.open("rb") as stream:
        head = stream.read(HEADER)
    if packed:
        try:
            head = zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(head, NIFTI_HEADER)
        except zlib.error as cause:
            raise ValueError(str(cause)) from cause
    order = next((order for order in "<>" if struct.unpack_from(f"{order}i", head)[0] == NIFTI_HEADER), None)
    if order is None or len(head) < NIFTI_HEADER or head[344:348] != b"n+1\0":
        raise ValueError("it is no NIfTI of version 1 in one file")
    dimensions = struct.unpack_from(f"{order}8h", head, 40)
    kind, bits = struct.unpack_from(f"{order}2h", head, 70)
    spacing = struct.unpack_from(f"{order}8f", head, 76)
    (start,) = struct.unpack_from(f"{order}f", head, 108)
    codes = struct.unpack_from(f"{order}2h", head, 252)
    place = struct.unpack_from(f"{order}18f", head, 256)
    if dimensions[0] != 3 and not (dimensions[0] == 4 and dimensions[4] == 1):
        raise ValueError("it is not in three dimensions")
    if min(dimensions[1:4]) < 1 or NIFTI_SIZES[kind] * 8 != bits or not NIFTI_HEADER <= start < MAX_VOXELS:
        raise ValueError(f"{dimensions[1:4]} voxels of {bits} bits from byte {start}")
    if not np.all(np.isfinite((*spacing[:4], *place))) or not all(0 <= code <= 5 for code in codes):
        raise ValueError("its place has numbers that are none")
    # SimpleITK turns meters and micrometers into millimeters.
    unit = "mm" if head[123] & 7 in NIFTI_UNITS else None
    return (
        Voxels(path, 0, 0, unit)
        if packed
        else Voxels(path, int(start), prod(dimensions[1:4]) * NIFTI_SIZES[kind], unit)
    )


PARSERS: tuple[tuple[tuple[str, ...], Callable[[Path], Voxels]], ...] = (
    ((".mha", ".mhd"), _meta),
    ((".nrrd", ".nhdr"), _nrrd),
    ((".nii", ".nii.gz"), _nifti),
)
