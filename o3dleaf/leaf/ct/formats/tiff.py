"""TIFF stacks: their pages and the lengths that they state, checked before anything is allocated."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt
import tifffile

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.atomic_files import whole_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import METERS
from o3dleaf.leaf.ct.formats.stated import Stated, turn_to_xyz, unit_named
from o3dleaf.leaf.ct.formats.tiff_pages import require_whole_chain
from o3dleaf.leaf.ct.volume import Volume

MAX_RATIO = 2000
"""No compression of TIFF packs zeros tighter than this (deflate 1032, LZW about 1400)."""
SUFFIXES = (".tif", ".tiff")


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (page, row, column) stack of a TIFF file, mapped where it can be, and its stated lattice.

    Raises
    ------
    InputError
        If the file is not a TIFF, is truncated, is in color or holds more than one stack.
    """
    try:
        require_whole_chain(path)
        with complaints(path), tifffile.TiffFile(path, _multifile=False) as tiff:
            _require_one_file(tiff, path)
            stack = _one_gray_series(tiff, path)
            _require_complete(tiff, stack, path)
            lattice = _stated(tiff)
            # tifffile names the type without the order of its bytes.
            mapped = stack.dtype.newbyteorder(tiff.byteorder).isnative and stack.nbytes > 0
            offset = stack.dataoffset if mapped else None
            pages = stack.asarray() if offset is None else np.memmap(path, stack.dtype, "r", offset, stack.shape)
            return np.asarray(pages).reshape(_three(stack.shape)), lattice
    except (InputError, MemoryError):
        raise
    except Exception as cause:
        # tifffile and its codecs raise whatever a broken file makes them.
        raise InputError(f"{path}: cannot be read as TIFF ({cause}); export it again") from cause


@checked
def write_volume(volume: Volume, path: str | PathLike[str]) -> None:
    """Write a volume as an ImageJ TIFF stack with its spacing, origin and unit, whole or not at all.

    8-bit and 16-bit unsigned integers and 32-bit floats are kept as they are; other types become
    32-bit floats, as ImageJ knows no others.

    Parameters
    ----------
    volume : Volume
        A unit of None is written as ImageJ's "pixel".
    path : path-like
        File to write; it appears under its name only when it is complete.

    Raises
    ------
    InputError
        If the first argument is no volume, or the folder cannot be written to.
    O3DLeafError
        If writing fails, for example because the disk is full.
    """
    if not isinstance(volume, Volume):
        given = type(volume).__name__
        raise InputError(
            f"volume: is of type {given}; give the volume first, then the path: write_volume(volume, path)"
        )
    kept = volume.data.dtype in (np.uint8, np.uint16, np.float32)
    pages = turn_to_xyz(volume.data if kept else volume.data.astype(np.float32))
    # ImageJ counts its origin in voxels, from the lattice's origin.
    steps = [float(v) for v in -volume.origin / volume.spacing]
    metadata: dict[str, Any] = dict(zip(("xorigin", "yorigin", "zorigin"), steps, strict=True))
    metadata |= {"axes": "ZYX", "spacing": float(volume.spacing[2]), "unit": volume.unit or "pixel"}
    across, down = (Fraction(float(s)).limit_denominator(10**6) for s in volume.spacing[:2])
    with whole_file(path, pages.nbytes) as temporary:
        tifffile.imwrite(
            temporary,
            np.ascontiguousarray(pages),
            imagej=True,
            resolution=((across.denominator, across.numerator), (down.denominator, down.numerator)),
            metadata=metadata,
            software="o3dleaf",
        )


@contextmanager
def complaints(path: Path) -> Iterator[None]:
    """Raise what tifffile logs in this thread: of a tag that it cannot read it only says so, a million times."""
    own = threading.get_ident()

    def refuse(record: logging.LogRecord) -> None:
        if record.thread != own:
            return
        said = " ".join(record.getMessage().split())
        raise InputError(f"{path}: is truncated or broken ({said}); copy or export it again")

    handler = logging.Handler(logging.ERROR)
    handler.emit = refuse  # type: ignore[method-assign]
    logger = logging.getLogger("tifffile")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


def _require_one_file(tiff: tifffile.TiffFile, path: Path) -> None:
    """Refuse an OME-TIFF that names other files: it would be read in part, or lead anywhere."""
    if not tiff.is_ome or tiff.ome_metadata is None:
        return
    named = {each.get("FileName", path.name) for each in ET.fromstring(tiff.ome_metadata).iter()}  # noqa: S314
    if len(named - {path.name}) and len(named) > 1:
        raise InputError(f"{path}: is one of {len(named)} files that are one volume; export it as one file")


def _one_gray_series(tiff: tifffile.TiffFile, path: Path) -> tifffile.TiffPageSeries:
    if len(tiff.series) != 1:
        raise InputError(f"{path}: contains {len(tiff.series)} images of different sizes; export one stack")
    stack = tiff.series[0]
    if "S" in stack.axes or tiff.pages.first.samplesperpixel > 1:
        raise InputError(f"{path}: is in color; export gray values")
    _three(stack.shape)
    return stack


def _three(shape: tuple[int, ...]) -> tuple[int, int, int]:
    """Shape as (page, row, column); a single slice is one page."""
    sizes = (1,) * (3 - len(shape)) + tuple(shape)
    if len(sizes) != 3:
        raise InputError(f"volume: the file is a stack of shape {shape}; export one channel of one time point")
    pages, rows, columns = sizes
    return pages, rows, columns


def _require_complete(tiff: tifffile.TiffFile, stack: tifffile.TiffPageSeries, path: Path) -> None:
    """Compare what the header promises with the size of the file, before anything is allocated."""
    size = tiff.filehandle.size
    if stack.dataoffset is not None:
        expected = stack.dataoffset + stack.nbytes
    else:
        segments = [
            (o + n) for page in stack.pages if page for o, n in zip(page.dataoffsets, page.databytecounts, strict=True)
        ]
        expected = max(segments, default=size + 1)
    if expected > size or stack.nbytes > MAX_RATIO * size or any(page is None for page in stack.pages):
        raise InputError(f"{path}: is truncated, {size} bytes where {expected} are expected; copy or export it again")


def _stated(tiff: tifffile.TiffFile) -> Stated:
    if tiff.is_imagej and tiff.imagej_metadata is not None:
        return _imagej_lattice(tiff.imagej_metadata, tiff.pages.first.tags)
    if tiff.is_ome and tiff.ome_metadata is not None:
        return _ome_lattice(tiff.ome_metadata)
    return Stated()


def _imagej_lattice(metadata: dict[str, Any], tags: tifffile.TiffTags) -> Stated:
    """ImageJ: pixels per unit in the resolution tags, the page spacing and the origin in the description."""
    unit = unit_named(str(metadata.get("unit", "")))
    across, down = tags.get("XResolution"), tags.get("YResolution")
    if "spacing" not in metadata or across is None or down is None or 0 in (*across.value, *down.value):
        return Stated(unit=unit)
    spacing = np.array(
        [
            across.value[1] / across.value[0],
            down.value[1] / down.value[0],
            float(metadata["spacing"]),
        ]
    )
    shift = np.array([float(metadata.get(name, 0.0)) for name in ("xorigin", "yorigin", "zorigin")])
    return Stated(spacing, -shift * spacing + 0.0, unit)


def _ome_lattice(xml: str) -> Stated:
    """OME-TIFF: PhysicalSizeX, Y and Z of the first image, micrometers unless it says otherwise."""
    pixels = next((e for e in ET.fromstring(xml).iter() if e.tag.endswith("}Pixels")), None)  # noqa: S314
    if pixels is None or any(pixels.get(f"PhysicalSize{a}") is None for a in "XYZ"):
        return Stated()
    sizes = [float(pixels.get(f"PhysicalSize{a}", "nan")) for a in "XYZ"]
    units = [unit_named(pixels.get(f"PhysicalSize{a}Unit", "µm")) for a in "XYZ"]
    if None in units:
        return Stated(np.array(sizes) if len(set(units)) == 1 else None)
    to_first = [METERS[u] / METERS[units[0]] for u in units if u is not None and units[0] is not None]
    return Stated(np.array(sizes) * to_first, None, units[0])
