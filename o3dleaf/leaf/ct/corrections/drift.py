"""Intensities that drift from slice to slice, brought back to those of the whole volume."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_smoothing_spline

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.ct.corrections.pure import classes_of, pure_voxels, slabs_of
from o3dleaf.leaf.ct.volume import Volume

ROUNDS = 3
"""Voxels are told apart by what is known of the drift, which is then found anew: the first round knows none."""
MIN_VOXELS = 100
"""Of a kind, in a slice that tells its mean: to a tenth of the noise."""
MIN_SLICES = 5
"""That a smoothing spline takes; of fewer the mean is all that is known."""


@dataclass(frozen=True)
class Drift:
    """Mean intensities of air and leaf along the third axis of a volume.

    Attributes
    ----------
    air, leaf : (nz,) ndarray
        Smooth curves.
    means : (2,) ndarray
        Of all air, and all leaf.
    """

    air: FloatArray
    leaf: FloatArray
    means: FloatArray

    @property
    def largest(self) -> float:
        """The greatest deviation of a curve from its mean, as a share of the step from air to leaf."""
        off = max(np.abs(self.air - self.means[0]).max(), np.abs(self.leaf - self.means[1]).max())
        return float(off / (self.means[1] - self.means[0]))

    def __str__(self) -> str:
        return f"drift along z: at most {self.largest:.2g} of the step from air to leaf"


@checked
def find_drift(volume: Volume) -> Drift:
    r"""Return how the mean intensities of air and of leaf run along z, slice by slice.

    The means are those of voxels that are air, or leaf, with all their neighbors, and are smoothed by a cubic spline
    that generalized cross-validation chooses, each slice weighted by its number of voxels (Wahba, Spline models for
    observational data, 1990). Air and leaf are told apart by the middle of both curves, three times over.

    Parameters
    ----------
    volume : Volume

    Raises
    ------
    InputError
        If air and leaf cannot be told apart.
    """
    means = classes_of(volume).means
    air, leaf = (np.full(volume.shape[2], mean) for mean in means)
    for _ in range(ROUNDS):
        counts, sums = _slices(volume, 0.5 * (air + leaf))
        air, leaf = (_smooth(counts[kind], sums[kind], means[kind]) for kind in range(2))
    # What is kept is the mean of all slices that tell one, so that a volume without drift stays as it is.
    told = [_mean(counts[kind], sums[kind], means[kind]) for kind in range(2)]
    return Drift(air, leaf, np.array(told))


@checked
def remove_drift(volume: Volume) -> Volume:
    r"""Return a volume whose air and leaf have the same mean intensities in every slice.

    :math:`I' = \mu_0 + (\mu_1 - \mu_0)\,(I - a(z)) / (l(z) - a(z))`, with a and l the curves of air and leaf
    (`find_drift`) and μ their means.

    Parameters
    ----------
    volume : Volume
        Its slices follow one another along z, in the order in which they were scanned.

    Returns
    -------
    Volume
        In single precision.

    Raises
    ------
    InputError
        If air and leaf cannot be told apart.
    """
    drift = find_drift(volume)
    gain = (drift.means[1] - drift.means[0]) / (drift.leaf - drift.air)
    data = np.empty(volume.shape, dtype=np.float32)
    for slab, values in slabs_of(volume):
        data[:, :, slab] = drift.means[0] + gain[slab] * (values - drift.air[slab])
    return Volume(data, volume.spacing, volume.origin, volume.unit)


def _slices(volume: Volume, levels: FloatArray) -> tuple[npt.NDArray[np.int_], FloatArray]:
    """Return the number of voxels (2, nz) of air and leaf in each slice, and the sum of their intensities."""
    nz = volume.shape[2]
    counts, sums = np.zeros((2, nz), dtype=np.int_), np.zeros((2, nz))
    for slab, values in slabs_of(volume):
        for kind, pure in enumerate(pure_voxels(volume, slab, levels)):
            counts[kind, slab] = np.count_nonzero(pure, axis=(0, 1))
            sums[kind, slab] = np.where(pure, values, 0.0).sum(axis=(0, 1))
        progress.report(slab.stop, nz)
    return counts, sums


def _smooth(counts: npt.NDArray[np.int_], sums: FloatArray, otherwise: float) -> FloatArray:
    """Return a smooth curve through the means of the slices, constant beyond the first and the last that tells one."""
    told = np.flatnonzero(counts >= MIN_VOXELS)
    if len(told) < MIN_SLICES:
        return np.full(len(counts), _mean(counts, sums, otherwise))
    weights = counts[told] / counts[told].mean()
    spline = make_smoothing_spline(told, sums[told] / counts[told], w=weights)
    curve: FloatArray = spline(np.clip(np.arange(len(counts)), told[0], told[-1]))
    return curve


def _mean(counts: npt.NDArray[np.int_], sums: FloatArray, otherwise: float) -> float:
    """Return the mean of all slices that tell one."""
    told = counts >= MIN_VOXELS
    return float(sums[told].sum() / counts[told].sum()) if told.any() else otherwise
