import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf import read_point_cloud
from o3dleaf.io.clouds.counts import count_points
from o3dleaf.io.geometry import read_geometry
from o3dleaf.io.point_cloud import has_faces


def cloud_of(points):
    return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.asarray(points, dtype=np.float64)))


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz"])
def test_what_open3d_wrote_is_read_back(tmp_path, suffix):
    points = np.random.default_rng(0).uniform(0, 100, (50, 3)).round(6)
    o3d.io.write_point_cloud(tmp_path / f"scan{suffix}", cloud_of(points))
    assert np.asarray(read_point_cloud(tmp_path / f"scan{suffix}").points) == pytest.approx(points, abs=1e-5)


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".off"])
def test_the_points_of_a_mesh_are_its_vertices(tmp_path, suffix):
    ball = o3d.geometry.TriangleMesh.create_sphere(5.0, 8).compute_triangle_normals()
    o3d.io.write_triangle_mesh(tmp_path / f"ball{suffix}", ball, write_vertex_normals=False)
    points, truth = np.asarray(read_point_cloud(tmp_path / f"ball{suffix}").points), np.asarray(ball.vertices)
    assert len(points) == len(truth)
    assert cKDTree(truth).query(points)[0].max() < 1e-5


@pytest.mark.parametrize("faces", ["", "f 1 2 3\n"])
def test_an_obj_of_vertices_alone_is_a_cloud_with_colors(tmp_path, faces):
    file = tmp_path / "scan.obj"
    file.write_text("# vertices\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\n" + faces)
    cloud = read_point_cloud(file)
    assert np.asarray(cloud.points).tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert np.asarray(cloud.colors).tolist() == np.eye(3).tolist()
    assert has_faces(file) == bool(faces)
    assert isinstance(read_geometry(file), o3d.geometry.TriangleMesh if faces else o3d.geometry.PointCloud)


def test_a_ply_that_claims_more_than_it_holds_is_refused_before_it_is_read(tmp_path):
    file = tmp_path / "bomb.ply"
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000\n"
    file.write_text(head + "property double x\nproperty double y\nproperty double z\nend_header\n" + 100 * "x")
    with pytest.raises(o3l.errors.InputError, match="cut off"):
        read_point_cloud(file)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.ply", None, "no such file"),
        ("empty.ply", "", "empty"),
        ("text.ply", "hello", "does not begin with 'ply'"),
        ("nothing.ply", "ply\nformat ascii 1.0\nend_header\n", "lists no vertices"),
        ("scan.dxf", "0", "unknown kind"),
        ("words.xyz", "these are words\n", "no line begins"),
        ("two.xyz", "0 0 0\n1 1 1\n", "at least 3"),
        ("nan.xyz", "0 0 0\n1 1 nan\n1 2 3\n4 5 6\n", "NaN"),
    ],
)
def test_a_bad_file_is_refused_with_its_cause(tmp_path, name, content, message):
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    with pytest.raises(o3l.errors.InputError, match=message):
        read_point_cloud(file)


@pytest.mark.parametrize("ascii_text", [True, False])
@pytest.mark.parametrize("colours", [True, False])
def test_a_ply_that_was_cut_off_is_refused(tmp_path, ascii_text, colours):
    whole = cloud_of(np.random.default_rng(3).uniform(0, 100, (500, 3)))
    if colours:
        whole.paint_uniform_color((0.1, 0.5, 0.1))
    o3d.io.write_point_cloud(tmp_path / "scan.ply", whole, write_ascii=ascii_text)
    assert len(read_point_cloud(tmp_path / "scan.ply").points) == 500
    content = (tmp_path / "scan.ply").read_bytes()
    for share in (0.5, 0.9, 0.99):
        (tmp_path / "cut.ply").write_bytes(content[: int(share * len(content))])
        with pytest.raises(o3l.errors.InputError, match="cut off"):
            read_point_cloud(tmp_path / "cut.ply")


def test_an_array_of_a_file_is_the_cloud_that_it_is(tmp_path):
    rows = np.random.default_rng(0).normal(size=(20, 6))
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    for kind in (np.float64, ">f4", np.int16):
        np.save(tmp_path / "a.npy", rows.astype(kind))
        cloud = read_point_cloud(tmp_path / "a.npy")
        assert np.array_equal(cloud.points, rows.astype(kind)[:, :3])
        assert np.array_equal(cloud.normals, rows.astype(kind)[:, 3:])
    np.save(tmp_path / "a.npy", np.asfortranarray(rows[:, :3]))
    assert np.array_equal(read_point_cloud(tmp_path / "a.npy").points, rows[:, :3])
    assert not read_point_cloud(tmp_path / "a.npy").has_normals()
    assert count_points(tmp_path / "a.npy") == 20


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.ones((9, 4)), r"shape \(9, 4\); give \(n, 3\)"),
        (np.ones((9, 3, 3)), r"shape \(9, 3, 3\)"),
        (np.ones((9, 3), dtype=complex), "complex"),
        (np.full((9, 3), None), "Python objects"),
        (np.ones((0, 3)), "no points"),
    ],
)
def test_an_array_that_is_no_cloud_is_refused_with_its_cause(tmp_path, array, message):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(o3l.errors.InputError, match=message):
        read_point_cloud(tmp_path / "a.npy")


def test_an_array_that_was_cut_off_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((9, 3)))
    whole = (tmp_path / "a.npy").read_bytes()
    for size in (5, 100, len(whole) - 1):
        (tmp_path / "a.npy").write_bytes(whole[:size])
        with pytest.raises(o3l.errors.InputError, match="cut off"):
            read_point_cloud(tmp_path / "a.npy")
        assert count_points(tmp_path / "a.npy") == 0
