"""Files appear whole or not at all: written under another name and renamed, or refused where they were cut off."""

import os
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from o3dleaf.core.errors import InputError, O3DLeafError

PLY_HEADER = 65536
"""Bytes in which the header of a PLY file must end."""

PLY_BYTES = dict.fromkeys(("char", "uchar", "int8", "uint8", "list"), 1)
PLY_BYTES |= dict.fromkeys(("short", "ushort", "int16", "uint16"), 2)
PLY_BYTES |= dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4)
PLY_BYTES |= dict.fromkeys(("double", "float64"), 8)
"""Bytes of each type that a vertex can have in a PLY file."""

KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (lambda _: True, "device"),
)
"""What a path may be but a file."""


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
    """Raise `InputError` if a file to be written (None: none) is one of those that are read."""
    read = {path.resolve() for path in inputs if path is not None}
    for path in outputs:
        if path is not None and path.resolve() in read:
            raise InputError(f"{path}: is read, so it is not written over; choose another name for the output")


def require_whole_ply(path: Path) -> None:
    """Refuse a PLY file that is shorter than its header claims: a reader would allocate it all and leave the rest wild.

    Raises
    ------
    InputError
        If the file is no PLY, names no points, or was cut off.
    """
    with path.open("rb") as stream:
        head = stream.read(PLY_HEADER)
        end = head.find(b"end_header")
        if not head.startswith(b"ply") or end < 0:
            raise InputError(f"{path}: is no PLY file, it does not begin with 'ply' and a header; export it again")
        header = [line.split() for line in head[:end].decode("ascii", "replace").splitlines()]
        count = next((int(w[2]) for w in header if w[:2] == ["element", "vertex"] and w[-1].isdigit()), None)
        if count is None:
            raise InputError(f"{path}: its PLY header names no points; export it again")
        start = head.find(b"\n", end) + 1
        if ["format", "ascii", "1.0"] in header:
            stream.seek(start)
            count_in_file = sum(block.count(b"\n") for block in iter(lambda: stream.read(1 << 20), b"")) + 1
        else:
            size = _vertex_bytes(header)
            count_in_file = (path.stat().st_size - start) // size if size else count
    if count_in_file < count:
        raise InputError(f"{path}: claims {count} points but is too short for them; it was cut off")


def _vertex_bytes(header: list[list[str]]) -> int:
    """Return the bytes of a vertex in a binary PLY."""
    size, inside = 0, False
    for words in header:
        if words[:1] == ["element"]:
            inside = words[1] == "vertex"
        elif inside and words[:1] == ["property"]:
            size += PLY_BYTES.get(words[1], 1)
    return size


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
        raise InputError(f"{target}: is there already and read-only; choose another name")
    folder = target.resolve().parent
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=target.suffix.lower(), dir=folder)
    except OSError as cause:
        raise InputError(f"{target}: the folder cannot be written to ({cause.strerror}); choose another") from cause
    os.close(handle)
    # mkstemp makes files private; the result gets the permissions that any new file would.
    mask = os.umask(0)
    os.umask(mask)
    Path(name).chmod(0o666 & ~mask)
    return Path(name)
