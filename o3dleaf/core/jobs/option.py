"""Options: fields of a job, with what the command line says of them."""

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from functools import cache
from inspect import get_annotations
from pkgutil import resolve_name
from types import MappingProxyType
from typing import Any

REQUIRED = ...
"""Default of an option that must be given."""

Names = str | tuple[str, ...]
"""Some names, or where a table of them stands, ``module:NAME``."""


@dataclass(frozen=True)
class Option:
    """Command-line attributes of a field: help, flags, choices, files.

    Attributes
    ----------
    text : str
        The help.
    flags : tuple of str
        Such as ("--output", "-o"), where they are not the field's own name.
    positional : bool
    kind : type, optional
        Type on the command line, where it is not the field's.
    parse : callable, optional
        ``parse(given)`` makes the field's value of that.
    choices : tuple of str or "module:NAME", optional
        The words that there are.
    reads : bool
        Whether it names a file, or files, to be read.
    writes : tuple of str or "module:NAME", optional
        Whether it names a file to be written, and the suffixes that it may have; an empty tuple allows any.
    needs : tuple of str
        Options, options with a value ("consumer=sph"), or properties of the job, without any of which it cannot act;
        those that the job has not do not count.
    unless : tuple of str
        Options, or properties of the job, beside which it cannot act.
    heading : str, optional
        Under which the help shows it: `HEADING` of the class that declares it, where that has one.
    """

    text: str
    flags: tuple[str, ...] = ()
    positional: bool = False
    kind: Any = None
    parse: Callable[[Any], Any] | None = None
    choices: Names = ()
    reads: bool = False
    writes: Names | None = None
    needs: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    heading: str | None = None


def option(default: Any, text: str, *flags: str, unit: str | None = None, **more: Any) -> Any:
    """Return a field that is an option; `more` are attributes of `Option`, `unit` ends the help."""
    known = Option(f"{text}, in {unit}." if unit else text, flags, **more)
    metadata = {"option": known}
    return field(metadata=metadata) if default is REQUIRED else field(default=default, metadata=metadata)


def argument(text: str, *, default: Any = REQUIRED, **more: Any) -> Any:
    """Return a field that is an argument without a name."""
    return option(default, text, positional=True, **more)


def output(suffixes: Names) -> Any:
    """Return the field of the file that a job is about to write."""
    return option(REQUIRED, "File to write.", "--output", "-o", writes=suffixes)


@cache
def options_of(job: type) -> Mapping[str, tuple[Field[Any], Option]]:
    """Return the options of a job by name: its own first, those that jobs share last."""
    known = {each.name: each for each in fields(job) if "option" in each.metadata}
    options: dict[str, tuple[Field[Any], Option]] = {}
    for kind in job.__mro__:
        for name in filter(known.__contains__, get_annotations(kind)):
            one = replace(known[name].metadata["option"], heading=vars(kind).get("HEADING"))
            options.setdefault(name, (known[name], one))
    return MappingProxyType(options)


def table(names: Names) -> tuple[str, ...]:
    """Return names, read from where their table stands."""
    entries = resolve_name(names) if isinstance(names, str) else names
    return (entries,) if isinstance(entries, str) else tuple(entries)


def spelled(name: str, known: Option) -> str:
    """Return the name of an option as a user writes it, without its dashes."""
    return (known.flags[0] if known.flags else name).lstrip("-").replace("_", "-")
