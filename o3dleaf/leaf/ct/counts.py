"""About how many voxels a file has, before it is read."""

import logging
from pathlib import Path

import numpy as np
import tifffile

from o3dleaf.leaf.ct.formats import TIFF

VOXEL_BYTES = 1
"""Of the formats whose header is left to their reader."""


def count_voxels(path: Path) -> int:
    """Return about how many voxels a volume has; 0 where nothing can be told, and its reader will say why."""
    try:
        if path.is_dir():
            slices = [file for file in path.iterdir() if file.suffix.lower() in TIFF]
            return len(slices) * _in_tiff(slices[0]) if slices else 0
        if not path.is_file():
            return 0
        if path.suffix.lower() in TIFF:
            return _in_tiff(path)
        if path.suffix.lower() == ".npy":
            return int(np.load(path, mmap_mode="r", allow_pickle=False).size)
        return path.stat().st_size // VOXEL_BYTES
    except Exception:  # noqa: BLE001 - whatever a broken file makes libraries raise
        return 0


def _in_tiff(path: Path) -> int:
    logger = logging.getLogger("tifffile")
    before = logger.disabled
    logger.disabled = True
    try:
        with tifffile.TiffFile(path) as tiff:
            return int(np.prod(tiff.series[0].shape, dtype=object))
    finally:
        logger.disabled = before
