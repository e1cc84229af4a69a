r"""Newton's method onto a level set F = 0, along the gradient in a metric.

With :math:`|v|^2 = v^T g\,v` the length of a step,

.. math:: x ← x - F(x) \frac{g^{-1} ∇F}{∇F^T g^{-1} ∇F}
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray

Jet: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Values (n,) of F, which is 0 on the level set, and gradients (n, d), at (n, d) points."""

Metric: TypeAlias = Callable[[FloatArray, FloatArray, FloatArray, float], FloatArray]
"""``metric(points, values, gradients, max_step)``: Newton's steps (n, d), none longer than `max_step`."""

Advance: TypeAlias = Callable[[FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
"""``advance(points, values, steps)``: the points (n, d) after the steps, and how far (n,) they have moved."""

MIN_SQUARE = 1e-300
"""Of the gradient: where it is 0 there is nowhere to go."""

MIN_DAMPING = 1 / 64
"""Share of a step that must bring |F| down; where none does, there is no surface to go to."""


def euclidean(points: FloatArray, values: FloatArray, gradients: FloatArray, max_step: float) -> FloatArray:
    """Return Newton's steps −F ∇F/|∇F|² (n, d), none longer than `max_step`: the metric of the points themselves."""
    del points
    square = np.maximum(np.einsum("ij,ij->i", gradients, gradients), MIN_SQUARE)
    steepness = np.sqrt(square)
    capped = np.abs(values) / steepness > max_step
    # Where the field is flat the quotient may be beyond all numbers.
    factor = -values / np.where(capped, 1.0, square)
    factor[capped] = -np.copysign(max_step, values[capped]) / steepness[capped]
    return np.asarray(factor[:, np.newaxis] * gradients)


def add_steps(points: FloatArray, values: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the points after the steps, and the steps' lengths."""
    del values
    return points + steps, np.linalg.norm(steps, axis=1)


def project_to_level(
    points: FloatArray,
    jet: Jet,
    *,
    max_step: float,
    tolerance: float,
    max_iterations: int,
    metric: Metric = euclidean,
    advance: Advance = add_steps,
) -> tuple[FloatArray, BoolArray]:
    """Move points that are near a level set onto it.

    Parameters
    ----------
    points : (n, d) ndarray
    jet : callable
        Values and gradients of F.
    max_step : float
        Length of the longest step.
    tolerance : float
        Length of the last step: what is left is about its square.
    max_iterations : int
    metric : callable
        What makes steps of values and gradients.
    advance : callable
        What takes them: a surface that ends somewhere takes less.

    Returns
    -------
    points : (n, d) ndarray
    converged : (n,) ndarray of bool
        Which ones got there.
    """
    moved, active = points.copy(), np.arange(len(points))
    for _ in range(max_iterations):
        if not len(active):
            break
        values, gradients = jet(moved[active])
        steps = metric(moved[active], values, gradients, max_step)
        moved[active], lengths = advance(moved[active], values, steps)
        stuck = ~steps.any(axis=1) & (values != 0)
        active = active[(lengths > tolerance) | stuck]
    converged = np.ones(len(points), dtype=bool)
    converged[active] = False
    return moved, converged


def descend_to_level(
    points: FloatArray,
    jet: Jet,
    *,
    max_step: float,
    tolerance: float,
    rounding: float,
    max_iterations: int,
    metric: Metric = euclidean,
) -> tuple[FloatArray, BoolArray]:
    r"""Move points to a level set from afar: x ← x + λ step, λ halved until \|F\| falls.

    Parameters
    ----------
    points, jet, max_step, max_iterations, metric
        As in `project_to_level`.
    tolerance : float
        Largest coordinate of the step that is left at a point on the surface.
    rounding : float
        The same where rounding hides whether the last step brought \|F\| down.

    Returns
    -------
    points : (n, d) ndarray
        The places of the least \|F\|.
    converged : (n,) ndarray of bool
        Whether F vanishes there but for rounding.
    """
    best, step = points.copy(), np.zeros_like(points)
    damping, residual = np.ones(len(points)), np.full(len(points), np.inf)
    converged, active = np.zeros(len(points), dtype=bool), np.arange(len(points))
    for _ in range(max_iterations):
        trial = best[active] + damping[active, np.newaxis] * step[active]
        values, gradients = jet(trial)
        better = np.abs(values) < residual[active]
        rows, worse = active[better], active[~better]
        best[rows], residual[rows], damping[rows] = trial[better], np.abs(values[better]), 1.0
        step[rows] = metric(trial[better], values[better], gradients[better], max_step)
        damping[worse] /= 2
        converged[rows] = np.abs(step[rows]).max(axis=1, initial=0.0) <= tolerance
        converged[worse] = np.abs(step[worse]).max(axis=1, initial=0.0) <= rounding
        active = active[~converged[active] & (damping[active] >= MIN_DAMPING)]
        if not len(active):
            break
    return best, converged
