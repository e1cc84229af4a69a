"""Coordinates that were rounded to steps about as wide as points are apart: a scan in terraces."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.neighbors import NEIGHBORS, fit_planes
from o3dleaf.surface.cloud.rounding import find_steps
from o3dleaf.surface.cloud.surfels import LINE

SAMPLE = 4000
"""Points whose neighborhoods are seen; their share is known to 0.01."""
MIN_TERRACES = 0.25
"""Share of neighborhoods in one terrace, from which on a scan is one of terraces: steps of 0.6 spacings leave 0.11 on a
bowed leaf and do no harm, 0.9 leave 0.29, and 1.25, of which it comes apart, half."""


class Rounding(NamedTuple):
    """The axis, 0 to 2, along which coordinates are rounded, and the step, in their unit."""

    axis: int
    step: float


def find_rounding(points: FloatArray) -> Rounding | None:
    """Return how the coordinates of a scan (n, 3) are rounded, if that makes terraces of it, and None if not.

    All sixteen points of a neighborhood have one height then, to the last bit, and the heights of all points are whole
    steps. Neighborhoods in a line do not count: lines of a scanner and slices have one coordinate in common, exactly.
    """
    some = even_rows(len(points), SAMPLE)
    near = query(cKDTree(points), points[some], k=np.arange(1, min(NEIGHBORS, len(points)) + 1))[1]
    with progress.silent():
        variance = fit_planes(points, near).variance
    terraces = np.ptp(points[near], axis=1) == 0
    terraces &= (variance[:, 1] > LINE**2 * variance[:, 2])[:, np.newaxis]
    axis = int(terraces.sum(axis=0).argmax())
    if terraces[:, axis].mean() < MIN_TERRACES:
        return None
    step = float(find_steps(points[:, [axis]])[0])
    return Rounding(axis, step) if step else None
