"""Options that several jobs have."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from o3dleaf.core.arguments.kinds import Count, Unit
from o3dleaf.core.jobs.option import option


@dataclass(frozen=True, kw_only=True)
class ResumeOption:
    """Whether a long job keeps what it has finished, and goes on from it."""

    HEADING: ClassVar = "Resources"

    resume: bool = option(
        False,
        "Keep finished parts beside the output, and go on from those of a run that was stopped: the result is the same "
        "to the byte. Give it from the first run on.",
        "--resume",
    )


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Whether a job is done by this process alone, or by the workers of a Dask cluster."""

    HEADING: ClassVar = "Resources"

    workers: Count | None = option(
        None, "Processes of this machine that work side by side, with Dask; left out, this process does it alone."
    )
    scheduler: str | None = option(
        None,
        "Address of a Dask scheduler, such as tcp://10.0.0.1:8786, whose workers have o3dleaf and see the same files.",
        unless=("workers",),
    )

    @property
    def is_spread(self) -> bool:
        """Whether workers do it."""
        return self.workers is not None or self.scheduler is not None


@dataclass(frozen=True, kw_only=True)
class UnitOption:
    """The unit of files that do not say theirs."""

    HEADING: ClassVar = "Input"

    unit: Unit | None = option(None, "Unit of the coordinates: m, cm, mm, um or nm.", unless=("saved_model",))


@dataclass(frozen=True, kw_only=True)
class ColumnsOption:
    """The columns of a text file of points that does not name them, or names them otherwise."""

    HEADING: ClassVar = "Input"

    columns: str | None = option(
        None, "Columns of points in text, such as 'x y z nx ny nz'; by default those that the file names, or x y z."
    )


@dataclass(frozen=True, kw_only=True)
class ScanOptions:
    """Midrib and unit of a scan."""

    HEADING: ClassVar = "Input"

    midrib: Path | None = option(
        None, "Control points from base to tip; computed if not given.", reads=True, unless=("saved_leaf",)
    )
    scan_unit: Unit = option("mm", "Unit of scan and midrib: m, cm, mm, um or nm.", unless=("saved_leaf",))
