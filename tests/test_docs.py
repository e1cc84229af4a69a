"""The documents name what is there: files, functions with their arguments, commands; and their Python runs."""

import ast
import inspect
import re
import shlex
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
import typer.main

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf.commands.cli import app

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("data_samples/*.md")])
NAMES = [path.relative_to(ROOT).as_posix() for path in PAGES]
COMMANDS = typer.main.get_command(app).commands
DESIGN = ROOT / "docs" / "design"
FOLDERS = "core|io|fitting|surface|leaf|samples|output|commands"
MAX_PARAGRAPH = 900  # characters: eight lines or so; one that says more says more than one thing


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_files_are_there(page):
    text = page.read_text(encoding="utf-8")
    links = [page.parent / link for link in re.findall(r"\]\(([^)#:]+)\)", text)]
    named = [ROOT / path for path in re.findall(r"`((?:scripts|tests|docs|o3dleaf)/[\w./]+)[^`*]*`", text)]
    named += [ROOT / "o3dleaf" / path for path in re.findall(rf"`((?:{FOLDERS})/[\w/]+\.py)`", text)]
    assert [str(path) for path in links + named if not path.exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_links_into_pages_lead_to_a_heading(page):
    links = re.findall(r"\]\(([^):#]*)#([^)]+)\)", page.read_text(encoding="utf-8"))
    assert [anchor for path, anchor in links if anchor not in anchors(page.parent / path if path else page)] == []


def anchors(page):
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", sorted(DESIGN.rglob("*.md")), ids=lambda page: page.relative_to(DESIGN).as_posix())
def test_a_paragraph_of_the_design_is_one_thought(page):
    """None is longer than a reader holds; tables, code and pictures aside, each point of a list by itself."""
    blocks = re.split(r"\n\s*\n|\n(?=- )", page.read_text(encoding="utf-8"))
    words = [block for block in blocks if not block.startswith(("|", "    ", "!["))]
    assert [block for block in words if len(block) > MAX_PARAGRAPH] == []


def test_the_map_of_the_design_has_every_page():
    links = re.findall(r"\]\(([^)#:]+)\)", (DESIGN / "README.md").read_text(encoding="utf-8"))
    linked = {(DESIGN / link).resolve() for link in links}
    assert [page for page in DESIGN.rglob("*.md") if page != DESIGN / "README.md" and page not in linked] == []


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_functions_take_what_they_are_given(page):
    """Of code within a line: `o3l.name(...)` is a call that the function would take, `o3dleaf.a.b` is there."""
    code = re.findall(r"(?<!`)`([^`\n]+)`(?!`)", page.read_text(encoding="utf-8"))
    for snippet in (text for text in code if re.match(r"(o3l|o3dleaf)\.\w+", text)):
        name = re.match(r"(?:o3l|o3dleaf)((?:\.\w+)+)", snippet)[1][1:]
        thing = resolve_name(f"o3dleaf:{name}") if snippet.startswith("o3l.") else resolve_name(f"o3dleaf.{name}")
        if snippet.endswith(")"):
            call = ast.parse(snippet, mode="eval").body
            inspect.signature(thing).bind(*call.args, **{keyword.arg: keyword.value for keyword in call.keywords})


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_commands_have_the_options(page):
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    unknown = []
    lines = [shlex.split(line)[1:] for line in re.findall(r"(?:^    |`)(o3dleaf [a-z]+ [^`\n#]*)", text, re.MULTILINE)]
    # What stands in quotes may be a command itself.
    inner = [word.split() for line in lines for word in line if word.partition(" ")[0] in COMMANDS and " " in word]
    for name, *words in [*lines, *inner]:
        options = {flag for each in COMMANDS[name].params for flag in (*each.opts, *each.secondary_opts)} | {"--help"}
        unknown += [(name, word) for word in words if re.match(r"--?[a-z]", word) and word not in options]
    assert unknown == []


def test_particles_are_read_as_the_page_says(tmp_path, monkeypatch):
    codes = (re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL) for page in PAGES)
    blocks = {name: "".join(code) for name, code in zip(NAMES, codes, strict=True) if code}
    # The first and the last have tests of their own.
    assert sorted(blocks) == ["README.md", "docs/consumers/particles.md", "docs/consumers/sph.md"]
    monkeypatch.chdir(tmp_path)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), [[0, 1, 2], [0, 2, 3]]
    particles = o3l.sample_particles(square, 0.2, labels=[0, 1], unit="mm")
    o3l.export_particles(particles, "boundary.csv")
    names = {}
    exec(blocks["docs/consumers/particles.md"], names)
    assert np.array_equal(np.stack([names[each] for each in ("x", "y", "z")], axis=1), particles.points)
    assert np.array_equal(np.stack([names[each] for each in ("nx", "ny", "nz")], axis=1), particles.normals)
    assert np.array_equal(names["area"], particles.sizes)
    assert np.array_equal(names["label"], particles.labels)


def test_the_loop_of_the_page_keeps_particles_out_of_a_leaf():
    """Balls that fall on a flat leaf bounce, and none comes nearer than its radius."""
    leaf = leaf_of(texture(lambda x, y, z: 0.3**2 - z**2 + 0.0 * x))[0]
    page = (ROOT / "docs/consumers/sph.md").read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", page, re.DOTALL)[1]
    places = np.column_stack([np.linspace(6, 14, 30), np.linspace(-2, 2, 30), np.full(30, 0.5)])
    names = {"leaf": leaf, "places": places, "speeds": np.tile([0.0, 0.0, -0.5], (30, 1)), "radius": 0.05}
    exec(code, names | {"dt": 0.02, "steps": 15, "low": (5, -3, -1), "high": (15, 3, 1), "step": 0.25})
    assert names["speeds"][:, 2].min() > 0
    assert leaf.signed_distance(places, closed=True).min() > 0.05 - 1e-3
