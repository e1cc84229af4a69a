"""Files: those that can be read."""

import os
import stat
from os import PathLike
from pathlib import Path

from o3dleaf.core.atomic_files import shown
from o3dleaf.core.errors import InputError


def is_folder(path: str | PathLike[str]) -> bool:
    """Return whether a path is a folder; a name that none can have is not, where `Path.is_dir` raises."""
    return os.path.isdir(path)  # noqa: PTH112


def is_file(path: str | PathLike[str]) -> bool:
    """Return whether a path is a regular file; a name that none can have is not, where `Path.is_file` raises."""
    return os.path.isfile(path)  # noqa: PTH113


def require_file(path: str | PathLike[str]) -> Path:
    """Return `path` as a `Path` if it is a file that holds something, else raise `InputError`."""
    file = Path(path)
    try:
        state = file.stat()
    except (OSError, ValueError) as cause:
        raise InputError(
            f"{shown(file)}: no such file ({getattr(cause, 'strerror', cause)}); check the path"
        ) from cause
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"{shown(file)}: is a folder, a pipe or a device, no such file as can be read; check the path")
    if state.st_size == 0:
        raise InputError(f"{shown(file)}: the file is empty; export it again")
    if not os.access(file, os.R_OK):
        raise InputError(f"{shown(file)}: may not be read by you; ask its owner, or copy it")
    return file
