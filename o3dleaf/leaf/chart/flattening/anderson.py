"""Anderson's acceleration of a descent by fixed-point steps, kept a descent by its energy."""

from collections.abc import Callable

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import look_for_stop

MEMORY = 8
"""Differences of steps that are combined."""
LOOK = 10
"""Steps between two looks at how far the energy has fallen."""


def accelerated_descent(
    step: Callable[[FloatArray], FloatArray],
    energy: Callable[[FloatArray], float],
    start: FloatArray,
    *,
    at_rest: Callable[[float], float],
    most: int,
) -> FloatArray:
    r"""Return a point where a descent x ← g(x) is at rest, in fewer steps than it takes by itself.

    With the residuals :math:`f_i = g(x_i) - x_i` of the last steps, the next point is

    .. math:: x = g(x_k) - \sum_i θ_i (g(x_{i+1}) - g(x_i)), \qquad θ = \arg\min |f_k - \sum_i θ_i (f_{i+1} - f_i)|

    (Anderson 1965, JACM 12:547). Where the energy after it would be above the last one, the plain step is taken in
    its place (Peng et al. 2018, ACM TOG 37:42), so that the energy never rises.

    Parameters
    ----------
    step : callable
        ``step(x)`` is g(x), of energy no greater than x's.
    energy : callable
    start : ndarray
    at_rest : callable
        ``at_rest(energy)``: fall of the energy in `LOOK` steps that ends it.
    most : int
        Steps at most.
    """
    residuals: list[FloatArray] = []
    images: list[FloatArray] = []
    point = image = start
    lowest = seen = np.inf
    for count in range(1, most + 1):
        look_for_stop()
        moved = step(point)
        value = energy(moved)
        if value > lowest:
            point = image
            moved = step(point)
            value = energy(moved)
        residuals.append((moved - point).ravel())
        images.append(moved.ravel())
        del residuals[: -MEMORY - 1], images[: -MEMORY - 1]
        image, lowest = moved, value
        if count % LOOK == 0:
            if seen - value <= at_rest(value):
                break
            seen = value
        point = _combined(residuals, images).reshape(start.shape)
    return image


def _combined(residuals: list[FloatArray], images: list[FloatArray]) -> FloatArray:
    """Return the point whose residual would be least if the steps were linear."""
    if len(residuals) == 1:
        return images[0]
    changes = np.diff(residuals, axis=0)
    shares = np.linalg.lstsq(changes @ changes.T, changes @ residuals[-1], rcond=None)[0]
    return np.asarray(images[-1] - shares @ np.diff(images, axis=0))
