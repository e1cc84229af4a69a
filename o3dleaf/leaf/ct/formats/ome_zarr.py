"""OME-Zarr: the finest level of a multiscale image, with the axes, scales and units that its metadata state."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.core.units import METERS
from o3dleaf.leaf.ct.formats.stated import VOXELS, Stated, VoxelLayout, import_extra, only_array, require_only

SUFFIXES = (".zarr",)
UNITS = {"micrometer": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "nanometer": "nm"}


def read(path: Path, layout: VoxelLayout) -> tuple[npt.NDArray[Any], Stated]:
    """Return an array of a Zarr folder and what its OME metadata state; other axes than x, y and z have length 1.

    Raises
    ------
    InputError
        If zarr is not installed, the folder is damaged, or it does not say which array is meant.
    """
    array, stated = open_array(path, layout)
    with _refused(path):
        return np.asarray(array[...]).reshape(array.shape[-3:]), stated


def open_array(path: Path, layout: VoxelLayout) -> tuple[Any, Stated]:
    """Return the same, its chunks read where they are asked for.

    Raises
    ------
    InputError
        As of `read`.
    """
    require_only(layout, ("dataset", "axes"), path)
    zarr = import_extra("zarr", "formats", path)
    with _refused(path):
        node = zarr.open(str(path), mode="r")
        if isinstance(node, zarr.Array):
            array, stated = node, Stated(axes=layout.axes or Stated().axes)
        else:
            array, stated = _array_of(zarr, node, layout, path)
    if array.ndim < 3 or any(count != 1 for count in array.shape[:-3]):
        raise InputError(f"{path}: has an array of shape {array.shape}; export one channel of one time point")
    return array, stated


@contextmanager
def _refused(path: Path) -> Iterator[None]:
    """Raise `InputError` for whatever zarr makes of broken metadata and chunks."""
    try:
        yield
    except InputError:
        raise
    except Exception as cause:
        raise InputError(f"{path}: cannot be read as Zarr ({cause}); export it again") from cause


def _array_of(zarr: Any, group: Any, layout: VoxelLayout, path: Path) -> tuple[Any, Stated]:
    """Return the array that is wanted, or the finest level of the image, and its lattice."""
    image = next(iter((group.attrs.get("ome") or group.attrs).get("multiscales", [])), None)
    if image is None or layout.dataset is not None:
        known = [
            name
            for name, node in group.members(max_depth=None)
            if isinstance(node, zarr.Array) and node.ndim >= 3 and node.dtype.kind in VOXELS
        ]
        return group[only_array(known, layout.dataset, path)], Stated(axes=layout.axes or Stated().axes)
    axes = [axis if isinstance(axis, dict) else {"name": axis} for axis in image["axes"]]
    names = "".join(axis["name"] for axis in axes)[-3:]
    if sorted(names) != ["x", "y", "z"]:
        raise InputError(f"{path}: its last axes are {', '.join(names)}; give an image of axes x, y and z")
    finest = image["datasets"][0]
    return group[finest["path"]], _lattice(axes[-3:], finest.get("coordinateTransformations", []), names)


def _lattice(axes: list[dict[str, Any]], transforms: list[dict[str, Any]], names: str) -> Stated:
    """Return the lattice of the last three axes: their scale, their translation, and their one unit."""
    order = [names.index(axis) for axis in "xyz"]
    units = [UNITS.get(axes[k].get("unit", "")) for k in order]
    moves = {each["type"]: np.asarray(each[each["type"]], dtype=np.float64)[-3:][order] for each in transforms}
    if "scale" not in moves or len(set(map(bool, units))) != 1:
        return Stated(axes=names)
    factors = np.array([METERS[unit] / METERS[units[0]] if unit and units[0] else 1.0 for unit in units])
    origin = moves["translation"] * factors if "translation" in moves else None
    return Stated(moves["scale"] * factors, origin, units[0], names)
