"""The macro truth is an honest distance to a blade in a right-handed frame; the scan lies on it, noisy and uneven."""

import numpy as np
import pytest
from scipy.spatial import KDTree

import o3dleaf as o3l
from o3dleaf import Field
from o3dleaf.samples import WheatBlade, wheat_scan
from tolerances import SAMPLE_DIFFERENCE, SHEET_ARC, SHEET_DISTANCE


@pytest.fixture(scope="module")
def sample():
    return wheat_scan(seed=0)


@pytest.fixture(scope="module")
def near(sample):
    """Points within 2 mm of the blade."""
    truth, rng = sample.truth, np.random.default_rng(2)
    along = rng.uniform(0, truth.length, 400)
    across = rng.uniform(-1, 1, 400) * truth.half_width(along)
    return truth.surface(along, across) + rng.uniform(-1, 1, (400, 3)) * 2 / np.sqrt(3)


def test_it_is_a_field(sample):
    assert isinstance(sample.truth, Field)
    assert sample.truth.unit == "mm"


def test_the_frame_is_right_handed_and_the_axis_runs_by_arc_length(sample):
    truth = sample.truth
    t = np.linspace(0, truth.length, 1000)
    along, across, up = truth.frame(t)
    assert abs(np.cross(along, across) - up).max() < 1e-12
    assert abs(np.linalg.norm(up, axis=1) - 1).max() < 1e-12
    h = 1e-4
    tangent = (truth.axis(t[1:-1] + h) - truth.axis(t[1:-1] - h)) / (2 * h)
    assert abs(tangent - along[1:-1]).max() < SHEET_ARC


def test_the_distance_is_that_of_a_fine_sampling(sample, near):
    truth = sample.truth
    t, u = (g.ravel() for g in np.meshgrid(np.linspace(0, truth.length, 4001), np.linspace(-1, 1, 241), indexing="ij"))
    tree = KDTree(truth.surface(t, u * truth.half_width(t)))
    brute = tree.query(near)[0]
    ours = truth.half_thickness - truth(near)
    assert (ours - brute).max() < SHEET_DISTANCE, "farther than a point of the blade"
    # A sampling 0.05 mm fine misses the foot by 0.04 at most.
    assert (brute - np.hypot(ours, 0.04)).max() < SHEET_DISTANCE


def test_gradient_is_the_difference_quotient_and_has_length_one(sample, near):
    truth, h = sample.truth, 1e-4
    off = near[truth.half_thickness - truth(near) > 0.05]
    quotient = np.stack([(truth(off + h * e) - truth(off - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    gradient = truth.gradient(off)
    assert abs(np.linalg.norm(gradient, axis=1) - 1).max() < 1e-12
    assert abs(gradient - quotient).max() < 100 * SAMPLE_DIFFERENCE


def test_points_of_the_blade_have_their_own_coordinates(sample):
    truth, rng = sample.truth, np.random.default_rng(4)
    along = rng.uniform(1, truth.length - 1, 500)
    across = rng.uniform(-0.95, 0.95, 500) * truth.half_width(along)
    points = truth.surface(along, across)
    assert abs(truth.closest(points)[1] - np.column_stack([along, across])).max() < SHEET_DISTANCE
    assert abs(truth(points) - truth.half_thickness).max() < SHEET_DISTANCE


def test_it_is_a_wheat_leaf(sample):
    truth = sample.truth
    t = np.linspace(0, truth.length, 400)
    axis, (_, across, _) = truth.axis(t), truth.frame(t)
    assert 185 < truth.length < 215
    assert 9.5 < 2 * truth.half_width(t).max() < 12.5
    assert truth.half_width(truth.length)[0] < 0.2
    top = axis[:, 2].argmax()
    assert 50 < top < 350, "rises, bends and hangs"
    assert np.degrees(np.arccos(across[0] @ across[-1])) > 30, "twists"
    strips = np.linspace(0, truth.length, 2001)
    flat = np.trapezoid(2 * truth.half_width(strips), strips)
    assert flat < truth.area < 1.1 * flat


@pytest.mark.few(noise=2)
@pytest.mark.parametrize("noise", [0.0, 0.1, 0.2])
def test_noise_is_what_it_says(noise):
    cloud, _, truth = wheat_scan(seed=1, noise=noise, misregistration=0.0)
    points = np.asarray(cloud.points)
    inner = truth.closest(points)[1]
    deep = abs(inner[:, 1]) < truth.half_width(inner[:, 0]) - 4 * noise - 0.1
    distance = truth.half_thickness - truth(points[deep])
    assert abs(np.sqrt((distance**2).mean()) - noise) < 0.03 * noise + SHEET_DISTANCE


def test_the_second_pass_is_displaced():
    points = [np.asarray(wheat_scan(seed=1, noise=0.0, misregistration=m).cloud.points) for m in (0.0, 0.3)]
    shift = np.linalg.norm(points[1] - points[0], axis=1)
    assert ((shift < 1e-9) | (abs(shift - 0.3) < 1e-9)).all()
    assert 0.4 < (shift > 0.1).mean() < 0.6


def test_density_is_uneven_and_holes_are_empty(sample):
    points = np.asarray(sample.cloud.points)
    assert points.shape == (6300, 3)
    along = sample.truth.closest(points)[1][:, 0] / sample.truth.length
    counts = np.histogram(along, bins=10, range=(0, 1))[0]
    width = sample.truth.half_width(sample.truth.length * (np.arange(10) + 0.5) / 10)
    density = counts / width
    assert density[4:7].min() > 2 * density[0]
    median = np.median(KDTree(points).query(points, k=2)[0][:, 1])
    assert 0.2 < median < 0.4
    gaps = [self_gap(wheat_scan(seed=0, holes=n)) for n in (0, 6)]
    assert gaps[1] > 1.5 * gaps[0]


def self_gap(sample):
    """The largest distance from the dense middle half of the blade to the scan."""
    truth = sample.truth
    t, u = (g.ravel() for g in np.meshgrid(np.linspace(0.3, 0.8, 400) * truth.length, np.linspace(-0.7, 0.7, 40)))
    sites = truth.surface(t, u * truth.half_width(t))
    return KDTree(np.asarray(sample.cloud.points)).query(sites)[0].max()


def test_the_midrib_is_near_the_axis_and_in_order(sample):
    truth, midrib = sample.truth, sample.midrib
    assert midrib.shape == (20, 3)
    axis = truth.axis(np.linspace(0, truth.length, 4000))
    distance, station = KDTree(axis).query(midrib)
    assert 0.05 < distance.mean() < 0.5
    assert (np.diff(station) > 0).all()


def test_outliers_are_off_the_leaf_and_the_same_leaf_stays():
    plain, dirty = (wheat_scan(seed=3, count=2000, outliers=count) for count in (0, 50))
    assert len(dirty.cloud.points) == len(plain.cloud.points) == 2000
    assert dirty.truth.area == plain.truth.area
    distance = dirty.truth.half_thickness - dirty.truth(np.asarray(dirty.cloud.points))
    assert 20 < (distance > 1.0).sum() <= 50


def test_the_seed_decides(sample):
    again, other = wheat_scan(seed=0), wheat_scan(seed=1)
    assert np.array_equal(np.asarray(again.cloud.points), np.asarray(sample.cloud.points))
    assert np.array_equal(again.midrib, sample.midrib)
    assert other.truth.length != sample.truth.length


def test_a_narrow_blade_has_the_area_of_its_outline():
    strip = WheatBlade(rise=0.0, droop=0.0, swing=0.0, twist=0.0, width=0.5)
    t = np.linspace(0, strip.length, 20_001)
    assert abs(strip.area / np.trapezoid(2 * strip.half_width(t), t) - 1) < 0.01


@pytest.mark.parametrize("wrong", [{"count": 10}, {"outliers": 6000}])
def test_impossible_scans_are_refused(wrong):
    with pytest.raises(o3l.errors.InputError, match="scan"):
        wheat_scan(**wrong)
