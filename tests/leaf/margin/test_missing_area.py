import numpy as np
import pytest

import planar_leaves as leaves
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.margin_curve import without_noise
from o3dleaf.leaf.margin.missing_area import randomness
from o3dleaf.leaf.margin.sample_region import cover_sample
from o3dleaf.leaf.margin.sample_triangles import triangulate
from tolerances import EFRON_AREA, NOISY_GROWTH, PICK, RANDOMNESS

SEEDS = 6


def covered(region):
    a, b, c = (region.points[region.triangles[:, corner]] for corner in range(3))
    return 0.5 * np.sum((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def test_random_samples_miss_in_the_mean_what_efrons_identity_says():
    """Independent points: the area covered, and a cell for each point that the others do not cover."""
    leaf = leaves.strip(20)
    regions = [cover_sample(leaves.uniform(leaf, 1500, np.random.default_rng(seed))) for seed in range(SEEDS)]
    errors = [(covered(region) + region.missing.sum()) / leaf.area - 1 for region in regions]
    assert abs(np.mean(errors)) < EFRON_AREA


def test_a_square_lattice_misses_half_a_cell_at_each_point_of_its_border():
    """Pick's theorem: n points are n cells."""
    points = np.stack(np.meshgrid(np.arange(30.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    region = cover_sample(points)
    assert covered(region) == pytest.approx(29 * 19)
    assert region.missing.sum() == pytest.approx(len(points) - covered(region) - 1, rel=PICK)


@pytest.mark.parametrize(("jitter", "least", "most"), [(0.0, 0.0, 1e-9), (0.2, 0.1, 0.3), (None, 1 - RANDOMNESS, 1.0)])
def test_randomness_runs_from_a_lattice_to_independent_points(jitter, least, most):
    rng = np.random.default_rng(0)
    lattice = np.stack(np.meshgrid(np.arange(100.0), np.arange(100.0)), axis=-1).reshape(-1, 2)
    points = rng.uniform(0, 99, lattice.shape) if jitter is None else lattice + rng.normal(0, jitter, lattice.shape)
    mesh = triangulate(points)
    deep = ((points > 5) & (points < 94)).all(axis=1)
    assert least <= randomness(mesh.areas, deep[mesh.triangles].sum(axis=1)) <= most


def test_growth_without_noise_is_the_inverse_of_what_noise_adds():
    """By simulation: points of a half plane moved by noise, seen from a curve that strays as much."""
    rng, noise = np.random.default_rng(1), 0.3
    depth = rng.uniform(-3, 0, 400_000) + rng.normal(0, noise, 400_000)
    for edge in (-0.8, -0.3, 0.0, 0.2):
        curve = edge + rng.normal(0, noise, len(depth))
        growth = 3 * np.mean(depth > curve)
        assert without_noise(np.array([growth]), np.array([noise]))[0] == pytest.approx(-edge, abs=NOISY_GROWTH)
    assert without_noise(np.array([0.4]), np.array([0.0]))[0] == 0.4


def test_noise_over_the_edge_does_not_make_the_leaf_larger():
    leaf = leaves.strip(20)
    points = leaves.uniform(leaf, 1500, np.random.default_rng(2))
    noise = 0.5 * leaves.true_spacing(leaf, points)
    noisy = points + np.random.default_rng(3).normal(0, noise, points.shape)
    assert Margin.fit(noisy, noise=noise).area == pytest.approx(leaf.area, rel=0.02)
    assert Margin.fit(noisy).area > 1.02 * leaf.area
