"""Compiled: the closest places on the sides of an outline."""

from o3dleaf.core.compiled.decorator import njit

BOX = 16
"""Sides that one box is around."""


@njit(nogil=True, cache=True)
def find_closest(points, sides, boxes, start, stop, away):
    """Write the vectors (n, 2) to the points start:stop from the closest places on `sides` (s, 4).

    Each of `boxes` (b, 4), low corner and high corner, is around `BOX` sides; of equally close ones the first counts.
    """
    nearest = 0
    for i in range(start, stop):
        x, y = points[i, 0], points[i, 1]
        # The side that the point before is closest to is close, so that most boxes are farther.
        u, v = from_side(x, y, sides, nearest)
        least = (u * u + v * v) * (1 + 1e-12) + 1e-300
        for box in range(len(boxes)):
            p = max(boxes[box, 0] - x, x - boxes[box, 2], 0.0)
            q = max(boxes[box, 1] - y, y - boxes[box, 3], 0.0)
            if p * p + q * q >= least:
                continue
            for side in range(BOX * box, min(BOX * (box + 1), len(sides))):
                u, v = from_side(x, y, sides, side)
                if u * u + v * v < least:
                    nearest, least = side, u * u + v * v
                    away[i, 0], away[i, 1] = u, v


@njit(nogil=True, cache=True)
def from_side(x, y, sides, side):
    """Return the vector to a point from the closest place on a side."""
    u, v = x - sides[side, 0], y - sides[side, 1]
    s, t = sides[side, 2] - sides[side, 0], sides[side, 3] - sides[side, 1]
    square = s * s + t * t
    share = min(max((u * s + v * t) / square, 0.0), 1.0) if square > 0 else 0.0
    return u - share * s, v - share * t
