"""The border to Open3D: what a user holds in, plain arrays out; nothing here imports Open3D."""

from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

from o3dleaf.checks import FloatArray, as_points

if TYPE_CHECKING:
    import open3d as o3d

CloudLike = Union[npt.ArrayLike, "o3d.geometry.PointCloud", "o3d.t.geometry.PointCloud"]
"""An (n, 3) array, or a legacy or tensor Open3D point cloud."""


def points_of(cloud: CloudLike, name: str = "points", *, least: int = 0) -> FloatArray:
    """Return the finite (n, 3) coordinates of an Open3D cloud (legacy or tensor) or of an array.

    Raises
    ------
    InputError
        If there are fewer than `least` points, or one is not finite.
    """
    held: Any = cloud
    if hasattr(held, "point"):
        held = held.point.positions.numpy()
    elif hasattr(held, "points"):
        held = np.asarray(held.points)
    return as_points(held, name, dim=3, least=least)
