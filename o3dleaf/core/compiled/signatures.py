"""The functions that Python calls in the main jobs and in the tests, and the types that it calls them with, as text.

Each line of `signatures.txt` is a function and the types of its arguments, as expressions of `numba.types`; those of
the demo come first, and what the tests alone call last. `scripts/list_compiled.py` writes it from what they call; a
test finds what is missing of the jobs, and what the tests call that is not listed is said when they end.
"""

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numba import types

LIST = Path(__file__).with_name("signatures.txt")

SECTIONS = {"demo": "# demo", "all": "# other jobs", "tests": "# tests"}
"""What can be asked for, each with all before it, and the line that stands above what it adds to them."""


def listed(jobs: str = "all") -> list[str]:
    """Return the lines of the "demo", of "all" jobs, or of these and the "tests"."""
    sections = re.split(r"^#.*\n", LIST.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return "".join(sections[: list(SECTIONS).index(jobs) + 1]).splitlines()


def called() -> Iterator[str]:
    """Yield a line for each function that Python has called in this process, and each set of types."""
    for module in sorted(name for name in sys.modules if name.startswith("o3dleaf.") and name.endswith("_loops")):
        for _, function in sorted(vars(sys.modules[module]).items()):
            if getattr(function, "__module__", None) == module:
                for signature in getattr(function, "overloads", ()):
                    yield written(function, signature)


def written(function: Any, signature: tuple[Any, ...]) -> str:
    """Return the line of a compiled function and types."""
    return f"{function.__module__}.{function.__name__} {', '.join(map(_expression, signature))}".rstrip()


def read(line: str) -> tuple[Any, tuple[Any, ...]]:
    """Return the compiled function and the types of a line."""
    name, _, arguments = line.partition(" ")
    module, _, function = name.rpartition(".")
    known = {**vars(types), "record": _record, "__builtins__": {"True": True}}
    signature = eval(f"({arguments},)" if arguments else "()", known)  # noqa: S307 - our own list
    return getattr(importlib.import_module(module), function), signature


def _expression(kind: Any) -> str:
    if isinstance(kind, types.BaseNamedTuple):
        parts = ", ".join(map(_expression, kind.types))
        return f"record('{kind.instance_class.__module__}', '{kind.instance_class.__qualname__}', {parts})"
    if isinstance(kind, types.UniTuple):
        return f"UniTuple({_expression(kind.dtype)}, {kind.count})"
    if isinstance(kind, types.BaseTuple):
        return f"Tuple(({', '.join(map(_expression, kind.types))},))"
    if isinstance(kind, types.Array):
        readonly = "" if kind.mutable else ", True"
        return f"Array({_expression(kind.dtype)}, {kind.ndim}, '{kind.layout}'{readonly})"
    if isinstance(kind, types.Omitted):
        return f"Omitted({kind.value!r})"
    return {"bool": "boolean"}.get(str(kind), str(kind))


def _record(module: str, name: str, *parts: Any) -> Any:
    """Return the type of a named tuple of these parts."""
    fields = getattr(importlib.import_module(module), name)
    if len(set(parts)) == 1:
        return types.NamedUniTuple(parts[0], len(parts), fields)
    return types.NamedTuple(parts, fields)
