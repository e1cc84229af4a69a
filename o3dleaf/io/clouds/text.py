"""Text files of points: one in a line, columns between blanks, tabs, commas or semicolons."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import GROUPS, Columns
from o3dleaf.io.clouds.header import TextHead, is_comment, lines_of, read_head, shown

SUFFIXES = (".txt", ".csv", ".asc")
DECIMAL_COMMAS = re.compile(r"\d,\d+\s+[+-]?\d+,\d")
"""Two numbers with commas for points, and blanks between them."""


def read_text(file: Path, columns: str | Sequence[str] | None = None) -> Columns:
    """Return the points of a text file, with normals and colors where it names them.

    A header names the columns, in a line of its own or in a comment: x, y, z; nx, ny, nz; r, g, b or red, green, blue;
    others, such as intensity, are not read. Without a header the first three columns are x, y and z, and no other is
    guessed at. Comments begin with # or //. A unit beside a name is not looked at: coordinates come as they stand.

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
    head = read_head(file, columns)
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


def read_columns(file: Path, names: str) -> Columns:
    """Return the points of a text whose first columns are known by its suffix, as "x y z nx ny nz".

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
        return read_text(file, names)
    groups = {group: [words.index(name) for name in each] for group, each in GROUPS.items() if set(each) <= set(words)}
    return Columns(**{group: rows[:, places] for group, places in groups.items()})


def _read(file: Path, head: TextHead, used: list[int]) -> FloatArray:
    """Return the columns `used` of all lines with points, (n, len(used))."""
    lines = (head.numbers(line) for number, line in lines_of(file) if number > head.skipped)
    rows = np.loadtxt(lines, delimiter=head.separator, comments=None, usecols=used, ndmin=2, dtype=np.float64)
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
