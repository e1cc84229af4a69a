"""`o3dleaf batch`: one command for each of many files, side by side or on a cluster, and a table of all."""

import csv
import io
import json
import shlex
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.clean import CleanJob
from o3dleaf.commands.leaf.job import LeafJob
from o3dleaf.commands.line.terminal import show_progress
from o3dleaf.commands.line.words import job_from
from o3dleaf.commands.patch import PatchJob
from o3dleaf.commands.reconstruct import ReconstructJob
from o3dleaf.core.checks.files import is_file, is_folder, require_file
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import Names, argument, option, options_of
from o3dleaf.core.jobs.shared import ClusterOptions
from o3dleaf.core.journal import stage
from o3dleaf.core.parallel import set_num_threads, single_threaded_blas

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need

BATCHED: dict[str, tuple[type[LongJob], str]] = {
    "leaf": (LeafJob, ".ply"),
    "reconstruct": (ReconstructJob, ".ply"),
    "clean": (CleanJob, ".ply"),
    "patch": (PatchJob, ".o3l"),
}
"""Commands of one file that write another one, and the suffix of that."""
TABLE = "batch"
"""Name of the table beside the results."""
FAILED = 1
"""Exit code where a file was refused."""


@dataclass(frozen=True)
class Row:
    """What became of a file.

    Attributes
    ----------
    file, result : str
    done : bool
    said : str
        The last line of the command, or of its error.
    seconds : float
    figures : dict
        Numbers of the command's summary, by dotted names.
    key : str
        Digest of input and options: with the same, `--resume` leaves a file out.
    """

    file: str
    result: str
    done: bool
    said: str
    seconds: float
    figures: dict[str, float]
    key: str

    @classmethod
    def refused(cls, file: Path, said: str, seconds: float = 0.0) -> "Row":
        """Return the row of a file that nothing was made of."""
        return cls(str(file), "", False, said, seconds, {}, "")


@dataclass(frozen=True)
class Piece:
    """The command of one file, its paths such as a worker elsewhere finds."""

    job: LongJob
    file: Path
    result: Path

    @property
    def key(self) -> str:
        """Digest of the options, and of what files that are read are called, hold in bytes and were written at."""
        from o3dleaf.core.resume.parts import key_of

        states = [(str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in self.job.inputs()]
        return key_of([], self.job.settings | {"files": states})

    def run(self) -> Row:
        """Do it without a word, and return what became of it."""
        start = time.monotonic()
        if self.job.threads is not None:
            set_num_threads(self.job.threads)
        try:
            key = self.key
            with show_progress(quiet=True), single_threaded_blas():
                summary = self.job.run()
        except Exception as cause:  # noqa: BLE001 - whatever happens to one file, the others go on
            ours = isinstance(cause, O3DLeafError)
            said = " ".join((str(cause) if ours else f"{type(cause).__name__}: {cause}").split())
            return Row.refused(self.file, said, time.monotonic() - start)
        figures = dict(_numbers(summary if isinstance(summary, dict) else _asdict(summary)))
        said = self.job.line(summary)
        return Row(str(self.file), str(self.result), True, said, time.monotonic() - start, figures, key)


@dataclass(frozen=True)
class BatchJob(ClusterOptions, LongJob):
    """Run one command for each of many files; results and a table of all, CSV and JSON, go into a folder.

    A file that is refused has its error in the table, and the others go on; exit code 1.
    """

    files: list[Path] = argument("Files, or folders whose files are taken.", reads=True)
    output: Path = option(..., "Folder of the results, named as their files.", "--output", "-o")
    command: str = option(
        "leaf", "leaf, reconstruct, clean or patch with its options, such as 'leaf --ct tile.o3l --spacing 0.05'."
    )
    resume: bool = option(
        False, "Leave out files whose result of the same input and options is in the folder.", "--resume"
    )

    def check(self) -> None:
        """Refuse a command that no file can have, and what would be refused of its options for any file."""
        from o3dleaf.core.atomic_files import make_folder

        pieces, new, kept = self.pieces, not is_folder(self.output), False
        make_folder(self.output)
        try:
            super().check()
            for piece in pieces:
                piece.job.check()
            kept = not self.only_estimate
        finally:
            if new and not kept:
                self.output.rmdir()

    def estimate(self) -> "list[Need]":
        """Return what the largest file takes, if that is asked; each is weighed by itself when its turn comes."""
        if not self.only_estimate:
            return []
        needs = [need for piece in self.pieces for need in piece.job.estimate()]
        return [max(needs, key=lambda need: need.bytes)] if needs else []

    def inputs(self) -> list[Path]:
        """Return the files that are read, those of folders too."""
        return sorted({file for each in self.files for file in _files_of(each)})

    def outputs(self) -> list[tuple[Path, Names]]:
        """Return the results and the tables."""
        tables: list[tuple[Path, Names]] = [
            (self.output / f"{TABLE}{suffix}", (suffix,)) for suffix in (".csv", ".json")
        ]
        return [*tables, *((piece.result, ()) for piece in self.pieces)]

    @cached_property
    def pieces(self) -> list[Piece]:
        """The commands of all files, in their order."""
        try:
            words = shlex.split(self.command)
        except ValueError as cause:
            raise InputError(f"command: is {self.command!r} ({cause}); close its quotes") from cause
        if not words or words[0] not in BATCHED:
            raise InputError(f"command: is {self.command!r}; begin with one of {', '.join(BATCHED)}")
        kind, suffix = BATCHED[words[0]]
        made = []
        for file in self.inputs():
            result = (self.output / file.name).with_suffix(suffix)
            if any(word.startswith(("--workers", "--scheduler")) for word in words):
                raise InputError("command: has workers of its own; give --workers or --scheduler to batch alone")
            job = _placed(job_from(kind, [*words[1:], str(file), "--output", str(result)]))
            job = replace(job, memory=job.memory or self.memory, time=job.time or self.time)
            made.append(Piece(job, file, result))
        return made

    def work(self) -> list[Row]:
        """Run them all, write the table after each, and return it in the order of the files."""
        from o3dleaf.core.atomic_files import write_json, write_text
        from o3dleaf.core.progress import report

        rows = self.known() if self.resume else {}
        left = [number for number in range(len(self.pieces)) if number not in rows]
        with stage("files"):
            for number, row in self.each([self.pieces[number] for number in left]):
                rows[left[number]] = row
                table = [rows[place] for place in sorted(rows)]
                write_json({"rows": [asdict(each) for each in table]}, self.output / f"{TABLE}.json")
                write_text(_as_csv(table), self.output / f"{TABLE}.csv")
                report(len(rows), len(self.pieces))
        return [rows[number] for number in range(len(self.pieces))]

    def known(self) -> dict[int, Row]:
        """Return the rows of a run before whose results are there, of the same input and options."""
        try:
            text = (self.output / f"{TABLE}.json").read_text(encoding="utf-8")
            rows = [Row(**row) for row in json.loads(text)["rows"]]
        except (OSError, ValueError, KeyError, TypeError):
            return {}
        done = {row.key: row for row in rows if row.done and is_file(row.result)}
        return {number: done[piece.key] for number, piece in enumerate(self.pieces) if piece.key in done}

    def each(self, pieces: Sequence[Piece]) -> Iterator[tuple[int, Row]]:
        """Yield the number of each piece and its row, as they are ready."""
        if not self.is_spread:
            yield from enumerate(map(Piece.run, pieces))
            return
        from o3dleaf.core.processes.cluster import cluster_of, share_of

        if self.workers is not None:
            share = share_of(self.workers)
            pieces = [replace(each, job=replace(each.job, threads=each.job.threads or share)) for each in pieces]
        with cluster_of(self.workers, self.scheduler) as cluster:
            for number, row in cluster.map(Piece.run, pieces):
                yield number, row if isinstance(row, Row) else Row.refused(pieces[number].file, str(row))

    def line(self, summary: list[Row]) -> str:
        """Return how many were done, and where the table is."""
        done = sum(row.done for row in summary)
        return f"{self.output / f'{TABLE}.csv'}: {done} of {len(summary)} files done"

    def lines(self, summary: list[Row]) -> list[str]:
        """Return a line for each file that was refused, then how many were done."""
        return [f"{row.file}: {row.said}" for row in summary if not row.done] + super().lines(summary)

    def exit_code(self, summary: list[Row]) -> int:
        """Return 1 if a file was refused."""
        return 0 if all(row.done for row in summary) else FAILED


def _files_of(place: Path) -> list[Path]:
    """Return a file, or the files in a folder, but for hidden ones."""
    if not is_folder(place):
        return [require_file(place)]
    files = [file for file in place.iterdir() if is_file(file) and not file.name.startswith(".")]
    if not files:
        raise InputError(f"{place}: holds no file; give files, or a folder of them")
    return files


def _placed(job: LongJob) -> LongJob:
    """Return a job whose files are named from the root on."""
    paths = {
        name: getattr(job, name).absolute() for name in options_of(type(job)) if isinstance(getattr(job, name), Path)
    }
    return replace(job, **paths)


def _asdict(summary: Any) -> dict[str, Any]:
    return dict(summary.to_dict()) if hasattr(summary, "to_dict") else {}


def _numbers(content: dict[str, Any], before: str = "") -> Iterator[tuple[str, float]]:
    """Yield the numbers in a summary, by dotted names; lists and words are left to the file beside the result."""
    for name, value in content.items():
        if isinstance(value, dict) and name != "settings":
            yield from _numbers(value, f"{before}{name}.")
        elif isinstance(value, bool | int | float):
            yield f"{before}{name}", value


def _as_csv(rows: Iterable[Row]) -> str:
    """Return a table with a column for each figure that any row has."""
    rows = list(rows)
    figures = list(dict.fromkeys(name for row in rows for name in row.figures))
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["file", "done", "seconds", *figures, "said"])
    for row in rows:
        writer.writerow(
            [row.file, row.done, f"{row.seconds:.1f}", *(row.figures.get(name, "") for name in figures), row.said]
        )
    return text.getvalue()
