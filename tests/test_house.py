"""The house stands: layers, lazy doors, a quick start, one file that touches GPL code, names with docstrings."""

import ast
import inspect
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from grimp import build_graph
from importlinter.cli import lint_imports
from scipy.sparse.csgraph import connected_components

import o3dleaf
from tolerances import START_TIMES

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for path in (ROOT / "o3dleaf").rglob("__init__.py"))
PROGRAM = Path(sys.executable).with_name("o3dleaf")
HEAVY = {"open3d", "numba", "scipy", "skimage", "pymeshlab", "matplotlib", "shapely", "tifffile"}
PROJECT = (ROOT / "pyproject.toml").read_text()


def test_layers_hold():
    assert lint_imports(config_filename=str(ROOT / "pyproject.toml"), no_cache=True) == 0


def test_no_circle_of_imports():
    """Type-only imports included: whoever reads a module needs those before it, and no other."""
    imports = build_graph("o3dleaf", cache_dir=None)
    names = sorted(imports.modules)
    graph = np.zeros((len(names), len(names)), dtype=bool)
    for row, name in enumerate(names):
        graph[row, [names.index(other) for other in imports.find_modules_directly_imported_by(name)]] = True
    assert graph.any(axis=1).sum() > 100
    _, component = connected_components(graph, connection="strong")
    circles = [[name for name, part in zip(names, component, strict=True) if part == n] for n in np.unique(component)]
    assert [circle for circle in circles if len(circle) > 1] == []
    assert not graph.diagonal().any()


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_chapter_map_names_what_is_there(package):
    """Each line of a chapter's docstring that begins with a name in backticks is an entry of its map."""
    entries = re.findall(r"^`(\w+)`", ast.get_docstring(ast.parse((package / "__init__.py").read_text())), re.MULTILINE)
    modules = {path.stem for path in package.glob("*.py")} - {"__init__"}
    folders = {path.parent.name for path in package.glob("*/__init__.py")}
    assert sorted(entries) == sorted(modules | folders)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_folder_holds_more_than_sixteen_files(package):
    assert len([path for path in package.iterdir() if path.is_file()]) <= 16


def test_contributing_shows_the_tree():
    """The tree in CONTRIBUTING.md has every folder of the package, and no other."""
    tree = re.search(r"^    o3dleaf/\n((?:     +.*\n)+)", (ROOT / "CONTRIBUTING.md").read_text(), re.MULTILINE)[1]
    named = sorted(re.findall(r"(\w+)/", tree))
    assert named == sorted(path.name for path in PACKAGES[1:])


def test_glossary_names_what_is_there():
    """The last column names a public name, one of its attributes, or a file or folder of the package."""
    rows = [line for line in (ROOT / "docs" / "glossary.md").read_text().splitlines() if line.count("`") >= 2]
    names = [name for row in rows if row.startswith("|") for name in re.findall(r"`([^`]+)`", row.rsplit("|", 2)[1])]
    files = {path.relative_to(ROOT / "o3dleaf").with_suffix("").as_posix() for path in (ROOT / "o3dleaf").rglob("*")}
    gone = [name for name in names if "/" in name and name not in files]
    for name in (name for name in names if "/" not in name):
        thing, *attributes = name.split(".")
        public = getattr(o3dleaf, thing, None)
        fields = getattr(public, "__annotations__", {})
        gone += [name] if public is None or any(not hasattr(public, a) and a not in fields for a in attributes) else []
    assert len(names) > 80
    assert gone == []


def test_no_two_classes_share_a_name():
    files = (ROOT / "o3dleaf").rglob("*.py")
    names = Counter(name for path in files for name in re.findall(r"(?m)^ *class (\w+)[(:]", path.read_text()))
    assert len(names) > 100
    assert [name for name, count in names.items() if count > 1] == []


def test_no_tolerance_replaces_another():
    """Of two that share a name the later one holds for both, which may be the looser one."""
    nodes = ast.parse((ROOT / "tests" / "tolerances.py").read_text()).body
    names = Counter(node.targets[0].id for node in nodes if isinstance(node, ast.Assign))
    assert len(names) > 100
    assert [name for name, count in names.items() if count > 1] == []


def test_every_tolerance_that_a_test_reads_is_there_and_every_one_there_is_read():
    """A test that reads a missing one fails only where it gets so far; one that no test reads holds nothing."""
    nodes = ast.parse((ROOT / "tests" / "tolerances.py").read_text()).body
    there = {node.targets[0].id for node in nodes if isinstance(node, ast.Assign)}
    read = set()
    for path in [*(ROOT / "tests").rglob("*.py"), *(ROOT / "scripts").rglob("*.py")]:
        text = path.read_text()
        for several, one in re.findall(r"(?m)^ *from (?:\w+\.)?tolerances import (?:\(([^)]*)\)|(.+))$", text):
            read |= set(re.findall(r"\w+", several or one))
        for name in re.findall(r"(?m)^.*import tolerances(?: as (\w+))?$", text):
            read |= set(re.findall(rf"\b{name or 'tolerances'}\.(\w+)", text))
    assert sorted(read ^ there) == []


def test_compiled_code_stands_on_compiled_code_alone():
    """So the stamp of a compiled module, which follows `from ..._loops import`, knows all that it depends on."""
    known = r"(o3dleaf\.[\w.]+_loops|o3dleaf\.core\.compiled\.decorator) import|\S+ import (Float|Int)Array$"
    stray = []
    for path in sorted((ROOT / "o3dleaf").rglob("*.py")):
        text, name = path.read_text(), path.relative_to(ROOT).as_posix()
        if path.name.endswith("_loops.py"):
            imports = re.findall(
                r"^\s*(?:from (o3dleaf.*)|import (o3dleaf.*)|from (numba import njit))", text, re.MULTILINE
            )
            stray += [(name, line) for line in map("".join, imports) if not re.match(known, line)]
        elif "compiled/" not in name and re.search(r"^\s*(@njit|from numba|import numba)", text, re.MULTILINE):
            stray.append((name, "numba"))
    assert stray == []


@pytest.mark.parametrize(
    "module", ["o3dleaf", "o3dleaf.__main__", "o3dleaf.commands.cli", "o3dleaf.output.view", "o3dleaf.output.figures"]
)
def test_import_loads_nothing_heavy(module):
    code = f"import {module}, sys; print(*set(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert HEAVY & set(loaded) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows counts no processor time of children")
@pytest.mark.parametrize("command", [(sys.executable, "-c", "import o3dleaf"), (PROGRAM, "--help")])
def test_starts_at_once(command):
    """Processor time over that of NumPy's import, in one of up to five pairs: what slows one slows the other."""

    def seconds(command: tuple[object, ...]) -> float:
        before = os.times()
        subprocess.run(command, capture_output=True, check=True)
        after = os.times()
        return after.children_user - before.children_user + after.children_system - before.children_system

    numpy = sys.executable, "-c", "import numpy"
    assert any(seconds(command) < START_TIMES * seconds(numpy) for _ in range(5))


def test_pymeshlab_is_touched_by_one_file():
    """The layers' linter sees import statements; a name handed to importlib is seen here."""
    importing = re.compile(r"import(_module)?\W+pymeshlab")
    files = [path for path in (ROOT / "o3dleaf").rglob("*.py") if importing.search(path.read_text())]
    assert [path.relative_to(ROOT).as_posix() for path in files] == ["o3dleaf/surface/repair/meshlab.py"]


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


@pytest.mark.parametrize("namespace", [pytest.param("samples", marks=pytest.mark.slow), "view", "errors"])
def test_namespaces_hold_what_they_list(namespace):
    """Each is there first thing in a new process, and each of its names has a docstring."""
    code = f"import o3dleaf; print(*o3dleaf.{namespace}.__all__)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    room = getattr(o3dleaf, namespace)  # here, where most of what they import is there
    assert said.split() == list(room.__all__)
    assert all(getattr(room, name).__doc__ for name in room.__all__)


def test_version_is_that_of_the_project_file():
    assert f'\nversion = "{o3dleaf.__version__}"\n' in PROJECT


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = o3dleaf.no_such_name
