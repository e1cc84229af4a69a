"""What a file holds, in plain values, and such values to disk as JSON."""

import json
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d

from o3dleaf.core.atomic_files import whole_file
from o3dleaf.core.errors import InputError
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import read_triangle_mesh
from o3dleaf.leaf.ct.formats import read_volume
from o3dleaf.surface.mesh.mesh_report import mesh_report

VOLUMES = (".tif", ".tiff", ".npy", ".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".gz")


def write_json(path: str | PathLike[str], content: dict[str, Any]) -> None:
    """Write `content` as JSON, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2, ensure_ascii=False, default=_plain) + "\n", encoding="utf-8")


def _plain(value: object) -> Any:
    """Turn what JSON does not know into what it does."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value)


def read_geometry(path: str | PathLike[str]) -> o3d.geometry.TriangleMesh | o3d.geometry.PointCloud:
    """Return the mesh of a file, or its point cloud if it holds no triangles.

    Raises
    ------
    InputError
        If it can be read as neither.
    """
    try:
        return read_triangle_mesh(path)
    except InputError:
        return read_point_cloud(path, least=1)


def describe_file(
    path: str | PathLike[str], *, unit: str | None = None, voxel_spacing: float | None = None
) -> dict[str, Any]:
    """Return what a mesh, point cloud or volume file holds, as plain values; lengths in `unit`.

    Raises
    ------
    InputError
        If the file is none of them.
    """
    if Path(path).is_dir() or Path(path).suffix.lower() in VOLUMES:
        volume = read_volume(path, spacing=voxel_spacing, unit=unit)
        return {
            "kind": "volume",
            "shape": list(volume.shape),
            "spacing": volume.spacing.tolist(),
            "bounds": volume.bounds.tolist(),
            "unit": volume.unit,
            "intensity": [float(volume.data.min()), float(volume.data.max())],
            "threshold": volume.threshold(),
        }
    found = read_geometry(path)
    if isinstance(found, o3d.geometry.TriangleMesh):
        return {"kind": "mesh"} | mesh_report(found, unit=unit).to_dict()
    points = np.asarray(found.points)
    return {
        "kind": "point cloud",
        "points": len(points),
        "normals": found.has_normals(),
        "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
        "median_spacing": float(np.median(np.asarray(found.compute_nearest_neighbor_distance()))),
        "unit": unit,
    }
