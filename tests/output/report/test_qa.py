"""A mesh is judged by what is required of it; the page and the JSON say what was found, and need nothing else."""

import base64
import io
import json
import os
import re
import shutil
import subprocess
from html.parser import HTMLParser

import numpy as np
import open3d as o3d
import pytest
from PIL import Image

import o3dleaf as o3l
from o3dleaf import check_report
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import triangle_areas
from o3dleaf.io.triangle_mesh import read_triangle_mesh, write_mesh
from o3dleaf.output.report import closeups, overviews, shots
from o3dleaf.output.report.examine import Examination, require_field
from o3dleaf.output.report.places import KINDS, find_places, look_at
from o3dleaf.output.report.reduce import reduce_mesh
from o3dleaf.output.report.requirements import RULES, parse_requirements
from o3dleaf.output.report.words import QUANTITIES
from o3dleaf.output.view.camera import Camera, View
from tolerances import PAGE_SECONDS, REDUCED_AREA

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
VOID = {"meta", "input", "image", "path", "circle", "rect", "br", "stop"}
PLANTED = set(KINDS)


def ball(resolution=12):
    mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, resolution)
    return np.asarray(mesh.vertices).copy(), np.asarray(mesh.triangles).astype(np.int64)


def planted():
    """A sphere with one of every defect: each far from the others."""
    vertices, triangles = ball()
    middles, taken = vertices[triangles].mean(axis=1), []

    def near(*place):
        order = np.argsort(np.linalg.norm(middles - place, axis=1))
        taken.append(next(row for row in order if row not in taken))
        return taken[-1]

    parts, count = [vertices], len(vertices)

    def grow(*points):
        nonlocal count
        parts.append(np.asarray(points, dtype=float))
        count += len(points)
        return np.arange(count - len(points), count)

    missing, flipped, twice, fin, tip, split = (
        near(*place) for place in ((0, 0, 1), (0, 0, -1), (1, 0, 0.2), (-1, 0, 0.2), (0, 1, 0.2), (0, -1, 0.2))
    )
    a, b, _ = triangles[fin]
    more = [[a, b, *grow((vertices[a] + vertices[b]) * 0.6)]]  # an edge of three triangles
    corner = triangles[tip][0]
    i, j, k = grow(*(vertices[corner] * 1.3 + 0.1 * np.eye(3)))  # pieces that touch in one vertex
    more += [[corner, i, j], [corner, j, k], [corner, k, i], [i, k, j]]
    more.append(triangles[twice][[1, 2, 0]].tolist())
    more.append(grow([0.5, 0.5, 0.2], [0.6, 0.5, 0.2], [1.2, 1.1, 0.9]).tolist())  # passes through the sphere
    a, b, c = triangles[split]
    (middle,) = grow((vertices[a] + vertices[b]) / 2)
    more += [[a, middle, c], [middle, b, c], [a, b, middle]]  # the last one has no area
    piece = o3d.geometry.TriangleMesh.create_icosahedron(0.05)
    more += (np.asarray(piece.triangles) + grow(*(np.asarray(piece.vertices) + [1.5, 1, 1]))[0]).tolist()
    triangles[flipped] = triangles[flipped][::-1]
    return np.concatenate(parts), np.concatenate([np.delete(triangles, [missing, split], axis=0), more])


@pytest.fixture(scope="module")
def broken():
    return Examination.of(planted(), unit="mm", require="watertight,manifold,oriented,components=1,min-triangles=9")


@pytest.fixture(scope="module")
def page(broken, tmp_path_factory):
    """The page of the broken mesh, with small pictures."""
    path = tmp_path_factory.mktemp("page") / "broken.html"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shots, "FINER", 0.35)
        broken.write_html(path, "broken <mesh> & co")
    return path


class Elements(HTMLParser):
    """Every element with its attributes; complains where tags do not balance."""

    def __init__(self, text):
        super().__init__()
        self.found, self.open = [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def all(self, tag):
        return [attributes for name, attributes in self.found if name == tag]


# --- requirements ---


@pytest.mark.parametrize(
    ("words", "met"),
    [
        ("watertight, manifold,oriented ,closed", True),
        ("components=1,genus=0,holes=0,boundary-edges=0", True),
        ("components=2", False),
        ("no-self-intersections,no-degenerate-triangles,no-duplicate-triangles", True),
        ("min-angle=45,max-angle=90.0001", True),
        ("min-angle=45.1", False),
        ("max-angle=89", False),
        ("share-below-20deg=0", True),
        ("min-edge=1,max-edge=1.4143", True),
        ("max-edge=1.4142", False),
        ("min-triangles=12,max-triangles=12", True),
        ("max-triangles=11", False),
        ("", True),
    ],
)
def test_a_box_is_what_it_is(words, met):
    """A unit cube of twelve right isosceles triangles, whose figures are known."""
    verdict = check_report(o3l.mesh_report(o3d.geometry.TriangleMesh.create_box()), words)
    assert verdict.passed is met
    assert verdict.word == ("not asked" if not words else "passed" if met else "failed")
    assert bool(verdict.failures) is not met


def test_bounds_bind_at_equality_and_break_beyond(broken):
    """Every word with a number agrees with its own figure, and fails beside it on the wrong side."""
    report = broken.inspection.report
    for name, rule in RULES.items():
        found = getattr(report, rule.attribute)
        if rule.order in {"is", "none"} or found is None:
            continue
        assert check_report(report, f"{name}={found!r}").passed, name
        less, more = (found - 1, found + 1) if rule.kind == "count" else (found * (1 - 1e-9), found * (1 + 1e-9))
        beyond = {"=": (less, more), "≥": (more,), "≤": (less,)}[rule.order]
        for value in beyond:
            if 0 <= value <= 180 and found not in {0, 180}:
                assert not check_report(report, f"{name}={value!r}").passed, name


def test_a_failure_says_what_was_wanted_and_found(broken):
    lines = [str(each) for each in broken.result.failures]
    report = broken.inspection.report
    assert lines[0].startswith(f"watertight: wanted yes, found no (boundary edges: {report.boundary_edges}, ")
    assert lines[-1] == f"components=1: wanted 1, found {report.components}"
    undefined = check_report(report, "genus=0").failures[0]
    assert "none" in undefined.found


@pytest.mark.parametrize(
    ("words", "say"),
    [
        ("waterproof", "watertight, manifold"),
        ("watertight=1", "takes no number"),
        ("components", "whole number"),
        ("components=1.5", "whole number"),
        ("components=-1", "whole number"),
        ("min-angle=200", "degrees"),
        ("min-angle=ten", "degrees"),
        ("min-angle=nan", "degrees"),
        ("share-below-5deg=3", "share"),
        ("max-edge=inf", "length"),
        ("watertight,,manifold", "unknown ''"),
        ("holes=0,holes=1", "twice"),
    ],
)
def test_a_requirement_that_is_none_gets_one_line(words, say):
    with pytest.raises(InputError, match=re.escape(say)) as failure:
        parse_requirements(words)
    assert "\n" not in str(failure.value)


def test_what_is_measured_to_must_be_given():
    box = o3d.geometry.TriangleMesh.create_box()
    with pytest.raises(InputError, match="needs a field"):
        check_report(o3l.mesh_report(box), "max-deviation=0.1")
    with pytest.raises(InputError, match="needs a cloud"):
        Examination.of(box, require="unsupported-share=0.1")


def test_a_model_that_is_no_field_is_refused():
    with pytest.raises(InputError, match="no surface of its own"):
        require_field(np.zeros(3), "model.o3l")


def test_every_figure_of_a_report_has_a_name(broken):
    assert set(broken.inspection.report.to_dict()) <= set(QUANTITIES)
    assert {rule.attribute for rule in RULES.values()} <= set(QUANTITIES)


# --- what is drawn ---


def test_a_reduced_mesh_keeps_the_budget_the_area_and_the_worst_values():
    vertices, triangles = ball(80)
    values = np.sin(40 * vertices[:, 0])
    reduced = reduce_mesh(vertices, triangles, 4000)
    assert 2000 < len(reduced.triangles) <= 4000
    area = triangle_areas(vertices, triangles).sum()
    assert abs(triangle_areas(reduced.vertices, reduced.triangles).sum() / area - 1) < REDUCED_AREA
    worst, least = reduced.worst(values), reduced.worst(values, least=True)
    for row in range(0, len(reduced.vertices), 50):
        assert (worst[row], least[row]) == (values[reduced.cluster == row].max(), values[reduced.cluster == row].min())
    for budget in (4, 60, 500, 9000, len(triangles) - 1):
        assert 0 < len(reduce_mesh(vertices * [1, 0.02, 9], triangles, budget).triangles) <= budget
    same = reduce_mesh(vertices, triangles, len(triangles))
    assert same.step == 0
    assert np.array_equal(same.vertices[same.triangles], vertices[triangles])


def test_every_planted_defect_has_a_close_up_that_shows_it(broken):
    places = find_places(broken.inspection)
    assert {place.kind for place in places} == PLANTED
    anatomy = broken.inspection.measurements
    for place in places:
        assert np.isin(place.rows, place.window).all()
        corners = anatomy.vertices[anatomy.triangles[place.rows]].reshape(-1, 3)
        at = look_at(broken.inspection, place).project(corners, closeups.SIZE) / np.array(closeups.SIZE)
        assert ((at > 0) & (at < 1)).all(axis=1).any()


def test_a_sound_sphere_has_worst_angles_and_no_defect():
    found = find_places(Examination.of(ball()).inspection)
    assert {place.kind for place in found} == {"sharpest"}


def test_two_faces_back_to_back_are_drawn_like_one(monkeypatch):
    """The normals of their vertices cancel: what is left is the normal of the triangle that is seen."""
    monkeypatch.setattr(shots, "FINER", 0.2)
    square = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], dtype=float)
    front = np.array([[0, 1, 2], [0, 2, 3]])
    pictures = []
    for triangles in (front, np.concatenate([front, front[:, ::-1]])):
        camera = Camera.framing(square, front, View(), 1.5)
        pictures.append(shots.shoot(square, triangles, shots.leaf_green, camera, (300, 200)).image)
    assert pictures[0] == pictures[1]


# --- the page ---


def test_the_page_needs_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    elements = Elements(text)
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    assert "url(" not in text
    assert not elements.all("link")
    outside = [a[name] for _, a in elements.found for name in ("src", "href") if name in a]
    assert outside
    assert all(address.startswith(("#", "data:image/webp;base64,")) for address in outside)
    assert "<mesh>" not in text
    assert "broken &lt;mesh&gt; &amp; co" in text
    names = [a["id"] for _, a in elements.found if "id" in a]
    assert len(names) == len(set(names))
    assert all(address[1:] in names for address in outside if address.startswith("#"))


def test_every_figure_of_the_json_is_on_the_page(page, broken, tmp_path):
    broken.write_json(tmp_path / "broken.json")
    figures = json.loads((tmp_path / "broken.json").read_text(), parse_constant=pytest.fail)
    text = page.read_text(encoding="utf-8")
    shown = {each["id"]: json.loads(each["value"]) for each in Elements(text).all("data")}
    measured = {name for name, value in figures.items() if value is not None} - {"required", "failures"}
    assert {name: shown[name] for name in measured} == {name: figures[name] for name in measured}
    assert figures["verdict"] == "failed"
    assert figures["required"] == [str(each.requirement) for each in broken.result.findings]
    for line in figures["required"]:
        assert f"<code>{line}</code>" in text
    assert text.count("✗ not met") == len(figures["failures"]) == 4


def test_every_defect_is_on_the_page(page):
    figures = [each for each in Elements(page.read_text(encoding="utf-8")).all("figure") if "data-kind" in each]
    assert {each["data-kind"] for each in figures} == PLANTED


def test_a_mesh_is_drawn_in_its_own_colors(monkeypatch):
    """A red ball is red from all sides, drawn whole or with fewer triangles; one without colors is leaf green."""
    monkeypatch.setattr(shots, "FINER", 0.25)
    mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, 12)
    mesh.paint_uniform_color([1, 0, 0])
    red, bare = Examination.of(mesh).colors, Examination.of(ball()).colors
    assert bare is None
    for budget in (10_000, 100):
        drawn = reduce_mesh(*ball(), budget)
        strongest = []
        for own in (drawn.mean(red), None):
            page = overviews.draw_sides(drawn, [], None, own)
            images = [address.split(",", 1)[1] for address in re.findall(r'"(data:image/webp;base64,[^"]+)"', page)]
            assert len(images) == 5
            each = [np.asarray(Image.open(io.BytesIO(base64.b64decode(image))).convert("RGBA")) for image in images]
            middle = [pixels[pixels.shape[0] // 2, pixels.shape[1] // 2, :3] for pixels in each]
            strongest.append({int(color.argmax()) for color in middle})
        assert strongest == [{0}, {1}]


def test_a_mesh_without_an_area_still_gets_a_page(tmp_path):
    line = ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert o3l.write_report(line, tmp_path / "line.html", require="no-degenerate-triangles").word == "failed"
    assert "nothing to draw" in (tmp_path / "line.html").read_text(encoding="utf-8")


def test_the_mesh_comes_first(tmp_path):
    with pytest.raises(InputError, match="takes the mesh first"):
        o3l.write_report(tmp_path / "box.html", o3d.geometry.TriangleMesh.create_box())


def test_maps_of_field_and_scan_have_their_colors_and_limits(monkeypatch, tmp_path):
    monkeypatch.setattr(shots, "FINER", 0.25)
    vertices, triangles = ball()
    # A spiral over the half of the sphere with x > 0, evenly dense, a little outside.
    x, turn = np.linspace(0, 1, 400), np.pi * (3 - np.sqrt(5)) * np.arange(400)
    scan = 1.02 * np.column_stack([x, np.sqrt(1 - x**2) * np.cos(turn), np.sqrt(1 - x**2) * np.sin(turn)])
    found = Examination.of((vertices, triangles), cloud=scan, unit="mm", require="max-scan-distance=0.1")
    reduced = reduce_mesh(vertices, triangles, 10**6)
    colors = overviews.scan_colors(found.inspection, reduced, found.points)
    assert np.isnan(colors.values[reduced.vertices[:, 0] < -0.5]).all()
    assert np.isfinite(colors.values[reduced.vertices[:, 0] > 0.1]).all()
    found.write_html(tmp_path / "scan.html", "scan")
    text = (tmp_path / "scan.html").read_text(encoding="utf-8")
    assert text.count("distance of the scan from the mesh, mm") >= 3  # two pictures and the view
    assert "distance of the scan&#x27;s points to the mesh, mm" in text  # and its histogram


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here: the page is not opened")
def test_the_page_opens_in_a_browser_without_an_error(page, tmp_path):
    """The view draws: its program marks the page when it has, and Chromium reports no error of the console."""
    words = [CHROMIUM, "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--virtual-time-budget=4000"]
    words += ["--enable-logging=stderr", "--v=0", "--host-resolver-rules=MAP * ~NOTFOUND", "--window-size=1200,900"]
    words += [f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", page.as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=PAGE_SECONDS, env=os.environ)
    drawn = re.search(r'id="viewer"[^>]*data-drawn="(\d+)"', done.stdout)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "GL Driver Message" not in line]
    assert console == []
    assert drawn
    assert int(drawn[1]) == len(planted()[1])
    assert 'class="interactive broken"' not in done.stdout


# --- the command ---


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    path = tmp_path_factory.mktemp("box") / "box.ply"
    o3d.io.write_triangle_mesh(path, o3d.geometry.TriangleMesh.create_box())
    return path


def test_the_exit_code_is_the_verdict(run, box, tmp_path):
    """1 where a requirement fails, with its line and the JSON written all the same."""
    done = run(
        "qa", box, "--unit", "mm", "--require", "watertight,min-angle=46", "--json", tmp_path / "box.json", "--quiet"
    )
    assert done.returncode == 1
    assert "min-angle=46: wanted at least 46°, found 45°" in done.stdout
    assert "watertight" not in done.stdout
    written = json.loads((tmp_path / "box.json").read_text())
    assert (written["verdict"], written["failures"]) == ("failed", ["min-angle=46: wanted at least 46°, found 45°"])
    assert written["unit"] == "mm"


def test_a_sound_mesh_passes(run, box):
    done = run("qa", box, "--require", "watertight,min-angle=45")
    assert done.returncode == 0
    assert "passed (2 of 2 met)" in done.stdout


@pytest.mark.parametrize("writer", ["ours", "Open3D's"])
def test_the_corners_of_an_stl_are_joined(run, tmp_path, writer):
    """STL has three vertices a triangle: judged as they stand, a sphere is as many pieces as it has triangles."""
    mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, 20).compute_triangle_normals()
    if writer == "ours":
        write_mesh(mesh, tmp_path / "ball.stl")
    else:
        o3d.io.write_triangle_mesh(tmp_path / "ball.stl", mesh)
    read = read_triangle_mesh(tmp_path / "ball.stl")
    assert len(read.vertices) == len(mesh.vertices)
    assert not read.has_vertex_normals()
    corners, same = (np.asarray(each.vertices)[np.asarray(each.triangles)] for each in (mesh, read))
    np.testing.assert_array_equal(same, corners.astype(np.float32))
    done = run("qa", tmp_path / "ball.stl", "--require", "watertight,manifold,oriented,components=1")
    assert (done.returncode, "passed (4 of 4 met)" in done.stdout) == (0, True)
    done = run("info", tmp_path / "ball.stl", "--json", tmp_path / "ball.json")
    assert done.returncode == 0
    said = json.loads((tmp_path / "ball.json").read_text())
    assert (said["components"], said["vertices"], said["watertight"]) == (1, len(mesh.vertices), True)


def test_wrong_input_is_one_line_and_leaves_nothing(run, box, tmp_path):
    done = run("qa", box, "--require", "waterproof", "--html", tmp_path / "box.html")
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert "waterproof" in done.stderr
    assert list(tmp_path.iterdir()) == []
