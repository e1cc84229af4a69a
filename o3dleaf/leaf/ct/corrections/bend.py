"""A blade that bends in its volume, found and straightened: every tile would repeat the bend."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import measure_in_words
from o3dleaf.leaf.ct.blade import OTHERS, SolidBlade
from o3dleaf.leaf.ct.heights import fit_quadric
from o3dleaf.leaf.ct.volume import Volume, thinned

MIN_BEND = 0.5
"""Voxels: less is not resampled for."""
SLAB = 1 << 20
"""Voxels, about, that are resampled at once."""


@dataclass(frozen=True)
class BladeBend:
    """The second-order terms of the middle of a blade over the plane of two axes of its volume.

    Attributes
    ----------
    axis : int
        Axis of the volume across the blade; heights are measured along it.
    center : (2,) ndarray
        The middle of the volume, on the other axes.
    terms : (3,) ndarray
        Of x², x y and y² from there, in 1/`unit`.
    limits : (2,) ndarray
        The least and the largest value of these terms over the blade.
    deviation, relief : float
        Root mean square deviations of the terms from their mean, and of the middles from the quadric, without hairs;
        of the latter at least half a voxel.
    unit : str or None
    """

    axis: int
    center: FloatArray
    terms: FloatArray
    limits: FloatArray
    deviation: float
    relief: float
    unit: str | None

    def heights(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the heights (nu, nv) by which the blade bends, about their middle; beside it the nearest to them."""
        x, y = np.meshgrid(u - self.center[0], v - self.center[1], indexing="ij")
        return np.asarray(np.clip(_second_order(x, y) @ self.terms, *self.limits) - self.limits.mean())

    @property
    def range(self) -> float:
        """From the lowest to the highest height, in `unit`."""
        return float(np.ptp(self.limits))

    @property
    def prevails(self) -> bool:
        """Whether the bend is larger than the blade's own relief: tiles would show it more than all else."""
        return self.deviation > self.relief

    def __str__(self) -> str:
        return f"the blade bends by {measure_in_words(self.range, self.unit, digits=3)} over the volume"


@checked
def find_bend(volume: Volume, level: str | Finite = "mixture") -> BladeBend:
    r"""Return how the blade of a volume bends: the quadric through the middles of its columns, by least squares.

    Parameters
    ----------
    volume : Volume
        Its blade lies within some 30 degrees of two of its axes.
    level : {"mixture", "valley", "otsu"} or float
        The surface's intensity, as in `Volume.threshold`.

    Raises
    ------
    ReconstructionError
        If no blade spans the volume.
    """
    small = thinned(volume)
    blade = SolidBlade.of(small.data > volume.threshold(level), small.spacing)
    axes = OTHERS[blade.axis]
    center = volume.bounds.mean(axis=0)[list(axes)]
    u, v = (small.origin[a] + small.spacing[a] * np.arange(small.shape[a]) - center[n] for n, a in enumerate(axes))
    middles = np.where(blade.crossed, 0.5 * (blade.first + blade.last) * small.spacing[blade.axis], np.nan)
    quadric, kept = fit_quadric(u, v, middles, float(small.spacing[blade.axis]))
    x, y = (place[kept] for place in np.meshgrid(u, v, indexing="ij"))
    bent, flat = _second_order(x, y) @ quadric[3:], np.stack([np.ones(len(x)), x, y], axis=-1) @ quadric[:3]
    # Middles are known to half a voxel; of a plate all may be the same.
    relief = max(
        float(np.sqrt(np.mean((middles[kept] - flat - bent) ** 2))), MIN_BEND * float(small.spacing[blade.axis])
    )
    limits = np.array([bent.min(), bent.max()])
    return BladeBend(blade.axis, center, quadric[3:], limits, float(bent.std()), relief, volume.unit)


def _second_order(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([x * x, x * y, y * y], axis=-1)


@checked
def remove_bend(volume: Volume, level: str | Finite = "mixture") -> Volume:
    r"""Return a volume whose blade does not bend: I'(x, y, z) = I(x, y, z + h(x, y)).

    h is the second-order part of the blade's middle (`find_bend`), which an arc leaves by :math:`a^4/8R^3`, for half
    a width a and radius R. Columns are moved along themselves, between voxels by a cubic B-spline (Unser, IEEE Signal
    Processing Magazine, 1999): thicknesses along them stay, and lengths along the blade are those of its projection.

    Parameters
    ----------
    volume, level
        As in `find_bend`.

    Returns
    -------
    Volume
        In single precision, and higher by the bend, so that nothing is lost; the volume itself where the blade bends
        by less than half a voxel.

    Raises
    ------
    ReconstructionError
        If no blade spans the volume.
    """
    bend = find_bend(volume, level)
    step = float(volume.spacing[bend.axis])
    if bend.range < MIN_BEND * step:
        return volume
    axes = OTHERS[bend.axis]
    u, v = (volume.origin[a] + volume.spacing[a] * np.arange(volume.shape[a]) for a in axes)
    shift = bend.heights(u, v) / step
    more = int(np.ceil(np.abs(shift).max()))
    columns = np.moveaxis(volume.data, bend.axis, 2)
    moved = np.empty((*shift.shape, columns.shape[2] + 2 * more), dtype=np.float32)
    rows = max(1, SLAB // (moved.shape[1] * moved.shape[2]))
    for start in range(0, len(moved), rows):
        slab = slice(start, min(start + rows, len(moved)))
        moved[slab] = _moved(columns[slab], shift[slab], more)
        progress.report(slab.stop, len(moved))
    origin = volume.origin.copy()
    origin[bend.axis] -= more * step
    return Volume(np.moveaxis(moved, 2, bend.axis), volume.spacing, origin, volume.unit)


def _moved(columns: npt.NDArray[np.generic], shift: FloatArray, more: int) -> FloatArray:
    """Return columns (nu, nv, nw) moved by shifts (nu, nv), in voxels, with some more at both ends."""
    nu, nv, nw = columns.shape
    places = np.empty((3, nu, nv, nw + 2 * more))
    places[0], places[1] = np.arange(nu)[:, np.newaxis, np.newaxis], np.arange(nv)[:, np.newaxis]
    places[2] = np.arange(-more, nw + more) + shift[:, :, np.newaxis]
    # What lies past an end is as at the end; a spline through the samples is them at whole places along u and v.
    return np.asarray(map_coordinates(columns.astype(np.float64), places, order=3, mode="nearest"))
