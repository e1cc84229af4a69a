"""What is written reads back; what fails leaves nothing behind."""

import re

import numpy as np
import open3d as o3d
import pytest

from mesh_fields import sphere
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.io import obj, ply, stl
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.mesh_data import MeshData
from o3dleaf.io.triangle_mesh import read_mesh, write_mesh
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import STL_DIGITS


@pytest.fixture(scope="module")
def ball():
    return extract_isosurface(sphere(), 0.2)


def test_ply_keeps_every_digit(ball, tmp_path):
    write_mesh(ball, tmp_path / "ball.ply")
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.ply")
    assert np.array_equal(np.asarray(again.vertices), np.asarray(ball.vertices))
    assert np.array_equal(np.asarray(again.triangles), np.asarray(ball.triangles))
    assert not ball.has_triangle_normals()


@pytest.mark.parametrize("normals", [False, True])
def test_obj_keeps_every_digit(ball, tmp_path, monkeypatch, normals):
    monkeypatch.setattr(obj, "BLOCK", 100)
    mesh = o3d.geometry.TriangleMesh(ball)
    if normals:
        mesh.compute_vertex_normals()
    write_mesh(mesh, tmp_path / "ball.obj")
    rows = [line.split() for line in (tmp_path / "ball.obj").read_text(encoding="ascii").splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], dtype=np.float64)
    faces = np.array([[corner.split("/")[0] for corner in row[1:]] for row in rows if row[0] == "f"], dtype=int) - 1
    assert np.array_equal(vertices, np.asarray(ball.vertices))
    assert np.array_equal(faces, np.asarray(ball.triangles))
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.obj")
    assert len(again.triangles) == len(ball.triangles)
    assert again.has_vertex_normals() == normals


def test_stl_has_the_triangles_and_their_normals(ball, tmp_path):
    write_mesh(ball, tmp_path / "ball.STL")
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.STL")
    vertices, triangles = mesh_arrays(again)
    expected = np.asarray(ball.vertices)[np.asarray(ball.triangles)]
    assert np.abs(vertices[triangles] - expected).max() < STL_DIGITS
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    facets = np.frombuffer((tmp_path / "ball.STL").read_bytes()[84:], dtype=record)
    middle = facets["corners"].mean(axis=1)
    assert (np.einsum("ij,ij->i", facets["normal"], middle) > 0).all()
    assert not ball.has_triangle_normals()


def test_arrays_and_tensor_meshes_are_written_too(ball, tmp_path):
    for name, mesh in [("a.ply", mesh_arrays(ball)), ("b.ply", o3d.t.geometry.TriangleMesh.from_legacy(ball))]:
        write_mesh(mesh, tmp_path / name)
        assert len(o3d.io.read_triangle_mesh(tmp_path / name).triangles) == len(ball.triangles)


@pytest.mark.parametrize("suffix", [".ply", ".stl"])
@pytest.mark.parametrize("carried", [(), ("normals",), ("colors",), ("normals", "colors")])
def test_a_plain_mesh_is_written_byte_for_byte_as_by_open3d(ball, tmp_path, monkeypatch, suffix, carried):
    for module in (ply, stl):
        monkeypatch.setattr(module, "BLOCK", 100)
    mesh = o3d.geometry.TriangleMesh(ball)
    if "normals" in carried:
        mesh.compute_vertex_normals()
    if "colors" in carried:
        shades = np.random.default_rng(0).integers(0, 511, (len(mesh.vertices), 3)) / 510  # halves of a byte among them
        mesh.vertex_colors = o3d.utility.Vector3dVector(shades)
    mesh.compute_triangle_normals()  # without which Open3D leaves an empty STL
    write_mesh(mesh, tmp_path / f"ours{suffix}")
    o3d.io.write_triangle_mesh(tmp_path / f"theirs{suffix}", mesh)
    assert (tmp_path / f"ours{suffix}").read_bytes() == (tmp_path / f"theirs{suffix}").read_bytes()


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl"])
@pytest.mark.parametrize("labelled", [False, True])
def test_a_labelled_mesh_is_read_as_it_was_written(ball, tmp_path, suffix, labelled):
    labels = (np.arange(len(ball.triangles)) % 3 if labelled else np.zeros(0)).astype(np.uint8)
    written = LabelledMesh(ball, np.sort(labels) if labelled else None, unit="mm")
    write_mesh(written, tmp_path / f"ball{suffix}")
    read = read_mesh(tmp_path / f"ball{suffix}")
    corners = [np.asarray(each.mesh.vertices)[np.asarray(each.mesh.triangles)] for each in (written, read)]
    # Open3D reads OBJ in single precision.
    single = suffix == ".stl" or (suffix == ".obj" and not labelled)
    assert np.abs(corners[0] - corners[1]).max() <= (STL_DIGITS if single else 0)
    assert np.array_equal(read.labels, written.labels) if labelled else read.labels is None
    assert read.names == written.names
    assert read.unit == ("mm" if suffix == ".ply" else None)


def test_labels_do_not_cost_a_mesh_its_colors(ball, tmp_path):
    mesh = o3d.geometry.TriangleMesh(ball).paint_uniform_color([0.2, 0.4, 0.6])
    write_mesh(LabelledMesh(mesh, np.zeros(len(mesh.triangles), dtype=np.uint8)), tmp_path / "ball.ply")
    again = o3d.io.read_triangle_mesh(tmp_path / "ball.ply")
    assert np.array_equal(np.asarray(again.vertex_colors), np.asarray(mesh.vertex_colors))


def test_a_labelled_mesh_says_what_it_is_in_a_line(ball):
    labels = np.zeros(len(ball.triangles), dtype=np.uint8)
    words = repr(LabelledMesh(ball, labels, ("top", "bottom"), "mm"))
    assert re.fullmatch(r"LabelledMesh\([\d,]+ vertices, [\d,]+ triangles, labels top/bottom, unit mm\)", words)


@pytest.mark.parametrize(
    ("name", "mesh", "words"),
    [
        ("leaf.xyz", None, "unknown suffix"),
        ("leaf", None, "unknown suffix"),
        ("missing/leaf.ply", None, "folder"),
        ("leaf.ply", o3d.geometry.TriangleMesh(), "no triangles"),
    ],
)
def test_what_cannot_be_written_is_refused_and_leaves_nothing(ball, tmp_path, name, mesh, words):
    with pytest.raises(InputError, match=words):
        write_mesh(ball if mesh is None else mesh, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_and_nothing_else(ball, tmp_path, monkeypatch, suffix, error):
    """In the middle: vertices are written, triangles fail."""
    path = tmp_path / f"ball{suffix}"
    path.write_text("old")

    def fail(*_):
        raise error

    monkeypatch.setattr(MeshData, "triangle_block", fail)
    with pytest.raises(O3DLeafError if isinstance(error, OSError) else KeyboardInterrupt):
        write_mesh(ball, path)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "old"
