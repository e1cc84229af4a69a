"""The compiled loops of the taper: the distance to the margin by a grid of cells, and the profile of the edge."""

import math
from typing import Any, NamedTuple

from o3dleaf.core.compiled.decorator import njit


class MarginSides(NamedTuple):
    """Sides (s, 4) of a margin, (u0, v0, u1, v1), the blade on their left, and normals (s, 4) that point inward.

    Those are of the two ends, each the sum of the unit normals of the two sides that meet there.
    """

    sides: Any
    normals: Any


class MarginGrid(NamedTuple):
    """Cells of the plane: corner (2,) and side of the first, `first` (nx ny + 1,) side near each, and their numbers.

    Without sides near it a cell lies in the blade or beside it as a whole: `inside` (nx, ny).
    """

    corner: Any
    size: float
    first: Any
    numbers: Any
    inside: Any


@njit(nogil=True, cache=True)
def list_near(sides, grid, reach, places, numbers):
    """Write the numbers of the sides that may be within reach of each cell from its place on, and move the places on.

    With no `numbers` it counts.
    """
    nx, ny = grid.inside.shape
    slack = reach + grid.size * math.sqrt(0.5)
    for s in range(len(sides)):
        x0, y0 = (sides[s, 0] - grid.corner[0]) / grid.size, (sides[s, 1] - grid.corner[1]) / grid.size
        x1, y1 = (sides[s, 2] - grid.corner[0]) / grid.size, (sides[s, 3] - grid.corner[1]) / grid.size
        wide = reach / grid.size
        for i in range(max(0, math.floor(min(x0, x1) - wide)), min(nx, math.floor(max(x0, x1) + wide) + 1)):
            for j in range(max(0, math.floor(min(y0, y1) - wide)), min(ny, math.floor(max(y0, y1) + wide) + 1)):
                u, v = grid.corner[0] + (i + 0.5) * grid.size, grid.corner[1] + (j + 0.5) * grid.size
                share = foot_on(sides[s], u, v)
                du = u - sides[s, 0] - share * (sides[s, 2] - sides[s, 0])
                dv = v - sides[s, 1] - share * (sides[s, 3] - sides[s, 1])
                if du * du + dv * dv > slack * slack:
                    continue
                if len(numbers):
                    numbers[places[i * ny + j]] = s
                places[i * ny + j] += 1


@njit(nogil=True, cache=True)
def foot_on(side, u, v):
    """Return how far along a side, 0 to 1, its point nearest to (u, v) lies."""
    along, across = side[2] - side[0], side[3] - side[1]
    return min(max(((u - side[0]) * along + (v - side[1]) * across) / (along * along + across * across), 0.0), 1.0)


@njit(nogil=True, cache=True)
def profile(depth, least, blend):
    """Return the thickness τ at a depth, in radii, and its slope: a circle's, on a floor that it leaves smoothly.

    Below `blend` a cubic goes on from the floor, level, to the circle with the circle's slope.
    """
    if depth >= 1.0:
        return 1.0, 0.0
    if depth <= 0.0:
        return least, 0.0
    if depth >= blend:
        thickness = math.sqrt(depth * (2.0 - depth))
        return thickness, (1.0 - depth) / thickness
    end = math.sqrt(blend * (2.0 - blend))
    rise, slope, share = end - least, (1.0 - blend) / end * blend, depth / blend
    # Hermite's cubic with slopes 0 and `slope`.
    thickness = least + share * share * (3.0 * rise - slope + share * (slope - 2.0 * rise))
    return thickness, share * (2.0 * (3.0 * rise - slope) + 3.0 * share * (slope - 2.0 * rise)) / blend


@njit(nogil=True, cache=True)
def depth_below(u, v, margin, grid, reach):
    """Return how deep in the blade a point lies, at most `reach`, 0 beside it, and the way there from the margin."""
    nx, ny = grid.inside.shape
    x, y = (u - grid.corner[0]) / grid.size, (v - grid.corner[1]) / grid.size
    if not (0.0 <= x < nx and 0.0 <= y < ny):
        return 0.0, 0.0, 0.0
    i, j = int(x), int(y)
    start, stop = grid.first[i * ny + j], grid.first[i * ny + j + 1]
    if start == stop:
        return (reach if grid.inside[i, j] else 0.0), 0.0, 0.0
    nearest, least, at = 0, math.inf, 0.0
    for n in range(start, stop):
        s = grid.numbers[n]
        share = foot_on(margin.sides[s], u, v)
        du = u - margin.sides[s, 0] - share * (margin.sides[s, 2] - margin.sides[s, 0])
        dv = v - margin.sides[s, 1] - share * (margin.sides[s, 3] - margin.sides[s, 1])
        if du * du + dv * dv < least:
            nearest, least, at = s, du * du + dv * dv, share
    side, normal = margin.sides[nearest], margin.normals[nearest]
    du, dv = u - side[0] - at * (side[2] - side[0]), v - side[1] - at * (side[3] - side[1])
    if at == 0.0:
        height = du * normal[0] + dv * normal[1]
    elif at == 1.0:
        height = du * normal[2] + dv * normal[3]
    else:
        height = dv * (side[2] - side[0]) - du * (side[3] - side[1])
    if height <= 0.0:
        return 0.0, 0.0, 0.0
    return math.sqrt(least), du, dv


@njit(nogil=True, cache=True)
def fill_taper(start, stop, plane, margin, grid, shape, jet):
    """Write τ and, where there is room for them, ∂τ/∂u and ∂τ/∂v (n, 3), of some rows of points of the plane (n, 2).

    `shape` is (radius, least, blend, edge): what is less deep than the last one counts as on the margin.
    """
    radius, least, blend, edge = shape
    for n in range(start, stop):
        depth, du, dv = depth_below(plane[n, 0], plane[n, 1], margin, grid, radius)
        if depth < edge:
            depth = 0.0
        jet[n, 0], slope = profile(depth / radius, least, blend)
        if jet.shape[1] == 3:
            factor = slope / (radius * depth) if 0.0 < depth < radius else 0.0
            jet[n, 1], jet[n, 2] = factor * du, factor * dv
