"""A lattice call is the field at the lattice's points, bit for bit, without anybody holding their coordinates."""

import itertools

import numpy as np
import pytest

from o3dleaf import PUInterpolant, TiledField
from o3dleaf.core import lattice as sampling
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, MemoryBudgetError
from o3dleaf.core.lattice import Lattice


def fitted(d):
    points = np.random.default_rng(d).random((300, d))
    return PUInterpolant.fit(points, np.sin(5 * points).sum(axis=1), points_per_ball=(30, 60))


def literal_points(low, high, step):
    """All whole multiples of the steps that cover the box, the last axis running fastest."""
    axes = [
        s * np.arange(np.floor(a / s + 1e-9), np.ceil(b / s - 1e-9) + 1)
        for a, b, s in zip(low, high, step, strict=True)
    ]
    return np.array(list(itertools.product(*axes))), tuple(len(axis) for axis in axes)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_it_is_the_field_at_the_points_bit_for_bit(d, dtype):
    """One step or one an axis; a box that leaves the field's bounds."""
    field = fitted(d)
    low, high = np.linspace(-0.3, 0.1, d), np.linspace(0.8, 1.4, d)
    for spacing in (0.25, 0.125 * (1 + np.arange(d))):
        lattice, values = field.on_lattice([low, high], spacing, dtype=dtype)
        points, shape = literal_points(low, high, np.broadcast_to(spacing, d))
        assert values.shape == lattice.shape == shape
        assert values.dtype == dtype
        np.testing.assert_array_equal(lattice.positions(np.argwhere(np.ones(shape))), points)
        np.testing.assert_array_equal(values.ravel(), field(points, dtype=dtype))


def test_a_tiled_field_has_no_end_on_a_lattice():
    field = TiledField(fitted(3))
    lattice, values = field.on_lattice([[-20, 30, -1], [-19, 31, 2]], 0.25)
    points = lattice.positions(np.argwhere(np.ones(lattice.shape)))
    np.testing.assert_array_equal(values.ravel(), field(points))


@pytest.mark.parametrize("block", [1, 7, 100])
@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_blocks_do_not_change_a_bit_and_progress_reaches_the_end(d, block, monkeypatch):
    field, seen = fitted(d), []
    box = [[0] * d, [1] * d]
    expected = field.on_lattice(box, 0.2)[1]
    whole = sampling.sample_lattice
    monkeypatch.setattr("o3dleaf.fitting.pu.blend.sample_lattice", lambda *a, **k: whole(*a, **k, block=block))
    with progress.listening(lambda *at: seen.append(at)):
        np.testing.assert_array_equal(field.on_lattice(box, 0.2)[1], expected)
        assert seen[-1][0] == seen[-1][1]
    assert all(a[0] <= b[0] for a, b in itertools.pairwise(seen))


@pytest.mark.parametrize(
    ("bounds", "spacing", "error", "words"),
    [
        ([[0] * 3, [1] * 3], -0.1, InputError, "above zero"),
        ([[0] * 3, [1] * 3], np.nan, InputError, "above zero"),
        ([[0] * 3, [1] * 3], [0.1, 0.1], InputError, "one number, or one per axis"),
        ([[0] * 3, [1] * 3], 1e-5, MemoryBudgetError, "lattice points are too many; coarsen"),
        ([[0] * 2, [1] * 2], 0.1, InputError, "\\(n, 3\\)"),
        ([[1] * 3, [0] * 3], 0.1, InputError, "the lower, then the upper one"),
        ([[0] * 3, [np.inf] * 3], 0.1, InputError, "infinite"),
    ],
)
def test_what_cannot_be_meant_is_refused(bounds, spacing, error, words):
    with pytest.raises(error, match=words):
        fitted(3).on_lattice(bounds, spacing)


@pytest.mark.few
@pytest.mark.parametrize("kernel", ["cubic", "quintic", "linear"])
@pytest.mark.parametrize("origin", [[0.0] * 3, [0.37, -11.2, 4.0]])
def test_rough_values_on_the_voxels_lattice_are_within_their_error(kernel, origin):
    """Where the lattice has the voxels' step or a part of it, wherever it begins, and its ends lie in the box."""
    values = np.sin(np.add.outer(np.add.outer(np.arange(20) / 3, np.arange(17) / 4), np.arange(18) / 2))
    field = PUInterpolant.fit_lattice(values, spacing=0.4, origin=origin, kernel=kernel, points_per_ball=80)
    low, high = field.bounds
    for step in (0.4, 0.2):
        lattice = Lattice.covering([low + 0.4, high - 0.4], step)
        rough = field.rough_on(lattice)
        exact = field(lattice.positions(np.argwhere(np.ones(lattice.shape)))).reshape(lattice.shape)
        assert rough.dtype == np.float32
        assert 0 < np.abs(rough - exact).max() < field.rough_error < 0.1 * np.abs(exact).max()


def test_other_lattices_and_other_fits_have_no_faster_rough_values():
    values = np.random.default_rng(3).normal(size=(20, 17, 18))
    field = PUInterpolant.fit_lattice(values, spacing=0.4, points_per_ball=80)
    assert field.rough_on(Lattice.covering([[1.0] * 3, [5.0] * 3], 0.3)) is None
    points = np.random.default_rng(4).random((300, 3))
    assert PUInterpolant.fit(points, points[:, 0]).rough_on(Lattice.covering([[0] * 3, [1] * 3], 0.1)) is None
