"""`o3dleaf pick`: the midrib of a scan, picked by hand."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.job import Job, argument, output

if TYPE_CHECKING:
    from o3dleaf.core.checks import FloatArray


@dataclass(frozen=True)
class PickJob(Job):
    """Pick the control points of a midrib in Open3D's window, from base to tip, for `leaf --midrib`."""

    scan: Path = argument("Point cloud of one leaf.", reads=True)
    output: Path = output((".ply",))

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
