"""A mesh as a solid: its closest points are those of the surface that it triangulates."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.core.errors import InputError
from o3dleaf.samples import Block, MeshSolid
from tolerances import SINGLE_PRECISION_FOOT, SOLID_FOOT

BLOCK = o3d.geometry.TriangleMesh.create_box(1.0, 0.7, 0.4).translate([-0.5, -0.35, -0.2])


@pytest.fixture(scope="module")
def twins():
    return MeshSolid.of(BLOCK), Block()


def test_the_mesh_of_a_block_is_as_far_as_the_block(twins):
    mesh, block = twins
    low, high = block.bounds
    points = np.random.default_rng(0).uniform(low, high, (4000, 3))
    found, true = mesh.closest(points), block.closest(points)
    assert np.abs(found.distance - true.distance).max() < SINGLE_PRECISION_FOOT
    assert np.abs(np.linalg.norm(points - found.points, axis=1) - np.abs(found.distance)).max() < SOLID_FOOT
    assert np.abs(block.signed_distance(found.points)).max() < SOLID_FOOT
    assert mesh.area == pytest.approx(block.area)


def test_samples_lie_on_the_faces_with_their_normals(twins):
    mesh, block = twins
    points, normals = mesh.sample(2000)
    feet = block.closest(points)
    assert np.abs(feet.distance).max() < SOLID_FOOT
    assert np.abs(normals - feet.normals).max() < SOLID_FOOT


def test_the_side_that_triangles_face_and_doubled_vertices_do_not_matter(twins):
    mesh, _ = twins
    vertices, triangles = np.asarray(BLOCK.vertices), np.asarray(BLOCK.triangles)
    soup = vertices[triangles[:, ::-1]].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    other = MeshSolid.of(soup)
    points = mesh.sample(100)[0] + 0.01
    assert np.array_equal(other.signed_distance(points), mesh.signed_distance(points))


def test_an_open_mesh_bounds_nothing():
    vertices, triangles = np.asarray(BLOCK.vertices), np.asarray(BLOCK.triangles)
    with pytest.raises(InputError, match="3 edges are not of two triangles"):
        MeshSolid.of((vertices, triangles[1:]))
