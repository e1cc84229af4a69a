"""The margin of a random sample as the curve of greatest penalized likelihood, as stiff as the sample allows.

Each length of an edge carries little information (`edge_score`), so that a curve through the outermost points alone
strays by a quarter of a spacing and more. Margins are smooth nearly everywhere, though, and a stiff curve averages over
many spacings. Where a stiffer curve leaves what a softer one has found by more than chance, at corners, teeth and
bites, the softer one stays (Lepski's rule).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from scipy import sparse
from scipy.ndimage import gaussian_filter1d, maximum_filter1d
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree
from scipy.special import log_ndtr

from o3dleaf.core.checks import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.edge_score import blurred, score
from o3dleaf.leaf.margin.margin_curve import MOST_NOISE, Spacing, resample
from o3dleaf.leaf.margin.sample_spacing import BoolArray

NODE_STEP = 0.5
"""Step of the nodes, in local spacings: a third of the least bandwidth."""
FIRST = 1.5
"""The least bandwidth, in local spacings."""
LEVELS = 4
"""Bandwidths, each √2 of the one before: the last is 4.2 spacings. Six would be a tenth steadier on long leaves, and
cut the ends of ellipses, whose radius is as long."""
WIDEN = np.sqrt(2.0)
CHANGE = 0.0307
"""Variance by which the curve changes from one bandwidth to the next, times information and bandwidth:
(1/π) ∫ (H(u) − H(√2 u))² du with H(u) = 1/(1 + u⁶)."""
BEYOND_CHANCE = 3.0
"""Deviations of that change from which on it is taken for none of chance's: 300 spacings of margin have about one such
by chance, and there the softer curve costs little; a corner that is missed costs more."""
SPREAD = 2.0
"""Bandwidths to both sides of such a place in which the softer curve stays."""
BIAS = 0.12
"""Spacings, over the bandwidth, by which the curve of greatest likelihood lies inside the true one: it bends to the
outermost points. By simulation of discs, 0.12 at the least bandwidth and 0.15 at the widest, with and without noise;
unblurred it would be 1/3, a cell for each degree of freedom, as Efron's identity has it."""
INSIDE, OUTSIDE = 6.0, 3.0
"""Blurs from the curve within which points are used: farther in they carry no information, farther out they are
strays."""
NARROW = 0.5
"""Spacings of half the width of a tip, below which its points belong to neither side."""
BESIDE = 1.0
"""Spacings from what was filled within which the curve runs over it."""
MOST_MOVED = 1.5
"""Spacings that the curve may move."""
NOT_ACROSS = 0.8
"""Share of the way to the axis of a tip that a flank may go: it does not cross the other one."""
NEWTON_STEPS, CONVERGED = 15, 5e-3
"""At most as many steps, until none moves the curve by more, in spacings: a hundredth of its own deviation."""
DAMPING = 1e-4
"""Added to the curvature: it decides only where neither points nor the penalty do, at the ends of tips."""
SMOOTH_NORMALS = 3.0
"""Width of the Gaussian, in spacings, by which the directions to move in are smoothed."""


@dataclass(frozen=True)
class EdgeSample:
    """What an edge is fitted to.

    Attributes
    ----------
    local : Spacing
        The points, with their spacing.
    noise : float
        Their deviation in the plane; it counts up to `MOST_NOISE` spacings.
    randomness : float
        Share of the way that is gone: a lattice, 0, has rows along its edge, and its points are not independent.
    filled : shapely.Geometry
        The gaps of the sample that were filled: where the edge runs over them, it stays.
    """

    local: Spacing
    noise: float
    randomness: float
    filled: shapely.Geometry


@dataclass(frozen=True)
class EdgeFit:
    """A closed curve (k, 2), the local spacings (k,) along it, where points were used (k,), the rows of sharp tips."""

    curve: FloatArray
    spacing: FloatArray
    observed: BoolArray
    apexes: list[int]


class _EdgeFrame(NamedTuple):
    """A curve with the points near it.

    `curve`, `normals` (n, 2); local `spacing`, `noise` in spacings, `half_width` of the tip (n,); whether points
    are used there (`observed`), and whether it runs over a `gap` that was filled; the nearest `node` (m,) of each point
    and how far `across` (m,) it lies, in spacings; third `differences` (n, n) of what moves, and of the curve itself
    (`bend`, n); the rows of tips.
    """

    curve: FloatArray
    normals: FloatArray
    spacing: FloatArray
    noise: FloatArray
    half_width: FloatArray
    observed: BoolArray
    gap: BoolArray
    node: IntArray
    across: FloatArray
    differences: sparse.csr_array
    bend: FloatArray
    apexes: list[int]


def fit_edge(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> EdgeFit:
    r"""Return the curve of greatest likelihood near a closed one, with the leaf on its left.

    It moves by d along its normals, and d is the maximum of

    .. math:: \sum_i \log Φ((d - x_i)/s) - \int d - \tfrac12 \int λ (n · C''')^2, \quad λ = I h^6,

    over the points at distances x from it, in spacings; C is the moved curve, I the information of a length, h the
    bandwidth. The third derivative is free at sharp tips, and over gaps that were filled the curve stays. In a narrow
    tip, half as wide as w, the points on the other side of its axis belong to the other flank, and a strip holds
    1 + log Φ((d + w)/s) points instead of 1.

    Parameters
    ----------
    curve : (k, 2) ndarray
    apexes : (a, 2) ndarray
        Its sharp tips, points of the curve.
    sample : EdgeSample

    References
    ----------
    Lepski, O. V. (1991): On a problem of adaptive estimation in Gaussian white noise. Theory Probab. Appl. 35, 454-466.
    Korostelev, A. P., Tsybakov, A. B. (1993): Minimax theory of image reconstruction. Springer.
    """
    frame = _frame(curve, apexes, sample)
    blur, _, information = blurred(frame.noise)
    moved = _most_likely(frame, blur, information * FIRST**6, np.zeros(len(frame.curve)))
    curve = _moved(frame, sample.randomness * moved)
    # Distances are taken anew from where the curve has come to.
    frame = _frame(curve, curve[frame.apexes], sample)
    blur, offset, information = blurred(frame.noise)
    moved, bandwidth = _widened(frame, blur, information)
    moved = sample.randomness * (moved - offset + BIAS / bandwidth)
    return EdgeFit(_moved(frame, moved), frame.spacing, frame.observed, frame.apexes)


def _widened(frame: _EdgeFrame, blur: FloatArray, information: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far (n,) the nodes move, and the widest bandwidths (n,) whose curves agree with the narrower ones."""
    bandwidth, stays = np.full(len(frame.curve), FIRST), np.zeros(len(frame.curve), dtype=bool)
    moved = _most_likely(frame, blur, information * bandwidth**6, np.zeros(len(frame.curve)))
    for level in range(LEVELS - 1):
        last = FIRST * WIDEN**level
        wider = np.where(stays, bandwidth, WIDEN * last)
        trial = _most_likely(frame, blur, information * wider**6, moved)
        change = np.abs(trial - moved) > BEYOND_CHANCE * np.sqrt(CHANGE / (information * last))
        contradicted = change & ~stays & frame.observed
        stays |= maximum_filter1d(contradicted, 2 * round(SPREAD * last / NODE_STEP) + 1, mode="wrap")
        bandwidth = np.where(stays, bandwidth, wider)
        again = contradicted.any()
        moved = _most_likely(frame, blur, information * bandwidth**6, trial) if again else trial
    return moved, bandwidth


def _most_likely(frame: _EdgeFrame, blur: FloatArray, stiffness: FloatArray, start: FloatArray) -> FloatArray:
    """Return how far (n,) the nodes move, in spacings, by Newton's steps; the likelihood is concave."""
    count, node = len(start), frame.node
    weights = sparse.diags_array(stiffness / NODE_STEP**5)
    penalty = (frame.differences.T @ weights @ frame.differences).tocsc()
    force = frame.differences.T @ (weights @ frame.bend)
    stays, moved = np.where(frame.gap, NODE_STEP / blur, 0.0), start
    for _ in range(NEWTON_STEPS):
        z, depth = (moved[node] - frame.across) / blur[node], (moved + frame.half_width) / blur
        scores, length = score(z), NODE_STEP * frame.observed
        gradient = np.bincount(node, scores / blur[node], count) - length * (1 + log_ndtr(depth))
        curvature = np.bincount(node, scores * (scores + z) / blur[node] ** 2, count) + length * score(depth) / blur
        # Over a filled gap the curve stays.
        matrix = (penalty + sparse.diags_array(curvature + stays + DAMPING)).tocsc()
        way = np.clip(spsolve(matrix, gradient - stays * moved - penalty @ moved - force), -0.5, 0.5)
        moved = np.clip(moved + way, np.maximum(-MOST_MOVED, -NOT_ACROSS * frame.half_width), MOST_MOVED)
        if np.abs(way).max() < CONVERGED:
            break
    return moved


def _moved(frame: _EdgeFrame, distance: FloatArray) -> FloatArray:
    return np.asarray(frame.curve + (distance * frame.spacing)[:, None] * frame.normals)


def _frame(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> _EdgeFrame:
    """Return a curve in steps of `NODE_STEP`, its tips among the nodes, with the points near it."""
    curve, spacing, _ = resample(curve, sample.local, NODE_STEP)
    count = len(curve)
    rows = sorted({int(np.argmin(((curve - apex) ** 2).sum(axis=1))) for apex in apexes})
    normals, half_width = _normals(curve, rows), _half_widths(curve, spacing, rows)
    gap = shapely.distance(shapely.points(curve), sample.filled) <= BESIDE * spacing
    observed = (half_width >= NARROW) & ~gap
    part = np.minimum(sample.noise / spacing, MOST_NOISE)
    blur = blurred(part)[0]
    points = np.asarray(sample.local.tree.data)
    reach = float((INSIDE * blur * spacing).max())
    node = cKDTree(curve).query(points, distance_upper_bound=reach)[1]
    points, node = points[node < count], node[node < count]
    across = ((points - curve[node]) * normals[node]).sum(axis=1) / spacing[node]
    near = observed[node] & (across < OUTSIDE * blur[node]) & (across > -INSIDE * blur[node])
    differences, bend = _third_differences(curve, normals, spacing, rows)
    return _EdgeFrame(
        curve, normals, spacing, part, half_width, observed, gap, node[near], across[near], differences, bend, rows
    )


def _normals(curve: FloatArray, apexes: list[int]) -> FloatArray:
    """Return the unit normals (n, 2) to the right, smoothed along the curve between its tips."""
    sides = np.roll(curve, -1, axis=0) - curve
    sides /= np.maximum(np.hypot(*sides.T), 1e-300)[:, None]
    width, count = SMOOTH_NORMALS / NODE_STEP, len(curve)
    smoothed = np.empty_like(sides)
    for i, start in enumerate(apexes):
        length = (apexes[(i + 1) % len(apexes)] - start) % count or count
        rows = (start + np.arange(length)) % count
        smoothed[rows] = gaussian_filter1d(sides[rows], min(width, length / 3), axis=0, mode="nearest")
    if not apexes:
        smoothed = gaussian_filter1d(sides, width, axis=0, mode="wrap")
    tangents = smoothed + np.roll(smoothed, 1, axis=0)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    return np.asarray(normals / np.maximum(np.hypot(*normals.T), 1e-300)[:, None])


def _half_widths(curve: FloatArray, spacing: FloatArray, apexes: list[int]) -> FloatArray:
    """Return half the distance (n,) to the other flank of a tip, in spacings; more than enough where there is none."""
    count = len(curve)
    half = np.full(count, 2 * INSIDE)
    steps = np.arange(count // 4)
    for apex in apexes:
        one, other = (apex - steps) % count, (apex + steps) % count
        width = np.hypot(*(curve[one] - curve[other]).T) / 2 / spacing[other]
        for rows in (one, other):
            half[rows] = np.minimum(half[rows], width)
    return half


def _third_differences(
    curve: FloatArray, normals: FloatArray, spacing: FloatArray, apexes: list[int]
) -> tuple[sparse.csr_array, FloatArray]:
    """Return the third difference along the normal of what moves (n, n), and of the curve itself (n,); none at tips."""
    count = len(curve)
    rows = np.arange(count)
    free = np.zeros(count, dtype=bool)
    free[(np.array(apexes, dtype=int)[:, None] + [-2, -1, 0, 1]) % count] = True
    terms, bend = [], np.zeros(count)
    for factor, shift in zip((-1.0, 3.0, -3.0, 1.0), (-1, 0, 1, 2), strict=True):
        other = (rows + shift) % count
        terms.append((np.where(free, 0.0, factor * (normals * normals[other]).sum(axis=1)), other))
        bend += factor * (normals * curve[other]).sum(axis=1) / spacing
    values, columns = (np.concatenate(each) for each in zip(*terms, strict=True))
    differences = sparse.csr_array((values, (np.tile(rows, 4), columns)), shape=(count, count))
    return differences, np.where(free, 0.0, bend)
