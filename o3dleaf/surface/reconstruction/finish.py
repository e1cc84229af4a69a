"""What the vertices of a reconstructed mesh carry: normals of its field, colors and scalars of its cloud, support."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import MeshLike, build_mesh, mesh_arrays, tensor_mesh
from o3dleaf.surface.reconstruction.vertex_support import MEASURES, VertexSupport, support_colors

AUTO = "auto"
SHOWN = (AUTO, *MEASURES)
"""What the colors of a mesh can show; "auto": those of its cloud or, where it has none, the distance to it."""


def field_normals(field: Field, vertices: npt.ArrayLike) -> FloatArray:
    r"""Return the (n, 3) outward unit normals of a field's surface at places on it, :math:`-\nabla F/|\nabla F|`.

    Where the gradient vanishes there is none: it is 0 there.
    """
    slope = -np.asarray(field.gradient(vertices), dtype=np.float64)
    length = np.linalg.norm(slope, axis=1, keepdims=True)
    return np.where(length > 0, slope / np.where(length > 0, length, 1.0), 0.0)


def finish_mesh(
    mesh: MeshLike,
    normals: FloatArray,
    carried: Mapping[str, npt.NDArray[Any]],
    support: VertexSupport | None,
    *,
    measure: str | None,
    tensor: bool,
) -> Any:
    """Return a tensor mesh with all that its vertices are to carry, or a legacy mesh with normals and colors.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
    normals : (n, 3) ndarray
    carried : mapping of str to (n,) or (n, c) ndarray
        Colors and other attributes by Open3D's names; those of the support come before them.
    support : VertexSupport or None
    measure : {"auto", "distance", "weight", "residual"} or None
        What the colors show; None, and "auto" where colors were carried: those.
    tensor : bool
    """
    vertices, triangles = mesh_arrays(mesh)
    colors = carried.get("colors")
    if support is not None and measure is not None and (measure != AUTO or colors is None):
        colors = support_colors(support, measure=MEASURES[0] if measure == AUTO else measure)
    if not tensor:
        legacy = mesh if isinstance(mesh, o3d.geometry.TriangleMesh) else build_mesh(vertices, triangles)
        legacy.vertex_normals = o3d.utility.Vector3dVector(normals)
        if colors is not None:
            legacy.vertex_colors = o3d.utility.Vector3dVector(colors.astype(np.float64))
        return legacy
    attributes = {name: values for name, values in carried.items() if name != "colors"}
    if support is not None:
        attributes |= {name: getattr(support, name) for name in MEASURES}
    result = tensor_mesh(vertices, triangles)
    result.vertex.normals = o3d.core.Tensor.from_numpy(normals.astype(np.float32))
    for name, values in attributes.items():
        result.vertex[name] = o3d.core.Tensor.from_numpy(values.reshape(len(vertices), -1).copy())
    if colors is not None:
        result.vertex.colors = o3d.core.Tensor.from_numpy(np.ascontiguousarray(colors))
    return result
