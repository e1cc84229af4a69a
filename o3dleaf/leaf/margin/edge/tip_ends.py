"""The ends of sharp tips: where their width falls to nothing, by the likelihood of the points in them."""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.polynomial import Polynomial

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.edge.edge_fit import EdgeFit
from o3dleaf.leaf.margin.edge.edge_frame import NODE_STEP, EdgeSample
from o3dleaf.leaf.margin.edge.edge_score import KERNEL
from o3dleaf.leaf.margin.edge.tip_likelihood import BEYOND, TipLikelihood

WIDE, LONG, LONGEST = 5.0, 10.0, 20.0
"""Spacings of width, and from the end, up to which at least a tip is fitted, and at most: farther leaves bend."""
FEWEST_NODES = 6
"""Nodes to each side at least that a tip has."""
FEWEST_POINTS = 6
"""Points of a tip at least: as many as it has parameters."""
BESIDE = 2.0
"""Spacings beside its base up to which its points are looked for."""
NOISY = 2.0
"""Deviations of the noise by which a point may lie beyond the end."""


class _Tip(NamedTuple):
    """A tip in its own axes: from the middle `origin` of its base along `axis`, with `side` to its left.

    `spacing` is the sample's; the base is `steps` nodes from the tip to both sides, `half_width` and `length` are the
    curve's, in spacings.
    """

    origin: FloatArray
    axis: FloatArray
    side: FloatArray
    spacing: float
    steps: int
    half_width: float
    length: float


def with_ends(edge: EdgeFit, sample: EdgeSample) -> FloatArray:
    """Return the curve (k, 2) of an edge whose sharp tips end where their points say.

    Both flanks of a tip are found together, by the likelihood of all its points (`TipLikelihood`): each by itself has
    few there. They are moved by what an edge so found is off (`BlurredEdge.bias`), and meet where the width is 0, but
    not before the last point.

    Parameters
    ----------
    edge : EdgeFit
    sample : EdgeSample
    """
    curve, count = edge.curve, len(edge.curve)
    for apex in edge.apexes:
        tip = _tip(edge, apex)
        if tip is None:
            continue
        flanks = _flanks(tip, sample)
        if flanks is not None:
            rows, ended = (apex + np.arange(1 - tip.steps, tip.steps)) % count, curve.copy()
            ended[rows] += sample.randomness * (flanks - curve[rows])
            if shapely.Polygon(ended).is_valid:  # else what passed for a tip lies beside another part of the leaf
                curve = ended
    return curve


def _tip(edge: EdgeFit, apex: int) -> _Tip | None:
    """Return the tip at a row of the curve; None where its flanks do not run together, or over a gap."""
    count = len(edge.curve)
    others = [abs((other - apex + count // 2) % count - count // 2) for other in edge.apexes if other != apex]
    steps = np.arange(1, min([count // 4, *(away // 2 for away in others)]))
    if len(steps) < FEWEST_NODES:
        return None
    one, other = edge.curve[(apex - steps) % count], edge.curve[(apex + steps) % count]
    spacing = float(edge.spacing[(apex + np.arange(-steps[-1], steps[-1] + 1)) % count].mean())
    width = np.hypot(*(one - other).T) / spacing
    away = steps * NODE_STEP
    wide = np.flatnonzero((width > WIDE) & (away > LONG) | (away > LONGEST))
    last = int(wide[0]) if len(wide) else len(steps) - 1
    if edge.gap[(apex + np.arange(-steps[last], steps[last] + 1)) % count].any():
        return None
    origin, middle = ((one[row] + other[row]) / 2 for row in (last, last // 2))
    axis = middle - origin
    axis /= max(float(np.hypot(*axis)), 1e-300)
    side = np.array([-axis[1], axis[0]])
    half = float((other[last] - one[last]) @ side) / 2 / spacing
    length = float((edge.curve[apex] - origin) @ axis) / spacing
    if half <= 0 or length <= 0:
        return None  # the leaf lies around the flanks and not between them: a notch, whatever made it pass for a tip
    return _Tip(origin, axis, side, spacing, int(steps[last]), half, length)


def _flanks(tip: _Tip, sample: EdgeSample) -> FloatArray | None:
    """Return both flanks (2 steps - 1, 2) of a tip, to put between the ends of its base; None for no end in reach."""
    seen = sample.seen(np.array([tip.spacing]))
    way = (np.asarray(sample.local.tree.data) - tip.origin) / tip.spacing
    u, v = way @ tip.axis, way @ tip.side
    near = (u > 0) & (u < tip.length + BEYOND) & (np.abs(v) < tip.half_width + BESIDE)
    u, v = u[near], v[near]
    if len(u) < FEWEST_POINTS:
        return None
    likelihood = TipLikelihood(u, v, float(seen.blur[0]), tip.half_width, tip.length)
    start = np.array([tip.half_width, tip.half_width / tip.length, 0.0, 0.0, 0.0, 0.0])
    shape = likelihood.least(start)
    # A curve of bandwidth h has as many parameters for its length as it counts each point, `KERNEL` / h.
    bandwidth = KERNEL * 2 * tip.length / likelihood.parameters(shape)
    bias = seen.bias(np.array([bandwidth]), np.zeros(1), sample.randomness)[0]
    half_width, middle = Polynomial(shape[:3] * [1, -1, 1]) - bias, Polynomial(shape[3:])
    ends = half_width.roots()
    ends = ends[np.isreal(ends) & (ends.real > 0)].real
    if not len(ends) or ends.min() > tip.length + BEYOND:
        return None
    # Not before its last point: strays lie beside a tip, not on its middle line.
    on_it = (np.abs(v - middle(u)) < WIDE / 2) & (u < ends.min() + WIDE)
    end = max(ends.min(), u[on_it].max(initial=0.0) - NOISY * sample.noise / tip.spacing)
    share = np.arange(1, tip.steps + 1) / tip.steps
    half, u = np.maximum(half_width(share * ends.min()), 0.0), share * end
    line = tip.origin + tip.spacing * u[:, None] * tip.axis
    before, after = (line + tip.spacing * (middle(u) + side * half)[:, None] * tip.side for side in (-1, 1))
    return np.vstack([before, after[-2::-1]])
