"""The commands as a user runs them: what they write, and the one line that bad input gets."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from matplotlib.image import imread

from o3dleaf.io.triangle_mesh import read_triangle_mesh
from o3dleaf.leaf import tile_lattice
from o3dleaf.leaf.ct.formats.tiff import write_volume
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.samples.ct import wheat_ct
from o3dleaf.samples.scan import wheat_scan
from o3dleaf.surface.mesh.mesh_report import mesh_report

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(sys.executable).with_name("o3dleaf")
MODULE = sys.executable, "-m", "o3dleaf"
POINTS, HALF_LENGTH = 800, 25.0
"""Of a whole scan, and how much of it is kept on either side of its middle: few, since what takes most of a run is the
blade's fit, which has tests of its own."""


def process(*arguments):
    """Call the installed program, as a shell does."""
    words = [str(PROGRAM), *(str(each) for each in arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A scan, a midrib and a small volume, good ones."""
    folder = tmp_path_factory.mktemp("input")
    scan = wheat_scan(count=POINTS)
    along = np.asarray(scan.cloud.points)[:, 0]
    middle = np.flatnonzero(np.abs(along - np.median(along)) < HALF_LENGTH)
    o3d.io.write_point_cloud(folder / "scan.ply", scan.cloud.select_by_index(middle))
    midrib = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(scan.midrib))
    o3d.io.write_point_cloud(folder / "midrib.ply", midrib)
    volume, _ = wheat_ct(size=(720, 720, 480))
    write_volume(volume, folder / "ct.tif")
    return folder


@pytest.fixture(scope="module")
def bad(files, tmp_path_factory):
    """One bad file after the other, by name."""
    folder = tmp_path_factory.mktemp("bad")
    points = np.asarray(o3d.io.read_point_cloud(files / "scan.ply").points)

    def cloud(name, rows):
        np.savetxt(folder / name, rows)
        return folder / name

    spoilt = points.copy()
    spoilt[:] = np.nan
    words = folder / "words.csv"
    words.write_text("x y z\n1 2 3\n1 2 three\n")
    (folder / "empty.ply").touch()
    (folder / "garbage.ply").write_bytes(bytes(range(256)) * 40)
    (folder / "garbage.tif").write_bytes(bytes(range(256)) * 40)
    volume = wheat_ct(size=(720, 720, 480))[0]
    flat = Volume(np.ones((20, 20, 20), dtype=np.float32), volume.spacing, volume.origin, volume.unit)
    write_volume(flat, folder / "flat.tif")
    return {
        "empty": folder / "empty.ply",
        "nan": cloud("nan.xyz", spoilt),
        "two": cloud("two.xyz", points[:2]),
        "one": cloud("one.xyz", points[:1]),
        "line": cloud("line.xyz", np.linspace([0, 0, 0], [100, 0, 0], 500)),
        "same": cloud("same.xyz", np.ones((200, 3))),
        "words": words,
        "garbage": folder / "garbage.ply",
        "flat": folder / "flat.tif",
        "garbage_ct": folder / "garbage.tif",
        "missing": folder / "missing.ply",
    }


CASES = {
    "an empty cloud": (("{empty}",), "empty"),
    "nothing but NaN": (("{nan}",), "NaN"),
    "two points": (("{two}",), "2 points"),
    "a cloud on a line": (("{line}",), "one line"),
    "a cloud on a line, over a plane": (("{line}", "--frame", "paper", "--midrib", "{line}"), "one line"),
    "a cloud on a line, over a plane, without a midrib": (("{line}", "--frame", "paper"), "one line"),
    "a cloud in one place": (("{same}",), "damaged"),
    "no such file": (("{missing}",), "no such file"),
    "an unreadable cloud": (("{garbage}",), "PLY"),
    "a midrib of one point": (("{scan}", "--midrib", "{one}"), "1 points"),
    "a volume of one value": (("{scan}", "--ct", "{flat}"), "one value"),
    "an unreadable volume": (("{scan}", "--ct", "{garbage_ct}"), "TIFF"),
    "a scan a thousand times too small": (("{scan}", "--scan-unit", "um"), "unit"),
    "a scan a thousand times too large": (("{scan}", "--scan-unit", "m"), "unit"),
    "a volume a thousand times too large": (
        ("{scan}", "--ct", "{ct}", "--ct-unit", "mm", "--voxel-spacing", "24"),
        "unit",
    ),
    "a line without a number": (("{words}",), "line 3: '1 2 three' has no number in column 3, z"),
    "columns of a file that names its own": (("{scan}", "--columns", "x y z"), "leave columns out"),
    "an unknown unit": (("{scan}", "--scan-unit", "inch"), "is 'inch'"),
    "a spacing of nothing": (("{scan}", "--spacing", "0"), "spacing"),
    "a spacing larger than the leaf": (("{scan}", "--spacing", "500"), "spacing"),
    "one larger than the paper's": (("{scan}", "--frame", "paper", "--spacing", "500"), "spacing"),
    "an unknown threshold": (("{scan}", "--ct", "{ct}", "--level", "best"), "best"),
    "an unknown method": (("{scan}", "--ct", "{ct}", "--method", "dice"), "dice"),
    "no threads": (("{scan}", "--threads", "0"), "threads"),
    "a solid of a blade without thickness": (("{scan}", "--closed"), "acts only with ct"),
    "one window in two ways": (
        ("{scan}", "--region", "1", "1", "2", "2", "--around", "0", "0", "0"),
        "region: cannot act with around",
    ),
    "hairs thinned out of a mesh of periodic tiles": (
        ("{scan}", "--ct", "{ct}", "--hair-density", "{scan}", "--remesh", "0.1"),
        "hair-density: cannot act with remesh",
    ),
    "a fine window of four numbers": (("{scan}", "--ct", "{ct}", "--fine", "1 1 2 2"), "five numbers"),
    "a fine window in a window": (
        ("{scan}", "--ct", "{ct}", "--fine", "1 1 2 2 0.1", "--region", "1", "1", "2", "2"),
        "region: cannot act with fine",
    ),
    "a grid of an unknown kind": (("{scan}", "--ct", "{ct}", "--grid", "grid.txt"), "suffix"),
    "an unknown part of a grid": (("{scan}", "--ct", "{ct}", "--grid-of", "colour"), "colour"),
    "an unknown distortion": (("{scan}", "--distortion", "taste"), "taste"),
    "a share of triangles above one": (("{scan}", "--ct", "{ct}", "--simplify", "3"), "share"),
    "an unknown period": (("{scan}", "--ct", "{ct}", "--period", "worst"), "period"),
    "an unknown frame": (("{scan}", "--frame", "wooden"), "wooden"),
    "an unknown offset": (("{scan}", "--ct", "{ct}", "--frame", "paper", "--offset", "down"), "down"),
    "an offset of a surface": (("{scan}", "--ct", "{ct}", "--offset", "normal"), "offset: is normal, which frame"),
    "a rim of the paper's blade": (("{scan}", "--frame", "paper", "--rim-radius", "1"), "rim-radius: is 1.0, which"),
    "a point beside the leaf": (("{scan}", "--around", "0", "0", "900"), "beside the blade"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_gets_one_line_and_leaves_nothing(run, case, files, bad, tmp_path):
    arguments, cause = CASES[case]
    places = bad | {"scan": files / "scan.ply", "ct": files / "ct.tif"}
    out = tmp_path / "out"
    out.mkdir()
    result = run("leaf", *(word.format(**places) for word in arguments), "-o", out / "leaf.ply", "--quiet")
    assert result.returncode == 2
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("o3dleaf: error: ")
    assert cause in lines[0]
    assert list(out.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        (("--period", "worst"), "period"),
        (("--period", "100"), "period"),
        (("--period", "100 0"), "period"),
        (("--level", "best"), "level"),
        (("--level", "nan"), "level"),
        (("--rho", "-1"), "rho"),
        (("--rho", "most"), "rho"),
        (("--flip", "up"), "flip"),
        (("--shift", "0.123"), "shift"),
        (("--tiles", "square"), "tiles"),
        (("--tiles", "wang", "--flip", "along"), "flip"),
        (("--tiles", "wang", "--period", "best"), "period"),
        (("--seed", "3"), "seed"),
        (("--simplify", "3"), "simplify"),
        (("--simplify", "0.5", "--remesh-tile", "1"), "simplify, remesh_tile"),
        (("--remesh-tile", "0"), "remesh-tile"),
        (("--remesh", "-1"), "remesh"),
        (("--frame", "paper", "--offset", "down"), "offset"),
    ],
)
def test_nonsense_is_refused_before_anything_is_read(run, tmp_path, words, cause):
    result = run("leaf", tmp_path / "no_scan.ply", "--ct", tmp_path / "no_ct.tif", *words, "-o", tmp_path / "leaf.ply")
    assert result.returncode == 2
    assert result.stderr.strip().startswith(f"o3dleaf: error: {cause}: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("output", ["leaf.xyz", "nowhere/leaf.ply"])
def test_an_output_that_cannot_be_written_is_refused_before_the_work(run, files, tmp_path, output):
    result = run("leaf", files / "scan.ply", "-o", tmp_path / output)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.few(frame=1)
@pytest.mark.parametrize(
    ("frame", "stage", "along"), [("surface", "fit surface", (20, 22)), ("paper", "fit height map", (90, 92))]
)
def test_a_leaf_from_files(run, files, tmp_path, frame, stage, along, monkeypatch):
    """What is along the leaf begins at the base of the scan, or of the midrib, which is longer."""
    output, ahead, made = tmp_path / "leaf.ply", tile_lattice.extract_tiles_ahead, []

    def note(*arguments):
        tiles = ahead(*arguments)
        made.append((list(tiles), tiles))
        return tiles

    monkeypatch.setattr(tile_lattice, "extract_tiles_ahead", note)
    result = run(
        "leaf", files / "scan.ply", "--midrib", files / "midrib.ply", "--ct", files / "ct.tif", "--spacing", 0.1,
        "--region", along[0], -1, along[1], 1, "--frame", frame, "-o", output,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "extract mesh" in result.stderr
    # Of mesh and picture both tiles are polygonized while the blade is fitted, and both are taken.
    ((wanted, left),) = made
    assert len(wanted) == 2
    assert not left
    assert {path.name for path in tmp_path.iterdir()} == {"leaf.ply", "leaf.png", "leaf.json"}
    summary = json.loads((tmp_path / "leaf.json").read_text())
    assert summary["unit"] == "mm"
    assert summary["micro_structure"]["unit"] == "um"
    assert summary["mesh"]["components"] == 2
    assert summary["mesh"]["manifold"]
    assert summary["settings"]["spacing"] == 0.1
    assert summary["settings"]["frame"] == frame
    assert {"fit micro-scale interpolant", stage, "extract mesh"} <= set(summary["seconds"])
    assert {"python", "numba", "open3d"} <= set(summary["versions"])
    mesh = o3d.io.read_triangle_mesh(output)
    assert len(mesh.triangles) == summary["mesh"]["triangles"]


FRAMES = {"surface": (), "paper": ("--frame", "paper", "--offset", "normal")}


@pytest.mark.parametrize("frame", ["surface", pytest.param("paper", marks=pytest.mark.slow)])
def test_a_closed_window_with_all_that_can_be_written_beside_it(run, files, tmp_path, frame):
    scan = np.asarray(o3d.io.read_point_cloud(files / "scan.ply").points)
    middle = scan[np.argmin(np.linalg.norm(scan - np.median(scan, axis=0), axis=1))]
    result = run(
        "leaf", files / "scan.ply", "--ct", files / "ct.tif", "--midrib", files / "midrib.ply", "--spacing", 0.05,
        "--around", *middle, "--window", 1.5, "--closed", "--period", "best", *FRAMES[frame],
        "--tile-solid", tmp_path / "tile.stl", "--distortion", "thickness", "--no-picture", "-o", tmp_path / "leaf.stl",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert "triangles at 0.0" in result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"leaf.stl", "tile.stl", "leaf.distortion.png", "leaf.json"}
    summary = json.loads((tmp_path / "leaf.json").read_text())
    assert summary["mesh"]["watertight"]
    assert summary["surface"]["closed"]
    assert summary["surface"]["triangles"] == len(o3d.io.read_triangle_mesh(tmp_path / "leaf.stl").triangles)
    assert frame == "surface" or not summary["frame"]["folded"]
    assert mesh_report(read_triangle_mesh(tmp_path / "tile.stl")).watertight


@pytest.mark.slow
def test_a_leaf_with_a_fine_window_and_a_grid(run, files, tmp_path):
    """Tiles are set one by one where there is a window."""
    result = run(
        "leaf", files / "scan.ply", "--ct", files / "ct.tif", "--midrib", files / "midrib.ply", "--spacing", 0.5,
        "--frame", "paper", "--fine", "95 -1 95.5 -0.5 0.125", "--no-picture",
        "--grid", tmp_path / "leaf.nrrd", "--grid-of", "mask", "--grid-step", 2,
        "-o", tmp_path / "leaf.obj", "-q",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"leaf.obj", "leaf.nrrd", "leaf.json"}
    report = json.loads((tmp_path / "leaf.json").read_text())["mesh"]
    assert report["manifold"]
    assert (report["components"], report["boundary_loops"]) == (2, 2)
    assert {line for line in (tmp_path / "leaf.obj").read_text().splitlines() if line[:1] == "g"} == {
        "g adaxial",
        "g abaxial",
    }


def test_a_patch_tells_its_seam_and_writes_a_block(run, files, tmp_path):
    result = run(
        "patch", files / "ct.tif", "-o", tmp_path / "m.o3l", "--tile-solid", tmp_path / "t.ply", "--spacing", 24
    )
    assert result.returncode == 0, result.stderr
    assert "seam energy" in result.stdout
    assert mesh_report(read_triangle_mesh(tmp_path / "t.ply")).watertight
    alone = run("patch", files / "ct.tif", "-o", tmp_path / "m.o3l", "--spacing", 24)
    assert "spacing: acts only with tile-solid" in alone.stderr


@pytest.mark.slow
def test_a_scan_in_text_is_the_same_scan(run, files, tmp_path):
    """Points in other columns, in another format, make the same mesh to the last bit."""
    points = np.asarray(o3d.io.read_point_cloud(files / "scan.ply").points)
    np.savetxt(tmp_path / "scan.txt", np.hstack([points[:, ::-1], points]), fmt="%.17g", header="three and three")
    options = "--spacing", 1, "--midrib", files / "midrib.ply", "--no-picture", "--quiet"
    first = run("leaf", files / "scan.ply", *options, "-o", tmp_path / "a.ply")
    other = run("leaf", tmp_path / "scan.txt", "--columns", "- - - x y z", *options, "-o", tmp_path / "b.ply")
    assert (first.returncode, other.returncode) == (0, 0), first.stderr + other.stderr
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()


def test_a_blade_without_a_volume_or_a_midrib(run, files, tmp_path):
    result = run("leaf", files / "scan.ply", "--no-picture", "-o", tmp_path / "blade.stl")
    assert result.returncode == 0, result.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"blade.stl", "blade.json"}
    summary = json.loads((tmp_path / "blade.json").read_text())
    assert summary["mesh"]["components"] == 1
    step = summary["mesh_step"]
    assert summary["settings"]["spacing"] is None
    assert summary["mesh"]["median_edge"] == pytest.approx(step["length"], rel=0.3)
    assert f"mesh spacing {step['length']} mm: {step['reason']}" in " ".join(result.stderr.split())


def test_info_says_what_a_file_holds(run, files, tmp_path):
    result = run("info", files / "ct.tif", "--json", tmp_path / "ct.json")
    assert result.returncode == 0, result.stderr
    contents = json.loads((tmp_path / "ct.json").read_text())
    assert contents["shape"] == [30, 30, 20]
    assert "rings around" in contents["rings"]
    assert " × " in contents["patch"]
    assert "of the step" in contents["drift"]
    points = len(o3d.io.read_point_cloud(files / "scan.ply").points)
    assert f" {points}\n" in run("info", files / "scan.ply", "--unit", "mm").stdout


def test_info_draws_the_pieces_of_a_scan(run, files, tmp_path):
    result = run("info", files / "scan.ply", "--unit", "mm", "--pieces", tmp_path / "pieces.png")
    assert result.returncode == 0, result.stderr
    assert re.search(r" piece  1: [\d,]+ points \(area about [\d,.]+ mm²\) at ", result.stdout)
    assert (tmp_path / "pieces.png").stat().st_size > 10_000
    o3d.io.write_triangle_mesh(tmp_path / "ball.ply", o3d.geometry.TriangleMesh.create_sphere(1.0, 4))
    for file in (tmp_path / "ball.ply", files / "ct.tif"):
        refused = run("info", file, "--pieces", tmp_path / "none.png")
        assert refused.returncode == 2
        assert "pieces: acts only where FILE is a point cloud" in " ".join(refused.stderr.split())
        assert not (tmp_path / "none.png").exists()


def test_info_on_levels_of_a_volume(run, files, tmp_path):
    result = run(
        "info", files / "ct.tif", "--level", 0.08, "--plot", tmp_path / "ct.svg", "--json", tmp_path / "ct.json"
    )
    assert result.returncode == 0, result.stderr
    assert "svg" in (tmp_path / "ct.svg").read_text()
    contents = json.loads((tmp_path / "ct.json").read_text())
    assert contents["threshold"] == contents["level"] == 0.08
    assert len(contents["levels"]) == 9
    assert " voids " in result.stdout
    outside = run("info", files / "ct.tif", "--level", 7)
    assert outside.returncode == 2
    assert "range of intensities" in outside.stderr


@pytest.mark.parametrize(
    ("name", "head", "says"),
    [
        ("scan.zip", b"PK\x03\x04", "unpack it"),
        ("scan.vgi", b"{volume1}", ".raw"),
        ("scan.001", b"DICM", "volumes (.tif"),
    ],
)
def test_info_tells_what_a_file_of_an_unknown_type_could_be(run, tmp_path, name, head, says):
    (tmp_path / name).write_bytes(head)
    result = run("info", tmp_path / name)
    assert result.returncode == 2
    assert "unknown file type" in result.stderr
    assert says in result.stderr


def test_points_with_the_papers_intensity_are_a_volume_whose_unit_is_asked_for(run, tmp_path):
    places = np.argwhere(np.ones((4, 5, 6), dtype=bool))
    lines = [f"element vertex {len(places)}", *(f"property float {name}" for name in "xyzf")]
    numbers = [" ".join(map(str, (*place, i % 2))) for i, place in enumerate(places.tolist())]
    text = ["ply", "format ascii 1.0", *lines, "end_header", *numbers]
    (tmp_path / "ct.ply").write_text("\n".join(text) + "\n")
    result = run("info", tmp_path / "ct.ply")
    assert result.returncode == 0, result.stderr
    assert "[4, 5, 6]" in result.stdout
    refused = run("patch", tmp_path / "ct.ply", "-o", tmp_path / "ct.o3l")
    assert refused.returncode == 2
    assert "give ct-unit" in refused.stderr


def test_info_takes_a_volume_without_two_classes(run, tmp_path):
    np.save(tmp_path / "fog.npy", np.random.default_rng(0).normal(size=(20, 20, 20)))
    result = run("info", tmp_path / "fog.npy", "--voxel-spacing", 1, "--plot", tmp_path / "fog.png")
    assert result.returncode == 0, result.stderr
    assert "two classes" in result.stdout
    assert (tmp_path / "fog.png").is_file()


def test_clean_and_render(run, tmp_path):
    sphere = o3d.geometry.TriangleMesh.create_sphere(1.0, 30)
    sphere += o3d.geometry.TriangleMesh.create_sphere(0.01).translate((3, 0, 0))
    o3d.io.write_triangle_mesh(tmp_path / "dirty.ply", sphere)
    cleaned = run("clean", tmp_path / "dirty.ply", "--smallest-component", 0.1, "-o", tmp_path / "clean.ply")
    assert cleaned.returncode == 0, cleaned.stderr
    assert len(o3d.io.read_triangle_mesh(tmp_path / "clean.ply").cluster_connected_triangles()[1]) == 1
    o3d.io.write_point_cloud(tmp_path / "points.ply", sphere.sample_points_uniformly(500))
    how = ("--unit", "mm", "--size", 480, 300)
    drawn = run("render", tmp_path / "clean.ply", tmp_path / "points.ply", "-o", tmp_path / "clean.png", *how)
    assert drawn.returncode == 0, drawn.stderr
    picture = imread(tmp_path / "clean.png")
    assert picture.shape[:2] == (300, 480)
    assert np.ptp(picture[:, :, :3]) > 0.5


def test_figures_are_drawn_and_what_is_left_out_is_said(run, files, tmp_path):
    only = ("--only", "flattened,histogram", "--formats", "png")
    drawn = run("figures", files / "scan.ply", "--midrib", files / "midrib.ply", *only, "-o", tmp_path / "figures")
    assert drawn.returncode == 0, drawn.stderr
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == ["2-flattened.png", "captions.md"]
    assert "histogram: left out" in " ".join(drawn.stderr.split())


def test_view_without_a_screen_says_so(run, files, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    result = run("view", files / "scan.ply")
    assert result.returncode == 2
    assert "no screen" in result.stderr


@pytest.mark.parametrize(
    "command", ["demo", "leaf", "patch", "sample", "info", "clean", "render", "pick", "view", "figures"]
)
def test_each_command_has_help(run, command):
    result = run(command, "--help")
    assert result.returncode == 0
    assert "Usage" in result.stdout
    assert result.stdout == run(command, "-h").stdout


@pytest.mark.slow
def test_a_patch_is_fitted_once_and_used_as_a_model(run, files, tmp_path):
    fitted = run("patch", files / "ct.tif", "-o", tmp_path / "micro.o3l")
    assert fitted.returncode == 0, fitted.stderr
    window = ("--spacing", 0.2, "--region", 20, -1, 22, 1, "--no-picture", "-q", "--midrib", files / "midrib.ply")
    for name, ct in {"model": tmp_path / "micro.o3l", "volume": files / "ct.tif"}.items():
        result = run("leaf", files / "scan.ply", "--ct", ct, *window, "-o", tmp_path / f"{name}.ply")
        assert result.returncode == 0, result.stderr
    assert (tmp_path / "model.ply").read_bytes() == (tmp_path / "volume.ply").read_bytes()


@pytest.mark.slow
def test_demo_writes_mesh_picture_summary_and_model(run, files, tmp_path):
    samples = tmp_path / "samples"
    samples.mkdir()
    for name, source in {
        "wheat_scan.ply": "scan.ply",
        "wheat_midrib.ply": "midrib.ply",
        "wheat_ct_24um.tif": "ct.tif",
    }.items():
        (samples / name).write_bytes((files / source).read_bytes())
    result = run("demo", "--samples", samples, "-o", tmp_path / "demo", "--spacing", 0.6, "-q")
    assert result.returncode == 0, result.stderr
    written = {path.name for path in (tmp_path / "demo").iterdir()}
    assert written == {"leaf.ply", "leaf.png", "leaf.json", "leaf.o3l"}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="on Windows Ctrl-C is for all who share a console, the tests too")
@pytest.mark.parametrize(("sent", "code", "word"), [("SIGINT", 130, "interrupted"), ("SIGTERM", 143, "terminated")])
def test_signals_leave_nothing_behind(files, tmp_path, sent, code, word):
    words = ["leaf", files / "scan.ply", "--ct", files / "ct.tif", "--spacing", "0.04", "-o", tmp_path / "leaf.ply"]
    words += ["--frame", "paper", "--no-picture"]  # whose blade is made sooner, with one tile
    process = subprocess.Popen([*MODULE, *map(str, words)], stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not list(tmp_path.iterdir()) and time.monotonic() < end:  # until it writes, which takes it far longer
        time.sleep(0.05)
    assert process.poll() is None
    process.send_signal(getattr(signal, sent))
    _, rest = process.communicate(timeout=60)
    assert process.returncode == code
    assert rest.strip().splitlines()[-1].startswith(f"o3dleaf: {word}")
    assert list(tmp_path.iterdir()) == []


INTERRUPT = """
import os, signal, sys

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            try:
                signal.raise_signal(signal.SIGINT)
                for _ in range(10):
                    pass  # where the interpreter looks for signals
            except KeyboardInterrupt as cause:
                if {wrapped}:
                    raise ImportError("initialization failed") from cause
                raise

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder())
"""


@pytest.mark.few(module=4)
@pytest.mark.parametrize("wrapped", [False, True], ids=["as it is", "as compiled modules wrap it"])
@pytest.mark.parametrize(
    "module", ["o3dleaf.commands.cli", "typer", "numpy", "open3d", "o3dleaf.surface.mesh.mesh_report"]
)
def test_ctrl_c_while_modules_are_imported_is_one_line(tmp_path, module, wrapped):
    """At a start that takes seconds people press it most."""
    (tmp_path / "sitecustomize.py").write_text(INTERRUPT.format(module=module, wrapped=wrapped))
    places = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    result = subprocess.run(
        [*MODULE, "info", "missing.ply"],
        capture_output=True, text=True, check=False, timeout=60, env=os.environ | {"PYTHONPATH": places},
    )  # fmt: skip
    assert result.returncode == 130
    assert result.stderr == "o3dleaf: interrupted; a file that was not finished has left nothing behind\n"


def test_a_letter_that_the_output_cannot_have_is_a_question_mark():
    """What Windows writes into a file or a pipe has no ρ, which file names and our own lines may have."""
    code = "import o3dleaf.commands.cli as cli; from o3dleaf.__main__ import main\n"
    code += "cli.main = lambda: print('ρ.ply, 12 µm'); main()"
    result = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, check=True, timeout=60, env=os.environ | {"PYTHONIOENCODING": "cp1252"},
    )  # fmt: skip
    assert result.stdout.decode("cp1252").strip() == "?.ply, 12 µm"


def test_the_program_is_the_guarded_one():
    assert '\no3dleaf = "o3dleaf.__main__:main"\n' in (ROOT / "pyproject.toml").read_text()


def test_what_is_read_is_never_written_over(run, files, tmp_path):
    scan, ct = tmp_path / "scan.ply", tmp_path / "ct.tif"
    scan.write_bytes((files / "scan.ply").read_bytes())
    ct.write_bytes((files / "ct.tif").read_bytes())
    before = {path: path.read_bytes() for path in (scan, ct)}
    # Windows lets few users make links, but a name in capitals is the same name.
    link = tmp_path / ("SCAN.PLY" if sys.platform == "win32" else "link.ply")
    if not link.exists():
        link.symlink_to(scan)
    for words in (
        ("leaf", scan, "-o", scan),
        ("leaf", scan, "-o", link),
        ("leaf", scan, "--midrib", link, "-o", scan),
        ("clean", scan, "-o", scan),
    ):
        result = run(*words)
        assert result.returncode == 2
        assert "not overwritten" in result.stderr
    assert all(path.read_bytes() == content for path, content in before.items())


def test_a_read_only_file_is_not_replaced(run, files, tmp_path):
    """A rename would replace it, and root may do anything; the mode is what counts."""
    target = tmp_path / "leaf.ply"
    target.write_text("mine")
    target.chmod(0o444)
    result = run("leaf", files / "scan.ply", "-o", target)
    assert result.returncode == 2
    assert "read-only" in result.stderr
    assert target.read_text() == "mine"


@pytest.mark.slow
def test_an_error_is_one_line_with_the_progress_shown_too(files, tmp_path):
    result = process("leaf", files / "scan.ply", "--scan-unit", "um", "-o", tmp_path / "leaf.ply")
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
