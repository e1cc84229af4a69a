"""Finished parts of a result, kept in a folder beside its name until it is whole, and known by context.

::

    with resuming(output, key, load):
        ...  # what is `kept` inside (`blocks`) is made once, by this run or by one that was stopped

A folder belongs to one key: a digest of what was read, of the options and of the version. That of another key is
emptied. It survives the end of a process, not that of the machine: nothing waits for the disk.
"""

import hashlib
import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

from o3dleaf.core import journal
from o3dleaf.core.atomic_files import make_folder, write_json

SUFFIX = ".o3dleaf-part"
STATE = "state.json"
CHUNK = 1 << 20
"""Bytes of a file that are read at once."""


@dataclass(frozen=True)
class Parts:
    """The finished parts of a result.

    Attributes
    ----------
    folder : Path
    load : callable
        ``load(path)`` returns what `save` wrote.
    state : dict
        What was recorded of them, by name.
    steps : Counter of str
        How often this run has begun steps of each name.
    """

    folder: Path
    load: Callable[[Path], Any]
    state: dict[str, Any] = field(default_factory=dict)
    steps: Counter[str] = field(default_factory=Counter)

    def path(self, name: str) -> Path:
        """Return the path of a part, there or not."""
        return self.folder / name

    def record(self, name: str, value: Any) -> None:
        """Keep what is finished of a part, whole or not at all."""
        self.state[name] = value
        write_json(self.state, self.folder / STATE)


_left: list[Path] = []
_parts: ContextVar[Parts | None] = ContextVar("o3dleaf.parts", default=None)


def current_parts() -> Parts | None:
    """Return the parts of the work that is running, None where it is not to be resumed."""
    return _parts.get()


@contextmanager
def resuming(path: str | PathLike[str], key: str, load: Callable[[Path], Any]) -> Iterator[Parts]:
    """Keep finished parts of the result `path` beside it, and take those that a run of the same `key` left.

    At the end they go; after an error, an interrupt or a kill they stay.
    """
    target = Path(path)
    parts = Parts(target.with_name(target.name + SUFFIX), load)
    known = _read(parts.path(STATE))
    if known.get("key") == key:
        parts.state.update(known)
        journal.note(f"goes on from {parts.folder.name}")
    elif parts.folder.exists():
        shutil.rmtree(parts.folder)
        journal.note(f"{parts.folder.name} was of other input, options or version: begins anew")
    make_folder(parts.folder)
    parts.record("key", key)
    token = _parts.set(parts)
    _left.append(parts.folder)
    try:
        yield parts
    finally:
        _parts.reset(token)
    shutil.rmtree(parts.folder, ignore_errors=True)
    _left.remove(parts.folder)


def left_behind() -> list[str]:
    """Return the folders of parts of work that did not come to its end in this process."""
    return [str(folder) for folder in _left if folder.is_dir()]


def key_of(inputs: Iterable[Path], options: dict[str, Any]) -> str:
    """Return a digest of the contents of files (of folders: of the files in them), of options and of our version."""
    digest = hashlib.sha256(json.dumps([version("o3dleaf"), options], default=str, sort_keys=True).encode())
    for path in inputs:
        files = sorted(each for each in path.rglob("*") if each.is_file()) if path.is_dir() else [path]
        for each in files:
            digest.update(f"{each.relative_to(path.parent)} {each.stat().st_size} ".encode())
            with each.open("rb") as stream:
                while chunk := stream.read(CHUNK):
                    digest.update(chunk)
    return digest.hexdigest()


def _read(path: Path) -> dict[str, Any]:
    """Return the state in a file; none where there is no such file, or it cannot be read."""
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return state if isinstance(state, dict) else {}
