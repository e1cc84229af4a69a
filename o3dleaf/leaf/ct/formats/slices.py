"""A folder of slices: one gray TIFF or PNG a page, stacked by the numbers in their names."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL.PngImagePlugin import PngImageFile

from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats import tiff
from o3dleaf.leaf.ct.formats.stated import Stated

PNG = ".png"
SUFFIXES = (*tiff.SUFFIXES, PNG)
PNG_START, CHUNK_FRAME = 8, 12
"""Bytes of a PNG before its first part, and of a part beside what it holds."""
BITS = {"1": 1, "L": 8, "I": 32, "I;16": 16, "I;16B": 16, "F": 32}
"""Of Pillow's images of one channel, whose numbers are intensities, the bits of a pixel."""
MAX_RATIO = 2000
"""Deflate, the compression of PNG, packs zeros 1032 to 1."""


def slices_in(folder: Path) -> list[Path]:
    """Return the slices in a folder, of the kind that has the most, slice_2 before slice_10."""
    files = [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
    png = [file for file in files if file.suffix.lower() == PNG]
    others = [file for file in files if file.suffix.lower() != PNG]
    return sorted(png if len(png) > len(others) else others, key=_by_number)


def read(folder: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (page, row, column) stack of a folder of slices, and what the first of them states.

    Raises
    ------
    InputError
        If there is no slice, one is missing by its number, damaged or in color, or they differ in size or type.
    """
    pages, stated = open_array(folder)
    stack = np.empty(pages.shape, dtype=pages.dtype)
    for k in range(len(stack)):
        stack[k] = pages[k : k + 1, :, :][0]
    return stack, stated


class SlicePages:
    """The (page, row, column) stack of a folder of slices, each read when it is asked for."""

    ndim = 3

    def __init__(self, files: list[Path]) -> None:
        self.files = files
        page, self.stated = _read_page(files[0])
        if page.ndim != 2:
            raise InputError(f"{files[0]}: has shape {page.shape}; give slices of one page each")
        self.shape, self.dtype = (len(files), *page.shape), page.dtype

    @property
    def chunks(self) -> tuple[int, ...]:
        """A page."""
        return (1, *self.shape[1:])

    def __getitem__(self, where: tuple[slice, ...]) -> npt.NDArray[Any]:
        return np.stack([self._page(file)[where[1:]] for file in self.files[where[0]]])

    def _page(self, file: Path) -> npt.NDArray[Any]:
        page = _read_page(file)[0]
        if page.shape != self.shape[1:] or page.dtype != self.dtype:
            raise InputError(
                f"{file}: has shape {page.shape} and type {page.dtype} where {self.files[0].name} has {self.shape[1:]} "
                f"and {self.dtype}; the slices in a folder must form one volume, one page each"
            )
        return page


def open_array(folder: Path) -> tuple[SlicePages, Stated]:
    """Return the stack of a folder of slices, read page by page, and what the first of them states.

    Raises
    ------
    InputError
        If there is no slice, one is missing by its number, or the first is damaged.
    """
    pages = SlicePages(_require_slices(folder))
    return pages, pages.stated


def _require_slices(folder: Path) -> list[Path]:
    files = slices_in(folder)
    if not files:
        raise InputError(f"{folder}: contains no slices; give a folder of TIFF, PNG or DICOM slices")
    _require_even(folder, files)
    return files


def _require_even(folder: Path, files: list[Path]) -> None:
    """Refuse slices whose names differ by one number alone, where that does not go on in even steps."""
    names = [_by_number(file) for file in files]
    varying = [column for column in zip(*names, strict=False) if len(set(column)) > 1]
    if len(varying) != 1 or len({len(name) for name in names}) > 1 or not varying[0][0][0]:
        return
    steps = np.diff([number for _, number, _ in varying[0]])
    if np.ptp(steps):
        k = int(np.flatnonzero(steps != np.median(steps))[0])
        raise InputError(
            f"{folder}: slices are missing or are there twice, {files[k + 1].name} follows {files[k].name}; "
            "copy the folder again, or number its slices evenly"
        )


def _read_page(file: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (row, column) pixels of a file, and what it states."""
    if require_file(file).suffix.lower() != PNG:
        pages, lattice = tiff.read(file)
        return pages[0] if len(pages) == 1 else pages, lattice
    try:
        _require_whole_chunks(file)
        # Not `Image.open`: it warns of large images, whatever their files; here files are weighed against them.
        with PngImageFile(file) as image:
            if image.mode not in BITS:
                raise InputError(f"{file}: is in color; export gray values")
            bits, size = image.width * image.height * BITS[image.mode], file.stat().st_size
            if bits > 8 * MAX_RATIO * size:
                raise InputError(f"{file}: is truncated, or its header lies: {image.size} pixels in {size} bytes")
            return np.asarray(image), Stated()
    except (OSError, SyntaxError, ValueError) as cause:
        raise InputError(f"{file}: cannot be read as PNG ({cause}); export it again") from cause


def _require_whole_chunks(file: Path) -> None:
    """Raise `ValueError` where a part of a PNG is longer than what is left: Pillow makes room for what it claims."""
    size, place = file.stat().st_size, PNG_START
    with file.open("rb") as stream:
        while place < size:
            stream.seek(place)
            place += CHUNK_FRAME + int.from_bytes(stream.read(4), "big")
    if place > size:
        raise ValueError("it is truncated")


def _by_number(file: Path) -> list[tuple[bool, int, str]]:
    """Sort key that compares the digits in a name as numbers."""
    parts = re.split(r"(\d+)", file.name.lower())
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]
