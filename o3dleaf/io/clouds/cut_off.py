"""Whether a cloud of PTS or columns of text was cut off, where Open3D reads on as if it were whole."""

from collections.abc import Callable
from pathlib import Path

from o3dleaf.core.errors import InputError

MAX_DIGITS = 15
"""Of a number of points."""


def require_whole_cloud(file: Path) -> None:
    """Raise `InputError` if a file holds fewer points than it says, or its last line is shorter than its first.

    PTS says how many in its first line. A text that was cut off at the end of a line, in a format
    that says no number, cannot be told from a whole one.
    """
    check = CHECKS.get(file.suffix.lower())
    if check is not None:
        check(file)


def _check_pts(file: Path) -> None:
    with file.open("rb") as stream:
        first = stream.readline().split()
    if len(first) != 1 or not first[0].isdigit() or len(first[0]) > MAX_DIGITS:
        raise InputError(f"{file}: its first line is no number of points; give PTS, or name the file .xyz")
    _require_lines(file, len(first[0]), int(first[0]))


def _check_columns(file: Path) -> None:
    _require_lines(file, 0, None)


def _require_lines(file: Path, start: int, count: int | None) -> None:
    """Raise `InputError` if from a byte on fewer lines than `count` begin with a number, or the last is shorter."""
    lines, first, last = 0, b"", b""
    with file.open("rb") as stream:
        stream.seek(start)
        for line in stream:
            if _begins_with_number(line):
                lines, first, last = lines + 1, first or line, line
    if count is not None and lines < count:
        raise too_short(file, count)
    if len(last.split()) < len(first.split()):
        raise InputError(f"{file}: its last line has fewer columns than its first; it was cut off, copy it again")


def _begins_with_number(line: bytes) -> bool:
    """Return whether a line is one of a point: comments and names of columns are not."""
    words = line.split(maxsplit=1)
    try:
        float(words[0])
    except (IndexError, ValueError):
        return False
    return True


def too_short(file: Path, count: int) -> InputError:
    """Return the error of a file that ends before so many points."""
    return InputError(f"{file}: is too short for the {count:,} points that it names; it was cut off, copy it again")


CHECKS: dict[str, Callable[[Path], None]] = {
    ".pts": _check_pts,
    ".xyz": _check_columns,
    ".xyzn": _check_columns,
    ".xyzrgb": _check_columns,
}
"""By suffix; other formats are counted by their readers."""
