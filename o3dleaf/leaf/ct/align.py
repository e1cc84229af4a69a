"""Alignment of the patch: the blade into the (x, y) plane, its ridges along x, without resampling a voxel."""

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.optimize import minimize

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.leaf.ct.blade import OTHERS, SolidBlade
from o3dleaf.leaf.ct.heights import HAIR, fit_plane, hann_window
from o3dleaf.leaf.ct.volume import Volume, thinned

MIN_TURN = np.radians(0.25)
"""A smaller turn is within the accuracy of a ridge's direction; left out, it keeps the voxels on straight rows."""
MIN_WAVE, MAX_WAVE = 4.0, 1.0 / 2.5
"""Ridges are looked for with wavelengths from 4 voxels to 1/2.5 of the patch."""


@checked
def align_blade(
    volume: Volume,
    level: str | Finite = "mixture",
    *,
    up: npt.ArrayLike | None = None,
    along: npt.ArrayLike | None = None,
) -> FloatArray:
    r"""Return the rigid motion ``T_patch_ct`` that lays the blade of a volume flat, for `Volume.to_samples`.

    "We take care to appropriately rotate the micro-scale data before fitting to ensure that the
    leaf aligns with the :math:`(z_1, z_2)` plane" (the paper's section on the multi-scale
    reconstruction). The blade is the largest piece above `level` that columns of voxels cross.
    A plane is fitted to the middles of the blade over the columns that cross it whole (Hann weights,
    so that a part of a ridge at the edge does not tilt it; columns with hairs left out). The ridges'
    direction is that of the highest peak in the spectrum of the blade's thickness, to which both
    faces' ridges add.

    Parameters
    ----------
    volume : Volume
        The patch, in any orientation.
    level : {"mixture", "valley", "otsu"} or float
        The surface's intensity, as in `Volume.threshold`.
    up, along : (3,) array_like, optional
        Hints, in the volume's coordinates: roughly the adaxial side, and roughly towards the
        leaf's tip. Without them the sense is kept that turns the volume least.

    Returns
    -------
    transform : (4, 4) ndarray
        Takes the volume's coordinates to the patch's: z up with the mid-plane at z = 0, ridges along
        x; the middle of the volume keeps its x and y, so that an aligned volume moves along z only
        (turns under 0.25°, the accuracy of this function, are left out).

    Raises
    ------
    ReconstructionError
        If no blade spans the volume.
    """
    with single_threaded_blas():
        return _align(thinned(volume), level, up, along)


def _align(volume: Volume, level: str | float, up: npt.ArrayLike | None, along: npt.ArrayLike | None) -> FloatArray:
    blade = SolidBlade.of(volume.data > volume.threshold(level), volume.spacing)
    normal_axis, (u_axis, v_axis) = blade.axis, OTHERS[blade.axis]
    # A column that does not cross the blade whole says nothing of its middle.
    middles = np.where(blade.crossed, 0.5 * (blade.first + blade.last), np.nan)
    thickness = np.where(blade.crossed, blade.last - blade.first + 1.0, np.nan)
    u, v = (volume.origin[a] + volume.spacing[a] * np.arange(volume.shape[a]) for a in (u_axis, v_axis))
    scale, shift = volume.spacing[normal_axis], volume.origin[normal_axis]
    slopes, height = fit_plane(u, v, middles * scale + shift)
    direction = _ridge_direction(u, v, thickness * scale)
    frame = np.zeros((3, 3))
    frame[0, [u_axis, v_axis, normal_axis]] = [*direction, direction @ slopes]
    frame[2, [u_axis, v_axis, normal_axis]] = [*-slopes, 1.0]
    R = _turned_least(frame[0] / np.linalg.norm(frame[0]), frame[2] / np.linalg.norm(frame[2]), up, along)
    center = volume.bounds.mean(axis=0)
    on_plane = center.copy()
    on_plane[normal_axis] = height + slopes @ center[[u_axis, v_axis]]
    transform = np.eye(4)
    transform[:3, :3] = R
    transform[:3, 3] = [*(center - R @ center)[:2], -(R @ on_plane)[2]]
    return transform


def _ridge_direction(u: FloatArray, v: FloatArray, thickness: FloatArray) -> FloatArray:
    """Return the unit vector (2,) along the ridges, across the wave of highest power in the thickness (nu, nv)."""
    slopes, base = fit_plane(u, v, thickness)
    weight = hann_window(thickness)
    off = np.where(weight > 0, thickness, 0.0) - (u[:, np.newaxis] * slopes[0] + v * slopes[1] + base)
    limit = HAIR * np.median(abs(off[weight > 0]))
    wave = weight * np.clip(off, -limit, limit)
    wave -= weight * (wave.sum() / weight.sum())
    steps = np.array([u[1] - u[0], v[1] - v[0]])
    sizes = [fft.next_fast_len(4 * n) for n in wave.shape]
    power = abs(fft.fft2(wave, sizes)) ** 2
    fu, fv = (fft.fftfreq(n, step) for n, step in zip(sizes, steps, strict=True))
    frequency = np.hypot(fu[:, np.newaxis], fv)
    extent = (np.array(wave.shape) * steps).min()
    power[(frequency < 1 / (MAX_WAVE * extent)) | (frequency > 1 / (MIN_WAVE * steps.max()))] = 0.0
    i, j = np.unravel_index(int(np.argmax(power)), power.shape)

    def minus_power(shift: FloatArray) -> float:
        q = [fu[i] + shift[0] * fu[1], fv[j] + shift[1] * fv[1]]
        return -float(abs(np.exp(-2j * np.pi * q[0] * u) @ wave @ np.exp(-2j * np.pi * q[1] * v)))

    shift = minimize(minus_power, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-12}).x
    across = np.array([fu[i] + shift[0] * fu[1], fv[j] + shift[1] * fv[1]])
    direction: FloatArray = np.array([-across[1], across[0]]) / np.linalg.norm(across)
    return direction


def _turned_least(x: FloatArray, z: FloatArray, up: npt.ArrayLike | None, along: npt.ArrayLike | None) -> FloatArray:
    """Rotation with rows ±x, z × x, ±z: the signs that the hints ask for, else those nearest to no rotation."""
    turns = [np.stack([s * x, np.cross(r * z, s * x), r * z]) for s in (1.0, -1.0) for r in (1.0, -1.0)]
    for hint, row in ((up, 2), (along, 0)):
        if hint is not None:
            turns = [R for R in turns if R[row] @ as_points(hint, "hint", dim=3)[0] >= 0] or turns
    R: FloatArray = max(turns, key=np.trace)
    straight = np.round(R)
    # |R − S|² is 8 sin² of half the angle between two rotations.
    return straight if np.linalg.norm(R - straight) < np.sqrt(8) * np.sin(0.5 * MIN_TURN) else R
