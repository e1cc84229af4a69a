"""Values of a leaf's field at the vertices of its mesh, for programs that color by them."""

from collections.abc import Callable

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.multiscale import MultiscaleLeaf


def field_deviation(leaf: MultiscaleLeaf, points: FloatArray) -> FloatArray:
    r"""Return the (n,) signed distances to the leaf's faces to first order, −G/\|∇G\|; negative inside, 0 where ∇G is.

    At the rim of a closed mesh, where its surface is not G = 0, they have no meaning.
    """
    slope = np.linalg.norm(leaf.gradient(points), axis=1)
    return np.asarray(-leaf(points) / np.where(slope > 0, slope, np.inf))


SCALARS: dict[str, Callable[[MultiscaleLeaf, FloatArray], FloatArray]] = {
    "curvature": MultiscaleLeaf.mean_curvature,
    "deviation": field_deviation,
}
"""What there is, by name."""
