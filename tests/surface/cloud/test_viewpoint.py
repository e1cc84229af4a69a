"""Scans from inside, or from known places: normals face the scanner."""

import numpy as np
import pytest

from cloud_shapes import block, scanned_ground, sphere
from o3dleaf import OrientedCloud, create_from_point_cloud_rbfpu, preprocess_point_cloud
from o3dleaf.core.errors import InputError
from o3dleaf.surface.cloud.orientation.orientation import estimate_normals
from o3dleaf.surface.cloud.orientation.viewpoint import face_viewpoint
from o3dleaf.surface.cloud.orientation.viewpoint_loops import weigh_sides
from tolerances import CLEAR_SIDE, SETTLED_SIDES


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


@pytest.mark.few(step=1)
@pytest.mark.parametrize("step", [1.2, 2.0])
def test_ground_seen_at_grazing_angles_faces_up_where_single_sights_are_chance(step):
    """Rays meet far waves at a few degrees, and planes through points so far apart are off by more."""
    points, upward, eye = scanned_ground(step)
    cloud = OrientedCloud.of(points)
    planes = estimate_normals(cloud)
    alone = np.sign(np.einsum("ij,ij->i", planes, eye - points))[:, np.newaxis] * planes
    assert np.sum(np.einsum("ij,ij->i", alone, upward) < 0) > 0.01 * len(points)
    found = face_viewpoint(points, planes, np.broadcast_to(eye, points.shape), cloud.neighbors.row)
    assert (np.einsum("ij,ij->i", found, upward) > 0).all()


@pytest.mark.parametrize("elevation", [5.0, 20.0, 50.0])
def test_no_side_of_a_thin_sheet_follows_the_other_that_was_seen_from_elsewhere(elevation):
    """A fifth of a spacing thick, so that half of the neighbors are of the other side and seem to lie beside."""
    rng = np.random.default_rng(3)
    places, side = rng.uniform(size=(3000, 2)), rng.choice([-1.0, 1.0], 3000)
    points = np.column_stack([places, 0.1 * side / np.sqrt(1500)])
    normals = np.outer(side, [0.0, 0.0, 1.0])
    turn, rise = np.radians([rng.choice(6, 3000) * 60.0, np.full(3000, elevation)])
    seen_from = 50 * np.column_stack([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), side * np.sin(rise)])
    chance = rng.choice([-1.0, 1.0], 3000)[:, np.newaxis]
    found = face_viewpoint(points, chance * normals, seen_from, OrientedCloud.of(points).neighbors.row)
    assert (found == normals).all()


def test_sides_are_weighed_to_the_solution_of_the_linear_system():
    """Each is the mean of its neighbors' sides, turned by their agreement, and of its own.

    Density differs much: sparse points have dense ones for neighbors, which have nearer ones.
    """
    rng = np.random.default_rng(4)
    rows = OrientedCloud.of(rng.uniform(size=(400, 3)) ** 4).neighbors.row
    some = np.flatnonzero(rng.uniform(size=400) < 0.7)
    agreement = rng.uniform(-1, 1, (len(some), rows.shape[1] - 1)).astype(np.float32)
    steepness, facing = rng.uniform(0, 0.1, len(some)), np.ones(400)
    matrix, right = np.eye(400), np.ones(400)
    right[some] = steepness
    for row, weights, own in zip(some, agreement.astype(float), steepness, strict=True):
        matrix[row, row] = 1 + own
        matrix[row, rows[row, 1:]] -= weights / np.abs(weights).sum()
    assert weigh_sides(rows, some, agreement, steepness, SETTLED_SIDES, 10_000, facing) < 10_000
    assert np.abs(facing - np.linalg.solve(matrix, right)).max() < 10 * SETTLED_SIDES


def test_normals_are_turned_where_the_equation_of_sides_has_a_negative_solution():
    """Planes of chance, all seen from one place: neighbors count by the less of what they agree mirrored or straight.

    Of neighbors whose two signs differ nothing is known, and of planes seen at 45° or more nobody asks.
    """
    rng = np.random.default_rng(6)
    points, normals = rng.uniform(size=(600, 3)), rng.normal(size=(600, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
    eye = 1e6 * np.array([0.6, 0.0, 0.8])
    rows = OrientedCloud.of(points).neighbors.row
    square = (normals @ eye / 1e6) ** 2
    facing = np.sign(normals @ eye)[:, np.newaxis] * normals
    matrix, right = np.eye(600), np.ones(600)
    for i in np.flatnonzero(square < 0.5):
        other, way = facing[rows[i, 1:]], points[rows[i, 1:]] - points[i]
        way /= np.linalg.norm(way, axis=1)[:, np.newaxis]
        straight = other @ facing[i]
        mirrored = straight - 2 * (way @ facing[i]) * np.einsum("ij,ij->i", way, other)
        known = np.where(straight * mirrored > 0, np.minimum(np.abs(straight), np.abs(mirrored)), 0.0)
        tangent = square[i] / (1 - square[i])
        matrix[i, i], right[i] = 1 + tangent, tangent
        matrix[i, rows[i, 1:]] = -np.sign(straight) * known / known.sum()
    share = np.linalg.solve(matrix, right)
    clear = np.abs(share) > CLEAR_SIDE
    found = np.einsum("ij,ij->i", face_viewpoint(points, normals, np.broadcast_to(eye, (600, 3)), rows), facing)
    assert clear.mean() > 0.99
    assert (share < 0).mean() > 0.1
    assert (np.sign(found) == np.sign(share))[clear].all()


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
