"""The command line: each command is made of the fields of its job."""

import inspect
import sys
from typing import Any, NoReturn, cast

import typer

from o3dleaf.commands.batch import BatchJob
from o3dleaf.commands.clean import CleanJob
from o3dleaf.commands.demo import DemoJob
from o3dleaf.commands.droplet.run import DropletJob
from o3dleaf.commands.export import ExportJob
from o3dleaf.commands.figures import FiguresJob
from o3dleaf.commands.info import InfoJob
from o3dleaf.commands.leaf.job import LeafJob
from o3dleaf.commands.line.terminal import show_progress
from o3dleaf.commands.line.words import HELP, command_of
from o3dleaf.commands.patch import PatchJob
from o3dleaf.commands.qa import QaJob
from o3dleaf.commands.reconstruct import ReconstructJob
from o3dleaf.commands.render import RenderJob
from o3dleaf.commands.sample import SampleJob
from o3dleaf.commands.warm_up import WarmUpJob
from o3dleaf.commands.windows import PickJob, ViewJob
from o3dleaf.core.checks.files import is_folder, require_file
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.jobs.job import Job, LongJob
from o3dleaf.core.parallel import set_num_threads, single_threaded_blas

JOBS: dict[str, type[Job]] = {
    "demo": DemoJob,
    "leaf": LeafJob,
    "reconstruct": ReconstructJob,
    "patch": PatchJob,
    "sample": SampleJob,
    "info": InfoJob,
    "qa": QaJob,
    "clean": CleanJob,
    "export": ExportJob,
    "droplet": DropletJob,
    "batch": BatchJob,
    "render": RenderJob,
    "figures": FiguresJob,
    "pick": PickJob,
    "view": ViewJob,
    "warm-up": WarmUpJob,
}
"""Every command, in the order of the help."""


NO_THREAD = "can't start new thread"


def add_command(program: typer.Typer, name: str, job: type[Job]) -> None:
    """Give a program the command of a job: its options are the job's fields, its help the docstring."""

    def do(asked: Job) -> None:
        raise typer.Exit(perform(asked))

    program.command(name, help=inspect.getdoc(job))(command_of(job, do))


def perform(job: Job) -> int:
    """Do a job as its command does, and return the exit code."""
    if isinstance(job, LongJob) and job.threads is not None:
        set_num_threads(job.threads)
    if job.only_estimate:
        return show_estimate(job)
    if isinstance(job, LongJob):
        # Systems of a few unknowns take ten times as long where BLAS wakes a thread for each core.
        with show_progress(quiet=job.quiet), single_threaded_blas():
            summary = job.run()
    else:
        summary = job.run()
    for line in job.lines(summary):
        typer.echo(line)
    return job.exit_code(summary)


def show_estimate(job: Job) -> int:
    """Print what a job will need of memory and time, and what there is; return the exit code: 2 if that is less."""
    from o3dleaf.core.resources.budget import memory_limit, time_limit, usable_memory
    from o3dleaf.core.resources.sizes import size_in_words

    with memory_limit(job.memory), time_limit(job.time):
        job.check()
        for path in job.inputs():
            if not is_folder(path):
                require_file(path)
        needs = job.estimate()
        for need in needs:
            typer.echo(f"{need}")
        if not needs:
            typer.echo("nothing is known of it before its files are read; what then is too large is refused")
        room = usable_memory()
        if room is not None:
            typer.echo(f"{size_in_words(max(room.free, 0))} more may be used {room.name}")
        for need in needs:
            need.require()
    return 0


app = typer.Typer(
    help="Combine laser scan and micro-CT of a leaf into one multi-scale surface.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings=HELP,
)
for _name, _job in JOBS.items():
    add_command(app, _name, _job)


UsageError = cast(type[Exception], typer.BadParameter.__bases__[0])
"""What typer raises for words that it cannot read; it has no name of its own there."""


def main() -> None:
    """Run the command line; an error of ours, of usage, or memory that ran out, is one line and exit code 2."""
    try:
        sys.exit(app(standalone_mode=False))
    except UsageError as error:
        _end(_misused(error))
    except O3DLeafError as error:
        _end(" ".join(str(error).split()))
    except MemoryError as error:
        _end(_out_of_memory(error))
    except RuntimeError as error:
        # What Python says where the system has no room for the stack of one thread more.
        if NO_THREAD not in str(error):
            raise
        _end(_out_of_memory(error))


def _misused(error: Any) -> str:
    """Return the line for words that are no command line; without any the help was shown, and that is all."""
    if type(error).__name__ == "NoArgsIsHelpError":
        sys.exit(error.exit_code)
    said = " ".join(error.format_message().split()).rstrip(".")
    command = next((word for word in sys.argv[1:2] if word in JOBS), None)
    where, program = (f"{command}: ", f"o3dleaf {command}") if command else ("", "o3dleaf")
    return f"{where}{said[:1].lower()}{said[1:]}; see {program} --help"


def _out_of_memory(error: Exception) -> str:
    said = " ".join(str(error).split())
    return (
        f"memory ran out{f' ({said})' if said else ''}; coarsen the spacing, give less data or fewer threads, "
        "or raise what limits it (ulimit -v, a container, other programs)"
    )


def _end(line: str) -> NoReturn:
    sys.stderr.write(f"o3dleaf: error: {line}\n")
    sys.exit(2)
