"""``o3dleaf reconstruct``: a cloud in; a mesh with its support, a model and a picture out; bad input in one line."""

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from o3dleaf import samples


@pytest.fixture
def scan(tmp_path):
    """Return the file of a cloud with normals in which one point is NaN."""
    points, normals = samples.Torus().sample(2_000, seed=1)
    points[17] = np.nan
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(points))
    cloud.point.normals = o3d.core.Tensor(normals)
    path = tmp_path / "scan.ply"
    o3d.t.io.write_point_cloud(str(path), cloud)
    return path


def test_all_that_a_run_writes(run, scan, tmp_path):
    """Mesh, model and picture are there, belong together, and what was decided is on the screen."""
    mesh, model, picture = tmp_path / "mesh.ply", tmp_path / "field.o3l", tmp_path / "picture.png"
    options = ("--spacing", "0.03", "--model", model, "--picture", picture, "--unit", "mm", "--measure", "residual")
    done = run("reconstruct", scan, "-o", mesh, *options)
    assert done.returncode == 0, done.stderr
    assert "1 not finite" in done.stderr
    assert "1 piece, closed, genus 1, manifold, no crossings, area" in done.stdout
    written = o3d.t.io.read_point_cloud(str(mesh))
    assert {"distance", "weight", "residual", "colors"} <= set(dict(written.point.items()))
    field = o3l.load(model)
    assert field.unit == "mm"
    assert np.abs(field(written.point.positions.numpy())).max() < 0.01 * 0.03
    assert picture.stat().st_size > 10_000
    assert o3l.mesh_report(o3d.io.read_triangle_mesh(str(mesh))).genus == 1


@pytest.mark.few(suffix=1)
@pytest.mark.parametrize("suffix", [".ply", ".obj"])
def test_a_mesh_in_place_of_a_cloud_is_told(run, scan, tmp_path, suffix):
    """Its vertices are taken, which may be few and uneven; of a cloud in the same format nothing is said."""
    ball = o3d.geometry.TriangleMesh.create_sphere(1.0, 20)
    o3d.io.write_triangle_mesh(str(tmp_path / f"ball{suffix}"), ball)
    done = run("reconstruct", tmp_path / f"ball{suffix}", "-o", tmp_path / "mesh.ply")
    assert done.returncode == 0, done.stderr
    assert f"is a mesh: its {len(ball.vertices)} vertices are taken for points" in " ".join(done.stderr.split())
    assert "is a mesh" not in run("reconstruct", scan, "-o", tmp_path / "mesh.ply").stderr


def test_a_red_cloud_is_red(run, small_pictures, tmp_path):
    """In the mesh, in the picture beside it, and in a picture of the mesh."""
    points, normals = samples.Torus().sample(1_500, seed=1)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    cloud.paint_uniform_color([1, 0, 0])
    o3d.io.write_point_cloud(str(tmp_path / "red.ply"), cloud)
    done = run("reconstruct", tmp_path / "red.ply", "-o", tmp_path / "mesh.ply", "--picture", tmp_path / "one.png")
    assert done.returncode == 0, done.stderr
    mesh = o3d.io.read_triangle_mesh(str(tmp_path / "mesh.ply"))
    np.testing.assert_array_equal(np.asarray(mesh.vertex_colors), np.broadcast_to([1, 0, 0], (len(mesh.vertices), 3)))
    assert mesh.has_vertex_normals()
    assert run("render", tmp_path / "mesh.ply", "--size", 400, 250, "-o", tmp_path / "two.png").returncode == 0
    for name in ("one.png", "two.png"):
        pixels = np.asarray(o3d.io.read_image(str(tmp_path / name)))[..., :3].astype(float)
        solid = np.ptp(pixels, axis=2) > 60  # neither paper nor ink
        assert solid.mean() > 0.1
        assert (pixels[solid].argmax(axis=1) == 0).all()


def test_what_no_data_support_can_be_kept(run, tmp_path):
    """Untrimmed, a patch of a plane is larger than its data by four spacings on all sides."""
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(size=(900, 2)), np.zeros(900)])
    path = tmp_path / "patch.xyz"
    np.savetxt(path, points)
    area = {}
    for name, options in (("trimmed.ply", ()), ("whole.ply", ("--untrimmed",))):
        done = run("reconstruct", path, "-o", tmp_path / name, *options)
        assert done.returncode == 0, done.stderr
        area[name] = o3d.io.read_triangle_mesh(str(tmp_path / name)).get_surface_area()
    assert area["trimmed.ply"] == pytest.approx(1.0, abs=0.1)
    assert area["whole.ply"] > 1.3


def test_normals_face_the_place_that_a_cloud_was_scanned_from(run, tmp_path):
    """A ball scanned from its center is a room: its mesh faces inward."""
    points, _ = samples.Sphere().sample(1_500, seed=2)
    np.savetxt(tmp_path / "room.xyz", points)
    done = run("reconstruct", tmp_path / "room.xyz", "--viewpoint", "0,-0.1,0", "-o", tmp_path / "room.ply")
    assert done.returncode == 0, done.stderr
    mesh = o3d.io.read_triangle_mesh(str(tmp_path / "room.ply"))
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() < 0


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--viewpoint", "1,2"), "viewpoint"),
        (("--viewpoint", "a,b,c"), "viewpoint"),
        (("--local", "voodoo"), "voodoo"),
        (("--measure", "luck"), "luck"),
        (("--closed", "maybe"), "maybe"),
        (("--rho", "much"), "much"),
        (("--spacing", "-1"), "spacing"),
        (("--unit", "furlong"), "furlong"),
        (("--model", "field.txt"), "suffix"),
        (("-o", "mesh.gltf"), "suffix"),
        (("-o", "scan.ply"), "is an input and is not overwritten"),
    ],
)
def test_bad_options_are_one_line_before_any_file(run, scan, tmp_path, monkeypatch, options, why):
    """The line names what is wrong; nothing is written."""
    monkeypatch.chdir(tmp_path)
    words = options if "-o" in options else ("-o", "mesh.ply", *options)
    before = sorted(tmp_path.iterdir()), scan.read_bytes()
    done = run("reconstruct", "scan.ply", *words, "--quiet")
    assert done.returncode != 0
    assert why in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert (sorted(tmp_path.iterdir()), scan.read_bytes()) == before


@pytest.mark.parametrize("kind", ["blob", "line", "few"])
def test_no_surface_no_file(run, tmp_path, kind):
    """A volume, a line and a handful of points are refused in one line that says so."""
    rng = np.random.default_rng(3)
    points = {"blob": rng.uniform(size=(2_000, 3)), "line": np.outer(np.arange(99.0), [1, 2, 3]), "few": np.eye(3)}
    np.savetxt(tmp_path / "scan.xyz", points[kind])
    done = run("reconstruct", tmp_path / "scan.xyz", "-o", tmp_path / "mesh.ply", "--quiet")
    assert done.returncode != 0
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "mesh.ply").exists()


def test_a_scene_is_refused_with_the_command_that_makes_it_of_a_mesh(run, scan, tmp_path):
    refused = run("reconstruct", scan, "-o", tmp_path / "a.glb")
    assert refused.returncode == 2
    command = refused.stderr.partition("`o3dleaf ")[2].partition("`")[0].replace("UNIT", "mm")
    assert run("reconstruct", scan, "-o", tmp_path / "a.ply").returncode == 0
    assert run(*command.split()).returncode == 0
    assert (tmp_path / "a.glb").read_bytes()[:4] == b"glTF"
