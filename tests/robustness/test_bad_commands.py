"""Every command, every option, by files, outputs, values and company that it cannot have: one line, exit code 2."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

from o3dleaf.commands.cli import JOBS, perform
from o3dleaf.commands.line.words import job_of
from o3dleaf.core.jobs.option import options_of
from o3dleaf.errors import O3DLeafError
from robustness.commands import GOOD, CommandRow, command_rows, misused_rows
from robustness.rows import HangError, limited
from robustness.world import World

FEWEST_ROWS = 700
ROWS = list(command_rows())
WINDOWS = {"pick", "view"}
THROUGH_THE_PROGRAM = 40
AS_PROCESSES = 1


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with good files, and bad ones of all their suffixes."""
    place = tmp_path_factory.mktemp("files")
    world = World(place)
    for name in ("good.ply", "good.xyz", "good.o3l", "good.tif", "good.stl"):
        world.file(name)
    for suffix in (".obj", ".off", ".pcd", ".pts", ".csv", ".json", ".html", ".vti", ".png", ""):
        world.spoiled(suffix)
    (place / "case").mkdir()
    (place / "case" / "droplet.json").write_text("{}")
    constants = dict.fromkeys(("xCells", "yCells", "zCells", "endTime", "maxDeltaT"), 5)
    (place / "case" / "constants").write_text("".join(f"{name} {value};\n" for name, value in constants.items()))
    return place


def outcome(row, folder):
    """What is wrong with what a command does, or nothing."""
    try:
        with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"), limited():
            warnings.simplefilter("ignore")
            perform(job_of(JOBS[row.command], row.given(folder)))
    except O3DLeafError as refused:
        text = str(refused)
        return "" if text and "\n" not in text and ";" in text else f"WORDS: {text!r}"
    except HangError:
        return "HANG"
    except BaseException as cause:  # noqa: BLE001 - a row tells of all of them
        return f"TRACEBACK {type(cause).__name__}: {cause}"
    return "TAKEN"


def test_the_table_has_every_command():
    assert set(GOOD) | WINDOWS == set(JOBS)
    assert len(ROWS) == len({str(row) for row in ROWS}) >= FEWEST_ROWS
    for command, good in GOOD.items():
        assert set(good) <= set(options_of(JOBS[command]))


@pytest.mark.parametrize("command", GOOD)
def test_commands_refuse_in_one_line(folder, command):
    found = {str(row): outcome(row, folder) for row in ROWS if row.command == command}
    assert {row: fault for row, fault in found.items() if fault} == {}


def words_of(row, folder):
    """The command line of a row."""
    known = options_of(JOBS[row.command])
    words = [row.command]
    for name, value in row.given(folder).items():
        one = known[name][1]
        listed = value if isinstance(value, list) else [value]
        words += [] if one.positional else [one.flags[0] if one.flags else f"--{name.replace('_', '-')}"]
        words += map(str, listed)
    return words


SHOWN = [row for row in ROWS if isinstance(row.value, str | float) and not row.company and row.change != "cut off .ply"]
"""Of a mesh that is cut off Open3D tells in lines of its own."""
SHOWN = SHOWN[:: max(1, len(SHOWN) // THROUGH_THE_PROGRAM)]


def test_words_that_are_no_command_line_are_one_line_with_exit_code_2(run, folder, monkeypatch):
    monkeypatch.chdir(folder)
    for words in misused_rows():
        result = run(*words)
        assert result.returncode == 2, words
        said = result.stderr.strip().splitlines()
        assert (len(said), result.stdout) == (1, ""), words
        assert said[0].startswith("o3dleaf: error: "), words
        assert " --help" in said[0].partition("; see o3dleaf")[2], words


@pytest.mark.parametrize("row", SHOWN, ids=str)
def test_the_program_says_so_with_exit_code_2(run, folder, row):
    result = run(*words_of(row, folder))
    assert result.returncode == 2, result
    assert "Traceback" not in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("row", SHOWN[:: len(SHOWN) // AS_PROCESSES][:AS_PROCESSES], ids=str)
def test_a_process_ends_likewise(folder, row):
    words = [sys.executable, "-m", "o3dleaf", *words_of(row, folder)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, len(done.stderr.strip().splitlines())) == (2, 1)


@pytest.mark.parametrize("command", GOOD)
def test_every_command_tells_what_it_will_need_and_does_nothing(folder, command, capsys):
    given = CommandRow(command, "only_estimate", "a good one", True).given(folder)
    before = sorted(folder.rglob("*"))
    assert perform(job_of(JOBS[command], given)) == 0
    said = capsys.readouterr().out.splitlines()
    assert " MB" in said[0] or " GB" in said[0] or command == "warm-up"
    assert sorted(folder.rglob("*")) == before
