"""HDF5: a dataset of three dimensions, slices first, with the voxel size that Fiji and its kin note beside it."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.scratch import load_array
from o3dleaf.leaf.ct.formats.stated import VOXELS, Stated, VoxelLayout, import_reader, only_array, reading, require_only

SUFFIXES = (".h5", ".hdf5", ".hdf")
MAX_RATIO = 2000
"""Deflate packs zeros 1032 to 1; what was never written takes no place, and is no scan."""
SIZE_OF_ELEMENT = "element_size_um"
"""Attribute with the size of a voxel in micrometers, in the order of the axes."""


def read(path: Path, layout: VoxelLayout) -> tuple[npt.NDArray[Any], Stated]:
    """Return a dataset, mapped where it lies in one piece, and its lattice if `element_size_um` states it.

    Raises
    ------
    InputError
        If h5py is not installed, the file is damaged, or it does not say which dataset is meant.
    """
    dataset, stated = open_array(path, layout)
    with dataset.file, reading(path, "HDF5"):
        return _values_of(dataset, path), stated


def open_array(path: Path, layout: VoxelLayout) -> tuple[Any, Stated]:
    """Return a dataset of a file that stays open as long as it is used, and its lattice.

    Raises
    ------
    InputError
        As of `read`.
    """
    require_only(layout, ("dataset", "axes"), path)
    h5py = import_reader("h5py", path)
    with reading(path, "HDF5"):
        file = h5py.File(path, "r")
        try:
            names: list[str] = []

            def note(name: str, node: Any) -> None:
                if isinstance(node, h5py.Dataset) and node.ndim == 3 and node.dtype.kind in VOXELS:
                    names.append(name)

            file.visititems(note)
            dataset = file[only_array(names, layout.dataset, path)]
            _require_here(dataset, path)
            axes = layout.axes or Stated().axes
            return dataset, Stated(_spacing_of(dataset, axes), None, _unit_of(dataset), axes)
        except BaseException:
            file.close()
            raise


def _require_here(dataset: Any, path: Path) -> None:
    """Refuse a dataset whose voxels are elsewhere, or whose chunks are larger than its file can hold."""
    if dataset.external or dataset.is_virtual:
        raise InputError(f"{path}: its voxels are in other files; export them into one")
    _require_held(math.prod(dataset.chunks or ()) * dataset.dtype.itemsize, dataset, path)


def _require_held(size: int, dataset: Any, path: Path) -> None:
    if size > MAX_RATIO * path.stat().st_size:
        raise InputError(f"{path}: is truncated, or its header lies: {dataset.shape} voxels in so small a file")


def _values_of(dataset: Any, path: Path) -> npt.NDArray[Any]:
    _require_held(dataset.nbytes, dataset, path)
    offset = dataset.id.get_offset() if dataset.chunks is None else None
    if offset is None or not dataset.nbytes:
        return load_array(dataset)
    return np.memmap(path, dtype=dataset.dtype, mode="r", offset=offset, shape=dataset.shape)


def _unit_of(dataset: Any) -> str | None:
    return "um" if SIZE_OF_ELEMENT in dataset.attrs else None


def _spacing_of(dataset: Any, axes: str) -> npt.NDArray[np.float64] | None:
    sizes = np.asarray(dataset.attrs.get(SIZE_OF_ELEMENT, ()), dtype=np.float64)
    return sizes[[axes.index(axis) for axis in "xyz"]] if sizes.shape == (3,) else None
