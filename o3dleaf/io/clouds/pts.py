"""PTS: the number of points in the first line, then coordinates, with intensity and colors or without."""

from itertools import islice
from pathlib import Path

import numpy as np

from o3dleaf.core.errors import InputError
from o3dleaf.io.clouds.columns import Columns
from o3dleaf.io.polygons.numbers import no_number

COLORS = {7: (4, 5, 6), 6: (3, 4, 5)}
"""Columns of red, green and blue, by the number of columns."""


def read_pts(file: Path) -> Columns:
    """Return the points of a PTS file, with colors, if any; intensities are not read.

    Raises
    ------
    InputError
        If it was cut off, or has no number where one belongs.
    """
    with file.open("rb") as stream:
        count = int(stream.readline())
        first = next((line for line in stream if not line.isspace()), b"")
    columns = len(first.split())
    if columns < 3:
        raise InputError(f"{file}: its points have {columns} numbers, not three; export it again")
    places = (0, 1, 2, *COLORS.get(columns, ()))
    with file.open("rb") as stream:
        lines = (line for line in islice(stream, 1, None) if not line.isspace())
        try:
            rows = np.loadtxt(islice(lines, count), usecols=places, comments=None, ndmin=2)
        except ValueError as cause:
            raise no_number(file, cause) from cause
    colors = np.clip(rows[:, 3:] / 255.0, 0.0, 1.0) if len(places) > 3 else None
    return Columns(rows[:, :3], None, colors)
