"""The largest straight box in a turned volume: the tile that a patch is cut to."""

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog, minimize

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds, as_points
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.volume import apply_transform

TOO_HIGH = "box: no box of this height fits into the rotated volume; reduce the height, or crop the volume less"


def inscribed_box(
    bounds: npt.ArrayLike, transform: npt.ArrayLike, height: tuple[float, float] | None = None
) -> FloatArray:
    """Return the largest axis-aligned box (2, 3) inside a box that a rigid motion has turned.

    A turned volume has no straight faces; the tiles of a leaf need a box that is full of voxels.

    Parameters
    ----------
    bounds : (2, 3) array_like
        The box before it is turned, for example ``volume.bounds``.
    transform : (4, 4) array_like
        Rigid motion, for example from `align_blade`.
    height : (low, high), optional
        Keep this range of z, which must hold the blade and its hairs, and make the base as large as
        possible (default: the largest volume).

    Raises
    ------
    InputError
        If no box has that height.
    """
    low, high = as_bounds(bounds, 3)
    matrix = as_points(transform, "transform", dim=4)
    if set(abs(matrix[:3, :3]).ravel()) <= {0.0, 1.0}:
        return _straight(np.sort(apply_transform(matrix, [low, high]), axis=0), height)
    # In units of the box's size. Faces of the turned box: N p <= b; a box fits if its corner
    # farthest along each normal does.
    size = (high - low).max()
    turn, move = matrix[:3, :3], matrix[:3, 3] / size
    normals = np.concatenate([turn.T, -turn.T])
    limits = np.concatenate([high / size + move @ turn, -low / size - move @ turn])
    rows = np.hstack([np.minimum(normals, 0.0), np.maximum(normals, 0.0)])
    if height is not None:
        limits = limits - rows[:, [2, 5]] @ (np.asarray(height, dtype=np.float64) / size)
        rows = rows[:, [0, 1, 3, 4]]
    box = _largest(rows, limits).reshape(2, -1) * size
    box += 1e-9 * size * np.array([[1.0], [-1.0]])
    return box if height is None else np.column_stack([box, height])


def _straight(box: FloatArray, height: tuple[float, float] | None) -> FloatArray:
    """Cut the box to the height: nothing to search where the axes are still axes."""
    if height is None:
        return box
    if height[0] < box[0, 2] or height[1] > box[1, 2]:
        raise InputError(TOO_HIGH)
    return np.column_stack([box[:, :2], height])


def _largest(rows: FloatArray, limits: FloatArray) -> FloatArray:
    """Corners (lower, upper) of the box with the largest product of sides, under ``rows @ corners <= limits``."""
    axes = rows.shape[1] // 2
    sides = np.hstack([-np.eye(axes), np.eye(axes)])
    # Start in the box whose shortest side is longest: there the logarithms below are finite.
    roomy = linprog(
        np.append(np.zeros(2 * axes), -1.0),
        A_ub=np.block([[rows, np.zeros((len(rows), 1))], [-sides, np.ones((axes, 1))]]),
        b_ub=np.append(limits, np.zeros(axes)),
        bounds=(None, None),
    )
    if not roomy.success or roomy.x[-1] <= 0:
        raise InputError(TOO_HIGH)
    result = minimize(
        lambda x: -np.log(np.maximum(sides @ x, 1e-12)).sum(),
        roomy.x[:-1],
        jac=lambda x: -sides.T @ (1.0 / np.maximum(sides @ x, 1e-12)),
        constraints={"type": "ineq", "fun": lambda x: limits - rows @ x, "jac": lambda _: -rows},
        method="SLSQP",
        options={"maxiter": 200, "ftol": 1e-12},
    )
    corners: FloatArray = result.x
    return corners
