"""What SimpleITK reads: NRRD, MetaImage, NIfTI, and DICOM, of which a folder is one series."""

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.lattice_headers import require_sane_header
from o3dleaf.leaf.ct.formats.stated import Stated, import_extra

NIFTI = (".nii", ".nii.gz")
DETACHED = (".mhd", ".nhdr")
DICOM = (".dcm", ".dicom", ".ima")
READERS = (
    ((".nrrd", ".nhdr"), "NrrdImageIO"),
    ((".mha", ".mhd"), "MetaImageIO"),
    (NIFTI, "NiftiImageIO"),
    (DICOM, "GDCMImageIO"),
)
"""SimpleITK's names."""
SUFFIXES = tuple(suffix for suffixes, _ in READERS for suffix in suffixes)
MAX_RATIO = 2000
"""Deflate, the compression of these formats, packs zeros 1032 to 1."""
MIN_NIFTI_HEADER = 348
"""Bytes."""
PLACE = "0020|0032"
"""DICOM's name of the place of a slice, of its first pixel, in millimeters."""
EVEN = 0.01
"""Share of the distance of two slices within which they are even: positions are written in decimals."""


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels of a file, (z, y, x), and its lattice in millimeters, turned to straight axes.

    Raises
    ------
    InputError
        If SimpleITK is not installed, the file is truncated or damaged, in color, not three-dimensional or oblique.
    """
    with _simple_itk(path) as itk:
        name = path.name.lower()
        if not name.endswith(DICOM):
            require_sane_header(path)
        header = itk.ImageFileReader()
        # By the name alone: of what a file says of itself SimpleITK would try twenty other readers.
        header.SetImageIO(next(reader for suffixes, reader in READERS if name.endswith(suffixes)))
        header.SetFileName(str(path))
        header.ReadImageInformation()
        expected, size = int(np.prod(header.GetSize(), dtype=np.int64)), path.stat().st_size
        if expected > MAX_RATIO * size and not name.endswith(DETACHED):
            raise InputError(f"{path}: is truncated, {size} bytes for {expected} voxels; copy or export it again")
        if name.endswith(NIFTI):
            one = itk.GetArrayViewFromImage(itk.Image([1] * 3, header.GetPixelID()))
            _require_whole_nifti(path, expected * one.itemsize)
        return _voxels_of(itk, header.Execute(), path)


def has_series(folder: Path) -> bool:
    """Return whether a folder has DICOM files; only the first bytes of each are read."""
    return any(_is_dicom(file) for file in folder.iterdir() if file.is_file())


def read_series(folder: Path, wanted: str | None) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (z, y, x) voxels of the DICOM series in a folder, or of that whose identifier is `wanted`.

    Raises
    ------
    InputError
        If there are several series, a slice is missing or damaged, or SimpleITK is not installed.
    """
    with _simple_itk(folder) as itk:
        reader = itk.ImageSeriesReader()
        series = list(reader.GetGDCMSeriesIDs(str(folder)))
        if wanted not in series and (wanted is not None or len(series) != 1):
            raise InputError(
                f"{folder}: has {len(series)} DICOM series: {', '.join(series)}; say which: dataset=SERIES"
            )
        files = reader.GetGDCMSeriesFileNames(str(folder), wanted or series[0])
        reader.SetFileNames(files)
        reader.MetaDataDictionaryArrayUpdateOn()
        image = reader.Execute()
        if all(reader.HasMetaDataKey(k, PLACE) for k in range(len(files))):
            _require_even([reader.GetMetaData(k, PLACE) for k in range(len(files))], folder)
        return _voxels_of(itk, image, folder)


def _require_even(places: list[str], folder: Path) -> None:
    """Refuse slices that are not evenly apart: SimpleITK reads them as if they were."""
    at = np.array([[float(number) for number in place.split("\\")] for place in places])
    gaps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    if len(gaps) and np.ptp(gaps) > EVEN * np.median(gaps):
        k = int(np.argmax(np.abs(gaps - np.median(gaps))))
        raise InputError(
            f"{folder}: slices are missing, or not evenly apart: {gaps[k]:.4g} mm from slice {k + 1} to the next, "
            f"{np.median(gaps):.4g} mm between most; export the series again"
        )


def _is_dicom(file: Path) -> bool:
    with file.open("rb") as content:
        return content.read(132)[128:] == b"DICM"


@contextmanager
def _simple_itk(path: Path) -> Iterator[Any]:
    """Yield the module SimpleITK, and turn what it raises into one line."""
    SimpleITK = import_extra("SimpleITK", "formats", path)
    loud = SimpleITK.ProcessObject.GetGlobalWarningDisplay()
    SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)  # they go to the terminal, and no program hears them
    try:
        yield SimpleITK
    except RuntimeError as cause:
        raise InputError(f"{path}: cannot be read ({_last_line(cause)}); export it again") from cause
    finally:
        SimpleITK.ProcessObject.SetGlobalWarningDisplay(loud)


def _voxels_of(itk: Any, image: Any, path: Path) -> tuple[npt.NDArray[Any], Stated]:
    if image.GetNumberOfComponentsPerPixel() != 1 or image.GetDimension() != 3:
        raise InputError(f"{path}: is in color or not three-dimensional; export one volume of gray values")
    image = itk.DICOMOrient(image, "LPS")
    if not np.allclose(image.GetDirection(), np.eye(3).ravel(), atol=1e-6):
        raise InputError(f"{path}: its axes are oblique; resample it to straight axes first")
    return itk.GetArrayFromImage(image), Stated(np.array(image.GetSpacing()), np.array(image.GetOrigin()), "mm")


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
