"""`o3dleaf demo`: the leaf of the samples."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.leaf.job import LeafJob, in_a_line
from o3dleaf.commands.sample import SampleOption
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.atomic_files import make_folder
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import option

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need


@dataclass(frozen=True)
class DemoJob(SampleOption, LongJob):
    """Build the sample leaf: mesh, picture and summary into a folder."""

    output: Path = option(Path("demo_output"), "Folder to write into.", "--output", "-o")
    spacing: Positive = option(0.1, "Mesh spacing", unit="mm")

    def estimate(self) -> "list[Need]":
        """Return what the leaf takes, of samples that are there; of others, what it takes to make them."""
        from o3dleaf.core.resources.measured import SAMPLES
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.samples.files import PATCH, SCAN

        scan, ct = self.samples / SCAN, self.samples / PATCH
        if not (scan.is_file() and ct.is_file()):
            return [need_of(SAMPLES, "samples", "close other programs")]
        job = LeafJob(scan, self.output / "leaf.ply", ct=ct, spacing=self.spacing, only_estimate=self.only_estimate)
        return job.estimate()

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
