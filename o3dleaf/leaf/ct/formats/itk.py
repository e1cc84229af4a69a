"""Volumes that SimpleITK reads: NRRD, MetaImage, NIfTI, and DICOM, of which a folder is one series."""

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.processes.child_process import run_in_subprocess
from o3dleaf.core.resources.machine import limit_memory
from o3dleaf.leaf.ct.formats.dicom_headers import Slice, is_dicom, look_over
from o3dleaf.leaf.ct.formats.lattice_headers import require_sane_header
from o3dleaf.leaf.ct.formats.stated import Stated, import_reader

NIFTI = (".nii", ".nii.gz")
DETACHED = (".mhd", ".nhdr")
DICOM = (".dcm", ".dicom", ".ima")
GDCM = "GDCMImageIO"
READERS = (
    ((".nrrd", ".nhdr"), "NrrdImageIO"),
    ((".mha", ".mhd"), "MetaImageIO"),
    (NIFTI, "NiftiImageIO"),
    (DICOM, GDCM),
)
"""SimpleITK's names."""
SUFFIXES = tuple(suffix for suffixes, _ in READERS for suffix in suffixes)
CHILD_ROOM, CHILD_TIMES = 1 << 30, 8
CHILD_SECONDS, CHILD_SPEED = 60, 1 << 20
"""What unpacking in another process may take: bytes, and for each of the voxels'; seconds, and the bytes in each."""
MAX_RATIO = 2000
"""Deflate, the compression of these formats, packs zeros 1032 to 1."""
MIN_NIFTI_HEADER = 348
"""Bytes."""
EVEN = 0.01
"""Share of the distance of two slices within which they are even: positions are written in decimals."""


def read(path: Path) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels of a file, (z, y, x), and its lattice, turned to straight axes.

    Raises
    ------
    InputError
        If SimpleITK is not installed, the file is truncated or damaged, in color, not three-dimensional or oblique.
    """
    import_reader("SimpleITK", path)
    name = path.name.lower()
    if name.endswith(DICOM):
        return _read_slices(path, [_require_pixels(path)])
    unit = require_sane_header(path)
    with _simple_itk(path) as itk:
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
        return _voxels_of(itk, header.Execute(), path, unit)


def has_series(folder: Path) -> bool:
    """Return whether a folder has DICOM files; only the first bytes of each are read."""
    return any(is_dicom(file) for file in folder.iterdir() if file.is_file())


def read_series(folder: Path, wanted: str | None) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (z, y, x) voxels of the DICOM series in a folder, or of that whose identifier is `wanted`.

    Raises
    ------
    InputError
        If there are several series, a slice is missing or damaged, or SimpleITK is not installed.
    """
    import_reader("SimpleITK", folder)
    files = sorted(file for file in folder.iterdir() if file.is_file() and is_dicom(file))
    series: dict[str, list[Slice]] = {}
    for each in filter(None, map(look_over, files)):
        series.setdefault(each.series, []).append(each)
    if wanted not in series and (wanted is not None or len(series) != 1):
        raise InputError(f"{folder}: has {len(series)} DICOM series: {', '.join(series)}; say which: dataset=SERIES")
    return _read_slices(folder, sorted(series[next(iter(series)) if wanted is None else wanted], key=_in_order))


def _in_order(each: Slice) -> tuple[tuple[float, float], str]:
    return each.order, each.file.name


def _require_pixels(path: Path) -> Slice:
    found = look_over(path)
    if found is None:
        raise InputError(f"{path}: has no pixels; give the file or the folder of a scan")
    return found


def _read_slices(path: Path, slices: list[Slice]) -> tuple[npt.NDArray[Any], Stated]:
    """Return the voxels of slices in their order; packed ones are unpacked in a process of its own, within limits."""
    if len(slices) > 1 and all(each.place for each in slices):
        _require_even([each.place for each in slices], path)
    files, size = [str(each.file) for each in slices], sum(each.bytes for each in slices)
    if not any(each.packed for each in slices):
        voxels, spacing, origin = read_files(str(path), files)
        return voxels, Stated(spacing, origin, "mm")
    if size > MAX_RATIO * sum(each.file.stat().st_size for each in slices):
        raise InputError(f"{path}: is truncated, or its header lies: {size} bytes in so small a file; export it again")
    try:
        (voxels, spacing, origin), _ = run_in_subprocess(
            read_files,
            (),
            {"path": str(path), "files": files, "room": CHILD_ROOM + CHILD_TIMES * size},
            name=f"{path}: unpacking",
            cure="the file is damaged; export it again, not packed",
            seconds=CHILD_SECONDS + size / CHILD_SPEED,
        )
    except InputError:
        raise
    except O3DLeafError as cause:  # whatever its codecs do to the process: the file is to blame
        raise InputError(str(cause)) from cause
    return voxels, Stated(spacing, origin, "mm")


def read_files(path: str, files: list[str], room: int | None = None) -> tuple[npt.NDArray[Any], ...]:
    """Return the (z, y, x) voxels, spacing and origin of DICOM files, in a process that may take `room` bytes more."""
    if room is not None:
        limit_memory(room)
    with _simple_itk(Path(path)) as itk:
        if len(files) == 1:
            image = itk.ReadImage(files[0], imageIO=GDCM)
        else:
            reader = itk.ImageSeriesReader()
            reader.SetImageIO(GDCM)
            reader.SetFileNames(files)
            image = reader.Execute()
        voxels, stated = _voxels_of(itk, image, Path(path), "mm")
        return voxels, np.asarray(stated.spacing), np.asarray(stated.origin)


def _require_even(places: list[tuple[float, ...]], folder: Path) -> None:
    """Refuse slices that are not evenly apart: SimpleITK reads them as if they were."""
    gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    if len(gaps) and np.ptp(gaps) > EVEN * np.median(gaps):
        k = int(np.argmax(np.abs(gaps - np.median(gaps))))
        raise InputError(
            f"{folder}: slices are missing, or not evenly apart: {gaps[k]:.4g} mm from slice {k + 1} to the next, "
            f"{np.median(gaps):.4g} mm between most; export the series again"
        )


@contextmanager
def _simple_itk(path: Path) -> Iterator[Any]:
    """Yield the module SimpleITK, and turn what it raises into one line."""
    SimpleITK = import_reader("SimpleITK", path)
    loud = SimpleITK.ProcessObject.GetGlobalWarningDisplay()
    SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)  # they go to the terminal, and no program hears them
    try:
        yield SimpleITK
    except RuntimeError as cause:
        raise InputError(f"{path}: cannot be read ({_last_line(cause)}); export it again") from cause
    finally:
        SimpleITK.ProcessObject.SetGlobalWarningDisplay(loud)


def _voxels_of(itk: Any, image: Any, path: Path, unit: str | None) -> tuple[npt.NDArray[Any], Stated]:
    if image.GetNumberOfComponentsPerPixel() != 1 or image.GetDimension() != 3:
        raise InputError(f"{path}: is in color or not three-dimensional; export one volume of gray values")
    image = itk.DICOMOrient(image, "LPS")
    if not np.allclose(image.GetDirection(), np.eye(3).ravel(), atol=1e-6):
        raise InputError(f"{path}: its axes are oblique; resample it to straight axes first")
    return itk.GetArrayFromImage(image), Stated(np.array(image.GetSpacing()), np.array(image.GetOrigin()), unit)


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
