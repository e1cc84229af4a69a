"""What the machine does to a run: signals, a full disk, missing libraries; `scripts/fault_runs.py` has more moments."""

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from o3dleaf.core.atomic_files import make_folder, require_apart, require_writable
from o3dleaf.core.checks.files import require_file
from o3dleaf.core.errors import InputError, O3DLeafError

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
MODULE = [sys.executable, "-m", "o3dleaf"]
GUARDED = "import sys; sys.argv[0] = 'o3dleaf'; from o3dleaf.__main__ import main; {}; main()"
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals and limits of POSIX")


def program(before="pass"):
    """Return a program that does something before our guard, and all of it."""
    return [sys.executable, "-c", GUARDED.format(before)]


@pytest.mark.parametrize(
    ("line", "code", "said"), [(["--help"], 0, "reconstruct"), (["leaf", "none.ply", "-o", "leaf.ply"], 2, "none.ply")]
)
def test_a_job_that_is_done_or_refused_ends_at_once_and_leaves_nothing_undone(tmp_path, line, code, said):
    """What is to be done at the end is done, and what was printed arrives; then no library is taken down."""
    before = (
        "import atexit, pathlib; atexit.register(pathlib.Path('done').touch); "
        "kept = type('Kept', (), {'__del__': lambda self: pathlib.Path('taken_down').touch()})()"
    )
    result = subprocess.run(
        [*program(before), *line], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )  # fmt: skip
    assert result.returncode == code
    assert said in result.stdout + result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["done"]


WAITING = (
    "import o3dleaf.commands.cli as cli, time, pathlib; "
    "cli.main = lambda: (pathlib.Path('ready').touch(), [time.sleep(0.1) for _ in range(300)])"
)
"""A signal between two statements does not end a sleep that begins after it: many short ones."""


RESUMING = (
    "import o3dleaf.commands.cli as cli, time, pathlib, o3dleaf.core.resume.parts as parts\n"
    "def work():\n"
    "    with parts.resuming('out.ply', 'key', None):\n"
    "        pathlib.Path('ready').touch()\n"
    "        [time.sleep(0.1) for _ in range(300)]\n"
    "cli.main = work\n"
)


def test_what_is_kept_for_another_run_is_said(tmp_path):
    code = f"import sys; from o3dleaf.__main__ import main\n{RESUMING}main()"
    command = [sys.executable, "-c", code]
    run = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=environment())
    try:
        wait_for(tmp_path / "ready")
        run.send_signal(signal.SIGTERM)
        _, said = run.communicate(timeout=30)
    finally:
        run.kill()
    assert run.returncode == 128 + signal.SIGTERM
    kept = "what was finished is in out.ply.o3dleaf-part; the same command with --resume goes on from it"
    assert said == f"o3dleaf: terminated; {kept}\n"
    assert (tmp_path / "out.ply.o3dleaf-part").is_dir()


def test_the_program_listens_before_it_imports_what_takes_long():
    """Until then a signal is the interpreter's, which says it by a traceback or not at all."""
    code = "import sys; before = set(sys.modules); import o3dleaf.__main__; print(*set(sys.modules) - before)"
    run = subprocess.run(
        [sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, env=environment()
    )
    late = {"typing", "re", "ast", "lazy_loader", "contextlib", "numpy", "typer", "o3dleaf.core", "o3dleaf.commands"}
    assert not late & set(run.stdout.split())


@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_a_signal_ends_a_run_within_a_second_in_one_line(tmp_path, number, word):
    run = subprocess.Popen(program(WAITING), cwd=tmp_path, stderr=subprocess.PIPE, text=True, env=environment())
    try:
        wait_for(tmp_path / "ready")
        sent = time.monotonic()
        run.send_signal(number)
        _, said = run.communicate(timeout=30)
    finally:
        run.kill()
    assert run.returncode == 128 + number
    assert said == f"o3dleaf: {word}; a file that was not finished has left nothing behind\n"
    assert time.monotonic() - sent < 5  # a second, on a machine with other work


def environment():
    return os.environ | {"PYTHONPATH": os.pathsep.join(each or str(Path.cwd()) for each in sys.path)}


def wait_for(file):
    end = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_what_is_done_is_done_though_a_signal_comes_late():
    """At the interpreter's own end an interrupt would be a traceback."""
    late = "import atexit, os, signal; atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT)); "
    late += "import o3dleaf.commands.cli as cli; cli.main = lambda: None"
    run = subprocess.run(program(late), capture_output=True, text=True, check=False, env=environment())
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (
            "ImportError('libGL.so.1: cannot open shared object file: No such file or directory')",
            (
                "the system library libGL.so.1 is missing (libGL.so.1: cannot open shared object file: No such file or "
                "directory); install it, on Debian: apt-get install libgl1"
            ),
        ),
        (
            "OSError(28, 'No space left on device')",
            "[Errno 28] No space left on device; see that the place is there, can be written to and has space",
        ),
    ],
)
def test_what_the_machine_refuses_is_one_line(error, line):
    failing = f"import o3dleaf.commands.cli as cli; cli.main = lambda: (_ for _ in ()).throw({error})"
    run = subprocess.run(program(failing), capture_output=True, text=True, check=False, env=environment())
    assert (run.returncode, run.stderr) == (2, f"o3dleaf: error: {line}\n")


def test_a_terminal_that_takes_no_more(tmp_path):
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [*MODULE, "--help"], stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=environment()
        )
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    """A file that may not grow on is what a full disk is to a program."""
    import open3d as o3d

    from o3dleaf.io.triangle_mesh import write_mesh

    mesh = o3d.geometry.TriangleMesh.create_sphere()
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, before[1]))
    try:
        for name in ("a.ply", "a.stl", "a.obj"):
            with pytest.raises(O3DLeafError, match=r"could not be written \(.*\); free space or choose another"):
                write_mesh(mesh, tmp_path / name)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["ring.ply", "a" * 300 + ".ply", "a\0b.ply", "line\nbreak/a.ply"])
def test_names_that_are_none(tmp_path, name):
    (tmp_path / "ring.ply").symlink_to("ring.ply")
    path = tmp_path / name
    asked = [
        lambda: require_writable(path, (".ply",)),
        lambda: require_apart([path], []) or require_writable(path),
        lambda: require_file(path),
        lambda: make_folder(path / "below"),
    ]
    for ask in asked[: 3 if "\n" in name else 4]:  # a folder may have a line break in its name
        with pytest.raises(InputError) as caught:
            ask()
        assert "\n" not in str(caught.value)
        assert "\0" not in str(caught.value)
        assert "; " in str(caught.value)


def test_a_folder_that_is_a_file_or_takes_no_files(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc")):
        with pytest.raises(InputError, match="; choose another"):
            make_folder(folder)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["kill", "interrupt", "terminate", "full", "both", "vanish"])
def test_a_report_under_faults(monkeypatch, tmp_path, fault):
    monkeypatch.syspath_prepend(str(SCRIPTS))
    faults = importlib.import_module("fault_runs")
    jobs = faults.prepare(tmp_path)
    row = faults.FAULTS[fault]("report", jobs["report"], 10, tmp_path)
    assert row["wrong"] == [], json.dumps(row)
