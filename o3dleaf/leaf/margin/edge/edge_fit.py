"""The margin of a random sample as the curve of greatest penalized likelihood, as stiff as the sample allows.

Each length of an edge carries little information (`edge_score`), so that a curve through the outermost points alone
strays by a quarter of a spacing and more. Margins are smooth nearly everywhere, though, and a stiff curve averages over
many spacings. Where a stiffer curve leaves what a softer one has found by more than chance, at corners, teeth and
bites, the softer one stays (Lepski's rule). Along teeth that even the softest curve cuts, softer ones follow.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.ndimage import distance_transform_edt, maximum_filter1d
from scipy.special import log_ndtr

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.edge.discoveries import find_discoveries
from o3dleaf.leaf.margin.edge.edge_frame import NODE_STEP, EdgeFrame, EdgeSample, edge_frame
from o3dleaf.leaf.margin.edge.edge_score import KERNEL, BlurredEdge, score
from o3dleaf.leaf.margin.sample_spacing import BoolArray

FIRST = 1.5
"""The least bandwidth, in local spacings, but along teeth."""
SOFTER = 2
"""Times that it is made √2 as narrow where the sample shows teeth: 0.75 leaves nine tenths of waves of seven spacings.
From there on everywhere, gaps between points pass for bays."""
LEVELS = 4
"""Bandwidths, each √2 of the one before: the last is 4.2 spacings. Six would be a tenth steadier on long leaves, and
cut the ends of ellipses, whose radius is as long."""
WIDEN = np.sqrt(2.0)
CHANGE = 0.0307
"""Variance by which the curve changes from one bandwidth to the next, times information and bandwidth:
(1/π) ∫ (H(u) − H(√2 u))² du with H(u) = 1/(1 + u⁶)."""
BEYOND_CHANCE = 3.0
"""Deviations of that change from which on it is taken for none of chance's. Gaps between points pass for such changes
too: a tenth of a straight margin keeps the softer curve by chance, 0.012 spacings farther inside in the mean; a corner
that is missed costs more. Nine units of twice the gain in log likelihood would be as rare as they should be, and would
miss bays of ten spacings."""
SPREAD = 2.0
"""Bandwidths to both sides of such a place in which the softer curve stays, and of the shortest windows of teeth."""
MAX_MOVE = 1.5
"""Spacings that the curve may move."""
NOT_ACROSS = 0.8
"""Share of the way to the axis of a tip that a flank may go: it does not cross the other one."""
UNCROSSED = (2.0, 4.0, 8.0, 16.0)
"""Spacings beside flanks that cross over which less is moved, one after the other until none do."""
NEWTON_STEPS, CONVERGED = 15, 5e-3
"""At most as many steps, until none moves the curve by more, in spacings: a hundredth of its own deviation."""
DAMPING = 1e-4
"""Added to the curvature: it decides only where neither points nor the penalty do, at the ends of tips."""


@dataclass(frozen=True)
class EdgeFit:
    """A closed curve (k, 2), the local spacings (k,) along it, where it runs over gaps (k,), the rows of sharp tips."""

    curve: FloatArray
    spacing: FloatArray
    gap: BoolArray
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
    frame = edge_frame(curve, apexes, sample)
    seen, bandwidth = sample.seen(frame.spacing), np.full(len(frame.curve), FIRST)
    moved = most_likely(frame, seen.blur, seen.information * bandwidth**6, np.zeros(len(frame.curve)))
    curve = moved_apart(frame, moved - seen.bias(bandwidth, frame.curvature, sample.randomness), sample.share(frame))
    # Distances are taken anew from where the curve has come to.
    frame = edge_frame(curve, curve[frame.apexes], sample)
    seen = sample.seen(frame.spacing)
    moved, bandwidth = widened(frame, seen)
    curve = moved_apart(frame, moved - seen.bias(bandwidth, frame.curvature, sample.randomness), sample.share(frame))
    return EdgeFit(curve, frame.spacing, frame.gap, frame.apexes)


def widened(frame: EdgeFrame, seen: BlurredEdge) -> tuple[FloatArray, FloatArray]:
    """Return how far (n,) the nodes move, and the widest bandwidths (n,) whose curves agree with the narrower ones."""
    blur, information = seen.blur, seen.information
    bandwidth, stays = np.full(len(frame.curve), FIRST), np.zeros(len(frame.curve), dtype=bool)
    moved = most_likely(frame, blur, information * bandwidth**6, np.zeros(len(frame.curve)))
    for level in range(LEVELS - 1):
        last = FIRST * WIDEN**level
        wider = np.where(stays, bandwidth, WIDEN * last)
        trial = most_likely(frame, blur, information * wider**6, moved)
        change = np.abs(trial - moved) > BEYOND_CHANCE * np.sqrt(CHANGE / (information * last))
        contradicted = change & ~stays & frame.observed
        stays |= maximum_filter1d(contradicted, 2 * round(SPREAD * last / NODE_STEP) + 1, mode="wrap")
        bandwidth = np.where(stays, bandwidth, wider)
        again = contradicted.any()
        moved = most_likely(frame, blur, information * bandwidth**6, trial) if again else trial
    return softened(frame, seen, moved, bandwidth)


def softened(
    frame: EdgeFrame, seen: BlurredEdge, moved: FloatArray, bandwidth: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far (n,) the nodes move and their bandwidths (n,), narrower along teeth than the least one.

    Along all of the curve, not where it is softest alone, the softer one has `KERNEL` parameters for each bandwidth.
    """
    for level in range(SOFTER):
        wide, narrow = FIRST / WIDEN**level, FIRST / WIDEN ** (level + 1)
        softest = bandwidth <= wide
        trial = most_likely(frame, seen.blur, seen.information * np.where(softest, narrow, bandwidth) ** 6, moved)
        free = KERNEL * (1 / narrow - 1 / wide) * NODE_STEP * frame.observed
        window = 2 * round(SPREAD * narrow / NODE_STEP) + 1
        teeth = softest & find_discoveries(2 * log_ratio(frame, seen.blur, trial, moved), free, window)
        if not teeth.any():
            break
        bandwidth = np.where(teeth, narrow, bandwidth)
        moved = most_likely(frame, seen.blur, seen.information * bandwidth**6, trial)
    return moved, bandwidth


def log_ratio(frame: EdgeFrame, blur: FloatArray, moved: FloatArray, other: FloatArray) -> FloatArray:
    """Return the logarithm (n,) of how many times as likely one curve makes the points of each node as another."""
    count, node = len(moved), frame.node
    points = log_ndtr((moved[node] - frame.across) / blur[node]) - log_ndtr((other[node] - frame.across) / blur[node])
    return np.asarray(np.bincount(node, points, count) - frame.length * frame.observed * (moved - other))


def most_likely(
    frame: EdgeFrame, blur: FloatArray, stiffness: FloatArray, start: FloatArray, steps: int = NEWTON_STEPS
) -> FloatArray:
    """Return how far (n,) the nodes move, in spacings, by Newton's steps; the likelihood is concave."""
    count, node = len(start), frame.node
    weights, bent = stiffness / NODE_STEP**5, frame.differences
    penalty = bent.squared(weights)
    stays, moved = np.where(frame.gap, NODE_STEP / blur, 0.0), start
    for _ in range(steps):
        z, depth = (moved[node] - frame.across) / blur[node], (moved + frame.half_width) / blur
        scores, length = score(z), frame.length * frame.observed
        gradient = np.bincount(node, scores / blur[node], count) - length * (1 + log_ndtr(depth))
        curvature = np.bincount(node, scores * (scores + z) / blur[node] ** 2, count) + length * score(depth) / blur
        # Over a filled gap the curve stays.
        pull = gradient - stays * moved - bent.transposed(weights * (bent.of(moved) + frame.bend))
        way = penalty.solve(curvature + stays + DAMPING, pull)
        way = np.clip(way, -0.5, 0.5)
        moved = np.clip(moved + way, np.maximum(-MAX_MOVE, -NOT_ACROSS * frame.half_width), MAX_MOVE)
        if np.abs(way).max() < CONVERGED:
            break
    return moved


def moved_apart(frame: EdgeFrame, distance: FloatArray, share: FloatArray) -> FloatArray:
    """Return the curve moved shares (n,) of the way, less where its flanks would cross, as in tips of few points.

    Parts of it that cross, and what lies between them, stay where they are, with less and less of it around them.
    """
    curve = moved_along(frame, distance, share)
    for reach in UNCROSSED:
        if shapely.is_valid(shapely.Polygon(curve)) or not (crossed := _crossed(curve)).any():
            break
        share = share * _beside(crossed, round(reach / NODE_STEP))
        curve = moved_along(frame, distance, share)
    return curve


def _crossed(curve: FloatArray) -> BoolArray:
    """Return the nodes (n,) of a closed curve that lie between two sides that cross, the shorter way around."""
    count = len(curve)
    sides = shapely.linestrings(np.stack([curve, np.roll(curve, -1, axis=0)], axis=1))
    one, other = shapely.STRtree(sides).query(sides, predicate="intersects")
    apart = (other - one) % count
    rows, lengths = one[(apart > 1) & (apart <= count // 2)], apart[(apart > 1) & (apart <= count // 2)]
    changes = np.bincount(rows + 1, minlength=2 * count + 1) - np.bincount(rows + lengths + 1, minlength=2 * count + 1)
    return np.asarray(np.cumsum(changes[: 2 * count]).reshape(2, count).any(axis=0))


def _beside(nodes: BoolArray, reach: int) -> FloatArray:
    """Return 0 at some nodes (n,) of a closed curve, and what grows to 1 over `reach` of them to both sides."""
    away = distance_transform_edt(~np.tile(nodes, 3))[len(nodes) : 2 * len(nodes)]
    return np.asarray(np.minimum(away / reach, 1.0))


def moved_along(frame: EdgeFrame, distance: FloatArray, share: FloatArray | float) -> FloatArray:
    """Return the curve moved shares (n,) of the way, the distances (n,) in spacings."""
    return np.asarray(frame.curve + (share * distance * frame.spacing)[:, None] * frame.normals)
