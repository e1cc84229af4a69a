"""The head of a text file of points: which lines are no points, what separates columns, and what they are called."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import GROUPS

COMMENTS = ("#", "//")
MAX_SHOWN = 60
"""Characters of a line that an error shows."""
ALSO = {
    "normal_x": "nx", "normal_y": "ny", "normal_z": "nz", "normalx": "nx", "normaly": "ny", "normalz": "nz",
    "red": "r", "green": "g", "blue": "b",
}  # fmt: skip
"""Other names of columns."""
COORDINATES = GROUPS["points"]


@dataclass(frozen=True)
class TextHead:
    """The layout of the lines of a text file of points.

    Attributes
    ----------
    skipped : int
        Lines before the first point.
    separator : str or None
        Between columns; None is blanks and tabs.
    columns : dict of str to int
        Numbers of the known columns, from 0.
    decimal_comma : bool
        Whether 1,5 means one and a half; between semicolons it does.
    unnamed : int
        Columns of the first point beyond those that have a name, known or not.
    """

    skipped: int
    separator: str | None
    columns: dict[str, int]
    decimal_comma: bool
    unnamed: int = 0

    def one_further(self) -> "TextHead":
        """Return the head of a file whose first column has no name: each name is the next column's."""
        return replace(self, columns={name: place + 1 for name, place in self.columns.items()})

    def numbers(self, line: str) -> str:
        """Return a line without comment and quotes, with decimal points."""
        text = without_comment(line).replace('"', "")
        return text.replace(",", ".") if self.decimal_comma else text

    def fields(self, line: str) -> list[str]:
        """Return the columns of a line."""
        return [field.strip() for field in self.numbers(line).split(self.separator)]


def read_head(file: Path, asked: str | Sequence[str] | None) -> TextHead:
    """Return the head of a text file, its columns named as `asked`, by its own header, or x, y, z in the first three.

    Raises
    ------
    InputError
        If no line has points, names are missing, or a column is asked for that is not there.
    """
    words = asked.replace(",", " ").split() if isinstance(asked, str) else asked
    names = None if words is None else _known_names(words)
    if names is not None and not set(COORDINATES) <= set(names):
        raise InputError(f"columns: {' '.join(names)!r} do not name x, y and z; give for example 'x y z nx ny nz'")
    header: tuple[int, list[str]] | None = None
    for number, line in lines_of(file):
        fields = _split(line.lstrip("/# \t") if is_comment(line) else without_comment(line))
        if is_comment(line) or not _is_number(fields[0]):
            named = set(_known_names(fields)) & set(COORDINATES)
            # A comment may speak of x; one that names all three is a header.
            header = (number, fields) if len(named) > 2 * is_comment(line) else header
        elif len(fields) > 1 or not fields[0].isdigit():  # a whole number in a line of its own counts the points
            return _head_of(file, number, line, names or _own_names(file, header))
    raise InputError(f"{file}: no line begins with three numbers; give points as 'x y z', one in a line")


def lines_of(file: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a file that are not empty, each with its number from 1."""
    with file.open(encoding="utf-8-sig", errors="replace") as lines:
        for number, line in enumerate(lines, start=1):
            if text := line.strip():
                yield number, text


def is_comment(line: str) -> bool:
    """Return whether a line is a comment."""
    return line.startswith(COMMENTS)


def shown(line: str) -> str:
    """Return a line as an error shows it."""
    return repr(line if len(line) <= MAX_SHOWN else line[:MAX_SHOWN] + "…")


def without_comment(line: str) -> str:
    """Return what stands before a comment."""
    for mark in COMMENTS:
        line = line.split(mark, 1)[0]
    return line.strip()


def _head_of(file: Path, number: int, first: str, names: list[str]) -> TextHead:
    """Return the head of a file whose first point stands in line `number`."""
    separator = _separator_of(without_comment(first))
    known = {name for group in GROUPS.values() for name in group}
    columns = {name: place for place, name in enumerate(names) if name in known}
    head = TextHead(number - 1, separator, columns, separator == ";" and "," in first)
    count = len(head.fields(first))
    missing = next((name for name, place in columns.items() if place >= count), None)
    if missing is not None:
        raise InputError(
            f"{file}: line {number}: {shown(first)} has {count} columns, none for {missing}; "
            "name those that there are, as columns 'x y z'"
        )
    return replace(head, unnamed=max(count - len(names), 0))


def _own_names(file: Path, header: tuple[int, list[str]] | None) -> list[str]:
    """Return the names of a file's header, or x, y, z where it has none."""
    if header is None:
        return list(COORDINATES)
    number, fields = header
    names = _known_names(fields)
    if not set(COORDINATES) <= set(names):
        raise InputError(
            f"{file}: line {number}: {shown(' '.join(fields))} does not name x, y and z; name the columns, as 'x y z'"
        )
    return names


def _known_names(fields: Sequence[str]) -> list[str]:
    """Return names in lower case without quotes or a unit in brackets: "X [m]" is x."""
    plain = (re.sub(r"[\[(].*", "", field).strip().strip('"').lower() for field in fields)
    return [ALSO.get(name, name) for name in plain]


def _separator_of(line: str) -> str | None:
    return ";" if ";" in line else "," if "," in line else None


def _split(line: str) -> list[str]:
    """Return the columns of a line whose separator is not known yet."""
    return [field.strip().strip('"') for field in line.split(_separator_of(line))] or [""]


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True
