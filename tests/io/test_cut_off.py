"""A file that was cut off is never read as if it were whole, and a whole one always is."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import read_mesh, read_triangle_mesh

POINTS = np.random.default_rng(0).normal(size=(200, 3))
SHARES = (0.2, 0.5, 0.8, 0.99)


def cloud_file(folder, name, *, text):
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    if name.endswith("xyzn"):
        cloud.normals = cloud.points
    file = folder / name
    assert o3d.io.write_point_cloud(file, cloud, write_ascii=text, compressed=name.startswith("compressed"))
    return file


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("binary.ply", False), ("text.ply", True), ("binary.pcd", False), ("compressed.pcd", False),
        ("text.pcd", True), ("text.pts", True),
    ],
)  # fmt: skip
def test_clouds_that_say_how_many_points_they_have(tmp_path, name, text):
    file = cloud_file(tmp_path, name, text=text)
    whole = file.read_bytes()
    assert len(read_point_cloud(file).points) == len(POINTS)
    for share in SHARES:
        file.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match="cut off"):
            read_point_cloud(file)


@pytest.mark.parametrize("name", ["points.xyz", "points.xyzn"])
def test_columns_that_end_in_the_middle_of_a_line(tmp_path, name):
    file = cloud_file(tmp_path, name, text=True)
    lines = file.read_bytes().splitlines(keepends=True)
    assert len(read_point_cloud(file).points) == len(POINTS)
    file.write_bytes(b"".join(lines[:99]) + lines[99].rsplit(b" ", 1)[0])
    with pytest.raises(InputError, match="fewer columns"):
        read_point_cloud(file)
    file.write_bytes(b"".join(lines[:99]))
    assert len(read_point_cloud(file).points) == 99
    file.write_bytes(b"// exported by a scanner with much to say of itself\n" + b"".join(lines))
    assert len(read_point_cloud(file).points) == len(POINTS)


@pytest.mark.parametrize("read", [read_mesh, read_triangle_mesh])
@pytest.mark.parametrize(("name", "text"), [("binary.ply", False), ("text.ply", True), ("mesh.off", True)])
def test_meshes_that_say_how_many_faces_they_have(tmp_path, read, name, text):
    sphere, file = o3d.geometry.TriangleMesh.create_sphere(resolution=8), tmp_path / name
    assert o3d.io.write_triangle_mesh(file, sphere, write_ascii=text)
    whole = file.read_bytes()
    read(file)
    for share in SHARES:
        file.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(InputError, match=r"cut off|no triangles"):
            read(file)


def test_faces_of_more_corners_are_whole_as_two_triangles(tmp_path):
    file = tmp_path / "quads.off"
    file.write_text("OFF\n# a comment\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    assert len(read_triangle_mesh(file).triangles) == 2


@pytest.mark.parametrize("last", ["f 1 2\n", "f 1", "v 1 2", "v 0.1 0."])
def test_an_obj_that_ends_in_the_middle_of_a_line(tmp_path, last):
    file = tmp_path / "mesh.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" + last)
    with pytest.raises(InputError, match="cut off"):
        read_mesh(file)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.pts", b"0 0 0\n1 0 0\n0 1 0\n"), ("a.pcd", b"VERSION 0.7\nFIELDS x y z\n"),
        ("a.pcd", b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 9\nDATA ascii\n0 0 0\n"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 1000000000\nDATA binary\n" + bytes(99)),
    ],
)  # fmt: skip
def test_headers_that_are_none_or_lie(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_point_cloud(tmp_path / name)
    assert "\n" not in str(caught.value)
