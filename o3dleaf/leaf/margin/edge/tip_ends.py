"""The ends of sharp tips: where their width falls to nothing."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.edge.edge_fit import EdgeFit
from o3dleaf.leaf.margin.edge.edge_frame import NODE_STEP, EdgeSample
from o3dleaf.leaf.margin.tips.margin_tips import BEYOND, BLUNTEST, replaced

WIDE, LONG = 4.5, 8.0
"""Spacings of width, and from the end, up to which at least a tip's taper is taken for even: farther leaves bend."""
FEWEST_POINTS = 3.0
"""Points beyond a place of a tip below which its width there is chance."""
FEWEST_NODES = 6
"""Nodes to each side at least that the taper is fitted to."""
LONGEST = 60.0
"""Spacings to the end beyond which there is none: a tip of a degree."""
NOISY = 2.0
"""Deviations of the noise by which a point may lie beyond the end."""


class _Taper(NamedTuple):
    """A tip in its own axes: from the middle `origin` of its narrow end along `axis`, in spacings.

    The narrow end is `first` nodes from the tip to both sides, and the tip begins at `begin` on the axis; `width` are
    the coefficients of the line of its widths, `spine` those of the parabola of its middles, `side` is to its left.
    """

    origin: FloatArray
    axis: FloatArray
    side: FloatArray
    spacing: float
    first: int
    begin: float
    width: FloatArray
    spine: FloatArray


def with_ends(edge: EdgeFit, sample: EdgeSample) -> FloatArray:
    """Return the curve (k, 2) of an edge with the flanks of its tips continued to where the width of the tip is 0.

    Two flanks known to 0.15 spacings meet in a tip of 20° to within a spacing; the last point of a sample is 1.6 ± 0.8
    short of it. The end lies no farther beyond the last point than by the area of `BEYOND` points, and not before it.

    Parameters
    ----------
    edge : EdgeFit
    sample : EdgeSample
    """
    count, ends = len(edge.curve), []
    for apex in edge.apexes:
        tip = _tip(edge, apex)
        if tip is None:
            continue
        length = _length(tip, np.asarray(sample.local.tree.data), sample.noise)
        if length is None:
            continue
        old = float((edge.curve[apex] - tip.origin) @ tip.axis) / tip.spacing
        length = old + sample.randomness * (length - old)
        start, stop = (apex - tip.first) % count, (apex + tip.first) % count
        ends.append((start, stop, _flanks(tip, edge.curve[start], edge.curve[stop], max(length, NODE_STEP))))
    return replaced(edge.curve, ends)


def _tip(edge: EdgeFit, apex: int) -> _Taper | None:
    """Return the tip at a row of the curve; None where its flanks do not run together."""
    count, spacing = len(edge.curve), float(edge.spacing[apex])
    steps = np.arange(1, count // 4)
    one, other = edge.curve[(apex - steps) % count], edge.curve[(apex + steps) % count]
    middle, width = (one + other) / 2, np.hypot(*(one - other).T) / spacing
    wide = np.flatnonzero((width > WIDE) & (steps * NODE_STEP > LONG))
    last = int(wide[0]) if len(wide) else len(steps) - 1
    # Between few points flanks may cross, and then have no width.
    width = np.where((one - other) @ (one[last] - other[last]) > 0, width, 0.0)
    # Where the tip goes on as it begins, w² / 2t points lie beyond a width w that falls by t a spacing.
    taper = max((width[last] - width[0]) / (last * NODE_STEP), 0.0)
    observed = edge.observed[(apex - steps) % count] & edge.observed[(apex + steps) % count]
    narrow = np.flatnonzero((width[:last] <= np.sqrt(2 * FEWEST_POINTS * taper)) | ~observed[:last])
    first = int(narrow[-1]) + 1 if len(narrow) else 0
    if last - first + 1 < FEWEST_NODES:
        return None
    axis = middle[first] - middle[last]
    axis /= max(float(np.hypot(*axis)), 1e-300)
    side = np.array([-axis[1], axis[0]])
    if (one[last] - other[last]) @ side >= 0:
        return None  # the leaf lies around the flanks and not between them: a notch, whatever made it pass for a tip
    way = (middle[first : last + 1] - middle[first]) / spacing
    u, v = way @ axis, way @ side
    taper = np.polynomial.polynomial.polyfit(u, width[first : last + 1], 1)
    spine = np.polynomial.polynomial.polyfit(u, v, 2)
    return _Taper(middle[first], axis, side, spacing, int(steps[first]), float(u[-1]), taper, spine)


def _length(tip: _Taper, points: FloatArray, noise: float) -> float | None:
    """Return how far the tip goes on beyond its narrow end, in spacings; None for no end within reach, or no tip.

    What tapers more bluntly than a tip is a corner, whose spine is too short to be continued.
    """
    width, taper = tip.width
    if not 0 < -taper <= 2 * np.tan(BLUNTEST / 2) or not 0 < -width / taper <= LONGEST:
        return None
    length = -width / taper
    way = (points - tip.origin) / tip.spacing
    u, v = way @ tip.axis, way @ tip.side
    beside = np.abs(v - np.polynomial.polynomial.polyval(u, tip.spine)) < WIDE / 2
    last = float(u[beside & (u > tip.begin) & (u < length + WIDE)].max(initial=0.0))
    farthest = last + np.sqrt(2 * BEYOND / -taper)
    return float(max(min(length, farthest), last - NOISY * noise / tip.spacing))


def _flanks(tip: _Taper, start: FloatArray, stop: FloatArray, length: float) -> FloatArray:
    """Return both flanks (k, 2) from the narrow end on, without their first points, bent as the spine is."""
    share = np.arange(1, 1 + max(2, round(length / NODE_STEP))) / max(2, round(length / NODE_STEP))
    u = share * length
    bend = np.polynomial.polynomial.polyval(u, tip.spine) - tip.spine[0]
    line = tip.origin + tip.spacing * (u[:, None] * tip.axis + bend[:, None] * tip.side)
    before, after = (line + (1 - share)[:, None] * (end - tip.origin) for end in (start, stop))
    return np.asarray(np.vstack([before, after[-2::-1]]))
