"""A job on files: a frozen dataclass whose fields are the options of its command.

::

    @dataclass(frozen=True)
    class PaintJob(LongJob):
        '''Paint a mesh.'''

        mesh: Path = argument("Mesh to paint.", reads=True)
        output: Path = output("o3dleaf.io.triangle_mesh:SUFFIXES")
        color: str = option("green", "Color of the paint.", choices=("green", "brown"))
        width: Positive | None = option(None, "Width of the brush; by default that of the mesh", unit="the mesh's unit")
        stripes: Path | None = option(None, "Where to paint them.", reads=True)
        angle: Finite = option(0.0, "Of the stripes", unit="degrees", needs=("stripes",))

        def work(self) -> int: ...

The line of a field is all that there is to an option: `o3dleaf.commands.cli` makes the command line of it, `Job.check`
refuses what it does not allow, what its annotation does not, and what cannot act as the others are; nothing hands it on
by name. `Job.estimate` says what it will need of memory, from its options and the heads of its files; more than there
is is refused before the work too. Nothing heavy is imported here, nor in a module that declares a job: ``o3dleaf
--help`` imports them all. Tables of suffixes and choices are named as ``module:NAME``.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import Field, dataclass, field, fields
from inspect import getdoc
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from o3dleaf.core.arguments.allowed import require
from o3dleaf.core.arguments.annotations import rules_of
from o3dleaf.core.arguments.kinds import Count, Unit
from o3dleaf.core.atomic_files import require_apart, require_writable
from o3dleaf.core.checks import require_choice
from o3dleaf.core.errors import InputError

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need

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


def options_of(job: type) -> dict[str, tuple[Field[Any], Option]]:
    """Return the options of a job by name: its own first, those that jobs share last."""
    known = {each.name: each for each in fields(job)}
    names = [name for kind in job.__mro__ for name in vars(kind).get("__annotations__", ())]
    return {
        name: (known[name], known[name].metadata["option"])
        for name in names
        if name in known and "option" in known[name].metadata
    }


def table(names: Names) -> tuple[str, ...]:
    """Return names, read from where their table stands."""
    entries = resolve_name(names) if isinstance(names, str) else names
    return (entries,) if isinstance(entries, str) else tuple(entries)


@dataclass(frozen=True, kw_only=True)
class Job(ABC):
    """The request of a command; its docstring and its fields are the command's help."""

    memory: str | None = option(
        None, "Memory to hold at most, such as 2GB (what the machine has, by default); more is refused before the work."
    )
    time: str | None = option(
        None, "Time that it may be predicted to take, such as 10min (any, by default); more is refused before the work."
    )
    only_estimate: bool = option(
        False, "Say how much memory it will need, and how long it will take, and do nothing.", "--estimate"
    )

    @abstractmethod
    def work(self) -> Any:
        """Do it, and return a summary of what was done."""

    def run(self) -> Any:
        """Refuse what cannot be done, or needs more than is allowed; then work, and return the summary."""
        from o3dleaf.core.resources.budget import memory_limit, time_limit  # noqa: PLC0415 - the help does without

        with memory_limit(self.memory), time_limit(self.time):
            self.check()
            for need in self.estimate():
                need.require()
            return self.work()

    def estimate(self) -> "list[Need]":
        """Return what the work will need, as far as options and the heads of files tell; a job says what it knows."""
        return []

    def check(self) -> None:
        """Raise `InputError`, before any work, for what would fail after it; a job adds what it knows."""
        written = self.outputs()
        require_apart((path for path, _ in written), self.inputs())
        for path, suffixes in written:
            require_writable(path, table(suffixes))
        rules = rules_of(type(self).__init__)
        for name, (_, known) in options_of(type(self)).items():
            if name in rules:
                require(getattr(self, name), spelled(name, known), rules[name])
            for value in _each(getattr(self, name)):
                if known.choices:
                    require_choice(value, table(known.choices), spelled(name, known))
        self.check_acting()

    def check_acting(self) -> None:
        """Raise `InputError` for an option that was given and cannot act, as the others are."""
        for name, (_, one) in options_of(type(self)).items():
            needed = [other for other in one.needs if hasattr(self, other.partition("=")[0])]
            if not self.has(name):
                continue
            if needed and not any(map(self.has, needed)):
                raise InputError(f"{spelled(name, one)}: acts only {' or '.join(map(self.when, needed))}; leave it out")
            for other in filter(self.has, one.unless):
                raise InputError(f"{spelled(name, one)}: cannot act {self.when(other)}; leave one of them out")

    def when(self, name: str) -> str:
        """Return the words for an option that is given, or for a property that is true: its docstring has them."""
        name, _, value = name.partition("=")
        known = options_of(type(self)).get(name)
        if known is not None:
            written = spelled(name, known[1])
            return f"where {written} is {value!r}" if value else f"with {written}"
        return f"where {(getdoc(getattr(type(self), name)) or name).removeprefix('Whether ').rstrip('.')}"

    def has(self, name: str) -> bool:
        """Return whether an option is not at its default, or has a value ("name=value"), or a property is true."""
        name, _, wanted = name.partition("=")
        value = getattr(self, name, None)
        if wanted:
            return bool(value == wanted)
        field, _ = options_of(type(self)).get(name, (None, None))
        return bool(value) if field is None else value != field.default

    @property
    def settings(self) -> dict[str, Any]:
        """Every option that the result depends on: all but the threads, workers, memory, the display and resuming."""
        left_out = {name for kind in (LongJob, ResumeOption, ClusterOptions) for name in options_of(kind)}
        return {name: getattr(self, name) for name in options_of(type(self)) if name not in left_out}

    def inputs(self) -> list[Path]:
        """Return the files that are read."""
        known = options_of(type(self))
        return [path for name, (_, one) in known.items() if one.reads for path in _each(getattr(self, name))]

    def outputs(self) -> list[tuple[Path, Names]]:
        """Return the files that are written, each with the suffixes that it may have."""
        known = options_of(type(self))
        written = [(name, one.writes) for name, (_, one) in known.items() if one.writes is not None]
        return [(path, suffixes) for name, suffixes in written for path in _each(getattr(self, name))]

    def line(self, summary: Any) -> str:
        """Return what the terminal says at the end; nothing by default."""
        del summary
        return ""

    def lines(self, summary: Any) -> list[str]:
        """Return the lines that the terminal shows at the end."""
        line = self.line(summary)
        return [line] if line else []

    def exit_code(self, summary: Any) -> int:
        """Return the exit code of the command: 0."""
        del summary
        return 0


@dataclass(frozen=True, kw_only=True)
class LongJob(Job):
    """A job that takes a while: on several threads, with its progress shown."""

    threads: int | None = option(None, "Threads; all cores by default. Results do not depend on it.")
    quiet: bool = option(False, "Show no progress.", "--quiet", "-q")

    def lines(self, summary: Any) -> list[str]:
        """Return the lines that the terminal shows at the end; none if quiet."""
        return [] if self.quiet else super().lines(summary)


@dataclass(frozen=True, kw_only=True)
class ResumeOption:
    """Whether a long job keeps what it has finished, and goes on from it."""

    resume: bool = option(
        False,
        "Keep finished parts beside the output, and go on from those of a run that was stopped: the result is the same "
        "to the byte. Give it from the first run on.",
        "--resume",
    )


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """Whether a job is done by this process alone, or by the workers of a Dask cluster."""

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

    unit: Unit | None = option(None, "Unit of the coordinates: m, cm, mm, um or nm.", unless=("saved_model",))


@dataclass(frozen=True, kw_only=True)
class ColumnsOption:
    """The columns of a text file of points that does not name them, or names them otherwise."""

    columns: str | None = option(
        None, "Columns of points in text, such as 'x y z nx ny nz'; by default those that the file names, or x y z."
    )


@dataclass(frozen=True, kw_only=True)
class ScanOptions:
    """Midrib and unit of a scan."""

    midrib: Path | None = option(
        None, "Control points from base to tip; computed if not given.", reads=True, unless=("saved_leaf",)
    )
    scan_unit: Unit = option("mm", "Unit of scan and midrib: m, cm, mm, um or nm.", unless=("saved_leaf",))


def spelled(name: str, known: Option) -> str:
    """Return the name of an option as a user writes it, without its dashes."""
    return (known.flags[0] if known.flags else name).lstrip("-").replace("_", "-")


def number_or_word(text: str) -> float | str:
    """Return a number for a text that is one."""
    try:
        return float(text)
    except ValueError:
        return text


def words_of(text: str) -> list[str]:
    """Return the words of a text, between commas or blanks."""
    return text.replace(",", " ").split()


def place_of(text: str) -> tuple[float | str, ...]:
    """Return the coordinates in a text, between commas or blanks."""
    return tuple(number_or_word(word) for word in words_of(text))


def corners_of(numbers: tuple[float, ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the lower and the upper corner of a box whose numbers stand in a row."""
    half = len(numbers) // 2
    return numbers[:half], numbers[half:]


def windows_of(texts: list[str]) -> tuple[tuple[float, ...], ...]:
    """Return the five numbers of each text, or raise `InputError`."""
    rows = [(text, [number_or_word(word) for word in words_of(text)]) for text in texts]
    for text, row in rows:
        if len(row) != 5 or any(isinstance(each, str) for each in row):
            raise InputError(f"fine: is {text!r}; give five numbers, 'ALONG0 ACROSS0 ALONG1 ACROSS1 STEP'")
    return tuple(tuple(map(float, row)) for _, row in rows)


def _each(value: Any) -> Iterable[Any]:
    """Return what an option holds: nothing, one value, or several."""
    if value is None:
        return ()
    return value if isinstance(value, list | tuple) else (value,)
