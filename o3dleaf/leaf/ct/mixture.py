r"""Air, leaf and the voxels between them, fitted to a histogram of intensities.

A voxel of air has the intensity :math:`\mu_0 + \varepsilon_0`, one of leaf :math:`\mu_1 + \varepsilon_1`, with normal
noise of deviations :math:`\sigma_0, \sigma_1`. One that the blurred surface runs through has a share
:math:`t = \Phi(x/b)` of leaf, x its distance from the surface and b the blur (the partial volume effect; Santago and
Gage, Quantification of MR brain images by mixture density and partial volume modeling, 1993). How many lie at x goes
with the area of the parallel surface, which is :math:`1 + 2Hx` of the surface's own to first order (Steiner), H its
mean curvature: one number more. At the surface itself t is one half, so that its intensity is
:math:`(\mu_0 + \mu_1)/2`, whatever the noise and however much of each there is.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import least_squares
from scipy.special import ndtr, softmax

from o3dleaf.core.checks.arrays import FloatArray

PARTS = 24
REACH = 3.0
"""Voxels between lie within so many blurs of the surface, in so many layers; beyond they are air or leaf."""
NODES = ndtr(np.linspace(-REACH, REACH, PARTS + 1))
SHARES, SPANS = 0.5 * (NODES[1:] + NODES[:-1]), np.diff(NODES)
"""Share of leaf in the middle of each layer, and how much it differs within."""
INWARD = np.linspace(-1, 1, PARTS + 1)[1:] - 1 / PARTS
"""Place of each layer, from the air's end to the leaf's."""
STARTS = (0.2, 0.5, 0.8, 0.95)
"""Quantiles that air and leaf are parted at to begin with: leaf is the larger or the smaller part of a volume."""
COARSER = 4
"""Bins that are one in the search from those starts; the best is then refined."""
SOFTNESS = 1.5
"""Deviation, in bins, of the normal noise that is added to the counts and to the model alike: without it the peaks of a
noise-free volume would be narrower than a bin, and their places a matter of where bins begin."""
MARGIN = 8
"""Empty bins on each side, for what that noise spreads beyond the ends."""
TINY = 1e-12
"""Probability of a bin that a model gives none."""
LIMITS = np.array([(0.0, 1.0), (-4.0, 0.2), (-14.0, 0.0), (-14.0, 0.0), (-12.0, 12.0), (-12.0, 12.0), (-0.95, 0.95)]).T
"""Of the parameters, in units of the range of the counts: the mean of air; logarithms of the distance of the means and
of the two deviations; logits of leaf and of what lies between, against air; how much more of these lie inward."""
PRIOR = np.array([[0, 0, 0.03, -0.03, 0, 0, 0], [0, 0, 0, 0, 0.001, 0, 0], [0, 0, 0, 0, 0, 0.001, 0], [0] * 6 + [0.01]])
"""What is expected before anything is seen, as residuals beside those of the bins: a scanner's noise is the same in air
and leaf, all three kinds exist, the surface is as often hollow as it bulges. It decides where the counts do not, as
where one class is a hundredth of a noisy volume; a thousand voxels in a hundred thousand outweigh it."""


@dataclass(frozen=True)
class Mixture:
    """Two classes and what lies between them.

    Attributes
    ----------
    means, deviations : (2,) ndarray
        Of air and leaf, in intensity.
    weights : (3,) ndarray
        Shares of air, leaf and what lies between; their sum is 1.
    """

    means: FloatArray
    deviations: FloatArray
    weights: FloatArray

    @property
    def level(self) -> float:
        """The intensity of the surface: the middle of the means."""
        return float(self.means.mean())

    @property
    def contrast(self) -> float:
        """Distance of the means, in deviations of the wider class."""
        return float((self.means[1] - self.means[0]) / self.deviations.max())


def fit_mixture(counts: npt.NDArray[np.int64], edges: FloatArray) -> Mixture:
    """Return the mixture nearest to the counts (n,) of bins with the given edges (n + 1,).

    Nearest in Hellinger's distance, Σ (√p − √q)², which is as sharp as the greatest likelihood where the model holds
    and suffers less where it does not (Beran, Minimum Hellinger distance estimates for parametric models, 1977).
    """
    coarse = np.add.reduceat(counts, np.arange(0, len(counts), COARSER))
    first = min((_descend(coarse, _start(coarse, share)) for share in STARTS), key=lambda fit: fit[1])
    best = _descend(counts, first[0])[0]
    low, width = float(edges[0]), float(edges[-1] - edges[0])
    deviations = width * np.hypot(np.exp(best[2:4]), 1 / len(counts) / np.sqrt(12))  # what is even over a bin has that
    return Mixture(low + width * (best[0] + np.array([0.0, np.exp(best[1])])), deviations, _weights(best))


def _start(counts: npt.NDArray[np.int64], share: float) -> FloatArray:
    """Return parameters for air and leaf as what lies below and above a quantile."""
    below = np.cumsum(counts) <= share * counts.sum()
    below[0], below[-1] = True, False
    centers = (np.arange(len(counts)) + 0.5) / len(counts)
    low, high = (np.average(centers[part], weights=counts[part] + TINY) for part in (below, ~below))
    gap = high - low
    return np.array([low, np.log(gap), np.log(gap / 5), np.log(gap / 5), np.log((1 - share) / share), np.log(0.1), 0.0])


def _descend(counts: npt.NDArray[np.int64], start: FloatArray) -> tuple[FloatArray, float]:
    """Return the parameters of the nearest minimum, and what is minimized there."""
    bins = len(counts)
    padded = np.pad(np.asarray(counts, dtype=np.float64), MARGIN)
    shares = gaussian_filter1d(padded / counts.sum(), SOFTNESS, mode="constant", truncate=MARGIN / SOFTNESS)
    edges = np.arange(-MARGIN, bins + MARGIN + 1) / bins
    roots = np.sqrt(shares)

    @lru_cache(maxsize=1)  # asked for the misfit first, then for its slopes in the same place
    def misfit(place: bytes) -> tuple[FloatArray, FloatArray]:
        parameters = np.frombuffer(place)
        chances, slopes = _chances(parameters, edges, SOFTNESS / bins)
        found = np.sqrt(chances)
        return np.append(roots - found, PRIOR @ parameters), np.vstack([-0.5 * (slopes / found).T, PRIOR])

    inside = np.clip(start, LIMITS[0] + 1e-6, LIMITS[1] - 1e-6)
    fit = least_squares(
        lambda x: misfit(x.tobytes())[0], inside, lambda x: misfit(x.tobytes())[1], LIMITS,
        x_scale="jac", xtol=1e-5, ftol=1e-7,
    )  # fmt: skip
    return fit.x, float(fit.cost)


def _chances(parameters: FloatArray, edges: FloatArray, soft: float) -> tuple[FloatArray, FloatArray]:
    """Return the probabilities of the bins, and their slopes (7, n) by the parameters."""
    gap, spread, weights, lean = (
        np.exp(parameters[1]),
        np.exp(parameters[2:4]) ** 2,
        _weights(parameters),
        parameters[6],
    )
    shares, spans = np.append([0.0, 1.0], SHARES), np.append([0.0, 0.0], SPANS)
    layers = (1 + lean * INWARD) / PARTS
    # A layer is even between its ends: a normal peak half as wide as that is long, ripples by 1 %.
    width = np.sqrt(spread[0] + shares * (spread[1] - spread[0]) + (0.5 * spans * gap) ** 2 + soft**2)
    z = (edges - (parameters[0] + shares * gap)[:, np.newaxis]) / width[:, np.newaxis]
    bell = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    peaks = np.diff(ndtr(z), axis=1)
    each = np.append(weights[:2], weights[2] * layers)
    by_middle, by_width = -np.diff(bell, axis=1), -np.diff(bell * z, axis=1)
    of_middle = np.stack([np.ones(len(shares)), gap * shares]) * each / width
    of_width = np.stack([(0.5 * spans * gap) ** 2, spread[0] * (1 - shares), spread[1] * shares]) * each / width**2
    kinds = np.stack([peaks[0], peaks[1], layers @ peaks[2:]])
    slopes = np.zeros((7, peaks.shape[1]))
    slopes[:2] = of_middle @ by_middle
    slopes[1:4] += of_width @ by_width
    slopes[4:6] = weights[1:, np.newaxis] * (kinds[1:] - weights @ kinds)
    slopes[6] = weights[2] / PARTS * (INWARD @ peaks[2:])
    return each @ peaks + TINY, slopes


def _weights(parameters: FloatArray) -> FloatArray:
    weights: FloatArray = softmax(np.concatenate([[0.0], parameters[4:6]]))
    return weights
