"""Two sheets so close that groups of points do not tell them apart: seen by the heights over the middle of both."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.surface.cloud.rounding import find_steps
from o3dleaf.surface.cloud.surfels import Surfels

TWO_SHEETS_NOTE = "two sheets lie close together and face away from one another"
WITHIN_NOISE_NOTE = "two sheets lie within the noise, cannot be told apart and are treated as one; give normals"
ROUNDED_NOTE = (
    "coordinates are rounded to steps about as wide as points are apart: sheets less than two steps apart are one"
)
TWO_SHEETS = -0.25
"""Excess kurtosis of heights below which they are of two sheets: noise has at least 0, sheets 2σ apart -0.5."""
TWO_CLEAR_SHEETS = -1.3
"""The same, below which each point lies clearly on one of them: a full slab has -1.2, sheets 4σ apart have -1.28."""


class Middle(NamedTuple):
    """Normals (n, 3) of surfels blended at the points, the points' heights (n,) over them, and their excess kurtosis.

    The excess kurtosis of noise is 0; of two sheets 2a apart with noise σ it is -2 a⁴/(a² + σ²)². It is that around
    most places: heights of parts that differ in thickness have more than those of each part, and rims have more.
    Coordinates rounded to steps spread heights evenly, which has -1.2; `step` is the width of these steps along the
    normals, on the average, where that is to be asked.
    """

    normals: FloatArray
    height: FloatArray
    excess: float
    step: float = 0.0

    @property
    def is_of_two(self) -> bool:
        """True where it is that of two sheets which the points lie clearly on."""
        return self.excess < TWO_CLEAR_SHEETS

    @property
    def is_rounded(self) -> bool:
        """True where heights are spread as steps of the coordinates spread them."""
        return bool(np.std(self.height) <= self.step)

    @property
    def is_within_noise(self) -> bool:
        """True where it is that of two sheets which noise joins, and not that of coordinates in steps."""
        return TWO_CLEAR_SHEETS <= self.excess < TWO_SHEETS and not self.is_rounded


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
    excess = float(np.median(kurtosis[surfels.rows].mean(axis=1))) - 3
    step = float(np.mean(np.abs(outward) @ find_steps(points))) if excess < TWO_SHEETS else 0.0
    return Middle(outward, height, excess, step)


def split_sheets(middle: Middle) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the normals (n, 3) of one sheet, or of two, turned outward from the middle between them, and the note."""
    if middle.is_of_two:
        return np.where(middle.height < 0, -1.0, 1.0)[:, np.newaxis] * middle.normals, (TWO_SHEETS_NOTE,)
    if middle.is_within_noise:
        return middle.normals, (WITHIN_NOISE_NOTE,)
    return middle.normals, (ROUNDED_NOTE,) if middle.excess < TWO_SHEETS else ()
