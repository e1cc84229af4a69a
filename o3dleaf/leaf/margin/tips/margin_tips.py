"""Sharp tips of a margin, which a sample ends before and smoothing rounds: triangles with the centroids of the ends."""

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.margin_curve import STEP, Spacing
from o3dleaf.leaf.margin.tips.tip_loops import TipBounds, TipTriangle, lies_within, next_tip

REACH = 3.0
"""A tip is looked for where the curve turns within so many spacings to both sides: what smoothing has rounded."""
SHARPEST, BLUNTEST = np.radians(2.0), np.radians(80.0)
"""Angles of tips. Sharper ones would begin a hundred spacings before they end; blunter ones are rounded by less than
the noise of the margin."""
WIDTHS = (3.5, 5.0, 7.0, 2.5)
"""Where tips begin, by the spacings between their flanks, in the order of trial."""
UNLIKE = 0.15
"""By what share a tip's area may differ from a triangle's of the same centroid; a round end's does by a quarter."""
ROUNDED = TipBounds(SHARPEST, BLUNTEST, UNLIKE)
BEYOND = 1.0
"""A tip may go on beyond the curve by the area of so many points: beyond its last point a sample leaves out one in the
mean."""
BENT = 0.65
"""Spacings by which a tip may lie outside its straight flanks, twice the deviation of a random sample's margin: one
that bends more ends as its points do."""


def with_tips(curve: FloatArray, spacing: Spacing) -> tuple[FloatArray, FloatArray]:
    """Return a closed curve (k, 2), counter-clockwise, with its sharp convex tips restored, and these (a, 2).

    Parameters
    ----------
    curve : (n, 2) ndarray
        In steps of `STEP` local spacings.
    spacing : Spacing
    """
    local = spacing(curve)
    turns, rounds = _turns(curve), np.vstack([curve] * 3)
    found: list[tuple[int, int, FloatArray]] = []
    for center in np.argsort(-turns):
        if turns[center] < np.pi - BLUNTEST - 0.6:
            break
        if any(_between(center, start, stop, len(curve)) for start, stop, _ in found):
            continue
        tip = _tip(rounds, int(center), float(local[center]))
        if tip is None or any(_overlap(tip, other, len(curve)) for other in found):
            continue
        if shapely.Polygon(replaced(curve, [*found, tip])).is_valid:
            found.append(tip)
    apexes = np.array([flanks[len(flanks) // 2] for _, _, flanks in found]).reshape(-1, 2)
    return replaced(curve, found), apexes


def _turns(curve: FloatArray) -> FloatArray:
    """Return how far (n,) the curve turns to the left within `REACH` spacings of each of its points."""
    tangent = np.roll(curve, -1, axis=0) - curve
    angle = np.arctan2(tangent[:, 1], tangent[:, 0])
    turn = np.angle(np.exp(1j * (angle - np.roll(angle, 1))))
    count = round(REACH / STEP)
    sums = np.cumsum(np.concatenate([turn[-count:], turn, turn[:count]]))
    sums = np.concatenate([[0.0], sums])
    turns: FloatArray = sums[2 * count + 1 :] - sums[: -2 * count - 1]
    return turns


def _tip(rounds: FloatArray, center: int, spacing: float) -> tuple[int, int, FloatArray] | None:
    """Return where the rounded tip begins and ends, and the curve (k, 2) to put there; None for no sharp one.

    `rounds` is three times the curve, so that what lies around a place of it is a slice.
    """
    count, widths, trial = len(rounds) // 3, spacing * np.array(WIDTHS), 0
    while True:
        trial, triangle = next_tip(rounds, center, widths, trial, ROUNDED)
        if trial == len(widths):
            return None
        middle, first = triangle.middle, triangle.first
        arc = rounds[count + middle - first : count + middle + first + 1]
        flanks = _flanks(arc, triangle, spacing)
        if _holds(flanks, arc, spacing):
            return (middle - first) % count, (middle + first) % count, flanks
        trial += 1


def _flanks(arc: FloatArray, triangle: TipTriangle, spacing: float) -> FloatArray:
    """Return both flanks (k, 2) of a tip that ends sharp, without their ends.

    Growth leaves out no area, but a narrow tip's is a strip of even width: its centroid stays, at a third of the height
    of the triangle on the same base. A square end has 4/3 of the area of that triangle, an elliptic one 5/4. The
    triangle is bent as the arc is, along the parabola through the middles between its sides.
    """
    middle, axis, base = (arc[0] + arc[-1]) / 2, triangle.axis, triangle.base
    side = np.array([axis[1], -axis[0]])
    half = len(arc) // 2
    spine, widths = (arc[:half] + arc[:half:-1]) / 2 - middle, np.hypot(*(arc[:half] - arc[:half:-1]).T)
    x, y = spine @ axis, spine @ side
    bend = np.linalg.lstsq(np.stack([x, x**2], axis=1) * widths[:, None], y * widths, rcond=None)[0]
    height = min(triangle.height, float(x.max()) + spacing * np.sqrt(2 * BEYOND * triangle.height / base))
    count = max(2, round(height / (STEP * spacing)))
    share = np.arange(1, count + 1) / count
    along = share * height
    line = middle + along[:, None] * axis + (bend[0] * along + bend[1] * along**2)[:, None] * side
    before, after = (line + (1 - share)[:, None] * (end - middle) for end in (arc[0], arc[-1]))
    return np.vstack([before, after[-2::-1]])


def _holds(flanks: FloatArray, arc: FloatArray, spacing: float) -> bool:
    """Return whether a tip between two flanks leaves out nothing of the arc, and adds little."""
    ring = np.vstack([arc[:1], flanks, arc[-1:]])
    tip, rounded = shapely.Polygon(ring), shapely.Polygon(arc)
    if not tip.is_valid or tip.area > (1 + UNLIKE) * rounded.area:
        return False
    return bool(lies_within(arc, ring, BENT * spacing))


def _between(center: int, start: int, stop: int, count: int) -> bool:
    return (center - start) % count <= (stop - start) % count


def _overlap(tip: tuple[int, int, FloatArray], other: tuple[int, int, FloatArray], count: int) -> bool:
    return any(_between(end, other[0], other[1], count) for end in tip[:2]) or _between(other[0], tip[0], tip[1], count)


def replaced(curve: FloatArray, tips: list[tuple[int, int, FloatArray]]) -> FloatArray:
    """Return the curve with the flanks (k, 2) of tips in place of what lies between two of its rows."""
    if not tips:
        return curve
    count = len(curve)
    keep = np.ones(count, dtype=bool)
    for start, stop, _ in tips:
        keep[(start + 1 + np.arange((stop - start) % count - 1)) % count] = False
    first = int(np.flatnonzero(keep)[0])
    kept, starts = np.flatnonzero(np.roll(keep, -first)), np.array([(start - first) % count for start, _, _ in tips])
    order = np.argsort(starts)
    rest, *stretches = np.split(
        np.roll(curve, -first, axis=0)[kept], np.searchsorted(kept, starts[order], side="right")
    )
    for number, stretch in zip(order, stretches, strict=True):
        rest = np.vstack([rest, tips[number][2], stretch])
    return rest
