"""OME-Zarr: the finest level of a multiscale image, with the axes, scales and units that its metadata state."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError
from o3dleaf.core.resources.scratch import load_array
from o3dleaf.core.units import METERS
from o3dleaf.leaf.ct.formats.stated import VOXELS, Stated, VoxelLayout, import_reader, only_array, reading, require_only

SUFFIXES = (".zarr",)
CODECS = {
    "bytes", "transpose", "sharding_indexed", "crc32c", "crc32", "adler32", "fletcher32", "gzip", "zlib", "zstd", "lz4",
    "lzma", "bz2", "blosc", "shuffle", "delta", "fixedscaleoffset", "quantize", "bitround", "packbits",
}  # fmt: skip
"""What may pack voxels: none that makes objects, as pickle does."""
METADATA = (".z", "zarr.json")
"""How the names of files begin that are no chunks."""
BLOSC_HEAD = struct.Struct("<4s3I")
"""Of a chunk: its versions and flags, bytes unpacked, of a block, and packed."""
WIDEST = 8
"""Bytes of a number."""
MAX_RATIO = 2000
"""No compression packs voxels of a scan tighter; what was never written takes no place, and is no scan."""
UNITS = {"micrometer": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "nanometer": "nm"}


def read(path: Path, layout: VoxelLayout) -> tuple[npt.NDArray[Any], Stated]:
    """Return an array of a Zarr folder and what its OME metadata state; other axes than x, y and z have length 1.

    Raises
    ------
    InputError
        If zarr is not installed, the folder is damaged, or it does not say which array is meant.
    """
    array, stated = open_array(path, layout)
    with reading(path, "Zarr"):
        _require_held(array.nbytes, array, path)
        return load_array(array).reshape(array.shape[-3:]), stated


def open_array(path: Path, layout: VoxelLayout) -> tuple[Any, Stated]:
    """Return the same, its chunks read where they are asked for.

    Raises
    ------
    InputError
        As of `read`.
    """
    require_only(layout, ("dataset", "axes"), path)
    zarr = import_reader("zarr", path)
    with reading(path, "Zarr"):
        node = zarr.open(str(path), mode="r")
        if isinstance(node, zarr.Array):
            array, stated = node, Stated(axes=layout.axes or Stated().axes)
        else:
            array, stated = _array_of(zarr, node, layout, path)
        _require_plain(array, path)
    if array.ndim < 3 or any(count != 1 for count in array.shape[:-3]):
        raise InputError(f"{path}: has an array of shape {array.shape}; export one channel of one time point")
    return array, stated


def _require_plain(array: Any, path: Path) -> None:
    """Refuse an array that is no numbers, has another codec than those listed, or chunks larger than its files."""
    facts = array.metadata.to_dict()
    codecs = set(_codecs([facts.get(key) for key in ("codecs", "compressor", "filters")]))
    strange = codecs - CODECS
    if strange or array.dtype.kind not in VOXELS:
        what = f"packed by {', '.join(sorted(strange))}" if strange else f"of type {array.dtype}"
        raise InputError(f"{path}: is {what}, and not read; export numbers, packed by zstd, blosc or gzip")
    chunk = math.prod(array.chunks) * array.dtype.itemsize
    _require_held(chunk, array, path)
    if "blosc" in codecs:
        if "sharding_indexed" in codecs:
            raise InputError(
                f"{path}: is packed by blosc in shards, which is not read; export without shards, or by zstd"
            )
        _require_whole_blosc(path / array.path, chunk)


def _require_held(size: int, array: Any, path: Path) -> None:
    held = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    if size > MAX_RATIO * held:
        raise InputError(f"{path}: is truncated, or its header lies: {array.shape} voxels in {held} bytes")


def _require_whole_blosc(folder: Path, size: int) -> None:
    """Refuse chunks of other sizes than they state: blosc reads on behind their end, and makes room for any number."""
    for file in folder.rglob("*"):
        if file.is_file() and not file.name.startswith(METADATA):
            with file.open("rb") as stream:
                head = stream.read(BLOSC_HEAD.size)
            _, unpacked, _, packed = BLOSC_HEAD.unpack(head.ljust(BLOSC_HEAD.size, b"\0"))
            # A filter may change the type, a sum stand behind.
            if not BLOSC_HEAD.size <= packed <= file.stat().st_size or not 0 < unpacked <= WIDEST * size:
                raise InputError(f"{file}: is truncated or damaged, {unpacked} bytes in {packed}; copy it again")


def _codecs(facts: Any) -> Iterator[str]:
    """Yield the names of all codecs in what is stated of an array, in both versions of Zarr."""
    if isinstance(facts, dict):
        named = facts.get("name") or facts.get("id")
        if named is not None:
            yield str(named).removeprefix("numcodecs.")
        facts = list((facts.get("configuration") or {}).values())
    if isinstance(facts, list | tuple):
        for each in facts:
            yield from _codecs(each)


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
