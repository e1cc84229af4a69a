"""`o3dleaf sample`: the synthetic samples as files, and the option of commands that take them."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.arguments.kinds import Whole
from o3dleaf.core.jobs.job import Job
from o3dleaf.core.jobs.option import argument, option

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need


@dataclass(frozen=True)
class SampleJob(Job):
    """Write a synthetic scan, its midrib and a micro-CT volume, with a page that describes them."""

    folder: Path = argument("Folder to write into.")
    seed: Whole = option(0, "Seed of the synthetic leaf.")
    leaves: bool = option(False, "Scans of curled, twisted, eaten, lobed and other leaves as well.", "--leaves")

    def estimate(self) -> "list[Need]":
        """Return what the samples take, which are always of one size."""
        from o3dleaf.core.resources.measured import SAMPLES
        from o3dleaf.core.resources.needs import need_of

        return [need_of(SAMPLES, "samples", "close other programs")]

    def work(self) -> list[Path]:
        """Write the samples, and return their files."""
        from o3dleaf.core.atomic_files import make_folder
        from o3dleaf.samples.files import write_samples
        from o3dleaf.samples.leaves.scan_files import write_leaf_scans

        paths = write_samples(make_folder(self.folder), seed=self.seed)
        return paths + (write_leaf_scans(self.folder, seed=self.seed) if self.leaves else [])

    def lines(self, summary: list[Path]) -> list[str]:
        """Return the files."""
        return [str(path) for path in summary]


@dataclass(frozen=True, kw_only=True)
class SampleOption:
    """The samples, for commands that work without any file of one's own."""

    samples: Path = option(
        Path("data_samples"), "Folder of the samples; they are created if missing.", unless=("scan", "model")
    )

    def find_samples(self, output: Path) -> tuple[Path, Path, Path]:
        """Return the files of scan, midrib and volume; written into a folder of `output` if they are not there."""
        from o3dleaf.samples.files import MIDRIB, PATCH, SCAN, write_samples

        names, folder = (SCAN, MIDRIB, PATCH), self.samples
        if not all((folder / name).is_file() for name in names):
            folder = output / "data_samples"
            write_samples(folder)
        return folder / SCAN, folder / MIDRIB, folder / PATCH
