"""About how many voxels a file has, before it is read."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import tifffile

from o3dleaf.core.checks.files import is_file, is_folder
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.leaf.ct.formats import hdf5, ome_zarr, tiff
from o3dleaf.leaf.ct.formats.bare import NPY
from o3dleaf.leaf.ct.formats.read import open_volume
from o3dleaf.leaf.ct.formats.slices import slices_in
from o3dleaf.leaf.ct.formats.tiff_pages import require_whole_chain
from o3dleaf.leaf.ct.volume import slices_in as slices_of_box

VOXEL_BYTES = 2
"""Of the formats whose header is left to their reader."""


def count_voxels(path: Path) -> int:
    """Return about how many voxels a volume has; 0 where nothing can be told, and its reader will say why."""
    try:
        if is_folder(path):
            return _in_folder(path)
        return _in_file(path) if is_file(path) else 0
    except Exception:  # noqa: BLE001 - whatever a broken file makes libraries raise
        return 0


def count_cropped(path: Path, crop: npt.ArrayLike, **how: Any) -> int:
    """Return how many voxels the part of a volume in a box has; 0 as of `count_voxels`.

    Parameters
    ----------
    path : Path
    crop : array-like (2, 3)
        In the volume's unit.
    how
        Of `open_volume`.
    """
    try:
        volume = open_volume(path, **how)
        return math.prod(each.stop - each.start for each in slices_of_box(volume, crop)[0])
    except O3DLeafError:
        return 0


def _in_folder(path: Path) -> int:
    if path.suffix.lower() in ome_zarr.SUFFIXES:
        return _in_chunks(path)
    files = slices_in(path)
    if files and files[0].suffix.lower() in tiff.SUFFIXES:
        return len(files) * _in_tiff(files[0])
    return _bytes_of(path) // VOXEL_BYTES


def _in_chunks(path: Path) -> int:
    """Return the voxels of packed chunks by their header; by their bytes where it leaves open which array is meant."""
    try:
        with open_volume(path, spacing=1.0) as volume:
            return math.prod(volume.shape)
    except O3DLeafError:
        return _bytes_of(path) // VOXEL_BYTES


def _bytes_of(path: Path) -> int:
    return sum(file.stat().st_size for file in [path, *path.rglob("*")] if file.is_file())


def _in_file(path: Path) -> int:
    if path.suffix.lower() in tiff.SUFFIXES:
        return _in_tiff(path)
    if path.suffix.lower() == NPY:
        return int(np.load(path, mmap_mode="r", allow_pickle=False).size)
    if path.suffix.lower() in hdf5.SUFFIXES:
        return _in_chunks(path)
    return path.stat().st_size // VOXEL_BYTES


def _in_tiff(path: Path) -> int:
    require_whole_chain(path)  # tifffile follows pages that lead back to one before without end
    with tiff.complaints(path), tifffile.TiffFile(path) as file:
        return int(np.prod(file.series[0].shape, dtype=object))
