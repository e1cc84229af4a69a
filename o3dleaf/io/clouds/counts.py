"""About how many points or triangles a file has, before it is read: from its header, or size and first lines."""

import struct
from collections.abc import Callable
from pathlib import Path

from o3dleaf.core.checks.files import is_file
from o3dleaf.io.clouds.npy import count_rows
from o3dleaf.io.ply_reader import count_items
from o3dleaf.io.stl import TRIANGLE, is_binary

HEAD = 1 << 16
"""Bytes of a text that are looked at."""
MIN_POINT_BYTES = 4
"""Bytes of a point where nothing is known: packed in E57 and LAZ, in a line "1 2 3"."""
TRIANGLE_BYTES = {".stl": TRIANGLE.itemsize, ".obj": 30}
"""Of a triangle at least: of OBJ half a vertex and three numbers."""
STL_TEXT_BYTES = 100
"""The same: seven lines."""
LAS_LEGACY, LAS_COUNT = struct.Struct("<107xI"), struct.Struct("<247xQ")
"""Where LAS has its number of points: until version 1.3, and from 1.4 on."""


def count_points(path: Path) -> int:
    """Return about how many points a file has; 0 where nothing can be told, and its reader will say why."""
    file = Path(path)
    if not is_file(file):
        return 0
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(HEAD)
    return min(COUNTS.get(file.suffix.lower(), _in_text)(file, head, size), size)


def _in_ply(file: Path, head: bytes, size: int) -> int:
    del head, size
    return count_items(file, "vertex")


def _in_las(file: Path, head: bytes, size: int) -> int:
    del file, size
    if len(head) < LAS_COUNT.size:
        return 0
    count: int = LAS_LEGACY.unpack_from(head)[0] or LAS_COUNT.unpack_from(head)[0]
    return count


def _in_pcd(file: Path, head: bytes, size: int) -> int:
    del file, size
    words = next((line.split() for line in head.splitlines() if line.startswith(b"POINTS ")), [])
    return int(words[1]) if len(words) > 1 and words[1].isdigit() else 0


def _in_e57(file: Path, head: bytes, size: int) -> int:
    del file, head
    return size // MIN_POINT_BYTES


def _in_stl(file: Path, head: bytes, size: int) -> int:
    del head
    return size // (TRIANGLE_BYTES[".stl"] if is_binary(file) else STL_TEXT_BYTES) // 2


def _in_npy(file: Path, head: bytes, size: int) -> int:
    del head, size
    return count_rows(file) or 0


def _in_text(file: Path, head: bytes, size: int) -> int:
    del file
    lines = head.splitlines()[1:-1] or [head]
    return size // max(sum(map(len, lines)) // len(lines) + 1, MIN_POINT_BYTES)


COUNTS: dict[str, Callable[[Path, bytes, int], int]] = {
    ".ply": _in_ply,
    ".las": _in_las,
    ".laz": _in_las,
    ".pcd": _in_pcd,
    ".e57": _in_e57,
    ".stl": _in_stl,
    ".npy": _in_npy,
}
"""By suffix; others are text, a point in a line."""


def count_triangles(path: Path) -> int:
    """Return about how many triangles a file has; 0 where nothing can be told, and its reader will say why."""
    file = Path(path)
    if not is_file(file):
        return 0
    suffix, size = file.suffix.lower(), file.stat().st_size
    count = size // TRIANGLE_BYTES.get(suffix, size + 1)
    if suffix == ".ply":
        count = count_items(file, "face")
    elif suffix == ".stl" and not is_binary(file):
        count = size // STL_TEXT_BYTES
    elif suffix == ".off":
        with file.open("rb") as stream:
            lines = (line.split(b"#")[0].split() for line in stream.read(HEAD).splitlines())
        numbers = [word for words in lines for word in words if word.isdigit()]
        count = int(numbers[1]) if len(numbers) > 1 else 0
    return min(count, size)
