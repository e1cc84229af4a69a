"""Files appear whole or not at all: written under another name and renamed, or refused where they were cut off."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from o3dleaf.errors import InputError, O3DLeafError

PLY_HEADER = 65536
"""Bytes in which the header of a PLY file must end."""


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary name beside `path`, with its suffix; what was written there takes the name at the end.

    A failure or an interruption leaves nothing behind, and an old file of the name survives it.

    Raises
    ------
    InputError
        If the folder is not there or cannot be written to.
    O3DLeafError
        If writing fails, for example because the disk is full.
    """
    target = Path(path)
    temporary = _beside(target)
    try:
        yield temporary
        temporary.replace(target)
    except OSError as cause:
        raise O3DLeafError(
            f"{target}: could not be written ({cause.strerror}); free space or choose another"
        ) from cause
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(path: str | PathLike[str], suffixes: tuple[str, ...]) -> Path:
    """Return `path` if a file of that name could be written, else raise `InputError`: before the work, not after it."""
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise InputError(f"{target}: unknown suffix {target.suffix!r}; choose one of {', '.join(suffixes)}")
    _beside(target).unlink()
    return target


def require_whole_ply(path: Path) -> None:
    """Refuse a PLY file whose header claims more points than its bytes can hold: a reader would allocate them all.

    Raises
    ------
    InputError
        If the file is no PLY, names no points, or was cut off.
    """
    with path.open("rb") as stream:
        head = stream.read(PLY_HEADER)
    if not head.startswith(b"ply"):
        raise InputError(f"{path}: does not begin with 'ply'; it is no PLY file, export it again")
    for line in head[: max(head.find(b"end_header"), 0)].splitlines():
        words = line.split()
        if words[:2] == [b"element", b"vertex"] and len(words) == 3 and words[2].isdigit():
            # Three coordinates take six bytes at the very least, as text ("0 0 0\n") and as binary.
            if int(words[2]) * 6 > path.stat().st_size:
                raise InputError(f"{path}: claims {int(words[2])} points but is too short for them; it was cut off")
            return
    raise InputError(f"{path}: its PLY header names no points; export it again")


def _beside(target: Path) -> Path:
    """Return a new empty file in the folder of `target`, or raise `InputError`."""
    if target.is_dir():
        raise InputError(f"{target}: is a folder; give the name of a file")
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}.", suffix=target.suffix.lower(), dir=target.parent)
    except OSError as cause:
        raise InputError(f"{target}: the folder cannot be written to ({cause.strerror}); choose another") from cause
    os.close(handle)
    # mkstemp makes files private; the result gets the permissions that any new file would.
    mask = os.umask(0)
    os.umask(mask)
    Path(name).chmod(0o666 & ~mask)
    return Path(name)
