"""How far noise carries points across the edge of a leaf: what blurs the edge says so, not what roughens the surface.

A scanner's error may lie along its beam, and so along the leaf's normal: then the points are no less exactly where the
leaf ends. Taken to be as large along the surface, noise of half a spacing draws the margin in by a sixth of one.
"""

from dataclasses import replace

import numpy as np
from scipy.special import log_ndtr

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.edge.edge_fit import most_likely, widened
from o3dleaf.leaf.margin.edge.edge_frame import INSIDE, EdgeFrame, EdgeSample, edge_frame
from o3dleaf.leaf.margin.edge.edge_score import KERNEL, KERNEL_SQUARE, blurred, score
from o3dleaf.leaf.margin.sample_spacing import BoolArray

SHARES = np.linspace(0.0, 1.5, 7)
"""Shares of the noise across the surface that are tried along it. A margin of 130 spacings tells half a spacing of
noise to a fifth of it; were no more than 1 tried, errors would not cancel where it is as large."""
SHARPEST = 0.1
"""Spacings of blur that the likelihood is asked for at least: a sharper edge comes out at the same place, to a
hundredth."""
STEPS = 4
"""Newton's steps from one blur to the next: near its maximum the likelihood hardly depends on where the curve is."""


def edge_noise(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> float:
    r"""Return the deviation of a sample's points in the plane, from how an edge near the curve is blurred.

    It is the σ of the greatest profile likelihood, at most one and a half times `sample.noise`,

    .. math:: \max_d \sum_i \log Φ((d - x_i)/σ) - \int d

    of the distances x of the points from a curve that is moved by d, as in `fit_edge`. Tips, where the other flank is
    near, do not count. A corner that the curve cuts passes for some noise; to leave out where the curve is as soft as
    it can be would leave out the outermost points with it, and find half of a noise of 0.2 spacings. What the curve
    gains by being fitted to the points is taken off (`_gained`): a sharper edge gains more.

    Parameters
    ----------
    curve : (k, 2) ndarray
        Near the margin, with the leaf on its left.
    apexes : (a, 2) ndarray
        Its sharp tips, points of the curve.
    sample : EdgeSample
        With the deviation that is expected.

    References
    ----------
    Takeuchi, K. (1976): Distribution of information statistics and criteria for adequacy of models. Suri Kagaku 153,
    12-18 (in Japanese).
    """
    frame = edge_frame(curve, apexes, sample)
    seen = blurred(frame.noise)
    moved, bandwidth = widened(frame, seen)
    deep = frame.observed & (frame.half_width > INSIDE * seen.blur)
    likelihood, before = np.empty(len(SHARES)), np.empty(0)
    for row in range(len(SHARES) - 1, -1, -1):  # the widest blur first: its curve is the easiest to find
        tried = np.maximum(SHARES[row] * frame.noise, SHARPEST)
        if np.array_equal(tried, before):  # as sharp as it gets: found again it would differ by a rounding
            likelihood[row] = likelihood[row + 1]
            continue
        moved = most_likely(frame, tried, seen.information * seen.blur / tried * bandwidth**6, moved, STEPS)
        likelihood[row], before = log_likelihood(frame, moved, tried, deep, bandwidth), tried
    return _peak(likelihood) * sample.noise


def with_edge_noise(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> EdgeSample:
    """Return the sample with the noise that its edge shows; one without noise, or a lattice, as it is."""
    if sample.noise == 0 or sample.randomness == 0:
        return sample
    return replace(sample, noise=edge_noise(curve, apexes, sample))


def log_likelihood(
    frame: EdgeFrame, moved: FloatArray, blur: FloatArray, counted: BoolArray, bandwidth: FloatArray
) -> float:
    """Return the logarithm of the likelihood of the points at some nodes, up to a constant.

    It is that of a curve in the mean, without what one gains that is fitted to the points (`_gained`).
    """
    rows, length = counted[frame.node], frame.length * counted
    node = frame.node[rows]
    z = (moved[node] - frame.across[rows]) / blur[node]
    fitted = log_ndtr(z).sum() - (length * moved).sum()
    return float(fitted - _gained(z, blur[node], float((length / bandwidth).sum())))


def _gained(z: FloatArray, blur: FloatArray, lengths: float) -> float:
    """Return what the logarithm of a likelihood gains in the mean by a curve that is fitted to the points.

    It is tr (S - S²/2) V/H for a smoothing S of traces `KERNEL` and `KERNEL_SQUARE` for each bandwidth of the margin, H
    what the likelihood is bent by and V the variance of its slope, as the sum of squares of the points' scores. Both
    are equal at the true blur; at a sharper one V is larger (Takeuchi 1976).

    Parameters
    ----------
    z, blur : (m,) ndarrays
        Of points, how far inside the edge in `blur`s, and these in spacings.
    lengths : float
        Of the margin, in bandwidths.
    """
    scores = score(z)
    bend = float((scores * (scores + z) / blur**2).sum())
    freedom = lengths * (KERNEL - KERNEL_SQUARE / 2)
    return freedom * float((scores**2 / blur**2).sum()) / bend if bend > 0 else 0.0


def _peak(likelihood: FloatArray) -> float:
    """Return the share of the greatest likelihood: the top of the parabola through it and its neighbors."""
    best = int(np.argmax(likelihood))
    row = min(max(best, 1), len(SHARES) - 2)
    before, peak, after = likelihood[row - 1 : row + 2]
    bend = before - 2 * peak + after
    if bend >= 0:
        return float(SHARES[best])
    share = SHARES[row] + (SHARES[1] - SHARES[0]) * (before - after) / (2 * bend)
    return float(np.clip(share, SHARES[0], SHARES[-1]))
