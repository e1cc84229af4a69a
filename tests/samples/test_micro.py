"""The micro truth is a Field whose surface is two sheets and closed pockets, at any voxel size."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label

from o3dleaf import Field, get_num_threads, set_num_threads
from o3dleaf.samples import wheat_ct
from o3dleaf.samples.micro import LEAF
from tolerances import FACE_INTENSITY, ROUNDING, SAMPLE_DIFFERENCE

SEEDS = range(4)


@pytest.fixture(scope="module")
def truth():
    return wheat_ct(seed=0)[1]


def test_it_is_a_field(truth):
    assert isinstance(truth, Field)
    assert truth.unit == "um"


def test_gradient_is_the_difference_quotient(truth):
    rng = np.random.default_rng(1)
    inside = rng.uniform(truth.bounds[0] + 1, truth.bounds[1] - 1, (20_000, 3))
    hairs = truth.hairs[rng.integers(0, len(truth.hairs), 2000)]
    share = rng.random((2000, 1))
    near_hairs = hairs[:, :3] * (1 - share) + hairs[:, 3:6] * share + rng.normal(0, 20, (2000, 3))
    pockets = truth.pockets[rng.integers(0, len(truth.pockets), 2000)]
    near_pockets = pockets[:, :3] + pockets[:, 3:] * rng.normal(0, 1, (2000, 3))
    outside = rng.uniform(truth.bounds[1] + 1, truth.bounds[1] + 300, (500, 3))
    p = np.concatenate([inside, near_hairs, near_pockets, outside])
    h = 1e-3
    quotient = np.stack([(truth(p + h * e) - truth(p - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    assert abs(truth.gradient(p) - quotient).max() < SAMPLE_DIFFERENCE


def test_outside_is_the_nearest_value_less_the_distance_in_blurs_of_leaf(truth):
    corner = truth.bounds[1]
    lost = 5.0 * LEAF / truth.blur
    assert truth(corner + np.array([3.0, 4.0, 0.0]))[0] == pytest.approx(truth(corner)[0] - lost, rel=ROUNDING)


@pytest.mark.few
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("spacing", [24.0, 12.0])
def test_two_sheets_and_closed_pockets(seed, spacing):
    volume, truth = wheat_ct(seed=seed, spacing=spacing, noise=0.0, drift=0.0)
    air, pieces = label(volume.data <= truth.level)
    above, below = np.unique(air[:, :, -1]), np.unique(air[:, :, 0])
    assert len(above) == len(below) == 1
    assert above != below
    assert pieces == 2 + len(truth.pockets)
    rim = np.concatenate([air[[0, -1]].ravel(), air[:, [0, -1]].ravel()])
    assert set(np.unique(rim)) <= {0, int(above[0]), int(below[0])}, "a pocket is cut by the edge"
    leaf, _ = label(volume.data > truth.level, structure=np.ones((3, 3, 3)))
    sizes = np.bincount(leaf.ravel())[1:]
    assert sizes.max() > 0.999 * sizes.sum()


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", SEEDS)
def test_noise_and_drift_connect_nothing(seed):
    volume, _ = wheat_ct(seed=seed)
    air, _ = label(volume.data <= volume.threshold())
    assert air[0, 0, 0] != air[0, 0, -1]
    sizes = np.bincount(air.ravel())[1:]
    both = sizes[[air[0, 0, 0] - 1, air[0, 0, -1] - 1]]
    assert both.min() > 0.15 * volume.data.size


def test_no_part_is_cut_and_each_is_there(truth):
    margin = 24.0
    low, high = truth.bounds + np.array([[margin], [-margin]])
    for ends in (truth.hairs[:, :3], truth.hairs[:, 3:6]):
        radius = truth.hairs[:, 6:7]
        assert (ends - radius > low).all()
        assert (ends + radius < high).all()
    assert (truth.pockets[:, :3] - truth.pockets[:, 3:] > low).all()
    assert (truth.pockets[:, :3] + truth.pockets[:, 3:] < high).all()
    up = truth.hairs[:, 5] > truth.hairs[:, 2]
    assert up.sum() >= 12
    assert (~up).sum() >= 2
    assert len(truth.stomata) >= 30
    assert len(truth.pockets) >= 15
    # A hair's axis is leaf up to its tip and a pocket's middle is air; a pit is lower than the groove beside it.
    assert (truth(truth.hairs[:, 3:6]) > truth.level).all()
    assert (truth(truth.pockets[:, :3]) < truth.level).all()
    pit, beside = truth.faces(truth.stomata)[0], truth.faces(truth.stomata + np.array([70.0, 0.0]))[0]
    assert (beside - pit > 15).all()


def test_the_level_of_a_bare_blade_is_its_faces(truth):
    bare = replace(truth, hairs=truth.hairs[:0], pockets=truth.pockets[:0])
    xy = np.random.default_rng(3).uniform(truth.bounds[0, :2] + 1, truth.bounds[1, :2] - 1, (3000, 2))
    for sign, z in zip((1, -1), bare.faces(xy), strict=True):
        assert abs(bare(np.column_stack([xy, z])) - truth.level).max() < FACE_INTENSITY
        assert (bare(np.column_stack([xy, z + sign])) < truth.level).all()
        assert (bare(np.column_stack([xy, z - sign])) > truth.level).all()


def test_ridges_repeat_across_the_patch():
    y = np.linspace(0, 1680, 500)
    _, truth = wheat_ct(seed=0)
    _, odd = wheat_ct(seed=0, ridges=5.5)
    x = np.full_like(y, 20.0)
    heights = truth.faces(np.column_stack([x, y]))[0]
    crests = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:]))
    assert len(crests) in (5, 6)
    jump = [abs(np.diff(f.faces(np.array([[800.0, 0.0], [800.0, 1680.0]]))[0])[0]) for f in (truth, odd)]
    assert jump[0] < 8
    assert jump[1] > 30


def test_the_volume_samples_the_truth():
    volume, truth = wheat_ct(seed=0, noise=0.0, drift=0.0)
    assert volume.data.size == 98_000
    assert np.array_equal(volume.bounds, truth.bounds)
    points, values = volume.to_samples(truth.level)
    assert np.array_equal((truth(points)).astype(np.float32), (volume.data.ravel()))
    assert len(values) == len(points)


def test_the_same_leaf_at_any_spacing():
    _, coarse = wheat_ct(seed=7)
    _, fine = wheat_ct(seed=7, spacing=12.0)
    for name in ("hairs", "stomata", "pockets", "phases", "bounds"):
        assert np.array_equal(getattr(coarse, name), getattr(fine, name))
    assert fine.blur == coarse.blur / 2


@pytest.mark.slow
def test_three_micrometres():
    volume, truth = wheat_ct(seed=0, spacing=3.0, size=(600.0, 600.0, 480.0))
    assert volume.shape == (200, 200, 160)
    assert truth.blur < 2
    assert abs(volume.threshold() - truth.level) < 0.6 * truth.level


def test_noise_and_drift_are_what_they_say():
    clean, _ = wheat_ct(seed=0, noise=0.0, drift=0.0)
    noisy, _ = wheat_ct(seed=0, noise=0.02, drift=0.0)
    drifted, _ = wheat_ct(seed=0, noise=0.0, drift=0.2)
    grain = noisy.data - clean.data
    assert abs(grain.std() / 0.02 - 1) < 1e-3
    assert abs(grain.mean()) < 1e-3
    assert 0.02 < np.corrcoef(grain[1:].ravel(), grain[:-1].ravel())[0, 1] < 0.3
    assert abs(drifted.data[35, 35].max() / clean.data[35, 35].max() - 0.8) < 1e-2
    assert abs(drifted.data[0, 0].max() / clean.data[0, 0].max() - 1.0) < 1e-6


def test_the_seed_decides_and_the_threads_do_not():
    threads = get_num_threads()
    try:
        set_num_threads(1)
        alone = wheat_ct(seed=5)[0].data
        set_num_threads(3)
        assert np.array_equal(wheat_ct(seed=5)[0].data, alone)
    finally:
        set_num_threads(threads)
    assert not np.array_equal(wheat_ct(seed=6)[0].data, alone)


def test_a_lattice_holds_what_its_points_do():
    volume, truth = wheat_ct(seed=2, noise=0.0, drift=0.0)
    x, y, z = (volume.origin[a] + volume.spacing[a] * np.arange(volume.shape[a]) for a in range(3))
    points = np.stack(np.meshgrid(x[10:30], y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    assert np.array_equal(truth.on_lattice(x[10:30], y, z).ravel(), truth.inside(points)[0])
    assert np.array_equal(volume.data[10:30].ravel(), truth(points).astype(np.float32))
