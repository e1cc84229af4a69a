from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf import PUInterpolant, TiledField
from o3dleaf.leaf.texture.seams import Crop, SampledPatch
from tolerances import (
    ANALYTIC_VS_DIFFERENCE,
    FADE_TWIN,
    HESSIAN_DIFFERENCE,
    ONE_LEAF_OF_RIDGES,
    PERIODIC,
    QUADRATURE,
    RIDGE_PITCH,
    TWIN,
)

PITCH = np.array([1.6, 0.7])
"""Bumps along, ridges across."""


@dataclass
class Ridges:
    """A ridged sheet, in any unit of length and of value."""

    pitch: np.ndarray
    scale: float = 1.0
    gain: float = 1.0
    unit: str | None = None
    bounds: np.ndarray | None = None

    def __call__(self, points):
        p = np.asarray(points) / self.scale
        along, across = (2 * np.pi * p[:, :2] / self.pitch).T
        return self.gain * (0.1 * np.sin(along) + 0.3 * np.cos(across) + 0.1 * np.cos(2 * across) - p[:, 2])

    def gradient(self, points):
        p = np.asarray(points) / self.scale
        (along, across), (u, v) = (2 * np.pi * p[:, :2] / self.pitch).T, 2 * np.pi / self.pitch
        slopes = 0.1 * u * np.cos(along), -v * (0.3 * np.sin(across) + 0.2 * np.sin(2 * across)), -np.ones(len(p))
        return self.gain / self.scale * np.stack(slopes, axis=1)

    def hessian(self, points):
        p = np.asarray(points) / self.scale
        (along, across), (u, v) = (2 * np.pi * p[:, :2] / self.pitch).T, 2 * np.pi / self.pitch
        bends = np.zeros((len(p), 3, 3))
        bends[:, 0, 0] = -0.1 * u**2 * np.sin(along)
        bends[:, 1, 1] = -(v**2) * (0.3 * np.cos(across) + 0.4 * np.cos(2 * across))
        return self.gain / self.scale**2 * bends


def exact(truth, extent, per_ball=250):
    """A patch whose balls hold the truth itself: what its seams are is known."""
    high = np.array([*extent, 1.0]) * truth.scale
    low = np.array([0.0, 0.0, -1.0]) * truth.scale
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, (20, 20, 9), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return PUInterpolant.fit(points, truth(points), points_per_ball=per_ball, local=lambda _points, _values: truth)


@pytest.fixture(scope="module")
def patch():
    """Two bumps along and four and a half ridges across, and a little more along."""
    return exact(Ridges(PITCH), (2.3 * PITCH[0], 4.5 * PITCH[1]))


def all_of(energy):
    return np.array([energy.along, energy.across, energy.total])


def test_a_patch_that_repeats_has_no_seam_energy():
    tiled = TiledField(exact(Ridges(PITCH), (2 * PITCH[0], 4 * PITCH[1])))
    assert all_of(tiled.seam_energy()).max() <= PERIODIC**2
    half = TiledField(exact(Ridges(PITCH), (2 * PITCH[0], 3.5 * PITCH[1]))).seam_energy()
    assert half.along <= PERIODIC**2 < 0.1 < half.across


def test_seam_energy_is_the_integral_that_it_says(patch):
    """Cut off by hand, on a grid that has nothing to do with the one inside."""
    truth, (low, high) = Ridges(PITCH), patch.bounds
    axes = [a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, (97, 89, 83), strict=True)]
    values = truth(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
    c = 0.5 * values.std()
    faces = []
    for axis in range(2):
        positions = [*axes]
        sides = []
        for face in (low, high):
            positions[axis] = face[axis : axis + 1]
            points = np.stack(np.meshgrid(*positions, indexing="ij"), axis=-1).reshape(-1, 3)
            sides.append(np.clip(truth(points), -c, c))
        faces.append(np.mean((sides[0] - sides[1]) ** 2) / (2 * np.clip(values, -c, c).var()))
    size = (high - low)[:2]
    expected = [*faces, (faces[0] * size[1] + faces[1] * size[0]) / size.sum()]
    np.testing.assert_allclose(all_of(TiledField(patch).seam_energy()), expected, rtol=QUADRATURE)


def test_seam_energy_is_a_pure_number(patch):
    expected = all_of(TiledField(patch).seam_energy())
    scaled = exact(Ridges(PITCH, scale=1000.0, gain=7.0), (2.3 * PITCH[0], 4.5 * PITCH[1]))
    np.testing.assert_allclose(all_of(TiledField(scaled).seam_energy()), expected, rtol=TWIN)


def test_seam_energy_does_not_depend_on_the_number_of_copies():
    """Twice as many bumps along: the seam across is twice as long and no better."""
    one, two = (TiledField(exact(Ridges(PITCH), (n * PITCH[0], 2.4 * PITCH[1]))).seam_energy() for n in (2, 4))
    assert two.across == pytest.approx(one.across, rel=QUADRATURE)


def test_the_best_period_is_a_whole_number_of_ridges(patch):
    best = TiledField(patch, "best")
    ridges = best.tile / PITCH
    assert np.abs(ridges - np.round(ridges)).max() <= RIDGE_PITCH
    assert np.all(best.tile >= 0.5 * (patch.bounds[1] - patch.bounds[0])[:2])
    assert np.all(best.offset - best.fade >= patch.bounds[0, :2])
    assert np.all(best.offset + best.tile + best.fade <= patch.bounds[1, :2])
    assert best.seam_energy(best.fade.min()).total <= RIDGE_PITCH * TiledField(patch).seam_energy().total


def test_faces_that_mirror_one_another_are_no_match():
    """Ridges are symmetric: each face has a twin of the same values, where the next ridge runs the other way."""
    for ridges in (3, 5, 7):
        best = TiledField(exact(Ridges(PITCH), (2.3 * PITCH[0], ridges * PITCH[1])), "best")
        assert abs(best.tile[1] / PITCH[1] - round(best.tile[1] / PITCH[1])) <= RIDGE_PITCH


@pytest.mark.slow
def test_one_axis_may_be_searched_alone(patch):
    whole = (patch.bounds[1] - patch.bounds[0])[0]
    across = TiledField(patch, (whole, "best"))
    assert across.tile[0] == whole
    assert across.fade[0] == 0 < across.fade[1]
    assert abs(across.tile[1] / PITCH[1] % 1 - 0.5) >= 0.5 - RIDGE_PITCH
    given = TiledField(patch, (1.5 * PITCH[0], "best"))
    assert given.tile[0] == 1.5 * PITCH[0]
    assert across.seam_energy().along == pytest.approx(TiledField(patch).seam_energy().along, rel=0.1)


@pytest.mark.few(left=1)
@pytest.mark.parametrize("left", [1e-6, 1e-3, 0.1, 0.5])
def test_a_given_period_is_kept_and_moved_as_far_as_the_patch_goes(patch, left):
    low, high = patch.bounds[:, :2]
    period = (high - low)[0] - left
    tiled = TiledField(patch, (period, "best"))
    assert tiled.tile[0] == period
    assert 0 < tiled.fade[0] <= left / 4 * (1 + 1e-6)
    slack = 1e-15 + 1e-9 * left
    assert (
        low[0] - slack <= tiled.offset[0] - tiled.fade[0] < tiled.offset[0] + period + tiled.fade[0] <= high[0] + slack
    )


@pytest.fixture(scope="module")
def leaf_patch():
    """Four and a half ridges in the width of a scanned blade, with hairs, pockets, noise and drift."""
    volume, truth = o3l.samples.wheat_ct(size=(720.0, 1260.0, 480.0), ridges=4.5)
    return o3l.create_texture(volume).field, 1260.0 / truth.ridges


def test_the_best_tile_of_a_scanned_patch_has_at_most_a_third_of_the_plain_seam_energy(leaf_patch):
    field, pitch = leaf_patch
    plain, best = TiledField(field), TiledField(field, "best")
    assert best.seam_energy().total <= plain.seam_energy().total / 3
    assert abs(best.tile[1] / pitch - round(best.tile[1] / pitch)) <= ONE_LEAF_OF_RIDGES


def fade_in(t):
    t = np.clip(t, 0, 1)
    return t**3 * (10 + t * (6 * t - 15))


def literal_crop(tiled, points, reach=4):
    """Σ ω(z − s) F(A z) over tiles laid one by one, mirrored and staggered; the windows sum to one."""
    total, weights = np.zeros(len(points)), np.zeros(len(points))
    flips = {None: (), "along": (0,), "across": (1,), "both": (0, 1)}[tiled.flip]
    for q in range(-reach, reach + 1):
        for p in range(-reach, reach + 1):
            t = points[:, :2] - tiled.offset - tiled.tile * [p + tiled.shift * q, q]
            window = np.prod(
                fade_in((t + tiled.fade) / (2 * tiled.fade))
                - fade_in((t - tiled.tile + tiled.fade) / (2 * tiled.fade)),
                axis=1,
            )
            at = points.copy()
            for axis, number in enumerate((p, q)):
                mirrored = axis in flips and number % 2
                at[:, axis] = tiled.offset[axis] + (tiled.tile[axis] - t[:, axis] if mirrored else t[:, axis])
            rows = np.flatnonzero(window > 0)
            if len(rows):
                total[rows] += window[rows] * tiled.field(at[rows])
            weights += window
    np.testing.assert_allclose(weights, 1.0, atol=FADE_TWIN)
    return total


@pytest.fixture(scope="module")
def fitted():
    """Splines, rather than the truth: what is blended is not periodic."""
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, -1], [4, 3, 1], (1500, 3))
    values = np.sin(2 * points[:, 0]) + np.cos(3 * points[:, 1]) - points[:, 2]
    return PUInterpolant.fit(points, values, points_per_ball=(40, 80), unit="mm", bounds=[[0, 0, -1], [4, 3, 1]])


LAID = [
    {},
    {"flip": "along"},
    {"flip": "across"},
    {"shift": 0.5},
    {"shift": 1 / 3},
    {"flip": "both", "shift": 0.25},
]


@pytest.mark.parametrize("laid", LAID)
def test_a_cropped_tiling_is_the_sum_over_windowed_copies(fitted, laid):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=(0.3, 0.2), **laid)
    points = np.random.default_rng(1).uniform([-2, -2, -1], [6, 5, 1], (2000, 3))
    expected = literal_crop(tiled, points)
    assert np.abs(tiled(points) - expected).max() <= FADE_TWIN * np.abs(expected).max()


@pytest.mark.parametrize("laid", LAID)
def test_a_cropped_tiling_repeats_after_its_period_and_its_cell_is_one(fitted, laid):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=0.2, **laid)
    points = np.random.default_rng(2).uniform([0, 0, -1], [9, 9, 1], (500, 3))
    for steps in ((1, 0), (0, 1), (-3, 7)):
        moved = points + np.append(tiled.period * steps, 0.0)
        assert np.abs(tiled(moved) - tiled(points)).max() <= PERIODIC
    np.testing.assert_allclose(np.diff(tiled.cell[:, :2], axis=0)[0], tiled.period)
    assert tiled.bounds[0, 2] == fitted.bounds[0, 2]


@pytest.mark.parametrize("laid", LAID)
def test_its_derivatives_are_differences_in_the_bands_too(fitted, laid):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=(0.4, 0.3), **laid)
    rng = np.random.default_rng(3)
    points = rng.uniform([-2, -2, -0.9], [9, 9, 0.9], (300, 3))
    points[::2, 0] = tiled.offset[0] + rng.integers(-2, 3, 150) * tiled.tile[0] + rng.uniform(-0.3, 0.3, 150)
    points[1::2, 1] = tiled.offset[1] + rng.integers(-2, 3, 150) * tiled.tile[1] + rng.uniform(-0.3, 0.3, 150)
    step = 1e-5
    numeric = np.stack([(tiled(points + step * e) - tiled(points - step * e)) / (2 * step) for e in np.eye(3)], axis=1)
    assert np.abs(numeric - tiled.gradient(points)).max() <= ANALYTIC_VS_DIFFERENCE * 10
    bends = np.stack(
        [(tiled.gradient(points + step * e) - tiled.gradient(points - step * e)) / (2 * step) for e in np.eye(3)],
        axis=1,
    )
    found = tiled.hessian(points)
    assert np.abs(bends - found).max() <= 100 * HESSIAN_DIFFERENCE * np.abs(found).max()


def test_inside_its_tile_a_cropped_tiling_is_the_patch_bit_for_bit(fitted):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=0.2)
    points = np.random.default_rng(4).uniform([0.71, 0.51, -1], [3.39, 2.39, 1], (300, 3))
    assert np.array_equal(tiled(points), fitted(points))
    assert np.array_equal(tiled.gradient(points), fitted.gradient(points))


def test_a_flipped_tiling_is_symmetric_about_its_seams_and_has_no_step_there(fitted):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=0.2, flip="along")
    points = np.random.default_rng(5).uniform([-1, 0, -1], [4, 3, 1], (300, 3))
    for face in tiled.offset[0] + tiled.tile[0] * np.arange(3):
        mirrored = points * [-1, 1, 1] + [2 * face, 0, 0]
        assert np.abs(tiled(mirrored) - tiled(points)).max() <= PERIODIC
    assert tiled.seam_energy().along == 0
    assert TiledField(fitted, (3.1, 2.3), (0.5, 0.3)).seam_energy().along > 0


def test_a_flipped_seam_is_measured_against_its_own_image():
    """Over a band, on both faces of the tile: what lies beyond each is held against what lies before it."""
    truth, width = Ridges(PITCH), 0.2
    # In smaller balls, which the places of its sums follow.
    sampled = SampledPatch.of(exact(truth, (2.3 * PITCH[0], 4.5 * PITCH[1]), per_ball=150))
    crop = Crop(np.array([0.5, 0.3]), np.array([2.1, 2.3]), np.array([width, 0.2]), np.array([True, False]), 0.0)
    stations, beside, rest = sampled.stations(width, 0), np.linspace(0, 2.3, 400), sampled.rest.ravel()

    def sections(along):
        grid = np.meshgrid(along, 0.3 + beside, rest, indexing="ij")
        values = truth(np.stack(grid, axis=-1).reshape(-1, 3))
        return np.clip(values, -sampled.cut_off, sampled.cut_off)

    faces = [np.mean((sections(face + stations) - sections(face - stations)) ** 2) for face in (0.5, 2.6)]
    assert min(faces) > 0
    expected = np.mean(faces) / (2 * sampled.variance)
    assert sampled.energy(crop, width).along == pytest.approx(expected, rel=QUADRATURE)


def test_a_staggered_tiling_is_the_same_in_the_next_row_moved_along(fitted):
    tiled = TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=0.2, shift=0.5)
    points = np.random.default_rng(6).uniform([-1, -4, -1], [4, 9, 1], (300, 3))
    moved = points + [0.5 * tiled.tile[0], tiled.tile[1], 0]
    assert np.abs(tiled(moved) - tiled(points)).max() <= PERIODIC
    assert tiled.period.tolist() == [3.1, 2 * 2.3]


def test_the_seams_of_staggered_tiles_are_measured_where_they_meet(fitted):
    """A shift by a whole tile is none; half a tile meets another part of the face."""
    laid = {s: TiledField(fitted, (3.1, 2.3), (0.5, 0.3), fade=0.2, shift=s).seam_energy() for s in (0.0, 1.0, 0.5)}
    assert laid[1.0].across == pytest.approx(laid[0.0].across)
    assert laid[0.5].along == laid[0.0].along
    assert laid[0.5].across != pytest.approx(laid[0.0].across, rel=0.1)


def test_an_axis_without_overlap_is_tiled_as_in_the_paper(fitted):
    """Cropped along alone: across, the images of balls overlap as they do without a crop."""
    tiled, plain = TiledField(fitted, (3.1, 3.0), (0.5, 0.0), fade=0.2), TiledField(fitted)
    points = np.random.default_rng(7).uniform([0.71, -4, -1], [3.39, 7, 1], (300, 3))
    assert np.abs(tiled(points) - plain(points)).max() <= PERIODIC


def test_what_was_chosen_comes_back_from_a_file(fitted, tmp_path):
    points = np.random.default_rng(8).uniform(-4, 9, (300, 3))
    for number, tiled in enumerate(
        [TiledField(fitted, "best", flip="across", shift=1 / 3), TiledField(fitted, (4.0, "best")), TiledField(fitted)]
    ):
        tiled.save(tmp_path / f"{number}.o3l")
        found = o3l.load(tmp_path / f"{number}.o3l")
        assert np.array_equal(found(points), tiled(points))
        assert np.array_equal(found.period, tiled.period)
        assert (found.flip, found.shift, found.seam_energy()) == (tiled.flip, tiled.shift, tiled.seam_energy())


def test_every_period_of_a_tiled_field_has_the_same_key(fitted):
    tiled = TiledField(fitted, "best", flip="along")
    assert all(tiled.tile_key(p) == tiled.tile_key(q) for p, q in pairwise(range(-3, 4)))


@pytest.mark.parametrize(
    ("arguments", "options", "reason"),
    [
        (("worst",), {}, "best"),
        (("best", (0, 0)), {}, "leave it out"),
        (((3.0, 2.0), (1.5, 0.5)), {}, "move the tile inwards"),
        (((3.0, 2.0), (0.5, 0.5)), {"fade": 0.6}, "move the tile inwards"),
        (((2.4, 2.0), (1.2, 0.5)), {"fade": 0.45}, "move the tile inwards"),  # beyond its far side
        ((None,), {"flip": "along"}, "give a smaller period"),
        ((None,), {"shift": 0.5}, "give a smaller period"),
        (("best",), {"flip": "upside down"}, "along, across, both"),
        (((3.0, 2.0),), {"shift": 0.123}, "fraction"),
        (("best",), {"fade": 1.5}, "fade less"),
        (((3.0, 2.0),), {"fade": -1}, "two lengths"),
    ],
)
def test_tilings_that_cannot_be_meant_are_refused(fitted, arguments, options, reason):
    with pytest.raises(o3l.errors.InputError, match=reason):
        TiledField(fitted, *arguments, **options)


def test_a_band_beyond_the_patch_is_refused(fitted):
    with pytest.raises(o3l.errors.InputError, match="beyond its tile"):
        TiledField(fitted).seam_energy(0.1)
