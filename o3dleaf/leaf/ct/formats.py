"""Files in, `Volume` out: TIFF stacks and folders of slices, NumPy arrays, and what SimpleITK reads."""

import gzip
import re
import zlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.checks import is_folder, require_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.leaf.ct.tiff import StatedLattice, read_tiff, swap_page_order
from o3dleaf.leaf.ct.volume import Volume

TIFF = (".tif", ".tiff")
ITK = (".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz")
MAX_RATIO = 2000
"""Deflate, the compression of these formats, packs zeros 1032 to 1."""
MIN_NIFTI_HEADER = 348
"""Bytes."""


@checked
def read_volume(
    path: str | PathLike[str],
    *,
    spacing: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    origin: npt.ArrayLike | None = None,
) -> Volume:
    """Read a micro-CT volume; large uncompressed files are mapped, not loaded.

    Parameters
    ----------
    path : path-like
        A TIFF stack, a folder of single-page TIFF slices (in the order of the numbers in their
        names), a ``.npy`` array with axes (x, y, z), or, with the extra ``formats`` installed,
        NRRD, MetaImage or NIfTI.
    spacing : float or (3,) array_like, optional
        Distance between voxels along (x, y, z), in `unit`; overrides what the file states (ImageJ and
        OME metadata, the headers of the other formats). Needed where the file states none.
    unit : str, optional
        Unit that the volume is to be in. Lengths that the file states are converted to it; numbers
        given here are in it. Default: the file's unit, if any (millimeters for NRRD, MetaImage, NIfTI).
    origin : (3,) array_like, optional
        Center of the first voxel, in `unit`; default: the file's, if its spacing is used too, else 0.

    Raises
    ------
    InputError
        If the file is missing, unreadable, truncated, in color or of one value, holds NaN, or no
        spacing is known.
    UnitError
        If the unit is unknown.
    """
    place, unit = Path(path), check_unit(unit)
    data, stated = _read_any(place)
    wanted = unit or stated.unit
    scale = unit_scale(stated.unit, wanted) if stated.unit else 1.0
    if spacing is None:
        if stated.spacing is None:
            raise InputError(f"{place}: does not state its voxel spacing; give the voxel spacing and its unit")
        spacing = stated.spacing * scale
        if origin is None and stated.origin is not None:
            origin = stated.origin * scale
    volume = Volume(data, spacing, (0.0, 0.0, 0.0) if origin is None else origin, wanted)
    if data.min() == data.max():
        raise InputError(f"{place}: all voxels have one value, {data.min()}; check the export, or scan again")
    return volume


def _read_any(path: Path) -> tuple[npt.NDArray[Any], StatedLattice]:
    """(x, y, z) voxels and stated lattice of a file of any known format."""
    if is_folder(path):
        pages, lattice = _read_slices(path)
        return swap_page_order(pages), lattice
    name = require_file(path).name.lower()
    if name.endswith(TIFF):
        pages, lattice = read_tiff(path)
        return swap_page_order(pages), lattice
    if name.endswith(".npy"):
        return _read_npy(path), StatedLattice()
    if name.endswith(ITK):
        return _read_itk(path)
    raise InputError(f"{path}: unknown format; give {', '.join((*TIFF, '.npy', *ITK))} or a folder of TIFF slices")


def _read_slices(folder: Path) -> tuple[npt.NDArray[Any], StatedLattice]:
    """Stack the single-page TIFF files of a folder, slice_2 before slice_10."""
    files = sorted((f for f in folder.iterdir() if f.suffix.lower() in TIFF), key=_by_number)
    if not files:
        raise InputError(f"{folder}: contains no TIFF slices; give the folder that does")
    slices: list[npt.NDArray[Any]] = []
    for file in files:
        page, lattice = read_tiff(require_file(file))
        if not slices:
            first, stated = page, lattice
        if len(page) != 1 or page.shape != first.shape or page.dtype != first.dtype:
            raise InputError(
                f"{file}: has shape {page.shape} and type {page.dtype} where {files[0].name} has {first.shape} and "
                f"{first.dtype}; the slices in a folder must form one volume, one page each"
            )
        slices.append(page[0])
    return np.stack(slices), stated


def _by_number(file: Path) -> list[tuple[bool, int, str]]:
    """Sort key that compares the digits in a name as numbers."""
    parts = re.split(r"(\d+)", file.name.lower())
    return [(part.isdigit(), int(part) if part.isdigit() else 0, part) for part in parts]


def _read_npy(path: Path) -> npt.NDArray[Any]:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as cause:
        raise InputError(f"{path}: cannot be read as a NumPy array ({cause}); save it again") from cause
    return np.asarray(array)


def _read_itk(path: Path) -> tuple[npt.NDArray[Any], StatedLattice]:
    """NRRD, MetaImage and NIfTI through SimpleITK, axes turned to the file's patient-free (x, y, z)."""
    try:
        import SimpleITK  # noqa: PLC0415 - an extra that few need
    except ImportError as cause:
        raise InputError(f"{path}: needs SimpleITK; run: pip install 'o3dleaf[formats]'") from cause
    try:
        header = SimpleITK.ImageFileReader()
        header.SetFileName(str(path))
        header.ReadImageInformation()
        expected, size = int(np.prod(header.GetSize(), dtype=np.int64)), path.stat().st_size
        detached = path.name.lower().endswith((".mhd", ".nhdr"))
        if expected > MAX_RATIO * size and not detached:
            raise InputError(f"{path}: is truncated, {size} bytes for {expected} voxels; copy or export it again")
        if path.name.lower().endswith((".nii", ".nii.gz")):
            one = SimpleITK.GetArrayViewFromImage(SimpleITK.Image([1] * 3, header.GetPixelID()))
            _require_whole_nifti(path, expected * one.itemsize)
        image = header.Execute()
        if image.GetNumberOfComponentsPerPixel() != 1 or image.GetDimension() != 3:
            raise InputError(f"{path}: is in color or not three-dimensional; export one volume of gray values")
        image = SimpleITK.DICOMOrient(image, "LPS")
    except RuntimeError as cause:
        raise InputError(f"{path}: cannot be read ({_last_line(cause)}); export it again") from cause
    if not np.allclose(image.GetDirection(), np.eye(3).ravel(), atol=1e-6):
        raise InputError(f"{path}: its axes are oblique; resample it to straight axes first")
    stated = StatedLattice(np.array(image.GetSpacing()), np.array(image.GetOrigin()), "mm")
    return swap_page_order(SimpleITK.GetArrayFromImage(image)), stated


def _require_whole_nifti(path: Path, expected: int) -> None:
    """Refuse a NIfTI file that ends early: SimpleITK fills the rest with zeros and says nothing."""
    size = path.stat().st_size
    if path.suffix.lower() == ".gz":
        size = 0
        try:
            with gzip.open(path) as file:
                while part := file.read(1 << 22):
                    size += len(part)
        except (EOFError, OSError, zlib.error) as cause:
            raise InputError(f"{path}: is truncated ({cause}); copy or export it again") from cause
    if size < MIN_NIFTI_HEADER + expected:
        raise InputError(f"{path}: is truncated, {size} bytes where {expected} are expected; copy or export it again")


def _last_line(cause: Exception) -> str:
    return str(cause).strip().splitlines()[-1]
