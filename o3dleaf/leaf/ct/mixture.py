r"""Air, leaf and the voxels between them, fitted to a histogram of intensities by maximum likelihood.

A voxel of air has the intensity :math:`\mu_0 + \varepsilon_0`, one of leaf :math:`\mu_1 + \varepsilon_1`, with normal
noise of deviations :math:`\sigma_0, \sigma_1`. One that the blurred surface runs through has a share
:math:`t = \Phi(x/b)` of leaf, x its distance from the surface and b the blur, all x equally frequent (the partial
volume effect; Santago and Gage, Quantification of MR brain images by mixture density and partial volume modeling,
1993). At the surface itself t is one half, so that its intensity is :math:`(\mu_0 + \mu_1)/2`, whatever the noise and
however much of each there is.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.special import ndtr, softmax

from o3dleaf.core.checks import FloatArray

SHARES = ndtr(np.linspace(-3.0, 3.0, 25))
"""Shares of leaf in voxels between, evenly apart in x; beyond three blurs a voxel is air or leaf."""
STARTS = (0.5, 0.7, 0.9)
"""Quantiles that air and leaf are parted at to begin with: leaf is rarely the larger part of a volume."""
ROUNDS = 3000
TINY = 1e-12
"""Probability of a bin that a model gives none."""
BIN = 1 / np.sqrt(12)
"""Deviation of what is spread evenly over one bin: no peak is narrower."""


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
    """Return the mixture of greatest likelihood for the counts (n,) of bins with the given edges (n + 1,)."""
    width, total = float(edges[1] - edges[0]), counts.sum()
    centers = 0.5 * (edges[1:] + edges[:-1])

    def unlikelihood(parameters: FloatArray) -> float:
        chances = _chances(parameters, edges, width)
        return float(-(counts @ np.log(chances / max(chances.sum(), TINY) + TINY)) / total)

    fits = []
    for share in STARTS:
        below = np.cumsum(counts) <= share * total
        means = [np.average(centers[part], weights=counts[part] + TINY) for part in (below, ~below)]
        gap = means[1] - means[0]
        start = np.array([*means, np.log(gap / 5), np.log(gap / 5), np.log((1 - share) / share), np.log(0.1)])
        options = {"maxiter": ROUNDS, "maxfev": ROUNDS, "xatol": 1e-5, "fatol": 1e-9, "adaptive": True}
        fits.append(minimize(unlikelihood, start, method="Nelder-Mead", options=options))
    best = min(fits, key=lambda fit: float(fit.fun)).x
    order = np.argsort(best[:2])
    weights = _weights(best)
    weights[:2] = weights[order]
    return Mixture(best[order], _deviations(best, width)[order], weights)


def _chances(parameters: FloatArray, edges: FloatArray, width: float) -> FloatArray:
    """Return the probability of every bin."""
    means, deviations, weights = parameters[:2], _deviations(parameters, width), _weights(parameters)
    shares = np.concatenate([[0.0, 1.0], SHARES])
    each = np.concatenate([weights[:2], np.full(len(SHARES), weights[2] / len(SHARES))])
    places = means[0] + shares * (means[1] - means[0])
    spreads = np.sqrt(deviations[0] ** 2 + shares * (deviations[1] ** 2 - deviations[0] ** 2))
    chances: FloatArray = each @ np.diff(ndtr((edges - places[:, None]) / spreads[:, None]), axis=1)
    return chances


def _deviations(parameters: FloatArray, width: float) -> FloatArray:
    deviations: FloatArray = np.hypot(np.exp(np.clip(parameters[2:4], -700, 300)), width * BIN)
    return deviations


def _weights(parameters: FloatArray) -> FloatArray:
    weights: FloatArray = softmax(np.concatenate([[0.0], parameters[4:6]]))
    return weights
