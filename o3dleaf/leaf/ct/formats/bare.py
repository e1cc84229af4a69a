"""Arrays without a lattice: NumPy's NPY and NPZ, and bare numbers whose layout is given."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.formats.stated import VOXELS, Stated, VoxelLayout, only_array, require_only

NPY, NPZ, RAW = ".npy", ".npz", (".raw", ".bin")
SUFFIXES = (NPY, NPZ, *RAW)
MAX_RATIO = 2000
"""Deflate, the compression of NPZ, packs zeros 1032 to 1."""


def read(path: Path, layout: VoxelLayout) -> tuple[npt.NDArray[Any], Stated]:
    """Return the array of a file, mapped where it is not packed; NPY and NPZ have axes (x, y, z) if nothing is said.

    Raises
    ------
    InputError
        If the file is damaged, does not say which array is meant, or its size is not that of the layout.
    """
    suffix = path.suffix.lower()
    if suffix in RAW:
        require_only(layout, ("shape", "dtype", "offset", "axes"), path)
        return _read_raw(path, layout), Stated()
    require_only(layout, ("axes",) if suffix == NPY else ("axes", "dataset"), path)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False) if suffix == NPY else _read_npz(path, layout.dataset)
    except InputError:
        raise
    except Exception as cause:  # the header is parsed as Python would, with all that Python may say to it
        reason = " ".join(str(cause).split())
        raise InputError(f"{path}: cannot be read as a NumPy array ({reason}); save it again") from cause
    return np.asarray(array), Stated(axes="xyz")


def _read_npz(path: Path, wanted: str | None) -> npt.NDArray[Any]:
    """Return an array of an archive; its size is compared with the file's before it is unpacked."""
    with zipfile.ZipFile(path) as archive:
        heads = {}
        for entry in archive.infolist():
            with archive.open(entry) as file:
                if file.read(6) != b"\x93NUMPY":
                    continue
                version = file.read(2)
                header = np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
                shape, _, kind = header(file)
            if len(shape) == 3 and kind.kind in VOXELS:
                heads[entry.filename.removesuffix(NPY)] = (shape, kind)
        name = only_array(sorted(heads), wanted, path)
        shape, kind = heads[name]
        if np.prod([float(count) for count in shape]) * kind.itemsize > MAX_RATIO * path.stat().st_size:
            raise InputError(
                f"{path}: is truncated, or its header lies: {shape} voxels in so small a file; save it again"
            )
    with np.load(path, allow_pickle=False) as arrays:
        return np.asarray(arrays[name])


def _read_raw(path: Path, layout: VoxelLayout) -> npt.NDArray[Any]:
    """Return bare numbers, mapped, in the order of their axes in the file."""
    kind = layout.number_type
    if layout.shape is None or kind is None:
        raise InputError(
            f"{path}: bare numbers do not say what they are; give their layout, as 'shape=700x700x160 dtype=uint16'"
        )
    stored = tuple(layout.shape["xyz".index(axis)] for axis in layout.axes or Stated().axes)
    offset, size = layout.offset or 0, path.stat().st_size
    expected = offset + int(np.prod(stored, dtype=object)) * kind.itemsize
    if expected != size:
        raise InputError(
            f"{path}: has {size:,} bytes where the layout takes {expected:,}; check shape, dtype and offset, "
            "or copy the file again"
        )
    return np.memmap(path, dtype=kind, mode="r", offset=offset, shape=stored)
