"""Two sheets so close that groups of points do not tell them apart: seen by the heights over the middle of both."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.surface.cloud.surfels import Surfels

TWO_SHEETS_NOTE = "two sheets lie close together and face away from one another"
WITHIN_NOISE_NOTE = "two sheets lie within the noise, cannot be told apart and are treated as one; give normals"
TWO_SHEETS = -0.25
"""Excess kurtosis of heights below which they are of two sheets: noise has at least 0, sheets 2σ apart -0.5."""
TWO_CLEAR_SHEETS = -1.3
"""The same, below which each point lies clearly on one of them: a full slab has -1.2, sheets 4σ apart have -1.28."""


class Middle(NamedTuple):
    """Normals (n, 3) of surfels blended at the points, the points' heights (n,) over them, and their excess kurtosis.

    The excess kurtosis of noise is 0; of two sheets 2a apart with noise σ it is -2 a⁴/(a² + σ²)². It is that around
    most places: heights of parts that differ in thickness have more than those of each part, and rims have more.
    """

    normals: FloatArray
    height: FloatArray
    excess: float

    @property
    def is_of_two(self) -> bool:
        """True where it is that of two sheets which the points lie clearly on."""
        return self.excess < TWO_CLEAR_SHEETS


def middle_of(points: FloatArray, surfels: Surfels, normals: FloatArray) -> Middle:
    """Return the normals (m, 3) of surfels blended at points (n, 3), and what the points are over them."""
    outward, height = surfels.blend(points, normals)
    if len(surfels.points) == len(points):
        return Middle(outward, height, 0.0)
    count, second, fourth = (surfels.total(height**power)[surfels.rows].sum(axis=1) for power in (0, 2, 4))
    if not (second.all() and count.min() > 1):
        return Middle(outward, height, 0.0)
    # So many values from a normal distribution have 3 on average if their ratio is multiplied with the first factor.
    kurtosis = (count + 1) / (count - 1) * count * fourth / second**2
    return Middle(outward, height, float(np.median(kurtosis[surfels.rows].mean(axis=1))) - 3)


def split_sheets(middle: Middle) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the normals (n, 3) of one sheet, or of two, turned outward from the middle between them, and the note."""
    if middle.is_of_two:
        return np.where(middle.height < 0, -1.0, 1.0)[:, np.newaxis] * middle.normals, (TWO_SHEETS_NOTE,)
    return middle.normals, (WITHIN_NOISE_NOTE,) if middle.excess < TWO_SHEETS else ()
