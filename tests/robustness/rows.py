"""One row of the table: a call with one argument spoiled, and what came of it."""

import signal
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d

from o3dleaf.errors import O3DLeafError
from robustness.doors import DOORS, Door
from robustness.kinds import Kind, Options

SECONDS = 20
"""Of the processor: what takes longer hangs."""
WAITING = 15
"""Times that long a loaded machine may keep it waiting."""


DEEPEST = 7
"""How far down into an object its parts are looked at."""


@dataclass(frozen=True)
class Row:
    """A door, the argument that is spoiled, by what, and whether it must be refused, may be, or must be answered."""

    door: str
    argument: str
    change: str
    kind: str

    def __str__(self) -> str:
        return f"{self.door}({self.argument}: {self.change}) [{self.kind}]"


def rows_of(name: str) -> Iterator[Row]:
    """Return the rows of a door."""
    for argument, kind in DOORS[name].arguments.items():
        for which in ("bad", "odd", "same"):
            if which == "same" and not kind.given:
                continue
            for change in getattr(kind, which):
                yield Row(name, argument, change, which)


class HangError(BaseException):
    """The call took too long."""


@contextmanager
def limited(seconds: float = SECONDS) -> Iterator[None]:
    """Raise `HangError` inside after so long."""

    def stop(*_: Any) -> None:
        raise HangError

    clocks = {signal.ITIMER_PROF: (signal.SIGPROF, seconds), signal.ITIMER_REAL: (signal.SIGALRM, WAITING * seconds)}
    before = {number: signal.signal(number, stop) for number, _ in clocks.values()}
    for clock, (_, after) in clocks.items():
        signal.setitimer(clock, after)
    try:
        yield
    finally:
        for clock in clocks:
            signal.setitimer(clock, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def spoiled(kind: Kind, which: str, change: str, world: Any) -> Any:
    """Return the argument of a row; one that leaves what floats hold is infinite."""
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return getattr(kind, which)[change](kind.good(world))


def answer(door: Door, arguments: Mapping[str, Any], world: Any) -> Any:
    """Return what a call gives; options of an argument with two stars are handed over each by its name."""
    named: dict[str, Any] = {}
    for name, value in arguments.items():
        named |= value.named if isinstance(value, Options) else {name: value}
    return door.find(world)(**named)


def good_arguments(door: Door, world: Any, *, but: str | None = None) -> dict[str, Any]:
    """Return good values of all arguments that are given."""
    return {name: kind.good(world) for name, kind in door.arguments.items() if kind.given and name != but}


def outcome(row: Row, world: Any, good: Any = None) -> str:
    """Return what is wrong with the answer to a row, or nothing."""
    door = DOORS[row.door]
    given = good_arguments(door, world, but=row.argument)
    given[row.argument] = spoiled(door.arguments[row.argument], row.kind, row.change, world)
    before = [*parts(given)]
    try:
        with warnings.catch_warnings(), np.errstate(divide="raise", over="raise", invalid="raise"), limited():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            made = answer(door, given, world)
    except O3DLeafError as refused:
        return fault_of(refused, row)
    except HangError:
        return "HANG"
    except BaseException as cause:  # noqa: BLE001 - a row tells of all of them
        return f"TRACEBACK {type(cause).__name__}: {str(cause)[:150]}"
    return "CHANGED its arguments" if not alike(before, [*parts(given)]) else fault_in(made, row, good)


def fault_in(made: Any, row: Row, good: Any) -> str:
    """Return what is wrong with an answer, or nothing."""
    if row.kind == "bad":
        return f"TAKEN: {str(made)[:60]!r}"
    found = [*parts(made)]
    if not DOORS[row.door].lacks and any(
        isinstance(part, np.ndarray) and part.dtype.kind == "f" and np.isnan(part).any() for part in found
    ):
        return "NAN in the answer"
    return "ANOTHER answer" if row.kind == "same" and not alike(found, good) else ""


def fault_of(refused: O3DLeafError, row: Row) -> str:
    """Return what is wrong with a refusal, or nothing."""
    text = str(refused)
    if row.kind == "same":
        return f"REFUSED: {text[:150]}"
    if not text or "\n" in text or ";" not in text:
        return f"WORDS: {text[:150]!r}"
    return ""


def alike(some: list[Any], others: list[Any]) -> bool:
    """Return whether two lists of parts are equal, NaN with NaN."""
    return len(some) == len(others) and all(
        np.array_equal(a, b, equal_nan=a.dtype.kind == "f" and b.dtype.kind == "f")
        if isinstance(a, np.ndarray) and isinstance(b, np.ndarray)
        else type(a) is type(b) and (a is b or a == b)
        for a, b in zip(some, others, strict=True)
    )


def parts(thing: Any, depth: int = 0) -> Iterator[Any]:
    """Return copies of the arrays, numbers and words that an object consists of."""
    if isinstance(thing, np.ndarray | int | float | np.generic):
        yield np.array(thing)
    elif isinstance(thing, str | bytes | Path | None):
        yield thing
    elif depth < DEEPEST:
        for each in inside(thing):
            yield from parts(each, depth + 1)


def inside(thing: Any) -> Iterable[Any]:
    """Return what an object is made of."""
    if isinstance(thing, o3d.geometry.TriangleMesh):
        return [np.asarray(each) for each in (thing.vertices, thing.triangles, thing.vertex_colors)]
    if isinstance(thing, o3d.geometry.PointCloud):
        return [np.asarray(each) for each in (thing.points, thing.normals, thing.colors)]
    if isinstance(thing, o3d.t.geometry.TriangleMesh):
        return [tensor.numpy() for _, tensor in thing.vertex.items()]
    if is_dataclass(thing) and not isinstance(thing, type):
        return [getattr(thing, each.name) for each in fields(thing)]
    if isinstance(thing, Mapping):
        return thing.values()
    return thing if isinstance(thing, list | tuple) else ()
