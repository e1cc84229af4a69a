"""Voxels that are air or leaf and nothing between, and what each is off the intensity of its kind."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.mixture import Mixture
from o3dleaf.leaf.ct.threshold import find_classes
from o3dleaf.leaf.ct.volume import Volume

BLUR = 1.0
"""Voxels: air and leaf are told apart by smoothed intensities, whose noise is a seventh."""
AROUND = 5
"""Edge, in voxels, of the cube of one kind around a pure voxel: a blurred surface is some two voxels wide."""
HALO = AROUND // 2 + 4
"""Slices beside a slab that its voxels are judged by: half that cube, and what the blur reaches."""
SLAB = 1 << 22
"""Voxels, about, that are looked at at once."""


def classes_of(volume: Volume) -> Mixture:
    """Return air and leaf of a volume.

    Raises
    ------
    InputError
        If they cannot be told apart.
    """
    classes = find_classes(volume.data)
    if classes is None:
        raise InputError("volume: does not show two classes, air and leaf, to compare; crop it to the leaf")
    return classes


def slabs_of(volume: Volume) -> Iterator[tuple[slice, FloatArray]]:
    """Yield the slices along z of a volume, some at a time, and their intensities."""
    nx, ny, nz = volume.shape
    step = max(1, SLAB // (nx * ny))
    for first in range(0, nz, step):
        slab = slice(first, min(first + step, nz))
        yield slab, volume.data[:, :, slab].astype(np.float64)


def pure_voxels(volume: Volume, slab: slice, levels: FloatArray) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return which voxels of some slices are air, and which are leaf, by the levels (nz,) of all slices."""
    around = slice(max(slab.start - HALO, 0), min(slab.stop + HALO, volume.shape[2]))
    smooth = gaussian_filter(volume.data[:, :, around].astype(np.float32), BLUR)
    leaf = (smooth > levels[around]).astype(np.uint8)
    inner = (slice(None), slice(None), slice(slab.start - around.start, slab.stop - around.start))
    return maximum_filter(leaf, AROUND)[inner] == 0, minimum_filter(leaf, AROUND)[inner] == 1
