"""`o3dleaf info`: the contents of a file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.patch import LAYOUT_HELP
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.atomic_files import write_json
from o3dleaf.core.checks import is_folder
from o3dleaf.core.errors import InputError
from o3dleaf.core.job import Job, UnitOption, argument, option

if TYPE_CHECKING:
    from o3dleaf.leaf.ct.volume import Volume


@dataclass(frozen=True)
class InfoJob(UnitOption, Job):
    """Show what a file contains: sizes, extent, and for a mesh whether it is manifold and closed."""

    file: Path = argument("A mesh, a point cloud or a volume.", reads=True)
    voxel_spacing: Positive | None = option(
        None, "Edge of a voxel (needed if the file does not state it)", unit="unit", needs=("volume_file",)
    )
    layout: str | None = option(None, LAYOUT_HELP, needs=("volume_file",))
    json: Path | None = option(None, "Also write it as JSON.", writes=())

    @property
    def volume_file(self) -> bool:
        """Whether FILE is a volume."""
        from o3dleaf.leaf.ct.formats.read import SUFFIXES

        volumes = tuple(suffix for suffix in SUFFIXES if suffix != ".ply")  # there, more often points or a mesh
        return is_folder(self.file) or self.file.name.lower().endswith(volumes)

    def work(self) -> dict[str, Any]:
        """Return the contents of the file, as plain values; lengths in `unit`."""
        contents = self.volume() if self.volume_file else self.geometry()
        if self.json is not None:
            write_json(contents, self.json)
        return contents

    def volume(self) -> dict[str, Any]:
        """Return the figures of a volume."""
        from o3dleaf.leaf.ct.formats.read import read_stated

        volume, stated = read_stated(self.file, spacing=self.voxel_spacing, unit=self.unit, layout=self.layout)
        return {
            "kind": "volume",
            "shape": list(volume.shape),
            "axes": f"x, y, z; in the file {', '.join(stated.axes)}, the slowest first",
            "type": str(volume.data.dtype),
            "spacing": volume.spacing.tolist(),
            "bounds": volume.bounds.tolist(),
            "unit": volume.unit,
            "intensity": [float(volume.data.min()), float(volume.data.max())],
            "threshold": _threshold_of(volume),
        }

    def geometry(self) -> dict[str, Any]:
        """Return the figures of a mesh or a point cloud."""
        import numpy as np
        import open3d as o3d

        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.surface.mesh.mesh_report import mesh_report

        read = read_geometry(self.file)
        if isinstance(read, o3d.geometry.TriangleMesh):
            return {"kind": "mesh"} | mesh_report(read, unit=self.unit).to_dict()
        points = np.asarray(read.points)
        return {
            "kind": "point cloud",
            "points": len(points),
            "normals": read.has_normals(),
            "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
            "median_spacing": float(np.median(np.asarray(read.compute_nearest_neighbor_distance()))),
            "unit": self.unit,
        }

    def lines(self, summary: dict[str, Any]) -> list[str]:
        """Return a line a figure."""
        return [f"{name:>24}  {value}" for name, value in summary.items()]


def _threshold_of(volume: "Volume") -> float | str:
    """Return the intensity of the surface, or why none was found: without two peaks it is a volume all the same."""
    try:
        return volume.threshold()
    except InputError as none:
        return str(none)
