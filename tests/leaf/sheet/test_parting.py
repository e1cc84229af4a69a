"""Theorems of layers over a sheet: told apart where the scan is clean, and only what lies over it, parallel, is one."""

import numpy as np
import pytest

from o3dleaf.leaf.sheet.layers.parting import other_layers, part_layers
from o3dleaf.leaf.sheet.layers.widths import find_layers
from o3dleaf.leaf.sheet.open_sheets import OpenSheets
from o3dleaf.leaf.sheet.sheet import find_sheet

STEP = 0.8


def patch(seed, low, high, height=0.0):
    """Return random points, 1/STEP² a unit of area, at a height over a part of a bent sheet."""
    rng = np.random.default_rng(seed)
    low, high = np.array(low), np.array(high)
    t, v = rng.uniform(low, high, (int(np.prod(high - low) / STEP**2), 2)).T
    reach = 40.0 + height
    return np.column_stack([reach * np.sin(t / 40.0), v, reach * np.cos(t / 40.0)])


@pytest.mark.few(seed=1, height=1)
@pytest.mark.parametrize("height", [0.8 * STEP, 1.5 * STEP])
@pytest.mark.parametrize("seed", [0, 1])
def test_of_two_layers_closer_than_the_points_the_larger_is_the_sheet_and_the_other_named(seed, height):
    leaf, other = patch(seed, [0, 0], [50, 20]), patch(seed + 10, [15, 5], [30, 13], height)
    sheet = find_sheet(np.concatenate([leaf, other]))
    assert np.array_equal(sheet.rows, np.arange(len(leaf)))
    assert (np.abs(np.linalg.norm(sheet.vertices[:, [0, 2]], axis=1) - 40.0) < 1e-9).all()
    assert sheet.scale == 0
    told = [note for note in sheet.leftovers.tell() if f"another layer, {len(other):,} points" in note]
    assert f"{height:.3g} off the sheet; `piece` takes it instead" in told[0]
    taken = find_sheet(np.concatenate([leaf, other]), piece=2)
    assert np.array_equal(taken.rows, np.arange(len(leaf), len(leaf) + len(other)))
    assert not any("meet" in note for note in sheet.leftovers.tell())


def test_a_second_layer_over_all_of_it_is_a_pass():
    leaf, again = patch(0, [0, 0], [50, 20]), patch(10, [0, 0], [50, 20], 0.8 * STEP)
    assert not len(other_layers(np.concatenate([leaf, again]), STEP, 0.0))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_one_layer_is_one(noise):
    points = patch(2, [0, 0], [50, 20])
    points += noise * STEP * np.random.default_rng(3).normal(size=points.shape)
    assert np.mean(part_layers(points, STEP, noise * STEP) == 0) > 0.995


def with_points(others, normals):
    """Return a flat sheet of 20 x 20 squares with other points that do not belong to it."""
    x, y = np.meshgrid(np.arange(21.0), np.arange(21.0), indexing="ij")
    grid = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    corner = (21 * np.arange(20)[:, np.newaxis] + np.arange(20)).ravel()
    halves = [corner[:, np.newaxis] + [0, 21, 22], corner[:, np.newaxis] + [0, 22, 1]]
    triangles = np.concatenate(halves).astype(np.int64)
    upright = np.tile([0.0, 0.0, 1.0], (len(grid), 1))
    return OpenSheets(
        np.concatenate([grid, others]),
        np.concatenate([upright, normals]),
        grid,
        triangles,
        np.zeros(len(triangles), np.int64),
        np.array([400.0]),
        np.empty((0, 3)),
        1.0,
        3.0,
    )


@pytest.mark.parametrize(("angle", "is_layer"), [(0, True), (50, True), (65, False)])
def test_a_layer_lies_above_the_sheet_and_parallel_to_it(angle, is_layer):
    row = np.linspace(5, 15, 12)[:, np.newaxis]
    above, beside = row * [1, 0, 0] + [0, 10, 2.0], row * [1, 0, 0] + [0, 22.5, 0.5]
    normal = np.tile([np.sin(np.radians(angle)), 0.0, np.cos(np.radians(angle))], (24, 1))
    places, need = find_layers(with_points(np.concatenate([above, beside]), normal))
    assert len(places) == (len(above) if is_layer else 0)
    assert (places[:, 2] == 2.0).all()
    assert np.allclose(need, 2.0)
