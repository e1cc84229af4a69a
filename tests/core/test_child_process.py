"""A library that crashes, hangs or fails in a child process is one line here, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.processes.child_process import run_in_subprocess

MISDEEDS = """
import ctypes, os, time
import numpy as np
from o3dleaf.core.errors import InputError

def double(array, other, times):
    print("doubled")
    return times * array, other

def crash(array):
    ctypes.string_at(0)

def hang(array):
    open(os.environ["MISDEEDS"], "w").write(str(os.getpid()))
    time.sleep(600)

def refuse(array):
    raise InputError("array: is wrong; give another")

def fail(array):
    raise RuntimeError("the filter said no")
"""
"""Functions that the child imports; not from this file, which pytest imports under no name."""


dies_of_a_signal = pytest.mark.skipif(sys.platform == "win32", reason="processes of Windows die of no signal")


@pytest.fixture
def misdeeds(tmp_path, monkeypatch):
    (tmp_path / "misdeeds.py").write_text(MISDEEDS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("MISDEEDS", str(tmp_path / "pid"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    import misdeeds

    yield misdeeds
    assert list((tmp_path / "temporary").iterdir()) == []
    del sys.modules["misdeeds"]


def call(function, *arrays, seconds=30.0, **options):
    given = arrays or (np.zeros(2),)
    return run_in_subprocess(function, given, options, name="the filter", cure="try another", seconds=seconds)


def test_arrays_go_over_and_come_back_with_what_was_printed(misdeeds):
    array, other = np.arange(6.0).reshape(2, 3), np.array([[1, 2]], dtype=np.uint8)
    (twice, same), output = call(misdeeds.double, array, other, times=2)
    assert output == "doubled\n"
    assert np.array_equal(twice, 2 * array)
    assert (same.dtype, same.tolist()) == (other.dtype, other.tolist())


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        pytest.param("crash", O3DLeafError, r"the filter: died of SIGSEGV.*; try another", marks=dies_of_a_signal),
        (
            "fail",
            O3DLeafError,
            r"the filter: failed with exit code 1 \(RuntimeError: the filter said no\); try",
        ),
        ("refuse", InputError, r"^array: is wrong; give another$"),
    ],
)
def test_what_goes_wrong_is_one_line(misdeeds, name, error, message):
    with pytest.raises(O3DLeafError, match=message) as caught:
        call(getattr(misdeeds, name))
    assert type(caught.value) is error
    assert "\n" not in str(caught.value)


def is_running(process: int) -> bool:
    """Return whether a process runs; a zombie, which waits for its parent to ask after it, does not."""
    try:
        if sys.platform == "linux":
            return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
        os.kill(process, 0)
    except (FileNotFoundError, ProcessLookupError):
        return False
    return True


def wait_for(condition):
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_hang_ends_at_the_limit(misdeeds, tmp_path):
    start = time.monotonic()
    with pytest.raises(O3DLeafError, match=r"the filter: did not end within 1 s and was stopped; try another"):
        call(misdeeds.hang, seconds=1.0)
    assert time.monotonic() - start < 10
    # On Windows os.kill asks nobody; that the folder it works in could be removed says as much (see the fixture).
    assert sys.platform == "win32" or not is_running(int((tmp_path / "pid").read_text()))


@pytest.mark.parametrize(
    "how",
    [
        pytest.param("SIGINT", marks=dies_of_a_signal),
        pytest.param(
            "SIGKILL",
            marks=pytest.mark.skipif(
                sys.platform != "linux", reason="Linux alone tells a process that the one that started it was killed"
            ),
        ),
    ],
)
def test_the_child_ends_with_its_parent(misdeeds, tmp_path, how):
    """Ctrl-C reaches the parent alone and leaves no folder; a parent that is killed takes its child along."""
    code = "import tempfile, sys; tempfile.tempdir = sys.argv[1]\n"
    code += "import numpy as np, misdeeds; from o3dleaf.core.processes.child_process import run_in_subprocess\n"
    code += "run_in_subprocess(misdeeds.hang, (np.zeros(1),), {}, name='it', cure='no', seconds=60)"
    path = os.pathsep.join(each or str(Path.cwd()) for each in sys.path)
    place = tmp_path / "temporary" if how == "SIGINT" else tmp_path
    with subprocess.Popen([sys.executable, "-c", code, place], env=os.environ | {"PYTHONPATH": path}) as parent:
        wait_for(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text())
        child = int((tmp_path / "pid").read_text())
        parent.send_signal(signal.Signals[how])
        parent.wait()
    wait_for(lambda: not is_running(child))
