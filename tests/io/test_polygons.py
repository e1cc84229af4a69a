"""Faces of any number of corners, in every format that has them, are covered by their triangles once."""

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dleaf.core.mesh_arrays import mesh_arrays, triangle_areas
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.polygons.triangulation import triangulate
from o3dleaf.io.triangle_mesh import read_mesh, read_triangle_mesh
from tolerances import PACKED_COLOR, POLYGON_AREA, TEXT_DIGITS

STAR = [(0, 0), (4, 0), (4, 3), (2, 1), (0, 3)]
"""A pentagon with a notch: its fan from the first corner is right, from others it is not."""


def area_of(outline):
    x, y = np.array(outline).T
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


@given(
    radii=st.lists(st.floats(0.1, 3.0), min_size=3, max_size=12),
    tilt=st.tuples(*[st.floats(-2, 2)] * 2),
    first=st.integers(0, 11),
)
def test_triangles_cover_a_face_once_and_look_its_way(radii, tilt, first):
    """Of a star about the origin, notched anywhere, tilted in space: all areas add up, and none is turned."""
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.roll(np.array(radii)[:, np.newaxis] * np.column_stack([np.cos(angles), np.sin(angles)]), first, axis=0)
    vertices = np.column_stack([flat, flat @ tilt])
    triangles, faces = triangulate(vertices, np.array([len(radii)]), np.arange(len(radii)), "it")
    assert len(triangles) == len(radii) - 2
    assert not faces.any()
    edges = vertices[triangles][:, 1:, :2] - vertices[triangles][:, :1, :2]
    turns = 0.5 * (edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    assert turns.sum() == pytest.approx(area_of(flat), rel=POLYGON_AREA)
    assert np.abs(turns).sum() == pytest.approx(area_of(flat), rel=POLYGON_AREA)


def written(name):
    """Return a file with a notched pentagon, a quadrilateral and a triangle."""
    vertices = [(*corner, 0) for corner in STAR] + [(9, 9, 1)]
    faces = [(3, 4, 0, 1, 2), (0, 1, 2, 4), (0, 1, 5)]
    rows = [" ".join(map(str, row)) for row in vertices]
    if name == "a.obj":
        words = [" ".join(f"{corner + 1}/7/1" for corner in face) for face in faces[:2]] + ["-6 -5 -1"]
        lines = ["mtllib none.mtl", *(f"v {row}" for row in rows), "vn 0 0 1", *(f"f {each}" for each in words)]
        return "\n".join(lines)
    body = [*rows, *(" ".join(map(str, (len(face), *face))) for face in faces)]
    if name == "a.off":
        return "\n".join(["OFF", "6 3 0", *body])
    head = ["ply", "format ascii 1.0", "element vertex 6", *(f"property float {axis}" for axis in "xyz")]
    return "\n".join([*head, "element face 3", "property list uchar int vertex_index", "end_header", *body, ""])


@pytest.mark.parametrize("read", [lambda file: read_mesh(file).mesh, read_triangle_mesh])
@pytest.mark.parametrize("name", ["a.obj", "a.off", "a.ply"])
def test_no_face_is_lost(tmp_path, name, read):
    (tmp_path / name).write_text(written(name))
    vertices, triangles = mesh_arrays(read(tmp_path / name))
    assert (len(vertices), len(triangles)) == (6, 3 + 2 + 1)
    areas = triangle_areas(vertices, triangles)
    assert areas[:3].sum() == pytest.approx(area_of(STAR), rel=POLYGON_AREA)


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_binary_ply_of_mixed_faces_and_lists_beside_points(tmp_path, order):
    words = {"<": "little", ">": "big"}[order]
    vertices = [(*corner, 0) for corner in STAR]
    head = (
        f"ply\nformat binary_{words}_endian 1.0\nelement vertex 5\nproperty float x\nproperty list uchar short more\n"
        "property double y\nproperty float z\nelement face 2\nproperty list ushort uint vertex_indices\nend_header\n"
    )
    body = b"".join(
        np.array([x], f"{order}f4").tobytes() + bytes([k]) + bytes(2 * k) + np.array([y], f"{order}f8").tobytes()
        + np.array([z], f"{order}f4").tobytes()
        for k, (x, y, z) in enumerate(vertices)
    )  # fmt: skip
    for face in ((0, 1, 2, 3, 4), (0, 1, 2)):
        body += np.array([len(face)], f"{order}u2").tobytes() + np.array(face, f"{order}u4").tobytes()
    (tmp_path / "a.ply").write_bytes(head.encode() + body)
    read, triangles = mesh_arrays(read_triangle_mesh(tmp_path / "a.ply"))
    np.testing.assert_array_equal(read, vertices)
    assert len(triangles) == 4


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.ply", {}), ("a.ply", {"write_ascii": True}), ("a.pcd", {}), ("a.pcd", {"write_ascii": True}),
        ("a.pcd", {"compressed": True}),
    ],
)  # fmt: skip
def test_clouds_are_what_open3d_wrote(tmp_path, name, options):
    rng = np.random.default_rng(0)
    points = np.round(rng.normal(size=(3000, 3)), 1)  # which packs well, so that what is packed refers back
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(points / np.linalg.norm(points + 1e-9, axis=1)[:, np.newaxis])
    cloud.colors = o3d.utility.Vector3dVector(rng.uniform(size=(3000, 3)))
    assert o3d.io.write_point_cloud(tmp_path / name, cloud, **options)
    read = read_point_cloud(tmp_path / name)
    np.testing.assert_allclose(read.points, points, rtol=0, atol=TEXT_DIGITS)
    np.testing.assert_allclose(read.normals, cloud.normals, rtol=0, atol=TEXT_DIGITS)
    np.testing.assert_allclose(read.colors, cloud.colors, rtol=0, atol=PACKED_COLOR)
    theirs = o3d.io.read_point_cloud(tmp_path / name)
    np.testing.assert_array_equal(read.points, theirs.points)
    np.testing.assert_array_equal(read.colors, theirs.colors)
