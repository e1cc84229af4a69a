"""The scale at which a cloud is a surface: as fine as noise allows, and none where points fill a volume."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import samples
from o3dleaf.surface.cloud.neighbors import NEIGHBORS, nearest_neighbors
from o3dleaf.surface.cloud.surfels import FEW, FLAT, flatness_of, surface_scale


def scale_of(points):
    return surface_scale(points, nearest_neighbors(cKDTree(points)).row)


def filled(kind, count, seed):
    rng = np.random.default_rng(seed)
    if kind == "normal":
        return rng.normal(size=(count, 3))
    if kind == "ball":
        directions = rng.normal(size=(count, 3))
        return directions / np.linalg.norm(directions, axis=1, keepdims=True) * np.cbrt(rng.uniform(size=(count, 1)))
    return rng.uniform(size=(count, 3)) * {"cube": (1, 1, 1), "rod": (8, 1, 1), "slab": (3, 3, 1)}[kind]


@pytest.mark.few
@pytest.mark.parametrize("kind", ["ball", "cube", "normal", "rod", "slab"])
@pytest.mark.parametrize("count", [300, 3_000, 10_000])
def test_points_that_fill_a_volume_are_no_surface_at_any_scale(kind, count):
    assert all(scale_of(filled(kind, count, seed)).full for seed in range(3))


@pytest.fixture(scope="module")
def plates():
    return samples.fins().sample(10_000)[0]


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_thin_plates_are_told_from_a_volume_and_not_thinned(plates, noise):
    """On coarser scales both sides of a plate lie in one neighborhood, and the plate becomes thicker."""
    diagonal = np.linalg.norm(np.ptp(plates, axis=0))
    scale = scale_of(plates + noise * diagonal * np.random.default_rng(2).normal(size=plates.shape))
    assert not scale.full
    assert scale.thinning == 1


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_planes_go_through_fewer_neighbors_where_the_others_lie_on_other_sheets(seed):
    """A plate folded onto itself, 2.3 spacings thick and apart: under noise of 0.43 it looked like a volume."""
    points = samples.fold().sample(10_000)[0]
    sigma = 0.005 * np.linalg.norm(np.ptp(points, axis=0))
    scale = scale_of(points + sigma * np.random.default_rng(seed).normal(size=points.shape))
    assert (scale.full, scale.thinning, scale.neighbors) == (False, 1, FEW)


@pytest.mark.few(kind=1)
@pytest.mark.parametrize("kind", ["ball", "cube", "normal"])
def test_planes_go_through_all_neighbors_where_points_or_noise_fill_them(kind):
    assert {scale_of(filled(kind, 10_000, seed)).neighbors for seed in range(3)} == {NEIGHBORS}


@pytest.mark.few(spacings=3)
@pytest.mark.parametrize("spacings", [0.0, 0.5, 1.0, 2.0, 4.0])
def test_a_sheet_is_thinned_as_far_as_its_noise_asks_for(spacings):
    """Of one in t points the spacing is √t of the cloud's: from that of the noise to eight times as much."""
    rng, count = np.random.default_rng(4), 20_000
    points = np.column_stack([rng.uniform(size=(count, 2)), spacings / np.sqrt(count) * rng.normal(size=count)])
    scale = scale_of(points)
    assert not scale.full
    assert scale.flatness <= 2 * FLAT
    assert scale.thinning == 1 if spacings == 0 else spacings < np.sqrt(scale.thinning) < 8 * spacings


def test_neighbors_on_a_line_or_in_one_place_show_no_surface():
    line = np.outer(np.random.default_rng(0).random(60), [1.0, -2.0, 0.5])
    assert flatness_of(line) == 1
    assert flatness_of(np.ones((60, 3))) == 1
