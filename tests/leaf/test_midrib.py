import numpy as np
import open3d as o3d
import pytest

from o3dleaf.errors import InputError, ReconstructionError
from o3dleaf.leaf.frame import LeafFrame
from o3dleaf.leaf.midrib import find_midrib
from o3dleaf.samples import wheat_scan


def distance_to_axis(points, control, towards):
    """Distance of dense points of one axis to the other axis."""
    frame, other = LeafFrame.fit(points, control), LeafFrame.fit(points, towards)
    dense = frame.stations(np.linspace(0, frame.length, 1000))[0]
    return np.linalg.norm(other.to_leaf(dense)[:, 1:], axis=1)


def test_the_wheat_leaf_has_its_midrib_found_within_half_its_width(real_scan):
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf.ply"))).points)
    picked = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf_midrib.ply"))).points)
    found = find_midrib(points)
    assert distance_to_axis(points, found, picked).max() < 5.5
    assert distance_to_axis(points, picked, found).max() < 5.5
    assert np.linalg.norm(found[0] - picked[0]) < np.linalg.norm(found[-1] - picked[0])


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_synthetic_leaves_have_their_midrib_found(seed, noise):
    sample = wheat_scan(seed=seed, noise=noise, count=4000)
    points = np.asarray(sample.cloud.points)
    found = find_midrib(sample.cloud)
    distance = distance_to_axis(points, found, sample.midrib)
    assert distance.max() < 2.5
    assert distance.mean() < 0.8
    assert np.linalg.norm(found[0] - sample.midrib[0]) < np.linalg.norm(found[-1] - sample.midrib[0])


def test_the_midrib_turns_and_scales_with_the_cloud():
    sample = wheat_scan(seed=3, count=3000)
    points = np.asarray(sample.cloud.points)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    found = (find_midrib(1000 * points @ turn.T + 5e4) - 5e4) @ turn / 1000
    assert distance_to_axis(points, found, find_midrib(points)).max() < 0.3


def test_a_broad_cloud_is_refused():
    rng = np.random.default_rng(1)
    disc = rng.uniform(-1, 1, (2000, 3)) * [10, 8, 0.1]
    with pytest.raises(ReconstructionError, match="not an elongated leaf"):
        find_midrib(disc)


def test_the_soybean_leaf_is_refused(real_scan):
    with pytest.raises(ReconstructionError, match="not an elongated leaf"):
        find_midrib(o3d.io.read_point_cloud(str(real_scan("leaves/soybean_with_normals.ply"))))


def test_a_handful_of_points_is_refused():
    with pytest.raises(InputError, match="at least"):
        find_midrib(np.random.default_rng(2).uniform(0, 1, (10, 3)))


@pytest.mark.parametrize("jitter", [0.0, 1e-9, 0.02])
def test_a_line_is_refused(jitter):
    """Also one that is thin rather than straight: a midrib with a station for each of its widths would never end."""
    points = np.linspace([0, 0, 0], [100, 20, 5], 500) + np.random.default_rng(0).uniform(-jitter, jitter, (500, 3))
    with pytest.raises(InputError, match="one line or in one place"):
        find_midrib(points)
