"""Roots of a field on the way between two points, by the Illinois variant of regula falsi."""

from collections.abc import Callable

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray

STEPS = 4
"""Steps that all take: enough where the field is smooth."""
MAX_STEPS = 16
"""Steps where it bends."""
TOLERANCE = 1e-4
"""Share of the way by which the next step would move a root that is found."""


def find_roots(
    field: Callable[[IntArray, FloatArray], FloatArray],
    low: FloatArray,
    high: FloatArray,
    f_low: FloatArray,
    f_high: FloatArray,
    most: int = MAX_STEPS,
) -> FloatArray:
    """Return where fields change their sign between `low` and `high`, all (n,).

    Parameters
    ----------
    field : callable
        Takes rows and places there to values.
    low, high, f_low, f_high : (n,) ndarrays
        Places with values of both signs.
    most : int
        Steps that are taken at most.
    """
    rows, roots = np.arange(len(low)), np.empty(len(low))
    a, b, fa, fb = low, high, f_low, f_high
    for step in range(most):
        z = (a * fb - b * fa) / (fb - fa)
        f = field(rows, z)
        crossed = (f > 0) != (fb > 0)
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa / 2)
        b, fb, roots[rows] = z, f, z
        if step + 1 < STEPS:
            continue
        going = np.abs(fb * (b - a)) > TOLERANCE * np.abs((fb - fa) * (high - low)[rows])
        rows = rows[going]
        a, b, fa, fb = (each[going] for each in (a, b, fa, fb))
        if not len(rows):
            break
    return roots
