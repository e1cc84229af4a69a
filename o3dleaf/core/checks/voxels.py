"""Arrays of voxels, and their steps."""

from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, as_array, as_floats, require_moderate
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError


def as_step(spacing: float | npt.ArrayLike, dimension: int = 3) -> FloatArray:
    """Return the (d,) steps of a spacing given as one number or one an axis, or raise `InputError`."""
    step = as_floats(spacing, "spacing")
    if step.shape not in {(), (dimension,)}:
        raise InputError(f"spacing: has shape {step.shape}; give one number, or one per axis")
    for each in step.ravel():
        require_positive(float(each), "spacing")
    return np.broadcast_to(step, dimension).copy()


def as_voxels(data: npt.ArrayLike, name: str = "values") -> npt.NDArray[Any]:
    """Return an array of finite real numbers in this machine's byte order, copied only if it must be.

    Raises
    ------
    InputError
        If it holds anything else, or has no voxel.
    """
    voxels = as_array(data, name)
    if voxels.dtype.kind not in "buif":
        raise InputError(f"{name}: has {voxels.dtype} values; give real numbers")
    if voxels.ndim == 0 or voxels.size == 0:
        raise InputError(f"{name}: has shape {voxels.shape}; give an array of voxels")
    if voxels.dtype.kind == "b":
        return voxels.astype(np.uint8)
    if not voxels.dtype.isnative:
        # Compiled loops know this machine's byte order only; ImageJ writes the other one.
        voxels = voxels.astype(voxels.dtype.newbyteorder("="))
    if voxels.dtype.kind == "f":
        # Slab by slab in the file's own order, so that a mapped file is read once and never held whole.
        axis = int(np.argmax(voxels.strides))
        for i in range(voxels.shape[axis]):
            require_moderate(np.moveaxis(voxels, axis, 0)[i], f"{name}, slab {i} along axis {axis}")
    return voxels


def as_mask(mask: npt.ArrayLike, shape: tuple[int, ...], name: str = "mask") -> npt.NDArray[np.bool_]:
    """Return `mask` as an array of bool of the given shape, or raise `InputError`."""
    array = as_array(mask, name)
    if array.shape != shape or array.dtype != np.bool_:
        raise InputError(f"{name}: is {array.dtype} of shape {array.shape}; give one bool per voxel, shape {shape}")
    return array
