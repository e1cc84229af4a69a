"""The job itself: what it refuses, what it reads and writes, and what it says."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from o3dleaf.core.arguments.allowed import require
from o3dleaf.core.arguments.annotations import rules_of
from o3dleaf.core.atomic_files import require_apart, require_writable
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.option import Names, option, options_of, spelled, table
from o3dleaf.core.jobs.shared import ClusterOptions, ResumeOption

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need


@dataclass(frozen=True, kw_only=True)
class Job(ABC):
    """The request of a command; its docstring and its fields are the command's help."""

    HEADING: ClassVar = "Resources"

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

    HEADING: ClassVar = "Resources"

    threads: int | None = option(None, "Threads; all cores by default. Results do not depend on it.")
    quiet: bool = option(False, "Show neither progress nor notes; those of `leaf` are in its summary.", "--quiet", "-q")

    def lines(self, summary: Any) -> list[str]:
        """Return the lines that the terminal shows at the end; none if quiet."""
        return [] if self.quiet else super().lines(summary)


def _each(value: Any) -> Iterable[Any]:
    """Return what an option holds: nothing, one value, or several."""
    if value is None:
        return ()
    return value if isinstance(value, list | tuple) else (value,)
