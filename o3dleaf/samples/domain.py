"""Fields that are known inside their bounds, evaluated anywhere."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.outside_loops import fall_outside
from o3dleaf.core.parallel import run_blocks

BLOCK = 16_384
"""Points evaluated together; fixed, so that results do not depend on the number of threads."""

NEVER = np.zeros(3)
"""Period of a field that does not repeat."""

Inside = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Values (n,) and gradients (n, 3) at (n, 3) points that lie in the bounds."""


def evaluate(
    inside: Inside, bounds: FloatArray, points: npt.ArrayLike, fall: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Return the (n,) values and (n, 3) gradients of a field that is known inside `bounds`, anywhere in space.

    Outside it is its value at the nearest point less `fall` times the distance.

    Parameters
    ----------
    inside : callable
        The field inside the bounds.
    bounds : (2, 3) ndarray
        Lower, then upper corner.
    points : (n, 3) array_like
        Where to evaluate.
    fall : float
        Value over length; 1 where the values are distances.

    Raises
    ------
    InputError
        If a point is NaN or infinite.
    """
    where = as_points(points, dim=3)
    values, gradients = np.empty(len(where)), np.empty((len(where), 3))

    def task(start: int, stop: int) -> None:
        block = where[start:stop]
        value, gradient = inside(np.clip(block, bounds[0], bounds[1]))
        jets = np.array([value, *gradient.T])
        fall_outside(0, len(block), jets, block, bounds, NEVER, fall)
        values[start:stop], gradients[start:stop] = jets[0], jets[1:].T

    run_blocks(task, len(where), BLOCK)
    return values, gradients


def inside_by_distance(points: FloatArray, feet: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Return the values (n,), `reach` less the distances of points (n, 3) from their feet, and the gradients (n, 3)."""
    away = points - feet
    distance = np.linalg.norm(away, axis=1)
    return reach - distance, -away / np.where(distance > 0, distance, 1.0)[:, np.newaxis]
