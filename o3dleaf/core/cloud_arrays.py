"""The border to Open3D: clouds of any kind in, plain arrays out; nothing here imports Open3D."""

from typing import TYPE_CHECKING, Any, Protocol, Union, cast

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray, as_array
from o3dleaf.core.checks.coordinates import as_sites, require_cloud

if TYPE_CHECKING:
    import open3d as o3d


class HasPoints(Protocol):
    """An object with points (n, 3), and perhaps normals, as Open3D's legacy clouds have them."""

    @property
    def points(self) -> Any:
        """Coordinates (n, 3)."""


CloudLike = Union[npt.ArrayLike, "o3d.geometry.PointCloud", "o3d.t.geometry.PointCloud", HasPoints]
"""An (n, 3) array, a legacy or tensor Open3D point cloud, or what has points as these have."""


def points_of(cloud: CloudLike, name: str = "points", *, least: int = 0) -> FloatArray:
    """Return the finite (n, 3) coordinates of an Open3D cloud (legacy or tensor) or of an array.

    Raises
    ------
    InputError
        If there are fewer than `least` points, or one is not finite, or they are beyond 1e±30.
    """
    return as_sites(raw_points(cloud, name), name, dim=3, least=least)


def raw_points(cloud: CloudLike, name: str = "cloud") -> npt.ArrayLike:
    """Return the coordinates of an Open3D cloud (legacy or tensor) or of an array, unchecked.

    Raises
    ------
    InputError
        If it is a path, or a mesh.
    """
    require_cloud(cloud, name)
    points: Any = cloud
    if hasattr(points, "point"):
        # A tensor cloud that is empty has no positions at all.
        points = points.point.positions.cpu().numpy() if "positions" in points.point else np.empty((0, 3))
    elif hasattr(points, "points"):
        points = as_array(points.points, name)
    return cast(npt.ArrayLike, points)


def raw_normals(cloud: CloudLike) -> npt.ArrayLike | None:
    """Return the normals of an Open3D cloud (legacy or tensor), unchecked, or None where it has none."""
    legacy: Any = cloud
    if hasattr(legacy, "point"):
        return cast(npt.ArrayLike, legacy.point.normals.cpu().numpy()) if "normals" in legacy.point else None
    normals = getattr(legacy, "normals", None)
    return None if normals is None or not len(normals) else np.asarray(normals)


def point_attributes(cloud: CloudLike) -> dict[str, npt.NDArray[Any]]:
    """Return what the points of an Open3D cloud carry beside positions and normals, unchecked, by Open3D's names."""
    legacy: Any = cloud
    if hasattr(legacy, "point"):
        own = {name: tensor.cpu().numpy() for name, tensor in legacy.point.items()}
        return {name: values for name, values in own.items() if name not in {"positions", "normals"}}
    colors = getattr(legacy, "colors", None)
    return {} if colors is None or not len(colors) else {"colors": np.asarray(colors)}
