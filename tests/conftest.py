"""What every test runs under: NumPy's errors raised, hypothesis repeatable, real scans found or skipped."""

from collections.abc import Callable, Iterator
from pathlib import Path

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
