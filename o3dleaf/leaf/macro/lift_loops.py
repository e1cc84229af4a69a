"""Compiled: the lift along up, and its Jacobian."""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.leaf.macro.frame_loops import station


@njit(nogil=True, cache=True)
def fill_lift(start, stop, flat, heights, gradients, splines, world, columns):
    """Write X(z) into world[start:stop] and ∂X/∂z_k into columns[start:stop, k], from H and its gradient."""
    frame, slope, scratch = np.empty((4, 3)), np.empty((4, 3)), np.empty((7, 3))
    for i in range(start, stop):
        station(flat[i, 0], splines, frame, slope, scratch)
        across, up = flat[i, 1], flat[i, 2] + heights[i]
        for k in range(3):
            world[i, k] = frame[0, k] + across * frame[2, k] + up * frame[3, k]
            columns[i, 0, k] = slope[0, k] + across * slope[2, k] + up * slope[3, k] + gradients[i, 0] * frame[3, k]
            columns[i, 1, k] = frame[2, k] + gradients[i, 1] * frame[3, k]
            columns[i, 2, k] = frame[3, k]
