import tracemalloc

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf import PatchBlend, PUInterpolant, TiledField
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.fitting.pu.blend import BATCH_SIZE, WORKING_MEMORY
from tolerances import ANALYTIC_VS_DIFFERENCE, FADE_TWIN, HESSIAN_DIFFERENCE, PERIODIC


def patch(seed, extent=(4.0, 3.0), depth=(-1.0, 1.0), unit="mm"):
    rng = np.random.default_rng(seed)
    box = np.array([[0, 0, depth[0]], [*extent, depth[1]]])
    points = rng.uniform(*box, (1500, 3))
    values = np.sin(2 * points[:, 0] + seed) + np.cos(3 * points[:, 1] - seed) - (1 + 0.3 * seed) * points[:, 2]
    return PUInterpolant.fit(points, values, points_per_ball=(40, 80), unit=unit, bounds=box)


@pytest.fixture(scope="module")
def base():
    return TiledField(patch(0), (3.1, 2.3), (0.5, 0.3), fade=0.2)


@pytest.fixture(scope="module")
def middle():
    """Five per cent off along, and deeper."""
    return TiledField(patch(1, depth=(-1.2, 1.5)), (3.25, 2.3), (0.4, 0.3), fade=0.2, shift=0.0)


@pytest.fixture(scope="module")
def tip():
    return TiledField(patch(2), (3.1, 2.2), (0.5, 0.3), fade=0.2)


@pytest.fixture(scope="module")
def along(base, middle, tip):
    return PatchBlend([base, middle, tip], [10.0, 25.0], 1.5)


@pytest.fixture(scope="module")
def sides(base, tip):
    return PatchBlend([base, tip], [0.1], 0.3, axis="up")


def queries(count=400, seed=0):
    return np.random.default_rng(seed).uniform([-5, -6, -1.6], [40, 9, 1.9], (count, 3))


def test_one_patch_alone_is_itself(base):
    blend, points = PatchBlend([base], []), queries()
    assert np.array_equal(blend(points), base(points))
    assert np.array_equal(blend.gradient(points), base.gradient(points))


def test_away_from_the_breaks_each_patch_is_seen_alone_and_stretched(along, base, middle, tip):
    for texture, low, high in ((base, -30, 8.4), (middle, 11.6, 23.4), (tip, 26.6, 60)):
        points = np.random.default_rng(1).uniform([low, -6, -0.9], [high, 9, 0.9], (300, 3))
        expected = texture(points * [*(texture.period / along.period), 1.0])
        assert np.abs(along(points) - expected).max() <= PERIODIC


def test_in_a_band_it_is_the_weighted_mean(along, base, middle):
    x = 10.0 + np.linspace(-1.49, 1.49, 80)
    u = (x - 8.5) / 3.0
    weight = u**3 * (10 - 15 * u + 6 * u**2)
    points = np.column_stack([x, np.random.default_rng(2).uniform([-6, -0.9], [9, 0.9], (80, 2))])
    left, right = (each(points * [*(each.period / along.period), 1.0]) for each in (base, middle))
    expected = (1 - weight) * left + weight * right
    assert np.abs(along(points) - expected).max() <= FADE_TWIN * np.abs(expected).max()


def test_patches_that_are_equal_blend_into_themselves(base):
    """The weights sum to one, and so do their slopes to nothing."""
    blend, points = PatchBlend([base, base, base], [10.0, 25.0], 3.0), queries(2000)
    assert np.abs(blend(points) - base(points)).max() <= PERIODIC
    assert np.abs(blend.gradient(points) - base.gradient(points)).max() <= PERIODIC


@pytest.mark.parametrize("name", ["along", "sides", "both"])
def test_its_derivatives_are_differences(name, along, sides, base, request):
    blend = PatchBlend([base, sides], [12.0], 4.0) if name == "both" else request.getfixturevalue(name)
    points, step = queries(600, 3), 1e-5
    points[::3, 0] = 10 + np.random.default_rng(4).uniform(-1.5, 1.5, 200)
    # Where the patch ends, above or below, the field has a corner.
    ends = np.array([-1.2, -1.0, 1.0, 1.5])
    points = points[np.abs(points[:, 2:] - ends).min(axis=1) > 10 * step]
    numeric = np.stack([(blend(points + step * e) - blend(points - step * e)) / (2 * step) for e in np.eye(3)], axis=1)
    found = blend.gradient(points)
    assert np.abs(numeric - found).max() <= 10 * ANALYTIC_VS_DIFFERENCE
    pairs = [(blend.gradient(points + step * e), blend.gradient(points - step * e)) for e in np.eye(3)]
    bends = np.stack([(after - before) / (2 * step) for after, before in pairs], axis=1)
    found = blend.hessian(points)
    assert np.abs(bends - found).max() <= 100 * HESSIAN_DIFFERENCE * np.abs(found).max()


def test_it_repeats_across_everywhere_and_along_between_the_breaks(along, sides):
    points = queries()
    assert np.abs(along(points + [0, 4 * along.period[1], 0]) - along(points)).max() <= PERIODIC
    whole = np.append(3 * sides.period * [1, -2], 0)
    assert np.abs(sides(points + whole) - sides(points)).max() <= PERIODIC


def test_sides_show_one_patch_below_and_one_above(sides, base, tip):
    """Within their own heights: beyond, both fall, each as steeply as its patch does."""
    points = queries()
    scale = [np.append(each.period / sides.period, 1.0) for each in (base, tip)]
    bottom, top = max(base.cell[0, 2], sides.cell[0, 2]), min(tip.cell[1, 2], sides.cell[1, 2])
    low, high = (points[:, 2] < -0.2) & (points[:, 2] >= bottom), (points[:, 2] > 0.4) & (points[:, 2] <= top)
    assert min(low.sum(), high.sum()) > 5
    assert np.abs(sides(points[low]) - base(points[low] * scale[0])).max() <= PERIODIC
    assert np.abs(sides(points[high]) - tip(points[high] * scale[1])).max() <= PERIODIC


@pytest.mark.parametrize("name", ["along", "both"])
def test_tiles_of_one_key_are_translates_of_one_another(name, along, sides, base):
    blend = along if name == "along" else PatchBlend([base, sides], [12.0], 1.0)
    size = blend.period[0]
    inside = np.random.default_rng(5).uniform([0, 0, -0.9], [size, blend.period[1], 0.9], (200, 3))
    inside[:2, 0] = 0, size
    tiles, values = range(-3, 14), {}
    for p in tiles:
        found = blend(inside + [blend.cell[0, 0] + p * size, 0, 0])
        key = blend.tile_key(p)
        assert np.abs(found - values.setdefault(key, found)).max() <= PERIODIC
    distinct = list(values.values())
    assert 3 <= len(distinct) < len(tiles)
    assert all(np.abs(a - b).max() > 1e-3 for i, a in enumerate(distinct) for b in distinct[:i])


def test_a_stretch_keeps_the_breaks_of_a_blend_within_a_blend(along, base):
    """Sides of which one is itself several patches along: stretched to a new period, it breaks where it did."""
    longer = TiledField(patch(3), (3.3, 2.3), (0.4, 0.3), fade=0.2)
    blend = PatchBlend([longer, along], [0.0], 0.2, axis="up")
    assert blend.local.textures[1].breaks.tolist() == along.breaks.tolist()
    assert np.array_equal(blend.local.textures[1].period, blend.period)
    assert len({blend.tile_key(p) for p in range(12)}) > 2


def test_it_falls_with_the_distance_above_and_below(along):
    rim = np.array([[9.0, 7.0, 1.5], [31.0, 1.0, 1.5]])
    assert along.bounds[:, 2].tolist() == [-1.2, 1.5]
    assert along.fall == max(each.fall for each in along.textures) > 0
    np.testing.assert_allclose(along(rim + [[0, 0, 2.5]]), along(rim) - 2.5 * along.fall)
    assert np.all(along.gradient(rim + [[0, 0, 2.5]])[:, 2] == -along.fall)


def test_it_comes_back_from_a_file(along, sides, base, tmp_path):
    points = queries()
    for number, blend in enumerate([along, PatchBlend([base, sides], [12.0])]):
        blend.save(tmp_path / f"{number}.o3l")
        found = o3l.load(tmp_path / f"{number}.o3l")
        assert np.array_equal(found(points), blend(points))
        assert np.array_equal(found.gradient(points), blend.gradient(points))
        assert [found.tile_key(p) for p in range(9)] == [blend.tile_key(p) for p in range(9)]
        assert found.unit == "mm"


def test_blends_that_cannot_be_meant_are_refused(base, middle):
    with pytest.raises(InputError, match="at least one"):
        PatchBlend([], [])
    with pytest.raises(InputError, match="breaks"):
        PatchBlend([base, middle], [1.0, 2.0])
    with pytest.raises(InputError, match="fade less"):
        PatchBlend([base, middle, base], [10.0, 11.0], 0.6)
    with pytest.raises(InputError, match="near one another"):
        PatchBlend([base, TiledField(patch(1), (2.0, 2.3))], [10.0])
    with pytest.raises(UnitError, match="one unit"):
        PatchBlend([base, TiledField(patch(1, unit="um"), (3.1, 2.3))], [10.0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cropped", "blend of blends"])
def test_it_keeps_to_the_memory_that_a_blend_promises(kind):
    """Beside arguments and result, Hessians at more than a chunk of points: what they need is the most."""
    points = np.random.default_rng(0).random((200, 3))
    small = PUInterpolant.fit(points, np.sin(5 * points).sum(axis=1), points_per_ball=(20, 40))
    texture = TiledField(small, (0.8, 0.8), (0.1, 0.1), fade=0.05)
    if kind != "cropped":
        sides = PatchBlend([texture, texture], [0.5], 0.1, axis="up")
        texture = PatchBlend([sides, sides], [0.5], 0.1)
    queries = np.random.default_rng(1).random((BATCH_SIZE * 9 // 8, 3))
    texture.hessian(points)
    tracemalloc.start()
    try:
        result = texture.hessian(queries)
        needed = tracemalloc.get_traced_memory()[1] - result.nbytes
    finally:
        tracemalloc.stop()
    assert 0.5 * WORKING_MEMORY < needed <= WORKING_MEMORY
