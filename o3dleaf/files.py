"""Files appear whole or not at all: written under another name in the same folder, then renamed."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from o3dleaf.errors import InputError, O3DLeafError


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
