"""The house stands: layers, lazy doors, a quick start, one file that touches GPL code, names with docstrings."""

import inspect
import re
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import o3dleaf
from tolerances import START_SECONDS

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = Path(sys.executable).with_name("o3dleaf")
HEAVY = {"open3d", "numba", "scipy", "skimage", "pymeshlab", "matplotlib", "shapely", "tifffile"}
PROJECT = (ROOT / "pyproject.toml").read_text()


def test_layers_hold():
    assert lint_imports(config_filename=str(ROOT / "pyproject.toml"), no_cache=True) == 0


@pytest.mark.parametrize("module", ["o3dleaf", "o3dleaf.__main__", "o3dleaf.cli"])
def test_import_loads_nothing_heavy(module):
    code = f"import {module}, sys; print(*set(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert HEAVY & set(loaded) == set()


@pytest.mark.parametrize("command", [(sys.executable, "-c", "import o3dleaf"), (PROGRAM, "--help")])
def test_starts_at_once(command):
    """Processor time, and the best of five: the other tests keep the machine busy meanwhile."""

    def seconds() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime

    assert min(seconds() for _ in range(5)) < START_SECONDS


def test_pymeshlab_is_touched_by_one_file():
    """The layers' linter sees import statements; a name handed to importlib is seen here."""
    importing = re.compile(r"import(_module)?\W+pymeshlab")
    files = [path for path in (ROOT / "o3dleaf").rglob("*.py") if importing.search(path.read_text())]
    assert [path.relative_to(ROOT).as_posix() for path in files] == ["o3dleaf/mesh/clean.py"]


@pytest.mark.parametrize("name", o3dleaf.__all__)
def test_public_name_is_documented(name):
    """It resolves, opens with a sentence, and names every parameter of what makes it: itself, or its `fit`."""
    thing = getattr(o3dleaf, name)
    assert re.match(r"\S.{10,}", inspect.getdoc(thing) or "")
    if inspect.isfunction(thing) or (inspect.isclass(thing) and not issubclass(thing, Exception)):
        fit = getattr(thing, "fit", None)
        maker = thing if fit is None or inspect.isfunction(fit) else fit  # an instance's own fit makes something else
        text = f"{inspect.getdoc(thing)} {inspect.getdoc(maker)}"
        variadic = {inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD}
        parameters = [p.name for p in inspect.signature(maker).parameters.values() if p.kind not in variadic]
        assert [p for p in parameters if not re.search(rf"\b{p}\b", text)] == []


def test_version_is_that_of_the_project_file():
    assert f'\nversion = "{o3dleaf.__version__}"\n' in PROJECT


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = o3dleaf.no_such_name
