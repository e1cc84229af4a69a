"""The surface of the leaf at points: projection onto it, its normals and its mean curvature.

All of it works in flat coordinates z, where the surface is F(z) = 0, and in the metric of the world,
which the lift X(z) brings in by its Jacobian: nothing has to find its way from the world to the leaf
but the queries themselves, once.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.newton import descend_to_level
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.leaf.distance import projection_loops
from o3dleaf.leaf.textured_blade import TexturedBlade

BATCH_SIZE = 1 << 15
"""Points looked at together: what is kept of them beside arguments and results, 600 bytes each, is 20 MB."""
BLOCK = 1 << 12
MAX_ITERATIONS = 40
TOLERANCE = 1e-11
"""Length of Newton's step, of the patch's thickness, at which a point is on the surface."""
ROUNDING = 1e-8
"""The same, where rounding hides whether the last step brought |F| down."""
MAX_STEP = 0.05
"""The same: no step is longer, so that it does not leap over the face that it goes to."""


def project(leaf: TexturedBlade, x: npt.ArrayLike, closest_points: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Return the (n, 3) points of G = 0 that Newton's method along the gradient reaches from (n, 3) world points.

    Where it reaches none, the `closest_points` of the leaf are requested.
    """
    points, size = as_points(x, "x", dim=3), leaf.thickness
    result = np.empty_like(points)
    for first, last in blocks(len(points), BATCH_SIZE):
        flat, converged = descend_to_level(
            leaf.blade.flatten(points[first:last]),
            leaf.values_and_gradients,
            max_step=MAX_STEP * size,
            tolerance=TOLERANCE * size,
            rounding=ROUNDING * size,
            max_iterations=MAX_ITERATIONS,
            metric=leaf.newton_steps,
        )
        result[first:last] = leaf.blade.lift(flat)
        lost = first + np.flatnonzero(~converged)
        if len(lost):
            result[lost] = closest_points(points[lost])
    return result


def normals(leaf: TexturedBlade, x: npt.ArrayLike) -> FloatArray:
    """Return the unit vectors −∇G/|∇G| (n, 3) at world points, 0 where ∇G vanishes."""
    gradient = leaf.gradient(x)
    length = np.linalg.norm(gradient, axis=1)
    return np.asarray(-gradient / np.where(length > 0, length, 1.0)[:, np.newaxis], dtype=np.float64)


def mean_curvature(leaf: TexturedBlade, x: npt.ArrayLike) -> FloatArray:
    """Return div n/2 (n,) of the level sets of G at world points, n = −∇G/|∇G|."""
    points = as_points(x, "x", dim=3)
    curvatures = np.empty(len(points))
    for first, last in blocks(len(points), BATCH_SIZE):
        _fill_curvatures(leaf, leaf.blade.flatten(points[first:last]), curvatures[first:last])
    return curvatures


def _fill_curvatures(leaf: TexturedBlade, flat: FloatArray, curvatures: FloatArray) -> None:
    """Write the mean curvatures of one chunk of points."""
    _, inner, hessians = leaf.jets(flat, 2)
    columns = leaf.blade.lift_with_jacobian(flat).columns
    second = leaf.blade.lift_hessians(flat)

    def task(start: int, stop: int) -> None:
        projection_loops.mean_curvatures(start, stop, columns, inner, hessians, second, curvatures)

    run_blocks(task, len(flat), BLOCK)
