"""Exports from file to file: of models and meshes, by the command line and below it."""

import json
from pathlib import Path

import numpy as np
import pytest

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf.commands.export import ExportJob
from o3dleaf.commands.info import InfoJob
from o3dleaf.core.errors import InputError
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.output.export.consumers import export_mesh
from o3dleaf.output.export.leaf_scalars import field_deviation
from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.reconstruction.fit import surface_data
from tolerances import FIRST_ORDER, FLAT_FACES

REGION = ((4.0, -1.0), (7.0, 1.0))


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.31**2 - z**2 + 0.0 * x), height=0.4)[0]


@pytest.fixture(scope="module")
def model(leaf, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "leaf.o3l"
    leaf.save(path)
    return path


def test_a_model_becomes_a_closed_mesh_for_openfoam(leaf, model, tmp_path):
    run = ExportJob(model, tmp_path / "a.obj", consumer="openfoam", spacing=0.5, no_remesh=True, origin=(1.0, 2.0, 3.0))
    said = run.run()
    made = leaf.plan_mesh(0.5, closed=True).extract()
    found = read_mesh(tmp_path / "a.obj")
    assert said == f"{len(made.mesh.triangles):,} triangles"
    assert mesh_report(found.mesh).watertight
    assert np.array_equal(np.asarray(found.mesh.vertices), (np.asarray(made.mesh.vertices) - [1.0, 2.0, 3.0]) * 1e-3)
    assert np.bincount(found.labels).tolist() == np.bincount(made.labels).tolist()
    # A mesh in memory knows its unit, too.
    export_mesh(made, tmp_path / "b.obj", consumer="openfoam")
    assert np.array_equal(
        np.asarray(read_mesh(tmp_path / "b.obj").mesh.vertices), np.asarray(made.mesh.vertices) * 1e-3
    )


@pytest.mark.slow
def test_a_solver_gets_a_remeshed_leaf(leaf, model, tmp_path):
    ExportJob(model, tmp_path / "a.stl", consumer="gmsh", spacing=0.5, region=REGION).run()
    ExportJob(model, tmp_path / "b.ply", spacing=0.5, remesh=0.4, region=REGION).run()
    surface = leaf.plan_mesh(0.5, REGION, closed=True)
    for name, edge in (("a.stl", 0.5), ("b.ply", 0.4)):
        found, made = read_mesh(tmp_path / name), surface.extract(remesh=edge)
        corners, ours = (np.asarray(m.mesh.vertices)[np.asarray(m.mesh.triangles)] for m in (found, made))
        # In STL the solids come one by one.
        assert np.array_equal(corners, ours[np.argsort(made.labels, kind="stable")] if name == "a.stl" else ours)
        assert mesh_report(found.mesh).watertight


@pytest.mark.parametrize(
    ("consumer", "how", "edge"),
    [
        ("openfoam", {}, 0.5),
        ("dualsphysics", {}, 0.5),
        ("gmsh", {"remesh": 0.4}, 0.4),
        ("gmsh", {"no_remesh": True}, None),
        ("gmsh", {"tile": True}, None),
        ("paraview", {}, None),
        (None, {"remesh": 0.4}, 0.4),
        (None, {}, None),
    ],
)
def test_who_gets_which_edge(consumer, how, edge):
    assert ExportJob(Path("a.o3l"), Path("a.stl"), consumer=consumer, spacing=0.5, **how).edge == edge


def test_what_cannot_be_remeshed_is_refused(leaf, model, tmp_path):
    leaf.texture.save(tmp_path / "t.o3l")
    for source, how, words in (
        (model, {"tile": True}, "remesh: cannot act with tile"),
        (tmp_path / "t.o3l", {}, "walls of a tile must match"),
        (model, {"no_remesh": True}, "remesh: cannot act with no-remesh"),
        (model, {"remesh": -1.0}, "above zero"),
        (tmp_path / "b.ply", {}, "acts only where SOURCE is a model"),
    ):
        with pytest.raises(InputError, match=words):
            ExportJob(source, tmp_path / "a.ply", **({"spacing": 0.5, "remesh": 0.4} | how)).run()
    assert not (tmp_path / "a.ply").exists()


def test_a_tile_and_a_texture_become_the_same_block(leaf, model, tmp_path):
    leaf.texture.save(tmp_path / "t.o3l")
    ExportJob(model, tmp_path / "a.ply", spacing=0.25, tile=True).run()
    ExportJob(tmp_path / "t.o3l", tmp_path / "b.ply", spacing=0.25).run()
    blocks = [read_mesh(tmp_path / name) for name in ("a.ply", "b.ply")]
    assert np.array_equal(*(np.asarray(block.mesh.vertices) for block in blocks))
    assert mesh_report(blocks[0].mesh).watertight


def test_particles_and_distances_of_a_mesh(model, tmp_path):
    ExportJob(model, tmp_path / "a.ply", spacing=0.5).run()
    assert read_mesh(tmp_path / "a.ply").unit == "mm"
    source = tmp_path / "a.ply"
    assert "particles" in ExportJob(source, tmp_path / "s.csv", what="surface-particles", step=0.5, to_unit="m").run()
    assert "particles" in ExportJob(source, tmp_path / "v.csv", what="volume-particles", step=0.2).run()
    first = np.loadtxt(tmp_path / "s.csv", delimiter=",", skiprows=2)[:, :3]
    second = np.loadtxt(tmp_path / "v.csv", delimiter=",", skiprows=2)[:, :3]
    assert np.abs(first.max(axis=0) * 1000 - second.max(axis=0)).max() < 0.5
    bounds = ((5.0, -1.0, 0.0), (6.0, 1.0, 1.0))
    moved = ExportJob(source, tmp_path / "d.npy", what="distance", step=0.1, bounds=bounds, origin=(5.0, 0.0, 0.4))
    moved.run()
    values = np.load(tmp_path / "d.npy").T
    assert values.shape == (11, 21, 11)
    # The blade is flat, 0.31 to both sides of a height of 0.4.
    heights = np.abs(np.linspace(-0.4, 0.6, 11)) - 0.31
    assert np.abs(values - heights).max() < FLAT_FACES


def test_one_part_is_the_triangles_of_its_label(leaf, model, tmp_path):
    ExportJob(model, tmp_path / "a.ply", spacing=0.5, part="adaxial").run()
    made, found = leaf.plan_mesh(0.5, closed=True).extract(), read_mesh(tmp_path / "a.ply")
    ours, whole = (np.asarray(mesh.mesh.vertices)[np.asarray(mesh.mesh.triangles)] for mesh in (found, made))
    assert np.array_equal(ours, whole[made.labels == 0])
    assert mesh_report(found.mesh).boundary_loops == 1


def test_scalars_are_those_of_the_field(leaf, model, tmp_path):
    points = np.array([[5.0, 0.2, 0.72], [6.0, 0.1, 0.08], [4.0, 0.3, 0.69]])
    assert np.abs(field_deviation(leaf, points) - [0.01, 0.01, -0.02]).max() < FIRST_ORDER
    run = ExportJob(model, tmp_path / "a.vtp", spacing=0.5, sheets=True, scalar=("deviation", "curvature"))
    run.run()
    header = (tmp_path / "a.vtp").read_bytes()
    assert b'Name="deviation"' in header
    assert b'Name="curvature"' in header


@pytest.mark.parametrize(
    ("name", "how", "words"),
    [
        ("a.ply", {}, "give the mesh spacing"),
        ("a.ply", {"spacing": 0.5, "what": "soup"}, "unknown 'soup'"),
        ("a.ply", {"spacing": 0.5, "what": "volume-particles"}, "step"),
        ("a.stl", {"spacing": 0.5, "what": "volume-particles", "step": 1.0}, "unknown suffix"),
        ("a.ply", {"what": "surface-particles", "step": 1.0, "consumer": "web"}, "for: cannot act where --what is"),
        ("a.ply", {"spacing": 0.5, "scalar": ("taste",)}, "taste"),
        ("a.ply", {"spacing": 0.5, "tile": True, "scalar": ("curvature",)}, "scalar: cannot act with tile"),
        ("a.ply", {"spacing": -1.0}, "above zero"),
        ("a.ply", {"spacing": 0.5, "part": "petiole"}, "petiole"),
        ("a.ply", {"spacing": 0.5, "part": "rim", "sheets": True}, "no triangle has the label rim"),
        ("nowhere/a.ply", {"spacing": 0.5}, "folder"),
    ],
)
def test_wrong_settings_are_refused_and_leave_nothing(model, tmp_path, name, how, words):
    with pytest.raises(InputError, match=words):
        ExportJob(model, tmp_path / name, **how).run()
    assert list(tmp_path.iterdir()) == []


def test_the_command_line_takes_all_of_it(run, model, tmp_path):
    done = run("export", model, "--spacing", 1, "--no-remesh", "--for", "gmsh", "-o", tmp_path / "a.stl")
    assert done.returncode == 0, done.stderr
    assert "triangles" in done.stdout
    assert read_mesh(tmp_path / "a.stl").names == ("adaxial", "abaxial", "rim")
    done = run("export", model, "--spacing", 0.5, "--open", "--for", "gmsh", "-o", tmp_path / "b.stl", "-q")
    assert done.returncode == 2
    assert "needs a closed mesh" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.stl"]


@pytest.fixture(scope="module")
def sphere_model(tmp_path_factory):
    """The cloud of a sphere, and the path of its field."""
    points, normals = o3l.samples.Sphere().sample(1_500, seed=1)
    path = tmp_path_factory.mktemp("field") / "sphere.o3l"
    cloud = o3l.OrientedCloud.of(points, normals)
    o3l.fit_surface(cloud, rho=0.0, unit="mm").save(path)
    return cloud, path


def test_info_tells_what_a_model_is_made_of(leaf, model, sphere_model, tmp_path, capsys):
    cloud, path = sphere_model
    told = InfoJob(path, json=tmp_path / "a.json").run()
    field = o3l.load(path)
    assert told["kind"] == "model of a field"
    assert (told["points"], told["balls"]) == (len(surface_data(cloud).points), len(field.cover.radii))
    assert (told["kernel"], told["local"], told["unit"]) == ("r^3", "splines of values", "mm")
    assert np.array_equal(told["bounds"], field.bounds)
    assert json.loads((tmp_path / "a.json").read_text()) == told
    told = InfoJob(model).run()
    assert (told["kind"], told["class"], told["unit"]) == ("model of a leaf", "MultiscaleLeaf", leaf.unit)
    leaf.texture.save(tmp_path / "texture.o3l")
    assert InfoJob(tmp_path / "texture.o3l").run()["kind"] == "model of a micro-structure"


def test_a_field_is_no_mesh_and_the_line_says_what_makes_one(sphere_model, tmp_path):
    cloud, path = sphere_model
    with pytest.raises(InputError, match="export the mesh that `o3dleaf reconstruct` wrote") as refused:
        ExportJob(path, tmp_path / "a.stl", spacing=0.1).run()
    call = str(refused.value).partition("make one by ")[2]
    made = eval(call, {"o3l": o3l, "points": cloud.points})
    assert mesh_report(made).watertight
