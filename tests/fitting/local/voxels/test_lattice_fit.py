"""The fit of voxels: balls that sit alike share one factorisation, and nothing else is changed by it."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import reference
from o3dleaf import PUInterpolant, get_num_threads, load, set_num_threads
from o3dleaf.core.errors import IllPosedError, InputError
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.lattice_cover import VoxelCover
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.fitting.local.smoothing_selection import GCV_BALLS
from o3dleaf.fitting.local.splines import fit_splines
from o3dleaf.fitting.rbf.kernels import as_kernel
from o3dleaf.fitting.rbf.smoothing import Spectrum, SplineModel, choose_by_gcv, gcv_score
from o3dleaf.fitting.rbf.spectrum_loops import spectra
from o3dleaf.fitting.rbf.tail import tail_exponents
from tolerances import GCV_CHOICE, POLYNOMIAL, ROUNDING, SHARED_DIAGNOSTICS, SHARED_FACTOR

SPACING = np.array([2.0, 3.0, 2.5])
ORIGIN = np.array([100.0, -50.0, 7.0])


def data(shape=(23, 17, 19), seed=0):
    rng = np.random.default_rng(seed)
    grid = np.meshgrid(*[np.arange(n) for n in shape], indexing="ij")
    return sum(np.sin(0.5 * axis + k) for k, axis in enumerate(grid)) + 0.05 * rng.normal(size=shape)


def positions(shape, spacing=SPACING, origin=ORIGIN, transform=None):
    points = np.ascontiguousarray(np.argwhere(np.ones(shape, dtype=bool)) * spacing + origin)
    return points if transform is None else points @ transform[:3, :3].T + transform[:3, 3]


def general_path(field, points, values, **options):
    """The same balls, each of them fitted by itself to all the points in it."""
    # A rounding more, so that voxels on the rim of a turned ball are in it.
    reach = field.cover.radii * (1 + 1e-12)
    rows = cKDTree(points).query_ball_point(field.cover.centers, reach, return_sorted=True)
    offsets = np.concatenate([[0], np.cumsum([len(row) for row in rows])])
    cover = Cover(field.cover.centers, field.cover.radii, field.cover.bounds, offsets, np.concatenate(rows))
    kernel = as_kernel(options.get("kernel", "cubic"), points.shape[1])
    degree = options.get("degree", kernel.degree)
    model = SplineModel(kernel, degree, field.local.smoothing)
    splines = fit_splines(cover, ScatteredData(points, values), model)
    return PUInterpolant(cover, field.index, splines, None)


def queries_in(field, count=3000):
    return np.random.default_rng(1).uniform(*field.bounds, (count, field.bounds.shape[1]))


def turned(shape):
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    transform[:3, 3] = [1.0, 2.0, 3.0]
    middle = positions(shape, transform=transform).mean(axis=0)
    return transform, np.array([middle - 8.0, middle + 8.0])


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"rho": 1e-2},
        {"smoothing": 3.0},
        {"rho": "gcv"},
        {"degree": 1, "points_per_ball": 60},
        {"degree": 3, "smoothing": 1.0},
        {"kernel": "quintic", "smoothing": 10.0},
        {"kernel": "linear", "overlap": 1.4},
    ],
)
def test_it_equals_the_fit_of_every_ball_by_itself(options):
    values = data()
    field = PUInterpolant.fit_lattice(values, spacing=SPACING, origin=ORIGIN, **options)
    twin = general_path(field, positions(values.shape), values.ravel(), **options)
    at = queries_in(field)
    expected = twin(at)
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=SHARED_FACTOR * np.abs(expected).max())
    np.testing.assert_array_equal(field.local.ranks, twin.local.ranks)


def test_a_turned_lattice_has_the_same_balls_turned():
    values = data()
    transform, box = turned(values.shape)
    field = PUInterpolant.fit_lattice(
        values, spacing=SPACING, origin=ORIGIN, transform=transform, bounds=box, smoothing=0.1, unit="um"
    )
    twin = general_path(field, positions(values.shape, transform=transform), values.ravel())
    at = queries_in(field)
    expected = twin(at)
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=SHARED_FACTOR * np.abs(expected).max())
    plain = PUInterpolant.fit_lattice(values, spacing=SPACING, origin=ORIGIN, smoothing=0.1)
    inverse = (at - transform[:3, 3]) @ transform[:3, :3]
    np.testing.assert_allclose(field(at), plain(inverse), rtol=0, atol=SHARED_FACTOR * np.abs(expected).max())


@pytest.mark.parametrize("shape", [(40,), (30, 21), (9, 9, 2), (2, 2, 2), (3, 40, 1)])
def test_any_dimension_and_thin_lattices(shape):
    values = data(shape)
    field = PUInterpolant.fit_lattice(values, spacing=2.0, smoothing=0.1, points_per_ball=50)
    twin = general_path(field, positions(shape, 2.0, 0.0), values.ravel())
    at = np.vstack([queries_in(field, 500), field.bounds])
    expected = twin(at)
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=SHARED_FACTOR * np.abs(expected).max())


def test_integers_are_read_as_they_lie_and_less_the_isovalue():
    values = np.random.default_rng(0).integers(0, 255, (12, 14, 13)).astype(np.uint8)
    field = PUInterpolant.fit_lattice(values[::-1], spacing=1.0, isovalue=100.0, rho=0.01)
    same = PUInterpolant.fit_lattice(values[::-1].astype(float) - 100.0, spacing=1.0, rho=0.01)
    at = queries_in(field)
    np.testing.assert_array_equal(field(at), same(at))


def test_polynomials_of_the_tail_are_reproduced():
    shape = (20, 18, 16)
    points = positions(shape)
    unit = (points - points.mean(axis=0)) / np.ptp(points)
    coefficients = np.random.default_rng(0).normal(size=10)
    values = reference.polynomials(unit, 2) @ coefficients
    field = PUInterpolant.fit_lattice(values.reshape(shape), spacing=SPACING, origin=ORIGIN, smoothing=5.0)
    at = queries_in(field)
    expected = reference.polynomials((at - points.mean(axis=0)) / np.ptp(points), 2) @ coefficients
    np.testing.assert_allclose(field(at), expected, rtol=0, atol=POLYNOMIAL)


def test_every_ball_of_a_class_holds_what_the_distances_say():
    shape = (23, 17, 19)
    cover = VoxelCover.fit(shape, np.diag(SPACING), 300, 1.1, np.indices(shape).sum(axis=0) < 8)
    centres, radii = cover.centers(np.zeros(3)), cover.radii
    assert set(cover.levels) == {0, 1}
    for ball in range(len(radii)):
        level, number = cover.levels[ball], cover.classes[ball]
        found = cover.starts[ball] + cover.voxels(number)
        first = cover.starts[ball] + (1 << level) // 2
        every = np.argwhere(np.ones(shape, dtype=bool))
        coarse = every[np.all((every - first) % (1 << level) == 0, axis=1)]
        inside = np.linalg.norm(coarse * SPACING - centres[ball], axis=1) <= radii[ball]
        np.testing.assert_array_equal(found, coarse[inside])
        local = (found * SPACING - centres[ball]) / radii[ball]
        np.testing.assert_allclose(cover.points(number, cover.voxels(number)).T, local, rtol=0, atol=ROUNDING)
        assert len(found) <= 300


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_tiles_are_the_same_in_any_unit(unit):
    shape = (23, 17, 19)
    cover, other = (VoxelCover.fit(shape, steps, 300, 1.1) for steps in (np.diag(SPACING), unit * np.diag(SPACING)))
    assert np.array_equal(cover.tile, other.tile)
    assert np.array_equal(cover.keys, other.keys)


def test_gcv_asks_a_sample_of_balls_as_the_general_path_does():
    """The pooled score of the sampled balls, each decomposed by itself, has no smaller smoothing within its noise."""
    values = data()
    field = PUInterpolant.fit_lattice(values, spacing=SPACING, origin=ORIGIN, rho="gcv")
    sample = np.unique(np.linspace(0, len(field.cover.radii) - 1, GCV_BALLS).round().astype(int))
    points, flat = positions(values.shape), values.ravel()
    parts = []
    for ball in sample:
        centre, radius = field.cover.centers[ball], field.cover.radii[ball]
        rows = np.linalg.norm(points - centre, axis=1) <= radius * (1 + 1e-12)
        local, weights = ((points[rows] - centre) / radius).T.copy(), np.ones(rows.sum())
        found, coefficients = spectra(local, flat[rows][np.newaxis], weights, tail_exponents(3, 2), 3)
        scale = rows.sum() / as_kernel("cubic", 3).theta / radius**3
        parts.append(Spectrum(found / scale, coefficients[0], int(rows.sum())))
    pooled, smoothing = Spectrum.pooled(parts), field.local.smoothing
    assert smoothing.value == pytest.approx(choose_by_gcv(pooled), rel=GCV_CHOICE)
    assert smoothing.score == pytest.approx(gcv_score(smoothing.value, pooled), rel=GCV_CHOICE)


def test_the_balls_of_a_lattice_have_the_diagnostics_of_any_others():
    values = data((14, 13, 12))
    field = PUInterpolant.fit_lattice(values, spacing=SPACING, origin=ORIGIN, smoothing=0.3)
    twin = general_path(field, positions(values.shape), values.ravel())
    summaries = field.diagnostics().summary(), twin.diagnostics().summary()
    for found, expected in zip(*(summary.values() for summary in summaries), strict=True):
        np.testing.assert_allclose(found, expected, rtol=SHARED_DIAGNOSTICS)


def test_balls_share_their_points():
    values = data((40, 40, 40))
    field = PUInterpolant.fit_lattice(values, spacing=1.0, smoothing=0.1)
    assert len(np.unique(field.local.places)) <= 64
    assert field.local.sites.size < 0.3 * 3 * field.local.weights.size


@pytest.mark.parametrize("spacing", [1.0, SPACING])
def test_every_query_in_the_box_lies_in_a_ball(spacing):
    """To the faces of the voxels, half a spacing beyond their centres."""
    values = data((21, 30, 18))
    step = np.broadcast_to(spacing, 3)
    faces = np.array([-0.5 * step, (np.array(values.shape) - 0.5) * step])
    field = PUInterpolant.fit_lattice(values, spacing=spacing, smoothing=0.1, bounds=faces)
    corners = np.stack(np.meshgrid(*faces.T, indexing="ij"), axis=-1).reshape(-1, 3)
    at = np.vstack([queries_in(field, 20000), corners])
    depth = [np.linalg.norm(at - c, axis=1) / r for c, r in zip(field.cover.centers, field.cover.radii, strict=True)]
    assert np.min(depth, axis=0).max() < 0.999
    assert np.isfinite(field(at)).all()


def test_a_mask_chooses_balls_and_leaves_the_marked_region_as_it_was():
    values = data((48, 48, 40))
    mask = np.zeros(values.shape, dtype=bool)
    mask[:, :, 18:22] = True
    full = PUInterpolant.fit_lattice(values, spacing=1.0, smoothing=0.1)
    part = PUInterpolant.fit_lattice(values, spacing=1.0, smoothing=0.1, mask=mask)
    assert len(part.cover.radii) < 0.8 * len(full.cover.radii)
    everywhere = queries_in(part, 20000)
    assert np.isfinite(part(everywhere)).all()
    coarse = np.flatnonzero(part.cover.radii > part.cover.radii.min() * 1.5)
    away = [np.linalg.norm(everywhere - part.cover.centers[i], axis=1) > part.cover.radii[i] for i in coarse]
    alone = np.all(away, axis=0)
    assert np.mean(alone[(everywhere[:, 2] > 18) & (everywhere[:, 2] < 21)]) > 0.1
    truth = np.sin(0.5 * everywhere[:, 0]) + np.sin(0.5 * everywhere[:, 1] + 1) + np.sin(0.5 * everywhere[:, 2] + 2)
    marked = (everywhere[:, 2] >= 18) & (everywhere[:, 2] <= 21)
    errors = [np.sqrt(np.mean((field(everywhere) - truth)[marked] ** 2)) for field in (full, part)]
    assert errors[1] < 1.1 * errors[0]
    nothing = PUInterpolant.fit_lattice(values, spacing=1.0, smoothing=0.1, mask=mask | True)
    np.testing.assert_array_equal(np.sort(nothing.cover.radii), np.sort(full.cover.radii))


def test_neither_threads_nor_company_change_a_bit():
    values = data()
    before, found = get_num_threads(), []
    for threads in (1, 2, 4):
        set_num_threads(threads)
        field = PUInterpolant.fit_lattice(values, spacing=SPACING, rho="gcv")
        found.append(field.local.weights.tobytes() + field.local.tails.tobytes())
    set_num_threads(before)
    assert found[0] == found[1] == found[2]


def test_it_is_saved_and_read_again(tmp_path):
    field = PUInterpolant.fit_lattice(data(), spacing=SPACING, origin=ORIGIN, smoothing=0.1, unit="um")
    field.save(tmp_path / "field.o3l")
    again = load(tmp_path / "field.o3l")
    at = queries_in(field)
    np.testing.assert_array_equal(again(at), field(at))
    np.testing.assert_array_equal(again.hessian(at), field.hessian(at))
    assert (again.unit, again.data_hash) == ("um", field.data_hash)


def test_what_cannot_be_meant_is_refused():
    values = data((8, 9, 7))
    fit = PUInterpolant.fit_lattice
    with pytest.raises(InputError, match="spacing"):
        fit(values, spacing=[1.0, 2.0])
    with pytest.raises(InputError, match="spacing: not an array of numbers"):
        fit(values, spacing="a")
    with pytest.raises(InputError, match="isovalue: is nan"):
        fit(values, spacing=1.0, isovalue=np.nan)
    with pytest.raises(InputError, match=r"degree: is 1.5; give a whole number"):
        fit(values, spacing=1.0, degree=1.5)
    with pytest.raises(InputError, match="one bool per voxel"):
        fit(values, spacing=1.0, mask=np.ones((8, 9, 6), dtype=bool))
    with pytest.raises(InputError, match="NaN"):
        fit(np.where(values > 1, np.nan, values), spacing=1.0)
    with pytest.raises(InputError, match="real numbers"):
        fit(values + 1j, spacing=1.0)
    with pytest.raises(InputError, match="reach beyond the voxels"):
        fit(values, spacing=1.0, bounds=[[0, 0, 0], [8, 8, 6]])
    with pytest.raises(InputError, match="are needed with a transform"):
        fit(values, spacing=1.0, transform=np.eye(4))
    with pytest.raises(InputError, match="no rigid motion"):
        fit(values, spacing=1.0, transform=2 * np.eye(4), bounds=[[0, 0, 0], [1, 1, 1]])
    with pytest.raises(IllPosedError, match="at least 1"):
        fit(values, spacing=1.0, degree=0)
    with pytest.raises(InputError, match="give 'gcv' or a number"):
        fit(values, spacing=1.0, rho="gcv-per-ball")
    with pytest.raises(InputError, match="points_per_ball"):
        fit(values, spacing=1.0, points_per_ball=0)


def test_the_tail_of_the_paper_has_ten_terms():
    assert PUInterpolant.fit_lattice(data(), spacing=1.0, rho=3e-5).local.tails.shape[1] == len(tail_exponents(3, 2))
