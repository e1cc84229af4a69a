"""`o3dleaf demo`: the leaf of the samples."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o3dleaf.commands.leaf import LeafJob, in_a_line
from o3dleaf.commands.sample import SampleOption
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.atomic_files import make_folder
from o3dleaf.core.job import LongJob, option


@dataclass(frozen=True)
class DemoJob(SampleOption, LongJob):
    """Build the sample leaf: mesh, picture and summary into a folder."""

    output: Path = option(Path("demo_output"), "Folder to write into.", "--output", "-o")
    spacing: Positive = option(0.1, "Mesh spacing", unit="mm")

    def work(self) -> dict[str, Any]:
        """Write the samples if need be, then the leaf, and return its summary."""
        folder = make_folder(self.output)
        scan, midrib, ct = self.find_samples(folder)
        mesh, model = folder / "leaf.ply", folder / "leaf.o3l"
        job = LeafJob(scan, mesh, ct=ct, midrib=midrib, model=model, spacing=self.spacing)
        summary: dict[str, Any] = job.run()
        return summary

    def line(self, summary: dict[str, Any]) -> str:
        """Return what was built."""
        return in_a_line(summary)
