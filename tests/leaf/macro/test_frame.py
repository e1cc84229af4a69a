import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from o3dleaf.core.errors import InputError
from o3dleaf.leaf.macro.frame import LeafFrame, arc_lengths
from o3dleaf.leaf.macro.midrib_normals import half_width
from tolerances import ANALYTIC_VS_DIFFERENCE, FRAME_ORTHONORMAL, ROUND_TRIP


def helix(t):
    return np.stack([30 * np.cos(t), 30 * np.sin(t), 8 * t], axis=1)


@pytest.fixture(scope="module")
def curved():
    """A strip along a helix, its normals turning with it."""
    t = np.linspace(0, 2, 400)
    axis = helix(t)
    tangent = np.gradient(axis, axis=0)
    across = np.cross(tangent, [0, 0, 1.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    side = np.linspace(-5, 5, 21)
    scan = (axis[:, None] + side[None, :, None] * across[:, None]).reshape(-1, 3)
    return LeafFrame.fit(scan, helix(np.linspace(0, 2, 12)), unit="mm")


@pytest.fixture(scope="module")
def wheat(real_scan):
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf.ply"))).points)
    midrib = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf_midrib.ply"))).points)
    return points, midrib, LeafFrame.fit(points, midrib, unit="mm")


def brute_force_closest(frame, points, count=100_001):
    """t* by a minimum over a fine sampling that reaches past both ends."""
    t = np.linspace(-0.2 * frame.length, 1.2 * frame.length, count)
    distance, row = cKDTree(frame.stations(t)[0]).query(points)
    return t[row], distance, t[1] - t[0]


def test_world_to_leaf_to_world_is_the_identity_on_the_wheat_leaf(wheat):
    points, _, frame = wheat
    error = np.abs(frame.to_world(frame.to_leaf(points)) - points).max()
    assert error <= ROUND_TRIP * frame.length


def test_the_closest_point_of_the_wheat_leaf_is_global(wheat):
    points, _, frame = wheat
    leaf = frame.to_leaf(points)
    _, sampled, step = brute_force_closest(frame, points)
    found = np.linalg.norm(points - frame.stations(leaf[:, 0].copy())[0], axis=1)
    assert np.all(found <= sampled + ROUND_TRIP * frame.length)
    assert np.all(sampled <= found + step)


def test_the_closest_point_is_global_where_the_axis_comes_back(curved):
    """Far off the axis of a bend several stationary points compete."""
    points = np.random.default_rng(1).uniform(-60, 60, (2000, 3))
    leaf = curved.to_leaf(points)
    t, sampled, step = brute_force_closest(curved, points)
    found = np.linalg.norm(points - curved.stations(leaf[:, 0].copy())[0], axis=1)
    assert np.all(found <= sampled + ROUND_TRIP * curved.length)
    inside = (t > -0.19 * curved.length) & (t < 1.19 * curved.length)
    assert np.all(np.abs(found - sampled)[inside] <= step**2)


def test_world_to_leaf_to_world_is_the_identity_past_the_ends(curved):
    points = np.random.default_rng(2).uniform(-200, 200, (2000, 3))
    leaf = curved.to_leaf(points)
    assert np.any(leaf[:, 0] < 0)
    assert np.any(leaf[:, 0] > curved.length)
    assert np.abs(curved.to_world(leaf) - points).max() <= ROUND_TRIP * 200


def test_leaf_to_world_to_leaf_is_the_identity_near_the_axis(curved):
    rng = np.random.default_rng(3)
    leaf = np.column_stack([rng.uniform(-5, curved.length + 5, 2000), rng.uniform(-6, 6, (2000, 2))])
    assert np.abs(curved.to_leaf(curved.to_world(leaf)) - leaf).max() <= ROUND_TRIP * curved.length


def test_the_frame_is_orthonormal_and_right_handed_at_1000_stations(wheat):
    frame = wheat[2]
    _, along, across, up = frame.stations(np.linspace(-10, frame.length + 10, 1000))
    basis = np.stack([along, across, up], axis=2)
    identity = np.swapaxes(basis, 1, 2) @ basis
    assert np.abs(identity - np.eye(3)).max() <= FRAME_ORTHONORMAL
    assert np.abs(np.linalg.det(basis) - 1).max() <= FRAME_ORTHONORMAL


def test_the_paper_w_is_minus_across(wheat):
    frame = wheat[2]
    _, along, across, up = frame.stations(np.linspace(0, frame.length, 100))
    assert np.abs(np.cross(along, up) + across).max() <= FRAME_ORTHONORMAL


@pytest.mark.parametrize("degree", [3, 5])
def test_the_jacobian_equals_central_differences(curved, degree):
    del curved
    t = np.linspace(0, 2, 12)
    scan = np.concatenate([helix(t) + s * np.array([0, 0, 1.0]) for s in np.linspace(-3, 3, 9)])
    frame = LeafFrame.fit(scan, helix(t), degree=degree)
    rng = np.random.default_rng(4)
    leaf = np.column_stack([rng.uniform(-5, frame.length + 5, 300), rng.uniform(-6, 6, (300, 2))])
    step = 1e-5
    away = np.abs(leaf[:, :1] - frame.breaks).min(axis=1) > step
    numeric = np.stack(
        [(frame.to_world(leaf + step * e) - frame.to_world(leaf - step * e)) / (2 * step) for e in np.eye(3)], axis=2
    )
    assert np.abs(numeric - frame.jacobian(leaf))[away].max() <= ANALYTIC_VS_DIFFERENCE


def test_arc_length_of_a_circle():
    angles = np.linspace(0, np.pi, 40)
    control = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    assert arc_lengths(control, 3) == pytest.approx(angles, rel=1e-5)


def test_a_straight_strip_has_its_own_coordinates():
    rng = np.random.default_rng(5)
    scan = np.column_stack([rng.uniform(0, 100, 2000), rng.uniform(-4, 4, 2000), np.zeros(2000)])
    frame = LeafFrame.fit(scan, [[0, 0, 0], [30, 0, 0], [100, 0, 0]])
    world = rng.uniform(-5, 5, (50, 3)) + [50, 0, 0]
    assert np.abs(frame.to_leaf(world) - world).max() <= ROUND_TRIP * 100


def test_hints_turn_the_frame_and_are_noted():
    rng = np.random.default_rng(6)
    scan = np.column_stack([rng.uniform(0, 100, 2000), rng.uniform(-4, 4, 2000), np.zeros(2000)])
    control = [[0, 0, 0], [30, 0, 0], [100, 0, 0]]
    down = LeafFrame.fit(scan, control, up=(0, 0, -1), base=(101, 0, 0))
    leaf = down.to_leaf([[90.0, 2.0, 1.0]])
    assert leaf == pytest.approx(np.array([[10.0, 2.0, -1.0]]))
    assert any("hint" in note for note in down.notes)


def test_neighbouring_normals_agree(wheat):
    frame = wheat[2]
    up = frame.stations(frame.breaks)[3]
    assert np.all(np.einsum("ij,ij->i", up[1:], up[:-1]) > 0)


@pytest.mark.parametrize("gap", [0.0, 1e-6, 3.0])
def test_half_width_is_measured_to_the_polyline_itself(gap):
    """Between its samples too: of points at one distance from a bent polyline it is that distance."""
    control = np.array([[0, 0, 0], [60, 0, 0], [60, 40, 0.0]])
    t = np.random.default_rng(0).uniform(0, 100, 400)
    on = np.column_stack([np.minimum(t, 60), np.maximum(t - 60, 0), np.full(400, gap)])
    assert half_width(on, control) == pytest.approx(gap, rel=1e-12, abs=1e-12)


def test_half_width_of_a_strip():
    rng = np.random.default_rng(7)
    scan = np.column_stack([rng.uniform(0, 100, 5000), rng.uniform(-4, 4, 5000), np.zeros(5000)])
    assert half_width(scan, np.array([[0, 0, 0], [100, 0, 0.0]])) == pytest.approx(3.8, abs=0.05)


def test_repeated_control_points_are_taken_once_and_a_single_one_is_refused(curved):
    del curved
    scan = np.random.default_rng(8).uniform(0, 10, (50, 3))
    frame = LeafFrame.fit(scan, [[0, 0, 0], [0, 0, 0], [10, 10, 10]])
    assert len(frame.breaks) == 2
    with pytest.raises(InputError, match="midrib"):
        LeafFrame.fit(scan, [[0, 0, 0], [0, 0, 0]])
    with pytest.raises(InputError, match="midrib"):
        LeafFrame.fit(scan, [[0, 0, 0]])
