"""Points near a blade in the world, with the Jacobian of the lift X(z) that took them there."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.blade import lifted_loops

BLOCK = 1 << 12


@dataclass(frozen=True)
class Lifted:
    """Points of the blade's neighborhood in the world, and the Jacobian of the lift there.

    Attributes
    ----------
    world : (n, 3) ndarray
        X(z).
    columns : (n, 3, 3) ndarray
        ``columns[:, k]`` is ∂X/∂z_k.
    """

    world: FloatArray
    columns: FloatArray

    def pull_back(self, inner: FloatArray) -> FloatArray:
        """Return the (n, 3) world gradients A⁻ᵀ g of functions with gradients g by z; A has the columns ∂X/∂z."""
        columns, gradients = self.columns, np.empty_like(inner)
        run_blocks(
            lambda start, stop: lifted_loops.pull_back(start, stop, columns, inner, gradients), len(inner), BLOCK
        )
        return gradients

    def newton_steps(self, values: FloatArray, inner: FloatArray, max_step: float) -> FloatArray:
        """Return Newton's steps in z towards F = 0 along the world gradient, none longer than `max_step` there.

        Parameters
        ----------
        values : (n,) ndarray
        inner : (n, 3) ndarray
            Gradients of F by z.
        max_step : float
            In the world.
        """
        columns, steps = self.columns, np.empty_like(inner)

        def task(start: int, stop: int) -> None:
            lifted_loops.gradient_steps(start, stop, columns, values, inner, max_step, steps)

        run_blocks(task, len(inner), BLOCK)
        return steps

    def to_flat(self, shifts: FloatArray) -> FloatArray:
        """Return the steps in z (n, 3) of shifts in the world."""
        return np.asarray(np.linalg.solve(self.columns.transpose(0, 2, 1), shifts[..., np.newaxis])[..., 0])
