"""A call in a process of its own: a library that crashes or hangs there becomes an error message here.

The child is a new interpreter, never a fork: Numba's and MeshLab's threads do not survive one. Arrays go
over and come back as .npy files in a folder of the call's own, which the child works in and which is gone
afterwards, whatever happened. Starting it takes about a second, most of it Open3D's import.
"""

import ctypes
import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core import errors
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.processes.light_imports import import_lightly

Arrays = tuple[npt.NDArray[Any], ...]

DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux's prctl: the signal that a process gets when the one that started it dies."""

TAIL = 300
"""Characters of the child's last line that an error repeats."""


class Outcome(NamedTuple):
    """What a function returned in a child process, and what was printed there."""

    arrays: Arrays
    output: str


def run_in_subprocess(
    function: Callable[..., Arrays],
    arrays: Iterable[npt.NDArray[Any]],
    options: dict[str, Any],
    *,
    name: str,
    cure: str,
    seconds: float,
) -> Outcome:
    """Return ``function(*arrays, **options)``, computed in a child process, and what that printed.

    Parameters
    ----------
    function : callable
        A function of a module, by whose name the child finds it; returns a tuple of arrays.
    arrays : iterable of ndarrays
        Each is written before the next one is asked for.
    options : dict
        What JSON can hold.
    name, cure : str
        For error messages: what runs, and what to try if it fails.
    seconds : float
        Time limit; then the child is killed.

    Raises
    ------
    O3DLeafError
        If the child runs too long, dies of a signal, or fails; what it raises of our own comes through.
    """
    with tempfile.TemporaryDirectory(prefix="o3dleaf-") as folder:
        home = Path(folder)
        call = {"module": function.__module__, "function": function.__qualname__, "options": options}
        _write(home, "argument", arrays)
        (home / "call.json").write_text(json.dumps(call), encoding="utf-8")
        code, output = _wait(home, name, cure, seconds)
        if (home / "error.json").exists():
            kind, message = json.loads((home / "error.json").read_text(encoding="utf-8"))
            raise getattr(errors, kind)(message)
        if code:
            raise O3DLeafError(f"{name}: {_reason(code)}{_last_line(output)}; {cure}")
        return Outcome(_read(home, "result"), output)


def _wait(home: Path, name: str, cure: str, seconds: float) -> tuple[int, str]:
    """Run the child and return its exit code and what it printed; it never outlives this call."""
    path = os.pathsep.join(map(os.path.abspath, sys.path))  # the child works elsewhere
    with subprocess.Popen(  # noqa: S603  the command is this interpreter and this file
        [sys.executable, "-m", __name__, str(home), str(os.getpid())],
        cwd=home,
        env=os.environ | {"PYTHONPATH": path, "PYTHONUTF8": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
        start_new_session=True,  # Ctrl-C reaches this process alone, which then kills the child; not on Windows
    ) as child:
        try:
            output, _ = child.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            raise O3DLeafError(f"{name}: did not end within {seconds:g} s and was stopped; {cure}") from None
        finally:
            child.kill()
            # Until nobody can write to it: in an environment on Windows the interpreter is a child of what was started.
            child.communicate()
        return child.returncode, output


def _reason(code: int) -> str:
    """Return the meaning of an exit code other than 0."""
    if code >= 0:
        return f"failed with exit code {code}"
    died = signal.Signals(-code).name
    return f"died of {died}" + (", perhaps for want of memory" if died == "SIGKILL" else "")


def _last_line(output: str) -> str:
    """Return the last line of a child's output, in brackets."""
    lines = output.strip().splitlines()
    return f" ({lines[-1].strip()[:TAIL]})" if lines else ""


def _write(home: Path, stem: str, arrays: Iterable[npt.NDArray[Any]]) -> None:
    """Write arrays as numbered files."""
    for n, array in enumerate(arrays):
        np.save(home / f"{stem}{n}.npy", array)


def _read(home: Path, stem: str) -> Arrays:
    """Return the arrays of `_write`."""
    return tuple(np.load(home / f"{stem}{n}.npy") for n in range(len(list(home.glob(f"{stem}*.npy")))))


def _serve(home: Path, parent: int) -> None:
    """Call, in the child, the function that the folder names."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
        if os.getppid() != parent:
            return
    elif sys.platform == "win32":
        # Ctrl-C reaches the child, too, and must end it: the parent cannot be interrupted while it waits.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    import_lightly()
    call = json.loads((home / "call.json").read_text(encoding="utf-8"))
    function = getattr(importlib.import_module(call["module"]), call["function"])
    try:
        _write(home, "result", function(*_read(home, "argument"), **call["options"]))
    except O3DLeafError as error:
        (home / "error.json").write_text(json.dumps([type(error).__name__, str(error)]), encoding="utf-8")


if __name__ == "__main__":
    _serve(Path(sys.argv[1]), int(sys.argv[2]))
