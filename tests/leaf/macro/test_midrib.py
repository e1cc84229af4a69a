import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from o3dleaf import LeafFrame, find_midrib
from o3dleaf.samples import wheat_scan

LENGTH, WIDTH = 200.0, 14.0
SHAPES = {
    "bent": {"bent": True},
    "bent sideways": {"sideways": True},
    "twisted by 90 degrees": {"twist": np.pi / 2},
    "twisted by 360 degrees": {"twist": 2 * np.pi},
    "tapering": {"taper": 0.8},
    "all": {"bent": True, "twist": np.pi / 2, "taper": 0.8},
    "all, sideways and twisted by 180 degrees": {"sideways": True, "twist": np.pi, "taper": 0.8},
}


def elongated(*, bent=False, sideways=False, twist=0.0, taper=0.0, noise=0.0, count=2500):
    """A leaf as it is bent to a radius of a quarter of its length, twisted and tapered: its scan, axis and half width.

    The noise is a share of the width, the taper the share of it that the tip lacks.
    """
    rng = np.random.default_rng(0)
    radius, flat = LENGTH / 4, np.column_stack([rng.uniform(0, LENGTH, 2 * count), rng.uniform(-1, 1, 2 * count)])

    def half(t):
        return WIDTH / 2 * (1 - taper * t / LENGTH)

    def section(t):
        turn, zero, one = t / radius, np.zeros_like(t), np.ones_like(t)
        sin, cos = np.sin(turn), np.cos(turn)
        if bent:
            axis, across, up = (radius * sin, zero, radius * cos), (zero, one, zero), (sin, zero, cos)
        elif sideways:
            axis, across, up = (radius * sin, -radius * cos, zero), (-sin, cos, zero), (zero, zero, one)
        else:
            axis, across, up = (t, zero, zero), (zero, one, zero), (zero, zero, one)
        return tuple(np.stack(column, axis=1) for column in (axis, across, up))

    t, across = flat[np.abs(flat[:, 1]) < half(flat[:, 0]) / (WIDTH / 2)][:count].T * [[1], [WIDTH / 2]]
    axis, side, up = section(t)
    angle = (twist * t / LENGTH)[:, None]
    points = axis + across[:, None] * (np.cos(angle) * side + np.sin(angle) * up)
    return points + noise * WIDTH * rng.normal(size=points.shape), section(np.linspace(0, LENGTH, 101))[0], half


def on_axis(points, control, towards):
    """Dense points of one axis in the coordinates of another: arc length along it, distance from it."""
    frame, other = LeafFrame.fit(points, control), LeafFrame.fit(points, towards)
    leaf = other.to_leaf(frame.stations(np.linspace(0, frame.length, 1000))[0])
    return np.clip(leaf[:, 0], 0, other.length), np.linalg.norm(leaf[:, 1:], axis=1)


def distance_to_axis(points, control, towards):
    """Distance of dense points of one axis to the other axis."""
    return on_axis(points, control, towards)[1]


def local_half_width(leaf, along):
    """Half of the scan's extent across, within 4 mm, about half the width, of each place along the axis."""
    near = [leaf[np.abs(leaf[:, 0] - t) < 4, 1] for t in along]
    return np.array([np.ptp(np.quantile(each, (0.02, 0.98))) / 2 for each in near])


@pytest.mark.few(shape=3)
@pytest.mark.parametrize("noise", [0.0, pytest.param(0.02, marks=pytest.mark.slow), 0.05])
@pytest.mark.parametrize("shape", SHAPES)
def test_the_axis_of_an_elongated_leaf_is_found_within_half_its_local_width(shape, noise):
    points, axis, half = elongated(**SHAPES[shape], noise=noise)
    found = find_midrib(points)
    along, away = on_axis(points, found, axis)
    assert np.all(away <= half(along))
    frame = LeafFrame.fit(points, found)
    leaf = frame.to_leaf(axis)
    away = np.linalg.norm(leaf[:, 1:], axis=1)
    assert np.all(away <= half(np.linspace(0, LENGTH, len(axis))))
    # It ends where the leaf does, but for what the noise adds.
    assert abs(frame.length - LENGTH) < WIDTH / 2


def test_the_wheat_leaf_has_its_midrib_found_within_half_its_width(real_scan):
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf.ply"))).points)
    picked = np.asarray(o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf_midrib.ply"))).points)
    found = find_midrib(points)
    along, away = on_axis(points, found, picked)
    assert np.all(away < local_half_width(LeafFrame.fit(points, picked).to_leaf(points), along))
    along, away = on_axis(points, picked, found)
    assert np.all(away < local_half_width(LeafFrame.fit(points, found).to_leaf(points), along))
    assert np.linalg.norm(found[0] - picked[0]) < np.linalg.norm(found[-1] - picked[0])


@pytest.mark.few
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("noise", [0.05, 0.2])
def test_synthetic_leaves_have_their_midrib_found(seed, noise):
    sample = wheat_scan(seed=seed, noise=noise, count=2500)
    points = np.asarray(sample.cloud.points)
    found = find_midrib(sample.cloud)
    distance = distance_to_axis(points, found, sample.midrib)
    assert distance.max() < 2.5
    assert distance.mean() < 0.8
    assert np.linalg.norm(found[0] - sample.midrib[0]) < np.linalg.norm(found[-1] - sample.midrib[0])


def test_the_midrib_turns_and_scales_with_the_cloud():
    sample = wheat_scan(seed=3, count=2000)
    points = np.asarray(sample.cloud.points)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    found = (find_midrib(1000 * points @ turn.T + 5e4) - 5e4) @ turn / 1000
    assert distance_to_axis(points, found, find_midrib(points)).max() < 0.3


def test_a_broad_cloud_is_refused():
    rng = np.random.default_rng(1)
    disc = rng.uniform(-1, 1, (2000, 3)) * [10, 8, 0.1]
    with pytest.raises(o3l.errors.ReconstructionError, match="not an elongated leaf"):
        find_midrib(disc)


@pytest.mark.parametrize("name", ["soybean_with_normals.ply", "sugarbeet.ply"])
def test_a_broad_leaf_is_refused(real_scan, name):
    """The sugar beet's too, which its petiole makes four times as long as wide."""
    with pytest.raises(o3l.errors.ReconstructionError, match="not an elongated leaf"):
        find_midrib(o3d.io.read_point_cloud(str(real_scan(f"leaves/{name}"))))


def stalked(aspect, petiole, outline):
    """A blade 10 wide and `aspect` times as long, slightly hollow, on a petiole of so many times its length."""
    rng = np.random.default_rng(0)
    length = 10 * aspect
    t, across = rng.uniform(-petiole * length, length, 60_000), rng.uniform(-5, 5, 60_000)
    kept = np.abs(across) < np.where(t < 0, 0.4, 5 * outline(np.clip(t / length, 0, 1)))
    points = np.column_stack([t, across, 0.02 * across**2])[kept][:4000]
    return points + 0.1 * rng.normal(size=points.shape)


@pytest.mark.few(petiole=2)
@pytest.mark.parametrize("petiole", [0.0, 1.0, 2.0])
@pytest.mark.parametrize(
    "outline", [lambda u: np.sqrt(u * (1 - u)) * 2, lambda u: 1 - u], ids=["elliptical", "triangular"]
)
def test_a_petiole_makes_no_leaf_long_or_broad(outline, petiole):
    with pytest.raises(o3l.errors.ReconstructionError, match="not an elongated leaf"):
        find_midrib(stalked(2.0, petiole, outline))
    assert len(find_midrib(stalked(5.0, petiole, outline))) > 5


def test_a_handful_of_points_is_refused():
    with pytest.raises(o3l.errors.InputError, match="at least"):
        find_midrib(np.random.default_rng(2).uniform(0, 1, (10, 3)))


@pytest.mark.few(count=1)
@pytest.mark.parametrize("count", [50, 100, 300])
def test_a_sparse_scan_has_a_midrib_too(count):
    points, axis, half = elongated(taper=0.8, count=4000)
    points = points[:count]
    along, away = on_axis(points, find_midrib(points), axis)
    assert np.all(away <= 1.5 * half(along))


@pytest.mark.parametrize("jitter", [0.0, 1e-9, 0.02])
def test_a_line_is_refused(jitter):
    """Also one that is thin rather than straight: a midrib with a station for each of its widths would never end."""
    points = np.linspace([0, 0, 0], [100, 20, 5], 500) + np.random.default_rng(0).uniform(-jitter, jitter, (500, 3))
    with pytest.raises(o3l.errors.InputError, match="one line or in one place"):
        find_midrib(points)
