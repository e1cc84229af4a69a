"""What every test runs under: NumPy's errors raised, hypothesis repeatable, real scans found or skipped."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from hypothesis import settings

REAL_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

# Examples follow from the test's source alone, so a failure here is a failure everywhere; and no
# deadline, because the first call of a compiled function compiles it.
settings.register_profile("repeatable", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True)
def _numpy_errors_raise() -> Iterator[None]:
    """Raise on division by zero, overflow and invalid operations.

    Underflow stays silent: a weight or a kernel that fades to zero is meant to get there.
    """
    with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
        yield


@pytest.fixture(scope="session")
def real_scan() -> Callable[[str], Path]:
    """Return a function that gives the path of a real scan, or skips the test that asks for it."""

    def find(name: str) -> Path:
        path = REAL_DATA / name
        if not path.is_file():
            pytest.skip(f"the real scan {name} is not in ../shared/data (made by others, kept outside the project)")
        return path

    return find


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., CompletedProcess[str]]:
    """Return a function that calls the command line, in this process: a process each would import all of it anew.

    What C++ prints is captured too. An exception that the program does not turn into a line leaves it as it is.
    """
    from o3dleaf.cli import main

    def call(*arguments: object) -> CompletedProcess[str]:
        words = ["o3dleaf", *map(str, arguments)]
        monkeypatch.setattr(sys, "argv", words)
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        code = stop.value.code
        return CompletedProcess(words, 0 if code is None else code, *capfd.readouterr())

    return call
