"""The plane inside a polygon as triangles that end on it."""

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import Delaunay

from o3dleaf.core.checks import FloatArray, as_bounds
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray


def triangulate(
    polygon: shapely.Polygon, spacing: float, region: npt.ArrayLike | None = None
) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 2) and counter-clockwise triangles (m, 3) of a polygon, or of a box of it.

    Raises
    ------
    ReconstructionError
        If nothing is inside.
    """
    area = polygon if region is None else polygon & shapely.box(*as_bounds(region, 2, "region").ravel())
    if area.area == 0:
        raise ReconstructionError("region: contains nothing of the blade; give one inside its outline")
    border = shapely.get_coordinates(shapely.segmentize(area, spacing))
    low, high = np.array(area.bounds).reshape(2, 2)
    axes = (
        np.arange(np.floor(a / spacing), np.ceil(b / spacing) + 1) * spacing for a, b in zip(low, high, strict=True)
    )
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = grid[shapely.contains_xy(area.buffer(-0.4 * spacing), *grid.T)]
    vertices = np.unique(np.concatenate([border, inner]), axis=0)
    triangles = Delaunay(vertices).simplices.astype(np.int64)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    turned = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[turned < 0] = triangles[turned < 0][:, ::-1]
    kept = shapely.contains_xy(area, *((a + b + c) / 3).T) & (np.abs(turned) > 1e-12 * spacing**2)
    return vertices, triangles[kept]
