"""Words of a command line into the job that they ask for."""

import inspect
from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.job import Job
from o3dleaf.core.jobs.option import Option, options_of

J = TypeVar("J", bound=Job)
HELP = {"help_option_names": ["--help", "-h"]}
"""Of every command."""


def command_of(job: type[J], do: Callable[[J], None]) -> Callable[..., None]:
    """Return the function that typer makes a command of: its parameters are the job's fields, and it does the job."""

    def command(**given: Any) -> None:
        do(job_of(job, given))

    command.__signature__ = inspect.Signature(parameters(job))  # type: ignore[attr-defined]
    return command


def job_from(job: type[J], words: Sequence[str]) -> J:
    """Return the job that words ask for; what typer raises for words that are no command line comes through.

    Raises
    ------
    InputError
        If the words ask for the help.
    """
    made: list[J] = []
    program = typer.Typer(add_completion=False)
    program.command(context_settings=HELP)(command_of(job, made.append))
    typer.main.get_command(program).main(list(words), prog_name="", standalone_mode=False)
    if not made:
        raise InputError("--help: is for a person; leave it out")
    return made[0]


def parameters(job: type[Job]) -> list[inspect.Parameter]:
    """Return the options of a job as typer's."""
    types = get_type_hints(job)
    return [_parameter(name, field, known, types[name]) for name, (field, known) in options_of(job).items()]


def _parameter(name: str, field: Field[Any], known: Option, annotated: Any) -> inspect.Parameter:
    kind: Any = known.kind or annotated
    default: Any = None if field.default == () else field.default
    if default is MISSING:
        default = inspect.Parameter.empty
    elif default is None:
        kind |= None
    info = (
        typer.Argument(help=known.text)
        if known.positional
        else typer.Option(*known.flags, help=known.text, rich_help_panel=known.heading)
    )
    annotation = Annotated[kind, info]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def job_of(job: type[J], given: dict[str, Any]) -> J:
    """Return the job of a command line; what it leaves out keeps its default."""
    known = {name: option for name, (_, option) in options_of(job).items()}
    named = {name: value for name, value in given.items() if value is not None and value != []}
    return job(**{name: (known[name].parse or _as_it_is)(value) for name, value in named.items()})


def _as_it_is(value: Any) -> Any:
    return value
