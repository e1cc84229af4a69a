"""`o3dleaf view` and `o3dleaf pick`: what opens Open3D's window."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.commands.render import need_for_pictures
from o3dleaf.core.jobs.job import Job
from o3dleaf.core.jobs.option import argument, output

if TYPE_CHECKING:
    from o3dleaf.core.checks.arrays import FloatArray
    from o3dleaf.core.resources.needs import Need


@dataclass(frozen=True)
class ViewJob(Job):
    """Show meshes and point clouds in Open3D's window."""

    files: list[Path] = argument("Meshes and point clouds.", reads=True)

    def estimate(self) -> "list[Need]":
        """Return what they take, as in a picture."""
        return [need_for_pictures(self.files)]

    def work(self) -> None:
        """Show them until the window is closed."""
        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.output.view.window import show

        show(*(read_geometry(file) for file in self.files))


@dataclass(frozen=True)
class PickJob(Job):
    """Pick the control points of a midrib in Open3D's window, from base to tip, for `leaf --midrib`."""

    scan: Path = argument("Point cloud of one leaf.", reads=True)
    output: Path = output((".ply",))

    def estimate(self) -> "list[Need]":
        """Return what the points take, as in a picture."""
        return [need_for_pictures([self.scan])]

    def work(self) -> "FloatArray":
        """Write the points that were picked, and return them."""
        from o3dleaf.io.point_cloud import read_point_cloud
        from o3dleaf.output.view.pick import pick_midrib, write_midrib

        control = pick_midrib(read_point_cloud(self.scan))
        write_midrib(control, self.output)
        return control

    def line(self, summary: "FloatArray") -> str:
        """Return how many they are."""
        return f"{self.output}: {len(summary)} control points"
