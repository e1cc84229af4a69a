"""Scans from inside, or from known places: normals face the scanner."""

import numpy as np
import pytest

from cloud_shapes import block, sphere
from o3dleaf import OrientedCloud, create_from_point_cloud_rbfpu, preprocess_point_cloud
from o3dleaf.core.errors import InputError


def room(count, seed=0):
    """Return the walls and the floor of a room without a ceiling, and their normals into it."""
    points, normals = block(count, (6.0, 5.0, 3.0), seed)
    kept = normals[:, 2] < 0.5
    return points[kept], -normals[kept]


def test_normals_face_the_place_that_they_were_scanned_from():
    points, inward = room(6000)
    cloud = preprocess_point_cloud(points, viewpoint=[0.5, 0.3, 0.2])
    assert (np.einsum("ij,ij->i", cloud.normals, inward) > 0).all()
    assert cloud.notes == ()


def test_each_point_may_have_a_place_of_its_own():
    """Two balls, one scanned from outside and one from its center; rows are shuffled and some removed on the way."""
    points, normals = sphere(3000)
    both = np.vstack([points, points[:1], points + [5, 0, 0]])
    seen_from = np.vstack([3 * points, 3 * points[:1], np.tile([5.0, 0, 0], (3000, 1))])
    expected = np.vstack([normals, normals[:1], -normals])
    order = np.random.default_rng(1).permutation(6001)
    cloud = preprocess_point_cloud(both[order], viewpoint=seen_from[order], outliers=None)
    assert cloud.removed.repeated == 1
    row = {tuple(point): n for point, n in zip(both, expected, strict=True)}
    assert all(row[tuple(point)] @ normal > 0 for point, normal in zip(cloud.points, cloud.normals, strict=True))


def test_given_normals_are_turned_to_it_and_counted():
    points, inward = room(4000)
    sign = np.where(np.arange(len(points)) % 4 == 0, -1.0, 1.0)
    cloud = preprocess_point_cloud(points, normals=sign[:, np.newaxis] * inward, viewpoint=[0, 0, 0], outliers=None)
    assert cloud.normals == pytest.approx(inward)
    assert cloud.notes[0].startswith(f"{int(np.sum(sign < 0)):,} of {len(points):,} normals faced away")


def test_normals_into_a_room_are_kept_and_into_a_closed_surface_are_turned():
    points, inward = room(6000)
    cloud = preprocess_point_cloud(points, normals=inward)
    assert cloud.normals == pytest.approx(inward)
    assert "as a room scanned from inside" in cloud.notes[0]
    points, outward = block(6000)
    cloud = preprocess_point_cloud(points, normals=-outward)
    assert cloud.normals == pytest.approx(outward)
    assert cloud.notes == ("all normals pointed inward and were flipped",)


def test_the_mesh_of_a_ball_seen_from_its_center_faces_the_center():
    points, _ = sphere(1500)
    mesh, _ = create_from_point_cloud_rbfpu(points, viewpoint=(0, 0, 0), measure=None)
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() < 0


@pytest.mark.parametrize("viewpoint", [(0.0, 1.0), np.zeros((7, 3)), (0, np.nan, 0)])
def test_what_is_no_place_is_refused(viewpoint):
    with pytest.raises(InputError, match="viewpoint"):
        preprocess_point_cloud(OrientedCloud.of(sphere(100)[0]), viewpoint=viewpoint)
