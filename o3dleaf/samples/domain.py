"""Outside its bounds a field is its value at the nearest point of the bounds less the distance to it."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, as_points
from o3dleaf.core.parallel import run_blocks

BLOCK = 16_384
"""Points evaluated together; fixed, so that results do not depend on the number of threads."""

Inside = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Values (n,) and gradients (n, 3) at (n, 3) points that lie in the bounds."""


def evaluate(inside: Inside, bounds: FloatArray, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the (n,) values and (n, 3) gradients of a field that is known inside `bounds`, anywhere in space.

    Parameters
    ----------
    inside : callable
        The field inside the bounds.
    bounds : (2, 3) ndarray
        Lower, then upper corner.
    points : (n, 3) array_like
        Where to evaluate.

    Raises
    ------
    InputError
        If a point is NaN or infinite.
    """
    where = as_points(points, dim=3)
    values, gradients = np.empty(len(where)), np.empty((len(where), 3))

    def task(start: int, stop: int) -> None:
        block = where[start:stop]
        nearest = np.clip(block, bounds[0], bounds[1])
        value, gradient = inside(nearest)
        away = block - nearest
        distance = np.sqrt((away**2).sum(axis=1))
        direction = away / np.where(distance > 0, distance, 1.0)[:, np.newaxis]
        values[start:stop] = value - distance
        gradients[start:stop] = np.where(away == 0, gradient, 0.0) - direction

    run_blocks(task, len(where), BLOCK)
    return values, gradients
