"""`o3dleaf view`: meshes and clouds in a window."""

from dataclasses import dataclass
from pathlib import Path

from o3dleaf.core.job import Job, argument


@dataclass(frozen=True)
class ViewJob(Job):
    """Show meshes and point clouds in Open3D's window."""

    files: list[Path] = argument("Meshes and point clouds.", reads=True)

    def work(self) -> None:
        """Show them until the window is closed."""
        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.output.view.window import show

        show(*(read_geometry(file) for file in self.files))
