"""Text files of points: one in a line, columns between blanks, tabs, commas or semicolons."""

import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from o3dleaf.core import journal
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import DataWarning, InputError
from o3dleaf.io.clouds.columns import GROUPS, Columns
from o3dleaf.io.clouds.header import TextHead, is_comment, lines_of, read_head, shown

SUFFIXES = (".txt", ".csv", ".asc")
DECIMAL_COMMAS = re.compile(r"\d,\d+\s+[+-]?\d+,\d")
"""Two numbers with commas for points, and blanks between them."""

MIN_COUNTED = 10
"""Lines that a column counts, at least: of fewer points any coordinate may."""
ASKED, UNIT = 100, 0.01
"""Points from the first on of which normals are known by their length, and what of it roundings may take."""


def read_text(file: Path, columns: str | Sequence[str] | None = None) -> Columns:
    """Return the points of a text file, with normals and colors where it names them.

    A header names the columns, in a line of its own or in a comment: x, y, z; nx, ny, nz; r, g, b or red, green, blue;
    others, such as intensity, are not read. Without a header the first three columns are x, y and z, and no other is
    guessed at; three more that are unit vectors, as normals are, are told. A first column that only counts the lines,
    and that no name is meant for, is left out and told. Comments begin with # or //. A unit beside a name is not looked
    at: coordinates come as they stand.

    Parameters
    ----------
    file : Path
    columns : str or sequence of str, optional
        Names of the columns from the first on, instead of the header's: "x y z - - - nx ny nz". A name that is not
        known leaves its column out.

    Raises
    ------
    InputError
        If there is no point, columns are missing, or a line has no number where one belongs; it names the line.
    """
    found = _columns(file, read_head(file, columns))
    return found if columns is not None else _as_meant(file, None, found)


def read_columns(file: Path, names: str) -> Columns:
    """Return the points of a text whose first columns are known by its suffix, as "x y z nx ny nz".

    A column before them that only counts the lines is left out and told.

    Raises
    ------
    InputError
        If a line has no number where one belongs; it names the line.
    """
    words = names.split()
    try:
        # In compiled code, as long as nothing but numbers and comments stands there.
        rows = np.loadtxt(file, usecols=range(len(words)), comments="#", ndmin=2, dtype=np.float64)
    except ValueError:
        return _as_meant(file, names, _columns(file, read_head(file, names)))
    groups = {group: [words.index(name) for name in each] for group, each in GROUPS.items() if set(each) <= set(words)}
    return _as_meant(file, names, Columns(**{group: rows[:, places] for group, places in groups.items()}))


def _as_meant(file: Path, names: str | None, found: Columns) -> Columns:
    """Return the columns of a file, all one further on where the first counts the lines; tell normals without names."""
    head = read_head(file, names)
    if head.unnamed and head.columns["x"] == 0 and _is_counter(found.points):
        journal.tell(
            f"{file}: the first of its columns counts the points and is left out: x, y and z are the next three; "
            "if it is x, name the columns, as 'x y z'",
            DataWarning,
        )
        head = head.one_further()
        found = _columns(file, head)
    with_normals = "" if found.normals is not None else _names_with_normals(file, head)
    if with_normals:
        journal.tell(
            f"{file}: no normals are read, though three more of its columns are unit vectors, as normals are; if they "
            f"are, name the columns, as '{with_normals}'",
            DataWarning,
        )
    return found


def _names_with_normals(file: Path, head: TextHead) -> str:
    """Return the names of a file's columns, three without a name as normals if they are unit vectors; empty if not."""
    count, first = head.unnamed + len(head.columns), 1 + max(head.columns.values())
    if head.unnamed < len(GROUPS["normals"]):
        return ""
    try:
        rows = _read(file, head, list(range(count)), ASKED)
    except ValueError:  # words, or lines of different lengths
        return ""
    for start in range(first, count - 2):
        if np.all(np.abs(np.linalg.norm(rows[:, start : start + 3], axis=1) - 1) <= UNIT):
            normals = {name: start + place for place, name in enumerate(GROUPS["normals"])}
            return " ".join(_in_order(head.columns | normals))
    return ""


def _in_order(columns: dict[str, int]) -> list[str]:
    """Return names by their places, - where there is none."""
    names = {place: name for name, place in columns.items()}
    return [names.get(place, "-") for place in range(1 + max(names))]


def _is_counter(points: FloatArray) -> bool:
    """Return whether the first of three columns counts the lines, or those left of them.

    Whole numbers that rise by one are no coordinate of a surface's points; nor are such that rise by more beside
    fractions, as where points were cut out of a cloud that was counted before.
    """
    first, others = points[:, 0], points[:, 1:]
    if len(first) < MIN_COUNTED or np.any(first != np.floor(first)) or np.any(first[1:] <= first[:-1]):
        return False
    return bool(np.all(first[1:] == first[:-1] + 1) or np.any(others != np.floor(others)))


def _columns(file: Path, head: TextHead) -> Columns:
    """Return the columns that the head of a file names."""
    places = {
        group: [head.columns[name] for name in names]
        for group, names in GROUPS.items()
        if set(names) <= head.columns.keys()
    }
    used = [place for group in places.values() for place in group]
    try:
        rows = _read(file, head, used)
    except ValueError as cause:
        raise _first_fault(file, head, used) or InputError(f"{file}: cannot be read ({cause})") from cause
    parts = dict(zip(places, np.split(rows, len(places), axis=1), strict=True))
    return Columns(**parts)


def _read(file: Path, head: TextHead, used: list[int], most: int | None = None) -> FloatArray:
    """Return the columns `used` of lines with points, (n, len(used)): of all, or of at most so many."""
    lines = (head.numbers(line) for number, line in lines_of(file) if number > head.skipped)
    rows = np.loadtxt(
        islice(lines, most), delimiter=head.separator, comments=None, usecols=used, ndmin=2, dtype=np.float64
    )
    return np.asarray(rows)


def _first_fault(file: Path, head: TextHead, used: list[int]) -> InputError | None:
    """Return an error that names the first line without a number in a column that is used."""
    names = {place: name for name, place in head.columns.items()}
    for number, line in lines_of(file):
        if number <= head.skipped or is_comment(line):
            continue
        fields = head.fields(line)
        for place in used:
            try:
                float(fields[place])
            except (ValueError, IndexError):
                cure = "correct the line, or name the columns, as 'x y z'"
                if DECIMAL_COMMAS.search(line):
                    cure = "write decimals with points, not commas"
                where = f"{file}: line {number}: {shown(line)} has no number in column {place + 1}, {names[place]}"
                return InputError(f"{where}; {cure}")
    return None
