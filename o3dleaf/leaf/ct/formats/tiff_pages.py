"""The chain of a TIFF's pages: each says where the next one is, and the last that there is none.

A reader that finds no page where one is announced may give those before it for all, with no more than a line in a log.
"""

import struct
from pathlib import Path
from typing import BinaryIO

from o3dleaf.core.errors import InputError

ORDERS = {b"II": "<", b"MM": ">"}
WIDTHS = {42: ("H", "I", 12), 43: ("Q", "Q", 20)}
"""By version, TIFF and BigTIFF: the number of tags and the place of the next page, and the bytes of a tag."""


def require_whole_chain(path: Path) -> None:
    """Raise `InputError` if a page of a TIFF file is announced that the file does not hold, or that came before.

    What is no TIFF at all is left to its reader.
    """
    with path.open("rb") as file:
        order = ORDERS.get(file.read(2))
        version = 0 if order is None else _number(file, f"{order}H")
        if order is None or version not in WIDTHS:
            return
        number, place, tag = WIDTHS[version]
        file.seek(4 if version == 42 else 8)
        offset, seen = _number(file, order + place), set[int]()
        while offset:
            file.seek(offset)
            tags = _number(file, order + number)
            if tags is not None:
                file.seek(tags * tag, 1)
            following = _number(file, order + place)
            if tags is None or following is None or offset in seen:
                raise InputError(
                    f"{path}: is truncated or broken, page {len(seen) + 1:,} is not where it is said to be; "
                    "copy or export it again"
                )
            seen.add(offset)
            offset = following


def _number(file: BinaryIO, form: str) -> int | None:
    """Return the number that comes next, or None at the end of the file."""
    content = file.read(struct.calcsize(form))
    return struct.unpack(form, content)[0] if len(content) == struct.calcsize(form) else None
