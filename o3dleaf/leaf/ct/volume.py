"""The volume: intensities on a lattice of voxels, with its place, its unit, and its surface level."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, Unit
from o3dleaf.core.checks.arrays import FloatArray, as_floats
from o3dleaf.core.checks.coordinates import as_bounds, as_points
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.checks.voxels import as_mask, as_voxels
from o3dleaf.core.errors import InputError
from o3dleaf.core.units import check_unit
from o3dleaf.leaf.ct.threshold import histogram_threshold, thin, thinning_stride


class PlacedVoxels:
    """The lattice of a volume's voxels, in memory or on disk."""

    spacing: FloatArray
    origin: FloatArray

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (x, y, z)."""
        raise NotImplementedError

    @property
    def voxel_bounds(self) -> FloatArray:
        """(2, 3) box of the voxel centers, in `unit`."""
        return np.stack([self.origin, self.origin + self.spacing * (np.array(self.shape) - 1)])

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) box of the voxels, face to face, in `unit`; its sides are the periods of a tiling."""
        half = 0.5 * self.spacing
        return self.voxel_bounds + np.stack([-half, half])


@checked
@dataclass(frozen=True, eq=False, init=False, repr=False)
class Volume(PlacedVoxels):
    r"""Intensities on a regular lattice, voxel (i, j, k) centered at ``origin + spacing * (i, j, k)``.

    Parameters
    ----------
    data : (nx, ny, nz) ndarray of real numbers
        Intensity (radio-density) of the voxels; ``data[i, j, k]`` runs along (x, y, z). It is not copied.
    spacing : float or (3,) array_like
        Distance between voxel centers along (x, y, z), in `unit`.
    origin : (3,) array_like
        Center of voxel (0, 0, 0), in `unit`.
    unit : str, optional
        Unit of length of `spacing` and `origin`.

    Raises
    ------
    InputError
        If the data are not three-dimensional real numbers, thinner than 2 voxels or not finite, or
        a spacing is not above zero.
    UnitError
        If the unit is unknown.
    """

    data: npt.NDArray[Any]
    spacing: FloatArray
    origin: FloatArray
    unit: Unit | None = None

    def __init__(
        self,
        data: npt.NDArray[Any],
        spacing: npt.ArrayLike,
        origin: npt.ArrayLike = (0.0, 0.0, 0.0),
        unit: Unit | None = None,
    ) -> None:
        object.__setattr__(self, "data", _as_voxels(data))
        object.__setattr__(self, "spacing", as_spacing(spacing))
        object.__setattr__(self, "origin", _frozen(as_points(origin, "origin", dim=3)[0]))
        object.__setattr__(self, "unit", check_unit(unit))

    def __repr__(self) -> str:
        shape = " × ".join(f"{count:,}" for count in self.shape)
        spacing = " × ".join(f"{step:.6g}" for step in self.spacing)
        return f"Volume({shape} voxels of {spacing}, {self.data.dtype}, unit {self.unit})"

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along (x, y, z)."""
        nx, ny, nz = self.data.shape
        return nx, ny, nz

    @checked
    def threshold(self, method: str | Finite = "mixture") -> float:
        """Return the intensity that separates leaf from air.

        Parameters
        ----------
        method : {"mixture", "valley", "otsu"} or float
            The middle of air and leaf in a model of the histogram, the valley between its two peaks, Otsu's threshold,
            or the number itself.

        Raises
        ------
        InputError
            If all voxels hold one value, the histogram shows no two classes, or a given number lies
            outside the range of the data, so that there is no surface.

        See Also
        --------
        histogram_threshold : the automatic methods.
        """
        if isinstance(method, str):
            return histogram_threshold(self.data, method)
        level, low, high = float(method), float(self.data.min()), float(self.data.max())
        if not low < level < high:
            raise InputError(
                f"threshold: {level:g} is outside the volume's range of intensities, {low:g} to {high:g}; "
                "choose a value between them"
            )
        return level

    @checked
    def to_samples(
        self,
        level: str | Finite = "mixture",
        *,
        mask: npt.ArrayLike | None = None,
        transform: npt.ArrayLike | None = None,
        bounds: npt.ArrayLike | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        r"""Return voxel centers :math:`z_i` and the values :math:`f_i - f_{\mathrm{surface}}`.

        The data of the paper's implicit fit: positive in the leaf, negative in the air.

        Parameters
        ----------
        level : {"mixture", "valley", "otsu"} or float
            The surface's intensity, as in `threshold`.
        mask : (nx, ny, nz) array_like of bool, optional
            The voxels to keep (default: all).
        transform : (4, 4) array_like, optional
            Rigid motion of the points, for example from `align_blade`; voxels are never resampled.
        bounds : (2, 3) array_like, optional
            Keep the points in this box only, after `transform`, for example from `inscribed_box`.

        Returns
        -------
        points : (n, 3) ndarray
            Voxel centers, in `unit`, z fastest.
        values : (n,) ndarray
            Intensity less level.

        Raises
        ------
        InputError
            If the level is outside the data's range or no voxel is left.
        """
        surface = self.threshold(level)
        keep = np.ones(self.shape, dtype=bool) if mask is None else as_mask(mask, self.shape)
        points = np.argwhere(keep) * self.spacing + self.origin
        values = self.data[keep].astype(np.float64) - surface
        if transform is not None:
            points = apply_transform(transform, points)
        if bounds is not None:
            low, high = as_bounds(bounds, 3)
            inside = np.all((points >= low) & (points <= high), axis=1)
            points, values = points[inside], values[inside]
        if len(points) == 0:
            raise InputError("samples: no voxel is left; widen the bounds or the mask")
        return points, values

    def crop(self, bounds: npt.ArrayLike) -> "Volume":
        """Return the volume of the voxels whose centers lie in `bounds` (2, 3), in `unit`, without a copy.

        Raises
        ------
        InputError
            If fewer than 2 voxels are left along an axis.
        """
        slices, origin = slices_in(self, bounds)
        return Volume(self.data[slices], self.spacing, origin, self.unit)


def slices_in(lattice: PlacedVoxels, bounds: npt.ArrayLike) -> tuple[tuple[slice, ...], FloatArray]:
    """Return the slices of the voxels whose centers lie in `bounds` (2, 3), and the first one's center."""
    low, high = as_bounds(bounds, 3)
    count = np.array(lattice.shape)
    # A millionth of a voxel forgives the rounding of a box that was computed from this lattice.
    first = np.clip(np.ceil((low - lattice.origin) / lattice.spacing - 1e-6), 0, count).astype(int)
    stop = np.clip(np.floor((high - lattice.origin) / lattice.spacing + 1e-6) + 1, first, count).astype(int)
    if (stop - first < 2).any():
        left = " × ".join(str(n) for n in stop - first)
        raise InputError(f"bounds: leave {left} voxels of {lattice.bounds.tolist()}; give a box in the volume")
    return tuple(slice(a, b) for a, b in zip(first, stop, strict=True)), lattice.origin + lattice.spacing * first


def thinned(volume: Volume) -> Volume:
    """Return every n-th voxel along each axis, a few millions of them, without a copy."""
    spacing = volume.spacing * thinning_stride(volume.data)
    return Volume(thin(volume.data), spacing, volume.origin, volume.unit)


def apply_transform(transform: npt.ArrayLike, points: npt.ArrayLike) -> FloatArray:
    """Return (n, 3) points moved by a (4, 4) rigid motion, in the unit of its last column."""
    matrix = as_points(transform, "transform", dim=4)
    if matrix.shape != (4, 4):
        raise InputError(f"transform: has shape {matrix.shape}; give a (4, 4) rigid motion")
    # Not BLAS: its last bits change with the number of threads.
    moved: FloatArray = np.einsum("nj,ij->ni", as_points(points, dim=3), matrix[:3, :3]) + matrix[:3, 3]
    return moved


def as_spacing(spacing: npt.ArrayLike) -> FloatArray:
    """Return one number or three as a (3,) spacing above zero, or raise `InputError`."""
    try:
        steps = np.broadcast_to(as_floats(spacing, "spacing"), (3,)).copy()
    except (TypeError, ValueError) as cause:
        raise InputError(f"spacing: is {spacing!r}; give one number or three, along (x, y, z)") from cause
    for step in steps:
        require_positive(step, "spacing")
    return _frozen(steps)


def _as_voxels(data: npt.NDArray[Any]) -> npt.NDArray[Any]:
    voxels = as_voxels(data, "volume")
    if voxels.ndim != 3 or min(voxels.shape) < 2:
        raise InputError(f"volume: has shape {voxels.shape}; give (nx, ny, nz) voxels, at least 2 along each axis")
    return voxels


def _frozen(array: FloatArray) -> FloatArray:
    array = array.copy()
    array.flags.writeable = False
    return array
