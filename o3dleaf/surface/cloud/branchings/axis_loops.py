"""The compiled loops of lines through planes: which way a line runs, and where the planes around a place meet."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.surface.cloud.cloud_loops import diagonalize

FEWEST = 12
"""Planes that a line is found from at least: of three sheets four each."""
BENT = 0.05
"""Least eigenvalue of the planes' normals up to which they are upright to one line: 13° off it, in the mean."""
TURNED = 0.08
"""Middle eigenvalue from which on they are not those of one sheet: a third of them turned by 40°."""
NEAR = 2.0
"""Spacings from the place where it was looked for up to which a line counts: other places see a farther one better."""
OFF = 0.5
"""Spacings off the line at which a plane counts a quarter: it belongs to a sheet that does not meet the others."""
ROUNDS = 6


@njit(nogil=True, cache=True)
def find_lines(start, stop, offsets, rows, places, spacing, points, normals, found, middles, frames):
    """Write which of the places start:stop have a line near them, its point across from each, and its frame.

    The planes at the points rows[offsets[k]:offsets[k + 1]] lie around place k. A frame (3, 3) is the line's direction
    and two unit vectors across it; middles are (m, 3).
    """
    spread, axes, values = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    center = np.empty(2)
    for k in range(start, stop):
        around = rows[offsets[k] : offsets[k + 1]]
        found[k] = around.size >= FEWEST
        if not found[k]:
            continue
        spread[:] = 0.0
        for row in around:
            for a in range(3):
                for b in range(a, 3):
                    spread[a, b] += normals[row, a] * normals[row, b] / around.size
        least = diagonalize(spread, axes, values)
        found[k] = values[0] <= BENT and values[1] >= TURNED
        if not found[k]:
            continue
        one, other = (least + 1) % 3, (least + 2) % 3
        for a in range(3):
            frames[k, 0, a], frames[k, 1, a], frames[k, 2, a] = axes[a, least], axes[a, one], axes[a, other]
        meet(around, places[k], spacing[k], points, normals, frames[k], center)
        found[k] = math.hypot(center[0], center[1]) <= NEAR * spacing[k]
        for a in range(3):
            middles[k, a] = places[k, a] + center[0] * frames[k, 1, a] + center[1] * frames[k, 2, a]


@njit(nogil=True, cache=True, error_model="numpy")
def meet(around, place, spacing, points, normals, frame, center):
    """Write where the planes at the points `around` meet, (2,) across a line from a place, by least squares.

    Those that pass it by count less and less.
    """
    flat, off, near = np.empty((around.size, 2)), np.empty(around.size), np.empty(around.size)
    for i in range(around.size):
        square, x, y = 0.0, 0.0, 0.0
        flat[i, 0] = flat[i, 1] = 0.0
        for a in range(3):
            arm, normal = points[around[i], a] - place[a], normals[around[i], a]
            square += arm * arm
            x += arm * frame[1, a]
            y += arm * frame[2, a]
            flat[i, 0] += normal * frame[1, a]
            flat[i, 1] += normal * frame[2, a]
        length = max(math.hypot(flat[i, 0], flat[i, 1]), 1e-12)
        flat[i, 0] /= length
        flat[i, 1] /= length
        off[i] = flat[i, 0] * x + flat[i, 1] * y
        near[i] = 1.0 / (1.0 + square / (NEAR * spacing) ** 2)
    for round_ in range(ROUNDS):
        xx = xy = yy = x = y = 0.0
        for i in range(around.size):
            u, v, weight = flat[i, 0], flat[i, 1], near[i]
            if round_ > 0:
                miss = (off[i] - u * center[0] - v * center[1]) / (OFF * spacing)
                weight /= (1.0 + miss * miss) ** 2
            xx += weight * u * u
            xy += weight * u * v
            yy += weight * v * v
            x += weight * u * off[i]
            y += weight * v * off[i]
        ridge = 1e-9 * (xx + yy)
        xx += ridge
        yy += ridge
        center[0] = (x * yy - y * xy) / (xx * yy - xy * xy)
        center[1] = (y * xx - x * xy) / (xx * yy - xy * xy)
