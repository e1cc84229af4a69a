"""Sharp tips of a margin, which a sample ends before and smoothing rounds: both flanks continued until they meet."""

import numpy as np
import shapely

from o3dleaf.core.checks import FloatArray
from o3dleaf.leaf.margin.margin_curve import STEP, Spacing

REACH = 3.0
"""A tip is looked for where the curve turns within so many spacings to both sides: what smoothing has rounded."""
SHARPEST, BLUNTEST = np.radians(5.0), np.radians(80.0)
"""Angles of tips. Sharper ones are parallel flanks to a fit of a few points; blunter ones are rounded by less than the
noise of the margin."""
FLANKS = ((3.5, 10.0), (3.5, 6.0), (2.0, 10.0), (2.0, 6.0))
"""Where flanks are fitted, in spacings: from where they are so far apart, and for that length. Nearer to the tip,
points of both are one row; where the flanks bend, less is straight."""
STRAIGHT = 0.25
"""A flank may stray from its line by this many spacings (rms), as noise does."""
BENT = 0.5
"""Spacings by which a tip may lie outside its straight flanks: one that bends more ends as its points do."""
WHOLE = 0.85
"""Share of the turn from flank to flank that lies within `REACH`: less is a round lobe, not a rounded tip."""
BEYOND = 1.0
"""A tip may go on beyond the curve by the area of so many points: what a sample leaves out in the mean."""


def with_tips(curve: FloatArray, spacing: Spacing) -> FloatArray:
    """Return a closed curve (k, 2), counter-clockwise, with its sharp convex tips restored.

    Parameters
    ----------
    curve : (n, 2) ndarray
        In steps of `STEP` local spacings.
    spacing : Spacing
    """
    local = spacing(curve)
    turns = _turns(curve)
    found: list[tuple[int, int, FloatArray]] = []
    for center in np.argsort(-turns):
        if turns[center] < np.pi - BLUNTEST - 0.6:
            break
        if any(_between(center, start, stop, len(curve)) for start, stop, _ in found):
            continue
        tip = _tip(curve, int(center), float(local[center]), float(turns[center]))
        if tip is None or any(_overlap(tip, other, len(curve)) for other in found):
            continue
        if shapely.Polygon(_replaced(curve, [*found, tip])).is_valid:
            found.append(tip)
    return _replaced(curve, found)


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


def _tip(curve: FloatArray, center: int, spacing: float, turn: float) -> tuple[int, int, FloatArray] | None:
    """Return where the rounded tip begins and ends, and the corner to put there; None where there is no sharp one."""
    count = len(curve)
    for width, length in FLANKS:
        middle, first = _centered(curve, center, width * spacing)
        last = first + round(length / STEP)
        if last >= count // 2:
            continue
        before = _line(curve[(middle - np.arange(first, last)) % count], spacing)
        after = _line(curve[(middle + np.arange(first, last)) % count], spacing)
        if before is None or after is None:
            continue
        if turn >= WHOLE * np.arccos(np.clip(-(before[1] @ after[1]), -1, 1)):
            arc = curve[(middle + np.arange(-first, first + 1)) % count]
            corner = _corner(arc, before, after, spacing)
            if corner is not None and _holds(corner, arc, spacing):
                return (middle - first) % count, (middle + first) % count, corner
    return None


def _centered(curve: FloatArray, center: int, width: float) -> tuple[int, int]:
    """Return the place of a tip that is farthest out, and the steps from it to where the flanks are `width` apart."""
    count = len(curve)
    offsets = np.arange(1, count // 2)
    first = count
    for _ in range(3):
        across = np.hypot(*(curve[(center + offsets) % count] - curve[(center - offsets) % count]).T)
        wide = np.flatnonzero(across >= width)
        if not len(wide):
            return center, count
        first = int(offsets[wide[0]])
        around = (center + np.arange(-first, first + 1)) % count
        arc = curve[around]
        center = int(around[np.argmax(np.linalg.norm(arc - (arc[0] + arc[-1]) / 2, axis=1))])
    return center, first


def _line(flank: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray] | None:
    """Return a point of the line through a flank, and its direction towards the tip; None where it is not straight."""
    middle = flank.mean(axis=0)
    _, values, axes = np.linalg.svd(flank - middle, full_matrices=False)
    if values[1] > STRAIGHT * spacing * np.sqrt(len(flank)):
        return None
    direction: FloatArray = axes[0] * np.sign(axes[0] @ (flank[0] - flank[-1]))
    return middle, direction


def _corner(
    arc: FloatArray, before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray], spacing: float
) -> FloatArray | None:
    """Return where two flanks meet, or less far out where points would be missed; None where they do not."""
    (p, d), (q, e) = before, after
    across = d[0] * e[1] - d[1] * e[0]
    angle = np.arctan2(-across, d @ e)
    if not SHARPEST <= angle <= BLUNTEST:
        return None
    corner = p + d * (((q - p)[0] * e[1] - (q - p)[1] * e[0]) / across)
    axis = (d + e) / np.linalg.norm(d + e)
    far = arc[np.argmax(arc.dot(axis))]
    if (corner - far) @ axis <= 0:
        return None
    # Beyond the curve the tip is about the triangle in front of it.
    beyond = np.tan(angle / 2) * float((corner - far) @ axis) ** 2
    most = BEYOND * spacing**2
    if beyond > most:
        corner = corner - axis * (float((corner - far) @ axis) * (1 - np.sqrt(most / beyond)))
    return np.asarray(corner)


def _holds(corner: FloatArray, arc: FloatArray, spacing: float) -> bool:
    """Return whether straight flanks to the corner leave out nothing of a curved tip."""
    tip = shapely.Polygon([arc[0], corner, arc[-1]])
    return bool(shapely.distance(tip, shapely.points(arc)).max() <= BENT * spacing)


def _between(center: int, start: int, stop: int, count: int) -> bool:
    return (center - start) % count <= (stop - start) % count


def _overlap(tip: tuple[int, int, FloatArray], other: tuple[int, int, FloatArray], count: int) -> bool:
    return any(_between(end, other[0], other[1], count) for end in tip[:2]) or _between(other[0], tip[0], tip[1], count)


def _replaced(curve: FloatArray, tips: list[tuple[int, int, FloatArray]]) -> FloatArray:
    """Return the curve with straight flanks, in steps as before, in place of what is rounded."""
    if not tips:
        return curve
    count = len(curve)
    keep = np.ones(count, dtype=bool)
    pieces: dict[int, FloatArray] = {}
    for start, stop, corner in tips:
        inside = (start + 1 + np.arange((stop - start) % count - 1)) % count
        keep[inside] = False
        pieces[int(start)] = np.vstack([_straight(curve[start], corner, curve), _straight(corner, curve[stop], curve)])
    first = int(np.flatnonzero(keep)[0])
    order = (first + np.arange(count)) % count
    parts = [np.vstack([curve[[i]], pieces[int(i)][1:]]) if int(i) in pieces else curve[[i]] for i in order if keep[i]]
    return np.vstack(parts)


def _straight(start: FloatArray, stop: FloatArray, curve: FloatArray) -> FloatArray:
    """Return points from `start` to before `stop`, in the mean step of the curve."""
    step = np.hypot(*np.diff(curve, axis=0).T).mean()
    count = max(1, round(float(np.hypot(*(stop - start)) / step)))
    line: FloatArray = start + (np.arange(count) / count)[:, None] * (stop - start)
    return line
