"""Files appear whole or not at all: written under another name and renamed, refused before the work if they cannot."""

import json
import os
import platform
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import Any

from o3dleaf.core.errors import InputError, O3DLeafError

KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (lambda _: True, "device"),
)
"""What a path may be but a file."""

OWNER = "o3dleaf-{node}-{process}"
"""In the names of temporary files, whose they are: those of a process that was killed go with the next run."""
MAX_STEM = 80
"""Letters of a file's name that its temporary name has: the rest of it takes some hundred, and 255 is the most."""


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name beside `path`, with its suffix; what was written there takes the name at the end.

    A failure or an interruption leaves nothing behind, and an old file of the name survives it. A symbolic link stays
    one: what it leads to is replaced, or made, as by any program that opens the link and writes.

    Raises
    ------
    InputError
        If the folder is not there or cannot be written to, or the name is taken by what is no regular file: a folder, a
        device, a pipe or a socket would be replaced.
    O3DLeafError
        If writing fails, for example because the disk is full.
    """
    target = Path(path)
    temporary = _beside(target)
    try:
        yield temporary
        temporary.replace(target.resolve())
    except OSError as cause:
        raise O3DLeafError(
            f"{target}: could not be written ({cause.strerror}); free space or choose another"
        ) from cause
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | PathLike[str], suffixes: tuple[str, ...] = ()) -> Path:
    """Return `path` if a file of that name could be written, else raise `InputError`: before the work, not after it.

    The suffix is one of `suffixes`, if there are any.
    """
    target = Path(path)
    if suffixes and target.suffix.lower() not in suffixes:
        raise InputError(f"{target}: unknown suffix {target.suffix!r}; choose one of {', '.join(suffixes)}")
    _beside(target).unlink()
    _remove_abandoned(target.resolve().parent)
    return target


def make_folder(folder: str | PathLike[str]) -> Path:
    """Return the folder, made if it was not there, or raise `InputError`."""
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise InputError(f"{target}: the folder cannot be created ({cause.strerror}); choose another") from cause
    return target


def require_free(path: str | PathLike[str], size: int) -> None:
    """Raise `O3DLeafError` if the disk of `path` has less than `size` bytes left: before the work, not after it."""
    free = shutil.disk_usage(Path(path).resolve().parent).free
    if free < size:
        raise O3DLeafError(
            f"{path}: needs {size / 1e9:.3g} GB of disk, {free / 1e9:.3g} GB are free; "
            "free some, choose another disk, or coarsen the spacing"
        )


def require_apart(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise `InputError` if a file to be written (None: none) is one of those that are read, or written twice."""
    # os.path.realpath goes as far as a link does that leads to itself; Path.resolve raises.
    read, written = {os.path.realpath(path) for path in inputs if path is not None}, set[str]()
    for path in outputs:
        if path is None:
            continue
        target = os.path.realpath(path)
        if target in read:
            raise InputError(f"{path}: is an input and is not overwritten; choose another name for the output")
        if target in written:
            raise InputError(f"{path}: would be written twice; give every output a name of its own")
        written.add(target)


def write_json(content: dict[str, Any], path: str | PathLike[str]) -> None:
    """Write `content` as JSON, whole or not at all; arrays become lists, and what JSON does not know its text."""
    text = json.dumps(content, indent=2, ensure_ascii=False, default=_plain)
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8", newline="\n")


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _beside(target: Path) -> Path:
    """Return a new empty file in the folder of what `target` is or leads to, or raise `InputError`."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG | 0o666
    except OSError as cause:
        raise InputError(f"{target}: cannot be written ({cause.strerror}); choose another name") from cause
    # A rename replaces whatever has the name, /dev/null and read-only files too, and root may do anything: the mode
    # says what the owner meant.
    if not stat.S_ISREG(mode):
        kind = next(word for test, word in KINDS if test(mode))
        raise InputError(f"{target}: is a {kind}, and only a file can be written; give the name of a file")
    if not mode & 0o222:
        raise InputError(f"{target}: exists already and is read-only; choose another name")
    folder = target.resolve().parent
    try:
        prefix = f".{target.stem[:MAX_STEM]}.{OWNER.format(node=_node(), process=os.getpid())}."
        handle, name = tempfile.mkstemp(prefix=prefix, suffix=target.suffix.lower(), dir=folder)
    except OSError as cause:
        raise InputError(f"{target}: the folder cannot be written to ({cause.strerror}); choose another") from cause
    os.close(handle)
    # mkstemp makes files private; the result gets the permissions that any new file would.
    mask = os.umask(0)
    os.umask(mask)
    Path(name).chmod(0o666 & ~mask)
    return Path(name)


def _node() -> str:
    """Return the name of this machine, of letters that a file's name may have."""
    return re.sub(r"[^A-Za-z0-9]+", "", platform.node())[:MAX_STEM]


def _remove_abandoned(folder: Path) -> None:
    """Remove temporary files that processes of this machine have left, which are there no more."""
    if os.name != "posix":  # elsewhere there is no harmless way to ask for a process
        return
    known = re.compile(re.escape("." + OWNER.format(node=_node(), process="")) + r"(\d+)\.")
    for entry in os.scandir(folder):
        found = known.search(entry.name)
        if entry.name.startswith(".") and found and not _is_running(int(found[1])):
            with suppress(OSError):
                Path(entry.path).unlink()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's
        return True
    return True
