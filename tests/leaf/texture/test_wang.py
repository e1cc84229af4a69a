"""Wang tiles: borders that match, one smooth field, least cuts, no period."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf import PUInterpolant, TiledField, WangField
from o3dleaf.leaf.texture.seams import SampledPatch
from o3dleaf.leaf.texture.wang.corners import KINDS, SIDE, kinds_of, torus_color
from o3dleaf.leaf.texture.wang.least_cut import least_cut
from o3dleaf.leaf.texture.wang.quilt import spline_weights
from o3dleaf.leaf.texture.wang.quilting import INSIDE
from o3dleaf.leaf.texture.wang.wang_field import QuiltedTiles
from tolerances import (
    ANALYTIC_VS_DIFFERENCE,
    BORDER,
    FADE_TWIN,
    HESSIAN_DIFFERENCE,
    INDEPENDENT_TILES,
    TWIN,
)

EXTENT = (6.0, 5.0)
WAVES = np.random.default_rng(5).normal(0, 5, (20, 2))
PHASES = np.random.default_rng(6).uniform(0, 2 * np.pi, 20)


class Rough:
    """A rough sheet that does not repeat."""

    bounds = None

    def __init__(self, height=0.17, shift=0.0):
        self.height, self.shift = height, shift

    def waves(self, p):
        return p[:, :2] @ WAVES.T + PHASES + self.shift

    def __call__(self, points):
        p = np.asarray(points)
        return self.height * np.cos(self.waves(p)).sum(axis=1) - p[:, 2]

    def gradient(self, points):
        p = np.asarray(points)
        return np.column_stack([-self.height * np.sin(self.waves(p)) @ WAVES, -np.ones(len(p))])

    def hessian(self, points):
        p = np.asarray(points)
        bends = np.zeros((len(p), 3, 3))
        bends[:, :2, :2] = -self.height * np.einsum("nk,ka,kb->nab", np.cos(self.waves(p)), WAVES, WAVES)
        return bends


def exact(truth, unit=None):
    """A patch whose balls hold the truth itself."""
    axes = [np.linspace(a, b, n) for a, b, n in zip((0, 0, -1), (*EXTENT, 1), (20, 20, 9), strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return PUInterpolant.fit(
        points, truth(points), points_per_ball=500, local=lambda _points, _values: truth, unit=unit
    )


@pytest.fixture(scope="module")
def patch():
    return exact(Rough())


@pytest.fixture(scope="module")
def tiles(patch):
    return WangField(patch, seed=3)


def somewhere(count=400, seed=0, reach=40.0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-reach, reach, (count, 2)), rng.uniform(-0.9, 0.9, count)])


def test_each_tile_of_the_set_lies_once_on_the_torus():
    p, q = np.meshgrid(np.arange(SIDE), np.arange(SIDE), indexing="ij")
    assert sorted(kinds_of(torus_color, p, q).ravel()) == list(range(KINDS))
    assert np.array_equal(kinds_of(torus_color, p, q), kinds_of(torus_color, p - SIDE, q + 3 * SIDE))


def test_tiles_that_share_a_border_share_its_corners(tiles):
    places = np.stack(np.meshgrid(np.arange(-9, 9), np.arange(-9, 9), indexing="ij"), axis=-1)
    kinds = tiles.kinds(places.reshape(-1, 2)).reshape(18, 18)
    bits = {(a, b): kinds >> (a + 2 * b) & 1 for a in range(2) for b in range(2)}
    for b in range(2):
        assert np.array_equal(bits[1, b][:-1], bits[0, b][1:])
        assert np.array_equal(bits[b, 1][:, :-1], bits[b, 0][:, 1:])
    # A window sees what the whole has there, and another seed something else.
    assert np.array_equal(tiles.kinds(places[4:7, 5:9].reshape(-1, 2)), kinds[4:7, 5:9].ravel())
    other = WangField(tiles.fields, seed=4, quilt=tiles.quilt)
    assert not np.array_equal(other.kinds(places.reshape(-1, 2)).reshape(18, 18), kinds)


@pytest.mark.few(axis=1)
@pytest.mark.parametrize("axis", [0, 1])
def test_the_field_and_its_derivatives_go_on_over_every_border(tiles, axis):
    """All 64 pairs of tiles that may lie beside one another, seen from either side."""
    size, rng = tiles.period, np.random.default_rng(1)
    for code in range(64):
        colors = np.array([code >> bit & 1 for bit in range(6)]).reshape((3, 2) if axis == 0 else (2, 3))
        local = QuiltedTiles(tiles.fields, tiles.quilt, lambda i, j, colors=colors: colors[i, j])
        points = np.column_stack([rng.uniform(0, 1, (12, 2)) * size, rng.uniform(-0.9, 0.9, 12)])
        sides = []
        for border in (size[axis], np.nextafter(size[axis], 0)):
            points[:, axis] = border
            sides.append(local.blend(tiles.index, points, level=2, dtype=np.dtype(np.float64)))
        assert np.abs(sides[0] - sides[1]).max() < BORDER * np.abs(sides[0]).max()


def test_what_does_not_change_in_the_plane_does_not_change_on_tiles():
    """Weights sum to one, and their derivatives to zero."""

    class Flat(Rough):
        def __call__(self, points):
            return np.sin(2 * np.asarray(points)[:, 2])

        def gradient(self, points):
            return np.outer(2 * np.cos(2 * np.asarray(points)[:, 2]), [0, 0, 1])

        def hessian(self, points):
            return -4 * np.sin(2 * np.asarray(points)[:, 2])[:, np.newaxis, np.newaxis] * np.diag([0.0, 0, 1])

    truth, points = Flat(), somewhere()
    laid = WangField(exact(truth))
    values, gradients, hessians = laid.jets(points, 2)
    assert np.abs(values - truth(points)).max() < TWIN
    assert np.abs(gradients - truth.gradient(points)).max() < TWIN
    assert np.abs(hessians - truth.hessian(points)).max() < TWIN / laid.quilt.step.min() ** 2
    assert laid.seam_energy().total < TWIN


def test_gradients_and_hessians_are_those_of_the_values(tiles):
    points, step = somewhere(150, seed=1, reach=8.0), 1e-5
    values, gradients, hessians = tiles.jets(points, 2)
    assert np.array_equal(values, tiles(points))
    for axis in range(3):
        aside = step * np.eye(3)[axis]
        slope = (tiles(points + aside) - tiles(points - aside)) / (2 * step)
        assert np.abs(slope - gradients[:, axis]).max() < ANALYTIC_VS_DIFFERENCE * np.abs(gradients).max()
        bend = (tiles.gradient(points + aside) - tiles.gradient(points - aside)) / (2 * step)
        assert np.abs(bend - hessians[:, axis]).max() < HESSIAN_DIFFERENCE * np.abs(hessians).max()


def test_splines_of_nodes_reproduce_lines():
    share, step = np.linspace(0, 1, 21), 0.3
    at = step * np.arange(-1, 3)[:, np.newaxis]
    weights, slopes, bends = spline_weights(share, step, 2)
    assert np.allclose((weights * at).sum(axis=0), share * step, atol=TWIN)
    assert np.allclose((slopes * at).sum(axis=0), 1, atol=TWIN)
    assert np.allclose((bends * at**2).sum(axis=0), 2, atol=TWIN)


@pytest.mark.parametrize("seed", range(5))
def test_no_cut_costs_less_than_the_least(seed):
    cost = np.random.default_rng(seed).random((4, 3)).round(2)
    keeps, takes = np.zeros((4, 3), dtype=bool), np.zeros((4, 3), dtype=bool)
    keeps[0], takes[3] = True, True

    def price(new):
        sums = [
            (cost[:-1] + cost[1:])[new[:-1] != new[1:]].sum(),
            (cost[:, :-1] + cost[:, 1:])[new[:, :-1] != new[:, 1:]],
        ]
        return sums[0] + sums[1].sum()

    shown, flow = least_cut(cost, keeps, takes)
    assert not shown[0].any()
    assert shown[3].all()
    everything = []
    for free in product((False, True), repeat=6):
        new = takes.copy()
        new[1:3] = np.array(free).reshape(2, 3)
        everything.append(price(new))
    # A link costs one unit more, so that of equal cuts the shorter is less.
    assert price(shown) <= min(everything) + 1e-3
    assert flow == pytest.approx(price(shown), abs=1e-3)


def test_a_part_that_agrees_with_what_is_there_is_taken_whole():
    keeps, takes = np.zeros((6, 5), dtype=bool), np.zeros((6, 5), dtype=bool)
    keeps[0], takes[-1] = True, True
    cost = np.ones((6, 5))
    cost[3] = cost[4] = 0.0
    shown, flow = least_cut(cost, keeps, takes)
    assert np.array_equal(shown, np.repeat(np.arange(6) >= 4, 5).reshape(6, 5))
    assert flow < 1e-3


def test_seam_energy_is_that_of_its_literal_twin(patch, tiles):
    sampled, quilt = SampledPatch.of(patch), tiles.quilt
    (n, m), links, at = quilt.nodes, [], []
    for kind, axis, i, j in product(range(KINDS), range(2), range(n), range(m)):
        ends = [np.array([i, j]), np.array([i, j]) + np.eye(2, dtype=int)[axis]]
        one, other = (quilt.labels[kind][tuple(end + 1)] for end in ends)
        if one != other:
            links.append(axis)
            at += [quilt.corners[label] + end * quilt.step for end in ends for label in (one, other)]
    places = np.repeat(at, len(sampled.rest), axis=0)
    points = np.column_stack([places, np.tile(sampled.rest, (len(at), 1))])
    values = sampled.field(points).clip(-sampled.cut_off, sampled.cut_off).reshape(len(links), 2, 2, -1)
    squares = ((values[:, :, 0] - values[:, :, 1]) ** 2).mean(axis=(1, 2)) / (2 * sampled.variance)
    energy, links = tiles.seam_energy(), np.array(links)
    assert energy.along == pytest.approx(squares[links == 0].mean(), rel=TWIN)
    assert energy.across == pytest.approx(squares[links == 1].mean(), rel=TWIN)
    assert energy.total == pytest.approx(squares.mean(), rel=TWIN)


def test_cuts_match_better_than_places_at_random(tiles):
    assert tiles.seam_energy().total < 0.5  # 1 is any two points; of a rough sheet nothing matches well


def test_insides_lie_apart_and_are_most_of_each_tile(tiles):
    quilt = tiles.quilt
    inside = quilt.corners[INSIDE:]
    distance = np.linalg.norm((inside[:, np.newaxis] - inside) / quilt.step, axis=2)
    room = np.prod((EXTENT - quilt.tile) / quilt.step + 1)
    assert distance[~np.eye(KINDS, dtype=bool)].min() >= np.sqrt(room / (np.pi * KINDS)) - 1e-6
    assert np.mean(quilt.labels >= INSIDE) > 0.5


def test_nothing_repeats_after_a_tile(patch, tiles):
    """At every lattice vector the heights correlate no more than where tiles are drawn independently of one another."""
    heights = {name: _heights(laid) for name, laid in (("wang", tiles), ("periodic", TiledField(patch)))}
    for shift in ((1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (3, 1), (4, 0), (4, 4)):
        assert _correlation(heights["periodic"], shift) == pytest.approx(1, abs=1e-6)
        assert _correlation(heights["wang"], shift) < INDEPENDENT_TILES


def _heights(laid, places=24, within=9):
    """Heights over the same places of many tiles: (along, across, within)."""
    share = (np.arange(within) + 0.5) / within
    at = np.stack(np.meshgrid(share, share, indexing="ij"), axis=-1).reshape(-1, 2)
    tile = np.stack(np.meshgrid(np.arange(places), np.arange(places), indexing="ij"), axis=-1)
    plane = (tile[:, :, np.newaxis] + at) * laid.period
    return laid(np.column_stack([plane.reshape(-1, 2), np.zeros(plane.size // 2)])).reshape(places, places, -1)


def _correlation(heights, shift):
    a, b = shift
    count = len(heights)
    one, other = heights[: count - a, : count - b], heights[a:, b:]
    mean = heights.mean()
    return np.mean((one - mean) * (other - mean)) / heights.var()


def test_tiles_of_several_patches_show_all_of_them():
    fields = [exact(Rough()), exact(Rough(shift=2.0))]
    laid = WangField(fields, tile=(2.0, 1.5), seed=1)
    assert set(laid.quilt.sources) == {0, 1}
    assert np.allclose(laid.period, [2.0, 1.5])
    points = somewhere(300, seed=4)
    within = points[:, :2] % laid.period
    cells = (within / laid.quilt.step).astype(int)
    alone = laid.quilt.alone[laid.kinds(np.floor(points[:, :2] / laid.period)), cells[:, 0], cells[:, 1]]
    rows = np.flatnonzero(alone >= 0)
    assert len(rows) > 100
    for row in rows:
        label = alone[row]
        shown = fields[laid.quilt.sources[label]]([[*(laid.quilt.corners[label] + within[row]), points[row, 2]]])
        assert laid(points[row : row + 1])[0] == pytest.approx(shown[0], abs=FADE_TWIN)


def test_a_saved_field_is_the_same_to_the_bit(patch, tmp_path):
    fit = PUInterpolant.fit(*_cloud(), smoothing=0.0, points_per_ball=80, unit="mm")
    laid = WangField(fit, seed=7)
    laid.save(tmp_path / "tiles.o3l")
    again, points = o3l.load(tmp_path / "tiles.o3l"), somewhere(200)
    assert np.array_equal(again(points), laid(points))
    assert again.seam_energy() == laid.seam_energy()
    assert (again.seed, again.unit) == (7, "mm")


def _cloud():
    axes = [np.linspace(-2, 2, 13), np.linspace(-2, 2, 13), np.linspace(-0.5, 0.5, 7)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, Rough()(points)


@pytest.mark.slow
def test_the_same_seed_cuts_the_same_tiles_and_another_others(patch, tiles):
    again, other = WangField(patch, seed=3), WangField(patch, seed=8)
    assert np.array_equal(again.quilt.labels, tiles.quilt.labels)
    assert np.array_equal(again.quilt.corners, tiles.quilt.corners)
    assert not np.array_equal(other.quilt.corners, tiles.quilt.corners)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"tile": (5.9, 1.0)}, "leaves too little of the patch"),
        ({"tile": (0.0, 1.0)}, "two lengths above zero"),
        ({"tile": 1.0}, "two lengths above zero"),
    ],
)
def test_tiles_that_cannot_be_are_refused(patch, given, match):
    with pytest.raises(o3l.errors.InputError, match=match):
        WangField(patch, **given)


def test_patches_that_do_not_go_together_are_refused(patch):
    with pytest.raises(o3l.errors.InputError, match="empty"):
        WangField([])
    with pytest.raises(o3l.errors.UnitError):
        WangField([exact(Rough(), "mm"), exact(Rough(), "um")])


@pytest.fixture(scope="module")
def fitted_tiles():
    return WangField(PUInterpolant.fit(*_cloud(), smoothing=0.0, points_per_ball=80, unit="mm"))


@pytest.mark.parametrize(
    ("part", "value"),
    [("labels", 40), ("labels", -1), ("sources", 1), ("sources", -1), ("corners", np.nan), ("tile", 0.0)],
)
def test_a_file_whose_tiles_show_what_is_not_there_is_refused(fitted_tiles, tmp_path, part, value):
    array = getattr(fitted_tiles.quilt, part).copy()
    array.flat[0] = value
    spoiled = replace(fitted_tiles.quilt, **{part: array})
    WangField(fitted_tiles.fields, quilt=spoiled).save(tmp_path / "tiles.o3l")
    with pytest.raises(o3l.errors.InputError, match="damaged"):
        o3l.load(tmp_path / "tiles.o3l")
