"""The threshold between leaf and air: where the histogram parts the two."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d
from skimage.filters import threshold_otsu

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.mixture import Mixture, fit_mixture

METHODS = ("mixture", "valley", "otsu")
BINS = 256
MAX_VOXELS = 4_000_000
"""A histogram of so many voxels is smooth, and a blade is found in them as well; larger volumes are thinned."""
MAX_RIPPLE = 0.8
"""A valley above this fraction of the lower peak is a ripple of one peak."""
MIN_SEPARATION = 0.8
"""Share of the variance that Otsu's two classes explain: 2/π for one normal peak, 3/4 for a flat histogram."""
MIN_CONTRAST = 2.5
"""Deviations between two classes: a single normal peak is taken for two that are at most about 2 apart."""
MAX_BETWEEN = 0.98
"""Share of voxels between air and leaf beyond which there is no class to speak of: 0.995 for a flat histogram."""
CURE = "give the threshold as a number"


def histogram_threshold(data: npt.NDArray[Any], method: str = "mixture") -> float:
    """Return the threshold between air and leaf in the histogram of intensities.

    ``"mixture"`` is the middle of air and leaf in a model of both and of the voxels between them (`fit_mixture`),
    which is at the surface whatever the noise, peaks or not; ``"valley"`` smooths the histogram until two peaks are
    left and takes the lowest point between them (Prewitt and Mendelsohn 1966); ``"otsu"`` maximizes the variance
    between the two classes (Otsu 1979). Zero-valued voxels are padding and are excluded, as in the paper's section on
    micro-scale data; where nothing with two classes is left, they are taken for air.

    Parameters
    ----------
    data : ndarray
        Intensities, any shape.
    method : {"mixture", "valley", "otsu"}
        How to choose.

    Raises
    ------
    InputError
        If all voxels have one value or no two classes can be told apart.
    """
    choose = {"valley": _valley, "otsu": _otsu, "mixture": _mixture}[require_choice(method, METHODS, "threshold")]
    low, high = data.min(), data.max()
    if low == high:
        raise InputError(f"volume: all voxels have one value, {low}; check the file, or scan again")
    for sample in _samples(data):
        level = choose(sample)
        if level is not None:
            return level
    raise InputError(f"threshold: the intensities do not fall into two classes, air and leaf; {CURE}")


def _samples(data: npt.NDArray[Any]) -> Iterator[npt.NDArray[Any]]:
    """Yield intensities in a row, without those that are 0 first, then with them: copies, to be put in any order."""
    sample = thin(data)
    yield sample[sample != 0]
    if not sample.all():
        yield np.array(sample, order="C").ravel()


def thin(data: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return every n-th voxel along each axis, about `MAX_VOXELS` of them, without a copy."""
    return data[(slice(None, None, thinning_stride(data)),) * data.ndim]


def thinning_stride(data: npt.NDArray[Any]) -> int:
    """Return the n of `thin`."""
    return int(np.ceil((data.size / MAX_VOXELS) ** (1 / data.ndim)))


def _valley(sample: npt.NDArray[Any]) -> float | None:
    """Lowest bin between the last two peaks of the smoothed histogram, or None if there are not two."""
    histogram = _histogram(sample)
    if histogram is None:
        return None
    counts, centers = histogram
    # Empty bins at both ends let a peak in the first or last bin count as one.
    counts = np.pad(counts.astype(np.float64), 1)
    while True:
        peaks = np.flatnonzero((counts[1:-1] > counts[:-2]) & (counts[1:-1] >= counts[2:])) + 1
        if len(peaks) <= 2:
            break
        counts = uniform_filter1d(counts, 3, mode="constant")
    if len(peaks) < 2:
        return None
    low, high = peaks
    between = counts[low : high + 1]
    if between.min() > MAX_RIPPLE * min(counts[low], counts[high]):
        return None
    # The floor of a wide valley is flat: its middle, so that neither class is favored.
    floor = np.flatnonzero(between == between.min())
    return float(centers[low - 1 + int(floor[len(floor) // 2])])


def _otsu(sample: npt.NDArray[Any]) -> float | None:
    """Otsu's threshold, or None if its two classes do not explain the variance."""
    histogram = _histogram(sample)
    if histogram is None:
        return None
    counts, centers = histogram
    level = float(threshold_otsu(hist=(counts, centers)))
    weight = counts / counts.sum()
    mean = float(weight @ centers)
    total = float(weight @ (centers - mean) ** 2)
    upper = float(weight[centers > level].sum())
    if total == 0.0 or upper in (0.0, 1.0):
        return None
    upper_mean = float(weight[centers > level] @ centers[centers > level]) / upper
    between = upper / (1.0 - upper) * (upper_mean - mean) ** 2
    return level if between > MIN_SEPARATION * total else None


def find_classes(data: npt.NDArray[Any]) -> Mixture | None:
    """Return air and leaf in the intensities, any shape, or None if they cannot be told apart."""
    return next((classes for classes in map(_classes, _samples(data)) if classes is not None), None)


def _mixture(sample: npt.NDArray[Any]) -> float | None:
    """Middle of air and leaf, or None if they cannot be told apart."""
    mixture = _classes(sample)
    return None if mixture is None else mixture.level


def _classes(sample: npt.NDArray[Any]) -> Mixture | None:
    histogram = _histogram(sample)
    if histogram is None:
        return None
    counts, centers = histogram
    half = 0.5 * (centers[1] - centers[0])
    mixture = fit_mixture(counts, np.append(centers - half, centers[-1] + half))
    apart = mixture.contrast > MIN_CONTRAST and mixture.weights[2] < MAX_BETWEEN
    return mixture if apart and centers[0] < mixture.level < centers[-1] else None


def _histogram(sample: npt.NDArray[Any]) -> tuple[npt.NDArray[np.int64], FloatArray] | None:
    """Count voxels in bins, with the bins' centers; one voxel in two thousand at each end may fall outside them.

    The sample is left in another order, and in its own type: a sorted copy of it in eight bytes would be most of what a
    fit holds.
    """
    if len(sample) == 0:
        return None
    low, high = (_quantile(sample, share) for share in (0.0005, 0.9995))
    if high <= low:
        low, high = np.float64(sample.min()), np.float64(sample.max())
    if high <= low:
        return None
    counts, edges = np.histogram(sample, bins=BINS, range=(low, high))
    return counts, 0.5 * (edges[1:] + edges[:-1])


def _quantile(sample: npt.NDArray[Any], share: float) -> np.float64:
    """Return a quantile, in double precision between the two intensities beside it; the order is changed."""
    place = share * (len(sample) - 1)
    first = int(place)
    sample.partition([first, min(first + 1, len(sample) - 1)])
    return np.float64(np.quantile(sample[first : first + 2].astype(np.float64), place - first))
