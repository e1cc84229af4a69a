"""Coordinates that were rounded to steps, as those of voxels and of depth cameras are."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray

MIN_LEVELS = 3
"""Levels at least: any two are one step apart."""
TOLERANCE = 0.01
"""Of a step, by which levels may be off whole ones: single precision rounds them anew."""


def find_steps(points: FloatArray) -> FloatArray:
    """Return the steps (d,) of points (n, d): coordinates along an axis are whole steps apart; 0 where they are not.

    All coordinates are, of those of a computer; what is done with a step is for its size to decide.
    """
    return np.array([_step_of(column) for column in points.T])


def _step_of(values: FloatArray) -> float:
    levels = np.unique(values)
    if len(levels) < MIN_LEVELS:
        return 0.0
    rises = np.diff(levels)
    steps = rises / rises.min()
    return float(rises.min()) if (np.abs(steps - np.round(steps)) <= TOLERANCE).all() else 0.0
