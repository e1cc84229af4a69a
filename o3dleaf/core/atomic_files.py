"""Files appear whole or not at all: written under another name and renamed, refused before the work if they cannot."""

import errno
import json
import os
import platform
import re
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any
from uuid import uuid4

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
def whole_file(path: str | PathLike[str], size: float = 0) -> Iterator[Path]:
    """Yield a temporary name beside `path`, with its suffix; what was written there takes the name at the end.

    A failure or an interruption leaves nothing behind, and an old file of the name survives it. A symbolic link stays
    one: what it leads to is replaced, or made, as by any program that opens the link and writes. Room for `size` bytes,
    where they are known, is asked for before the first is written (`claim` asks for what is known later).

    Raises
    ------
    InputError
        If the folder is not there or cannot be written to, or the name is taken by what is no regular file: a folder, a
        device, a pipe or a socket would be replaced.
    O3DLeafError
        If writing fails, for example because the disk is full.
    """
    target = Path(path)
    with _beside(target) as temporary:
        try:
            if size:
                require_free(target, size)
            yield temporary
            temporary.replace(target.resolve())
        except OSError as cause:
            raise O3DLeafError(
                f"{shown(target)}: could not be written ({cause.strerror}); free space or choose another"
            ) from cause


@contextmanager
def whole_folder(path: str | PathLike[str], mark: str, results: str) -> Iterator[Path]:
    """Yield a new folder beside `path` that takes its name at the end; a failure leaves nothing behind.

    One of that name gives way if `require_replaceable` says that it may.
    """
    target = require_replaceable(path, mark, results)
    temporary = target.parent / _own_name(target)
    try:
        temporary.mkdir()
        yield temporary
        if target.exists():
            old = target.parent / _own_name(target)
            target.rename(old)
            temporary.rename(target)
            shutil.rmtree(old)
        else:
            temporary.rename(target)
    except OSError as cause:
        raise O3DLeafError(
            f"{shown(target)}: could not be written ({cause.strerror}); free space or choose another"
        ) from cause
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def require_replaceable(path: str | PathLike[str], mark: str, results: str) -> Path:
    """Return `path` if a folder of that name could be written, else raise `InputError`: before the work, not after it.

    One that is there is replaced if it is empty, or holds a file `mark`, which says that it is ours, and nothing that
    the pattern `results` matches: what took hours is not written over.
    """
    target = _resolved(Path(path))
    if target.exists() and not target.is_dir():
        raise InputError(f"{shown(target)}: is a file, and a folder is written; give the name of a new folder")
    if target.is_dir() and any(target.iterdir()):
        if not (target / mark).is_file():
            raise InputError(f"{shown(target)}: exists already and is not empty; give the name of a new folder")
        if next(target.glob(results), None) is not None:
            raise InputError(f"{shown(target)}: holds results, which are not written over; give another, or remove it")
    _require_folder_of(target.parent / f"{target.name}.new")
    _remove_abandoned(target.parent)
    return target


def require_writable(path: str | PathLike[str], suffixes: tuple[str, ...] = ()) -> Path:
    """Return `path` if a file of that name could be written, else raise `InputError`: before the work, not after it.

    The suffix is one of `suffixes`, if there are any.
    """
    target = Path(path)
    if suffixes and target.suffix.lower() not in suffixes:
        raise InputError(f"{shown(target)}: unknown suffix {target.suffix!r}; choose one of {', '.join(suffixes)}")
    _require_folder_of(target)
    _remove_abandoned(_resolved(target).parent)
    return target


def make_folder(folder: str | PathLike[str]) -> Path:
    """Return the folder, made if it was not there; raise `InputError` where it cannot be made or written to."""
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as cause:
        raise InputError(f"{shown(target)}: the folder cannot be created ({_why(cause)}); choose another") from cause
    _require_folder_of(target / "new")
    return target


def require_free(path: str | PathLike[str], size: float) -> None:
    """Raise `O3DLeafError` if the disk of `path` has less than `size` bytes left: before the work, not after it."""
    free = shutil.disk_usage(_resolved(Path(path)).parent).free
    if free < size:
        raise O3DLeafError(
            f"{shown(Path(path))}: needs {size / 1e9:.3g} GB of disk, {free / 1e9:.3g} GB are free; "
            "free some, choose another disk, or coarsen the spacing"
        )


def claim(out: IO[bytes], size: int) -> None:
    """Raise `OSError`, to which `whole_file` gives the name, if the disk has no room for an open file of this size."""
    there = out.seek(0, os.SEEK_END)
    out.seek(0)
    place = getattr(out, "name", None)  # a descriptor, if it has no name; None in memory
    free = size if place is None else shutil.disk_usage(place).free
    if size - there > free:
        raise OSError(errno.ENOSPC, f"it takes {size / 1e9:.3g} GB, {free / 1e9:.3g} GB are free")


def require_apart(outputs: Iterable[Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise `InputError` if a file to be written (None: none) is one of those that are read, or written twice."""
    read, written = {_resolved(path) for path in inputs if path is not None}, set[Path]()
    for path in outputs:
        if path is None:
            continue
        target = _resolved(path)
        if target in read:
            raise InputError(f"{shown(path)}: is an input and is not overwritten; choose another name for the output")
        if target in written:
            raise InputError(f"{shown(path)}: would be written twice; give every output a name of its own")
        written.add(target)


def write_json(content: dict[str, Any], path: str | PathLike[str]) -> None:
    """Write `content` as JSON, whole or not at all; arrays become lists, and what JSON does not know its text."""
    write_text(json.dumps(content, indent=2, ensure_ascii=False, default=_plain) + "\n", path)


def write_text(text: str, path: str | PathLike[str]) -> None:
    """Write a text as it is, whole or not at all."""
    content = text.encode()
    with whole_file(path, len(content)) as temporary:
        temporary.write_bytes(content)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _require_folder_of(target: Path) -> None:
    """Raise `InputError` if no file can be made in the folder of what `target` is or leads to."""
    with _beside(target):
        pass


@contextmanager
def _beside(target: Path) -> Iterator[Path]:
    """Yield a new empty file in the folder of what `target` is or leads to, gone at the end, or raise `InputError`."""
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG | 0o666
    except (OSError, ValueError) as cause:
        raise InputError(f"{shown(target)}: cannot be written ({_why(cause)}); choose another name") from cause
    # A rename replaces whatever has the name, /dev/null and read-only files too, and root may do anything: the mode
    # says what the owner meant.
    if not stat.S_ISREG(mode):
        kind = next(word for test, word in KINDS if test(mode))
        raise InputError(f"{shown(target)}: is a {kind}, and only a file can be written; give the name of a file")
    if not mode & 0o222:
        raise InputError(f"{shown(target)}: exists already and is read-only; choose another name")
    temporary = _resolved(target).parent / _own_name(target)
    try:
        _create(temporary, target)
        yield temporary
    finally:
        with suppress(FileNotFoundError, NotADirectoryError, PermissionError):  # it could not be made, or was renamed
            temporary.unlink()


def _create(temporary: Path, target: Path) -> None:
    """Make an empty file, or raise `InputError` that names `target`."""
    try:
        # With the permissions of any new file: tempfile's are private, and to ask for the mask is to change it.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as cause:
        raise InputError(
            f"{shown(target)}: the folder cannot be written to ({cause.strerror}); choose another"
        ) from cause


def _own_name(target: Path) -> str:
    """Return a new name for what is to be called otherwise in the end, which says whose it is."""
    prefix = f".{target.stem[:MAX_STEM]}.{OWNER.format(node=_node(), process=os.getpid())}."
    return f"{prefix}{uuid4().hex}{target.suffix.lower()}"


def shown(path: Path) -> str:
    """Return a path as a message may show it, in one line."""
    text = str(path)
    return text if text.isprintable() else repr(text)


def _resolved(path: Path) -> Path:
    """Return where a path leads, or raise `InputError` where it leads in a circle or is no name."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError) as cause:
        raise InputError(f"{shown(path)}: is no place for a file ({_why(cause)}); choose another name") from cause


def _why(cause: Exception) -> str:
    """Return the reason of an error, without the name that it has as well."""
    return (cause.strerror if isinstance(cause, OSError) else None) or str(cause)


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
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path)
                else:
                    Path(entry.path).unlink()


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's
        return True
    return True
