"""A file or folder in, `Volume` out: the format by its suffix or its content."""

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.checks.files import is_folder, require_file
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.leaf.ct.formats import bare, hdf5, itk, ome_zarr, points, scanco, slices, tiff
from o3dleaf.leaf.ct.formats.content import content_hint
from o3dleaf.leaf.ct.formats.stated import Stated, TurnedVoxels, VoxelLayout, parse_layout, require_only, turn_to_xyz
from o3dleaf.leaf.ct.on_disk import VolumeOnDisk
from o3dleaf.leaf.ct.volume import Volume

TAKING_LAYOUT = (bare, hdf5, ome_zarr)
"""Formats that may leave open which array, or the order of its axes."""
FORMATS = (tiff, *TAKING_LAYOUT, itk, scanco, points)
SUFFIXES = tuple(suffix for each in FORMATS for suffix in each.SUFFIXES)


@checked
def read_volume(
    path: str | PathLike[str],
    *,
    spacing: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    origin: npt.ArrayLike | None = None,
    layout: str | VoxelLayout | None = None,
) -> Volume:
    """Read a micro-CT volume; files that are not packed are mapped, not loaded.

    Parameters
    ----------
    path : path-like
        A TIFF stack; a folder of TIFF or PNG slices (in the order of the numbers in their names) or of one DICOM
        series; ISQ, AIM; ``.npy``, ``.npz``; bare numbers (``.raw``, ``.bin``) with their `layout`; a PLY of points on
        a lattice with an intensity ``f``. With ``pip install 'o3dleaf[formats]'`` NRRD, MetaImage, NIfTI, DICOM, HDF5
        and OME-Zarr.
    spacing : float or (3,) array_like, optional
        Distance between voxels along (x, y, z), in `unit`; overrides what the file states. Needed where it states none.
    unit : str, optional
        Unit that the volume is to be in. Lengths that the file states are converted to it; numbers
        given here, and those whose unit the file leaves open, are in it. Default: the file's unit, if any.
    origin : (3,) array_like, optional
        Center of the first voxel, in `unit`; default: the file's, if its spacing is used too, else 0.
    layout : str or VoxelLayout, optional
        What the file does not say of its voxels, such as "shape=700x700x160 dtype=uint16 offset=512" of bare numbers,
        or "dataset=scan/raw axes=zyx". Axes are named the slowest first: NPY and NPZ are taken as xyz, all others as
        zyx (pages, rows, columns) where nothing is said.

    Raises
    ------
    InputError
        If the file is missing, unreadable, truncated, in color or of one value, holds NaN, no spacing is known, or the
        package that reads it is not installed.
    UnitError
        If the unit is unknown.
    """
    return read_stated(path, spacing=spacing, unit=unit, origin=origin, layout=layout)[0]


def read_stated(
    path: str | PathLike[str],
    *,
    spacing: npt.ArrayLike | None = None,
    unit: str | None = None,
    origin: npt.ArrayLike | None = None,
    layout: str | VoxelLayout | None = None,
) -> tuple[Volume, Stated]:
    """Return the volume as `read_volume` does, and what its file states of it."""
    data, stated = _read_voxels(Path(path), parse_layout(layout))
    volume = Volume(data, *_lattice(Path(path), stated, spacing, unit, origin))
    if data.min() == data.max():
        raise InputError(f"{path}: all voxels have one value, {data.min()}; check the export, or scan again")
    return volume, stated


@checked
def open_volume(
    path: str | PathLike[str],
    *,
    spacing: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    origin: npt.ArrayLike | None = None,
    layout: str | VoxelLayout | None = None,
) -> VolumeOnDisk:
    """Open a micro-CT volume of any size; its voxels stay in the file until `crop` reads some of them.

    Parameters
    ----------
    path, spacing, unit, origin, layout
        As of `read_volume`. Chunks of HDF5 and Zarr and the slices of a folder are read where they are asked for;
        TIFF, NPY and bare numbers are mapped where they are not packed. All other formats are read whole.

    Raises
    ------
    InputError, UnitError
        As of `read_volume`.
    """
    return open_stated(path, spacing=spacing, unit=unit, origin=origin, layout=layout)[0]


def open_stated(
    path: str | PathLike[str],
    *,
    spacing: npt.ArrayLike | None = None,
    unit: str | None = None,
    origin: npt.ArrayLike | None = None,
    layout: str | VoxelLayout | None = None,
) -> tuple[VolumeOnDisk, Stated]:
    """Return the volume as `open_volume` does, and what its file states of it."""
    voxels, stated = _open_voxels(Path(path), parse_layout(layout))
    return VolumeOnDisk(voxels, *_lattice(Path(path), stated, spacing, unit, origin)), stated


def _lattice(
    place: Path, stated: Stated, spacing: npt.ArrayLike | None, unit: str | None, origin: npt.ArrayLike | None
) -> tuple[npt.ArrayLike, npt.ArrayLike, str | None]:
    """Return spacing, origin and unit as given, where they are, or as stated."""
    wanted = check_unit(unit) or stated.unit
    scale = unit_scale(stated.unit, wanted) if stated.unit else 1.0
    if spacing is None:
        if stated.spacing is None:
            raise InputError(f"{place}: does not state its voxel spacing; give the voxel spacing and its unit")
        spacing = stated.spacing * scale
        if origin is None and stated.origin is not None:
            origin = stated.origin * scale
    return spacing, (0.0, 0.0, 0.0) if origin is None else origin, wanted


def _open_voxels(path: Path, layout: VoxelLayout) -> tuple[Any, Stated]:
    """Return voxels along (x, y, z), read by slices where the format allows, and what the file states of them."""
    read = _reader_of(path)
    if read in (hdf5, ome_zarr):
        array, stated = read.open_array(path, layout)
    elif read is slices:
        require_only(layout, (), path)
        array, stated = slices.open_array(path)
    else:
        return _read_voxels(path, layout)
    stated = replace(stated, axes=layout.axes or stated.axes)
    return TurnedVoxels(array, stated.axes, path), stated


def _read_voxels(path: Path, layout: VoxelLayout) -> tuple[npt.NDArray[Any], Stated]:
    """Return the (x, y, z) voxels of a file or folder of any known format, and what it states of them."""
    read = _reader_of(path)
    if read in TAKING_LAYOUT:
        array, stated = read.read(path, layout)
    elif read is itk and is_folder(path):
        require_only(layout, ("dataset",), path)
        array, stated = itk.read_series(path, layout.dataset)
    else:
        require_only(layout, (), path)
        array, stated = read.read(path)
    if array.ndim != 3:
        raise InputError(f"{path}: has an array of shape {array.shape}; give (nx, ny, nz) voxels")
    stated = replace(stated, axes=layout.axes or stated.axes)
    return turn_to_xyz(array, stated.axes), stated


def _reader_of(path: Path) -> Any:
    """Return the module that reads a file or folder."""
    if is_folder(path) and path.suffix.lower() not in ome_zarr.SUFFIXES:
        return itk if not slices.slices_in(path) and itk.has_series(path) else slices
    name = path.name.lower() if is_folder(path) else require_file(path).name.lower()
    known = [each for each in FORMATS if name.endswith(each.SUFFIXES)]
    if not known:
        raise InputError(
            f"{path}: unknown kind of volume; give {', '.join(SUFFIXES)} or a folder of TIFF, PNG or DICOM slices"
            f"{content_hint(path)}"
        )
    return known[0]
