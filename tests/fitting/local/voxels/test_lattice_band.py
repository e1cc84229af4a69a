"""A fit in a narrow band: around the surface it is the whole fit, and elsewhere it stays on the side of its voxels."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import PUInterpolant, extract_isosurface, get_num_threads, load, set_num_threads
from o3dleaf.core.errors import InputError
from o3dleaf.core.resources import scratch
from o3dleaf.core.resources.measured import LEFT_VOXEL, VOLUME
from o3dleaf.fitting.cover import lattice_band
from o3dleaf.fitting.cover.lattice_band import LatticeBand
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.local.splines import Splines
from o3dleaf.fitting.local.voxels import lattice_fit
from o3dleaf.fitting.local.voxels.lattice_balls import averaged_voxels
from tolerances import POLYNOMIAL, ROUNDING, SHARED_FACTOR

SPACING = np.array([2.0, 3.0, 2.5])
ORIGIN = np.array([100.0, -50.0, 7.0])


def solid(shape=(48, 44, 40), noise=0.05, seed=0):
    """A ball with a void in it, 1 inside and −1 outside, blurred over two voxels, off the middle."""
    places = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1)
    far, hole = (np.linalg.norm(places - np.array(middle), axis=-1) for middle in ([25, 21, 18], [29, 21, 18]))
    return np.tanh(np.minimum(14 - far, hole - 4)) + noise * np.random.default_rng(seed).normal(size=shape)


def fits(values, **options):
    options = {"spacing": SPACING, "origin": ORIGIN, "rho": "gcv", "points_per_ball": 60, **options}
    return PUInterpolant.fit_lattice(values, **options), PUInterpolant.fit_lattice(values, band=True, **options)


def bare_balls(field):
    return np.flatnonzero(field.cover.counts == 0)


def near_bare(field, points):
    cover, balls = field.cover, bare_balls(field)
    near, tree = np.zeros(len(points), dtype=bool), cKDTree(points)
    for rows in tree.query_ball_point(cover.centers[balls], cover.radii[balls]):
        near[rows] = True
    return near


def queries(field, count=6000):
    return np.random.default_rng(1).uniform(*field.bounds, (count, field.bounds.shape[1]))


@pytest.mark.parametrize("options", [{}, {"smoothing": 0.0}, {"kernel": "linear"}, {"overlap": 1.4}])
def test_where_the_balls_are_those_of_the_whole_fit_it_is_the_whole_fit(options):
    if options:
        options["rho"] = None
    whole, band = fits(solid(), **options)
    assert len(bare_balls(band)) > 0.1 * len(band.cover.radii)
    assert band.local.smoothing == whole.local.smoothing
    at = queries(band)
    expected, found, elsewhere = whole(at), band(at), near_bare(band, at)
    np.testing.assert_array_equal(found > 0, expected > 0)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found[~elsewhere], expected[~elsewhere], rtol=0, atol=SHARED_FACTOR * scale)
    np.testing.assert_allclose(
        band.gradient(at[~elsewhere]), whole.gradient(at[~elsewhere]), rtol=0, atol=SHARED_FACTOR * scale
    )
    # Wherever the surface can be, and half of a voxel beside it.
    assert not np.any(elsewhere & (np.abs(expected) < 0.5))


@pytest.mark.parametrize("noise", [0.2, 0.4])
def test_noise_that_the_fit_averages_away_does_not_widen_the_band(noise):
    whole, band = fits(solid(noise=noise), points_per_ball=160)
    assert len(bare_balls(band)) > 0.1 * len(band.cover.radii)
    at = queries(band)
    np.testing.assert_array_equal(band(at) > 0, whole(at) > 0)


@pytest.mark.parametrize("smoothing", [0.0, 0.3, 30.0])
def test_averaged_voxels_is_by_how_much_noise_of_the_fit_is_smaller(smoothing):
    cover = VoxelCover.fit((30, 30, 30), np.eye(3), 60, 1.1)
    model = Splines(smoothing=smoothing).model(3)
    noise = np.random.default_rng(0).normal(size=(30, 30, 30))
    field = PUInterpolant.fit_lattice(noise, spacing=1.0, smoothing=smoothing, points_per_ball=60)
    middle = cover.starts[cover.classes == np.bincount(cover.classes).argmax()] + cover.tile // 2
    assert np.var(field(middle)) == pytest.approx(1 / averaged_voxels(cover, model), rel=0.4)


def test_threads_and_the_layout_in_memory_do_not_change_a_bit():
    values, before, found = solid(), get_num_threads(), []
    for threads, lies in ((1, values), (2, np.asfortranarray(values)), (4, values.transpose(1, 0, 2).copy())):
        set_num_threads(threads)
        data = lies.transpose(1, 0, 2) if threads == 4 else lies
        field = PUInterpolant.fit_lattice(data, spacing=SPACING, smoothing=0.3, band=True, points_per_ball=60)
        found.append((field.local.weights.tobytes(), field.local.tails.tobytes(), field.data_hash))
    set_num_threads(before)
    assert found[0] == found[1] == found[2]


def test_its_surface_is_that_of_the_whole_fit():
    whole, band = fits(solid())
    expected, found = (extract_isosurface(field, 2.0) for field in (whole, band))
    np.testing.assert_array_equal(np.asarray(found.triangles), np.asarray(expected.triangles))
    np.testing.assert_allclose(np.asarray(found.vertices), np.asarray(expected.vertices), rtol=0, atol=SHARED_FACTOR)


def test_all_voxels_around_a_bare_ball_lie_on_one_side_and_every_query_in_a_ball():
    values = solid()[:, :, :24]
    cover = VoxelCover.fit(values.shape, np.diag(SPACING), 60, 1.1).banded(values, 0.0)
    places = np.argwhere(np.ones(values.shape, dtype=bool))
    centers, radii, inside = cover.centers(np.zeros(3)), cover.radii, values.ravel() > 0
    assert set(cover.levels[cover.bare]) >= {0, 1}
    for ball in [*np.flatnonzero(cover.levels), *np.flatnonzero(cover.bare)[::7]]:
        away = np.maximum(np.abs(places * SPACING - centers[ball]) - 2 * SPACING, 0.0)
        around = inside[np.linalg.norm(away, axis=1) <= radii[ball]]
        assert around.all() or not around.any()
    tree, covered = cKDTree(places * SPACING), np.zeros(len(places), dtype=bool)
    for rows in tree.query_ball_point(centers, radii):
        covered[rows] = True
    assert covered.all()


@pytest.mark.parametrize("shape", [(400,), (90, 81), (40, 37, 30)])
def test_planes_are_reproduced_in_all_balls(shape):
    places = np.argwhere(np.ones(shape, dtype=bool)).astype(float)
    slope = np.array([1.0, 0.3, -0.2])[: len(shape)]
    values = (places @ slope - 0.8 * shape[0]).reshape(shape)
    band = PUInterpolant.fit_lattice(values, spacing=1.0, band=True, smoothing=5.0, points_per_ball=40)
    assert len(bare_balls(band)) > 0
    at = queries(band, 3000)
    expected = at @ slope - 0.8 * shape[0]
    np.testing.assert_allclose(band(at), expected, rtol=0, atol=POLYNOMIAL * shape[0])


def test_a_bare_ball_keeps_the_side_of_its_voxels_however_steep_they_are():
    """The plane of least squares through a step from 1 to 4.8 in the middle of a ball is below zero at its edge."""
    shape, lowest = (60, 24, 24), []
    unit = np.random.default_rng(0).normal(size=(500, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, np.newaxis]
    for middle in range(27, 33):
        values = np.where(np.arange(shape[0]) < middle, 1.0, 4.8)[:, np.newaxis, np.newaxis] * np.ones(shape)
        band = PUInterpolant.fit_lattice(values, spacing=1.0, band=True, smoothing=0.0, points_per_ball=200)
        balls, exponents = bare_balls(band), band.local.exponents
        assert len(balls) == len(band.cover.radii)
        lowest.append((np.prod(unit[:, np.newaxis, :] ** exponents, axis=2) @ band.local.tails[balls].T).min())
    assert min(lowest) > 0


def test_the_coefficients_go_with_the_surface_and_not_with_the_volume():
    values = solid((48, 44, 40))
    lengths = [PUInterpolant.fit_lattice(values, spacing=1.0, band=True, smoothing=0.1, points_per_ball=60)]
    more = np.pad(values, [(0, 96), (0, 88), (0, 80)], mode="constant", constant_values=-1.0)
    lengths.append(PUInterpolant.fit_lattice(more, spacing=1.0, band=True, smoothing=0.1, points_per_ball=60))
    few, many = (len(field.local.weights) for field in lengths)
    assert many < 1.2 * few
    # 27 times the volume; balls of all sizes, each with a face to one that is half as large, add a layer for each size.
    few, many = (len(field.cover.radii) for field in lengths)
    assert many < 3 * few


def test_a_band_of_all_voxels_is_the_whole_fit():
    """Noise as large as the contrast leaves no tile far from the level."""
    whole, band = fits(solid(noise=3.0))
    at = queries(band, 3000)
    assert len(bare_balls(band)) == 0
    np.testing.assert_array_equal(band(at), whole(at))


def test_coefficients_in_a_file_are_the_same_bits(monkeypatch, tmp_path):
    """Where they would take too much of the memory that may be used, they lie on the disk."""
    _, band = fits(solid())
    monkeypatch.setattr(scratch, "is_held", lambda *_: False)
    _, mapped = fits(solid())
    at = queries(band, 3000)
    np.testing.assert_array_equal(mapped(at), band(at))
    np.testing.assert_array_equal(mapped.rough(at), band.rough(at))
    mapped.save(tmp_path / "mapped.o3l")
    band.save(tmp_path / "held.o3l")
    assert (tmp_path / "mapped.o3l").read_bytes() == (tmp_path / "held.o3l").read_bytes()
    splines, index = mapped.local, mapped.index
    by_ball = splines.offsets, splines.places, splines.tails, splines.ranks, splines.dropped
    for array in (splines.weights, *by_ball, index.balls, index.centers, index.radii, index.shifts, index.tree.images):
        assert isinstance(array.base, np.memmap)


def test_what_a_band_needs_is_refused_by_its_size_and_what_lies_in_files_is_not_counted(monkeypatch):
    values = solid()
    cover = VoxelCover.fit(values.shape, np.eye(3), 60, 1.1).banded(values, 0.0)
    asked = []
    monkeypatch.setattr(lattice_fit, "require_resources", lambda cost, what, _: asked.append((cost.bytes, what)))
    lattice_fit.require_room_for_voxels(values.size, None)
    lattice_fit.require_room_for_voxels(values.size, cover)
    monkeypatch.setattr(lattice_fit, "is_held", lambda *_: False)
    lattice_fit.require_room_for_voxels(values.size, cover)
    whole, band, mapped = (size for size, _ in asked)
    assert band - VOLUME.bytes < 0.9 * (whole - VOLUME.bytes)
    assert mapped == VOLUME.bytes + LEFT_VOXEL.bytes * values.size
    assert "near the surface" in asked[1][1]


def test_single_precision_and_files_and_diagnostics_know_bare_balls(tmp_path):
    _, band = fits(solid())
    at = queries(band, 3000)
    values = band(at)
    assert np.abs(band.rough(at) - values).max() <= band.rough_error + ROUNDING
    band.save(tmp_path / "band.o3l")
    np.testing.assert_array_equal(load(tmp_path / "band.o3l")(at), values)
    some = np.flatnonzero(band.cover.counts)
    assert (band.diagnostics(some[:5]).points > 0).all()
    with pytest.raises(InputError, match="bare"):
        band.diagnostics(bare_balls(band)[:2])
    with pytest.raises(InputError, match="give one of them"):
        PUInterpolant.fit_lattice(solid(), spacing=1.0, band=True, mask=np.ones((48, 44, 40), dtype=bool))


@pytest.mark.slow
def test_its_memory_goes_with_the_surface_and_not_with_the_volume():
    """Of four million bytes a ball of a thousandth: all else is a few bytes a voxel, where a whole fit has 30."""
    places = np.stack(np.meshgrid(*[np.arange(160, dtype=np.float32)] * 3, indexing="ij"), axis=-1)
    values = (200 * (np.linalg.norm(places - 70, axis=-1) < 12)).astype(np.uint8)
    tracemalloc.start()
    field = PUInterpolant.fit_lattice(values, spacing=1.0, isovalue=100.0, band=True, smoothing=0.1)
    held, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert field([[70.0, 70, 70], [100, 100, 100]]).tolist() == pytest.approx([100, -100], rel=0.01)
    assert held < 2 * values.size
    assert peak < 8 * values.size


@pytest.mark.few
@pytest.mark.parametrize("shape", [(48, 44, 40), (9, 70, 31), (31, 5, 60)])
@pytest.mark.parametrize("averaged", [1.0, 30.0])
def test_a_layer_is_looked_at_in_parts_as_in_one(shape, averaged, monkeypatch):
    axis = int(np.argmax(shape))
    along = np.moveaxis(
        np.broadcast_to(np.arange(max(shape)), np.delete(shape, axis).tolist() + [max(shape)]), -1, axis
    )
    values = np.tanh(6 - np.abs(along - 22)) + 0.05 * np.random.default_rng(0).normal(size=shape)
    tile, reach = np.array([4, 3, 5]), np.array([2, 3, 2])
    found = []
    for part in (1, 3000, 1 << 30):
        monkeypatch.setattr(lattice_band, "PART", part)
        orders = values, np.asfortranarray(values)
        found += [LatticeBand.of(data, 0.0, tile, reach, averaged).far for data in orders]
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])
    assert 0.02 < found[0].mean() < 0.98
