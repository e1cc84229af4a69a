import re

import numpy as np
import open3d as o3d
import pytest
import shapely
import shapely.affinity

from o3dleaf import samples
from o3dleaf.leaf.chart import petiole as petiole_module
from o3dleaf.leaf.chart.petiole import find_petiole
from o3dleaf.leaf.chart.stalk.junction import Junction
from o3dleaf.leaf.chart.stalk.lobes import COMMON
from o3dleaf.leaf.chart.stalk.point_ways import PointWays
from o3dleaf.leaf.chart.stalk.sections import Sections, sections_along
from o3dleaf.leaf.chart.stalk.stretches import StalkStretch, find_stretches
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from tests import planar_leaves
from tests import tolerances as tol
from tests.sheet_shapes import blade, ellipse, lobed, rolled, stalked, triangulated


def bent(flat, noise=0.0, seed=0):
    """Plane points rolled up, with noise."""
    points = rolled(flat)
    return points + np.random.default_rng(seed).normal(0, noise, points.shape)


def drawn(outline, spacing, seed=0):
    """Random points (n, 2) in a polygon."""
    rng, (low, high) = np.random.default_rng(seed), np.reshape(outline.bounds, (2, 2))
    points = rng.uniform(low, high, (round(np.prod(high - low) / spacing**2), 2))
    return points[shapely.contains_xy(outline, *points.T)]


@pytest.mark.parametrize(("width", "depth"), [(2.0, 1.0), (3.0, 0.5)])
def test_sections_of_a_bar_are_as_wide_and_deep_as_the_bar(width, depth):
    points = np.random.default_rng(0).uniform(0, [40, width, depth], (20_000, 3))
    sections = sections_along(points, np.full(len(points), 40 * width / len(points)), points[:, 0], 0.0)
    assert np.median(sections.width) == pytest.approx(width, rel=tol.SECTION)
    assert np.median(sections.depth) == pytest.approx(depth, rel=tol.SECTION)


def test_sections_of_a_single_point_are_no_width():
    sections = sections_along(np.ones((1, 3)), np.ones(1), np.zeros(1), 0.1)
    assert (sections.width == 0).all()


def test_a_chain_of_single_points_is_as_wide_as_the_sections_beside_it():
    """Each of its stations holds one point, which says nothing of the width: they do not taper to the end."""
    bar = np.random.default_rng(0).uniform([20, 0, 0], [40, 2, 1], (10_000, 3))
    chain = np.column_stack([np.arange(0.0, 20.0, 2.0), np.tile([0.1, 1.9], 5), np.full(10, 0.5)])
    points = np.concatenate([chain, bar])
    sections = sections_along(points, np.full(len(points), 0.01), points[:, 0], 0.0)
    alone = sections.free == 0
    assert alone.sum() > 10
    assert (sections.width[alone] == sections.width[~alone][0]).all()
    assert (sections.depth[alone] == sections.depth[~alone][0]).all()
    assert sections.width[~alone][0] > 1.5


@pytest.mark.parametrize("ratio", [1.0, 4.0, 16.0])
def test_lines_of_a_scan_are_joined_and_stand_for_its_area(ratio):
    leaf = planar_leaves.lobed()
    points = planar_leaves.lines(leaf, 0.7, ratio, 0.3, np.random.default_rng(0))
    ways = PointWays(np.insert(points, 2, 0.0, axis=1))
    assert len(ways.rows) == len(points)
    assert ways.cells.sum() == pytest.approx(leaf.area, rel=tol.AREA_OF_CELLS)


@pytest.mark.few
@pytest.mark.parametrize("stub", [0.0, 8.0])
@pytest.mark.parametrize("thickness", [2.0, 4.0])
def test_a_flat_petiole_is_cut_off_at_the_blade_with_its_stub(stub, thickness):
    flat = drawn(stalked(thickness=thickness, stub=stub), 0.5, seed=1)
    kept, petiole, _ = find_petiole(bent(flat))
    # An ellipse leaves the petiole of half a width h at h²/(2 r) past its end, r its radius of curvature there, 5.2.
    assert np.mean(kept == (flat[:, 0] > 40)) > 0.98
    assert petiole.width == pytest.approx(thickness, rel=tol.JUNCTION_WIDTH)
    assert petiole.length == pytest.approx(40 + (6 if stub else 0), abs=3)
    assert np.linalg.norm(np.array(petiole.junction) - rolled(np.array([[40.0, 0.0]]))[0]) < 1.0
    assert "petiole: 4" in str(petiole)


@pytest.mark.few(spacing=1, shape=1)
@pytest.mark.parametrize(("spacing", "noise"), [(0.6, 0.5), (0.9, 0.0), (0.9, 0.2)])
@pytest.mark.parametrize("shape", [{}, {"stub": 8.0, "stalk": 25.0}, {"width": 60.0, "length": 60.0, "arch": 0.0}])
def test_a_round_petiole_ends_where_the_blade_begins(shape, spacing, noise):
    leaf = samples.leaf_shape("petiole", **shape)
    scan = samples.scan_leaf(leaf, spacing=spacing, noise=noise, seed=1)
    kept, petiole, _ = find_petiole(scan.points, scan.noise)
    base, ahead = leaf.lift([[0.0, 0.0]])[0], leaf.jacobian([[0.0, 0.0]])[0, :, 0]
    off = np.array(petiole.junction) - base
    assert abs(off @ ahead) <= tol.JUNCTION * spacing
    assert np.linalg.norm(off - (off @ ahead) * ahead) < spacing + scan.noise
    assert petiole.width == pytest.approx(2.4, rel=tol.JUNCTION_WIDTH)
    blade = len(scan.places)
    assert np.mean(kept[:blade]) > 0.995
    assert np.mean(~kept[blade:]) > 0.95


def seen(arc, diameter, length, spacing, noise, seed=0):
    """Return points of a broad leaf, and those of its petiole of which an arc, in degrees, faces the scanner."""
    flat = drawn(ellipse(50, 50), spacing, seed)
    rng = np.random.default_rng(seed + 7)
    count = round(np.radians(arc) / 2 * diameter * length / spacing**2)
    turn, down = rng.uniform([[-arc / 2], [-length]], [[arc / 2], [1.0]], (2, count))
    around = diameter / 2 * np.stack([np.sin(np.radians(turn)), np.cos(np.radians(turn))])
    stalk = np.column_stack([down, around[0], around[1] - diameter / 2])
    blade = np.column_stack([flat, np.zeros(len(flat))])
    return [each + rng.normal(0, noise, each.shape) for each in (blade, stalk)]


@pytest.mark.few(arc=1, seed=1)
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    ("arc", "diameter", "length", "spacing", "noise"),
    [(135, 2.0, 20.0, 0.3, 0.0), (150, 2.0, 20.0, 0.4, 0.05), (150, 1.3, 34.0, 0.55, 0.15)],
)
def test_a_petiole_that_is_seen_from_one_side_is_found(arc, diameter, length, spacing, noise, seed):
    """Of a broad leaf, shorter than that is wide; of some the noise hides the depth."""
    blade, stalk = seen(arc, diameter, length, spacing, noise, seed)
    kept, petiole, _ = find_petiole(np.concatenate([blade, stalk]), noise)
    assert petiole is not None
    assert np.mean(kept[: len(blade)]) > 0.995
    assert np.mean(~kept[len(blade) :]) > 0.85


@pytest.mark.few(kind=1)
@pytest.mark.parametrize(
    ("kind", "angle", "length", "width", "spacing", "seed"),
    [("twisted", 220, 170, 11, 0.65, 2), ("winding", 80, 170, 6, 0.5, 11), ("wavy", 70, 130, 6, 0.5, 2)],
)
def test_the_tip_of_a_narrow_leaf_under_noise_is_no_petiole(kind, angle, length, width, spacing, seed):
    """Its last ten widths are one or two points wide, and may look as straight as a petiole."""
    leaf = samples.leaf_shape(kind, angle=angle, length=length, width=width)
    points = samples.scan_leaf(leaf, seed=seed, spacing=spacing, noise=0.5).points
    assert find_petiole(points, OrientedCloud.of(points).noise)[1:] == (None, None)


@pytest.mark.parametrize(
    ("arc", "diameter", "length", "spacing", "noise"),
    [(120, 2.0, 20.0, 0.5, 0.2), (150, 0.7, 30.0, 0.5, 0.0)],
    ids=["flat and short", "too few points wide"],
)
def test_what_may_be_a_petiole_is_kept_and_told_with_its_size_and_place(arc, diameter, length, spacing, noise):
    blade, stalk = seen(arc, diameter, length, spacing, noise)
    points = np.concatenate([blade, stalk])
    kept, petiole, part = find_petiole(points, noise)
    assert kept.all()
    assert petiole is None
    long, wide = (float(number) for number in re.findall(r"([\d.]+) (?:long|wide)", str(part)))
    assert long == pytest.approx(length, abs=tol.UNSURE_LENGTH * 50)  # the width of the blade
    assert diameter / 2 < wide < diameter + spacing
    place = np.array(str(part).split("its end at ")[1].split(":")[0].split(), dtype=float)
    assert np.linalg.norm(place - [-length, 0, 0]) < 2 * diameter
    # Found where it is curled, and wide enough.
    blade, stalk = seen(180, 2.0, length, 0.4, 0.0)
    assert find_petiole(np.concatenate([blade, stalk]))[2] is None


def test_a_petiole_with_which_too_much_would_be_cut_off_is_kept_and_told(monkeypatch):
    """Here, what is more than half such a tube is too much."""
    points = bent(drawn(stalked(stub=20.0), 0.5, seed=1))
    monkeypatch.setattr(petiole_module, "LARGEST", 0.5)
    kept, petiole, part = find_petiole(points)
    assert kept.all()
    assert petiole is None
    assert re.search(r"narrow part, about [\d.]+ long and [\d.]+ wide, .* has [\d.]+ times the area", str(part))


@pytest.mark.parametrize(("share", "noise", "seed"), [(1.0, 0.0, 0), (0.7, 0.0, 1), (1.0, 0.05, 5)])
def test_a_petiole_of_few_points_is_cut_off_whose_blade_narrows_into_it(real_scan, share, noise, seed):
    """That of a young sugar beet, 2.3 mm wide; its blade, 12 mm wide, begins 47 to 51 mm from its end.

    Of a part of its points, or with noise, it seems to begin 17 mm before, where single points lie wide.
    """
    cloud = o3d.io.read_point_cloud(str(real_scan("leaves/sugarbeet_petiole.ply")))
    rng = np.random.default_rng(seed)
    points = np.asarray(cloud.points)[rng.random(len(cloud.points)) < share]
    points = points + rng.normal(0, noise, points.shape)
    kept, petiole, _ = find_petiole(points, OrientedCloud.of(points).noise)
    assert 46 < petiole.length < 52
    assert 1.2 < petiole.width < 3
    assert np.mean(kept) > 0.9


def test_a_petiole_whose_junction_nothing_shows_is_told_of_a_narrow_leaf_too(monkeypatch):
    monkeypatch.setattr(petiole_module, "find_junction", lambda *_: None)
    flat = drawn(stalked(length=150.0), 0.5, seed=1)
    kept, petiole, part = find_petiole(np.insert(flat, 2, 0.0, axis=1))
    assert kept.all()
    assert petiole is None
    assert part.why == petiole_module.NO_JUNCTION


def test_the_outermost_line_of_a_scan_is_no_petiole():
    """Lines lie four spacings apart, so that it hangs on the leaf by its end alone; noise makes it 0.6 of one wide."""
    leaf = samples.leaf_shape("cupped")
    points = samples.scan_leaf(leaf, seed=1, spacing=0.7, noise=0.2, pattern="stripes").points
    kept, petiole, _ = find_petiole(points, OrientedCloud.of(points).noise)
    assert petiole is None
    assert kept.all()


def test_few_points_that_lie_wide_part_no_stalk_and_many_do():
    """With many it goes on past them if no blade begins there."""
    width = np.repeat([2.0, 4.0, 2.0, 12.0], [20, 3, 20, 80])
    free = np.where(width == 4.0, 0.9, 4.0)
    few = next(find_stretches(Sections(1.0, width, 0 * width, np.cumsum(width), free)))
    many, whole = find_stretches(Sections(1.0, width, 0 * width, np.cumsum(width), 2 * free))
    assert few.last == 43
    assert many.last == 20
    assert whole == few


def test_a_stalk_that_goes_on_past_wider_sections_tapers_less_than_one_before_them():
    """Its outer third is 0.69 times as wide as the inner: a tip that has begun to widen."""
    width = np.repeat([1.8, 5.1, 2.6, 20.0], [40, 1, 40, 90])
    found = [*find_stretches(Sections(1.0, width, width, np.cumsum(width), np.full(len(width), 40.0)))]
    assert [each.last for each in found] == [40]


def test_what_is_told_of_a_stalk_is_told_of_a_longer_one_too(monkeypatch):
    """Of the tip of a narrow leaf too few points are not; a stalk without a junction is."""
    rng = np.random.default_rng(0)
    leaf = petiole_module._Leaf(rng.uniform(0, [200, 10, 0.1], (2000, 3)), 0.0)
    distance = leaf.ways.points[:, 0]
    stalks = [StalkStretch(0.0, 20.0, 9.0, True), StalkStretch(0.0, 40.0, 9.0, True)]
    junctions = iter([None, Junction(np.zeros(3), np.array([1.0, 0, 0]), 0.1)])
    monkeypatch.setattr(petiole_module, "find_stretches", lambda _: stalks)
    monkeypatch.setattr(petiole_module, "find_junction", lambda *_: next(junctions))
    stalk = petiole_module._stalk_from(leaf, distance)
    assert stalk.stretch == stalks[1]
    assert stalk.junction is None
    assert stalk.is_told


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", range(3))
def test_strays_hide_no_petiole(seed):
    """One point of a hundred lies anywhere around the leaf: beside the petiole, and as an end of its own."""
    blade, stalk = seen(150, 2.0, 20.0, 0.4, 0.05, seed)
    leaf = np.concatenate([blade, stalk])
    low, high = leaf.min(axis=0) - [0, 0, 20], leaf.max(axis=0) + [0, 0, 20]
    strays = np.random.default_rng(seed).uniform(low, high, (len(leaf) // 100, 3))
    kept, petiole, _ = find_petiole(np.concatenate([leaf, strays]), 0.05)
    assert petiole is not None
    assert np.mean(kept[: len(blade)]) > 0.995
    assert np.mean(~kept[len(blade) : len(leaf)]) > 0.85


def test_a_stalk_that_tapers_no_more_than_its_few_points_scatter_is_told():
    """Its outer third is 0.42 as wide as the inner: a tip, if that is known."""
    width = np.concatenate([np.linspace(0.8, 2.6, 30), np.full(60, 20.0)])
    few, many = (
        next(find_stretches(Sections(1.0, width, 0 * width, np.cumsum(width), np.full(len(width), held))), None)
        for held in (2, 40)
    )
    assert few is not None
    assert not few.is_sure
    assert many is None


def test_a_petiole_makes_no_blade_narrow():
    """However long it is: a blade three times as long as wide on a stalk as long."""
    width = np.repeat([2.0, 20.0], 60)
    held = np.full(len(width), 50)
    sections = Sections(1.0, width, width, np.cumsum(width), held)
    assert not sections.is_narrow_from(60.0)
    assert Sections(1.0, width[60:] / 2, width[60:], np.cumsum(width[60:]), held[60:]).is_narrow_from(0.0)


def finger(radius=1.0, length=30.0):
    """A blade in the plane whose petiole is a closed tube that hangs from a hole at its end."""
    around, along = np.meshgrid(np.arange(16), np.arange(41), indexing="ij")
    angle = around * 2 * np.pi / 16
    tube = np.stack([radius * np.cos(angle), radius * np.sin(angle), -along * length / 40], axis=-1).reshape(-1, 3)
    at = lambda i, j: (i % 16) * 41 + j  # noqa: E731
    i, j = around[:, :-1].ravel(), along[:, :-1].ravel()
    walls = np.concatenate(
        [
            np.stack([at(i, j), at(i, j + 1), at(i + 1, j + 1)], 1),
            np.stack([at(i, j), at(i + 1, j + 1), at(i + 1, j)], 1),
        ]
    )
    rings = np.concatenate([[radius], np.linspace(radius + 0.5, 15, 20)])
    disc = np.stack(
        [np.outer(np.cos(angle[:, 0]), rings), np.outer(np.sin(angle[:, 0]), rings), np.zeros((16, 21))], axis=-1
    ).reshape(-1, 3)
    on = lambda i, j: len(tube) + (i % 16) * 21 + j  # noqa: E731
    i, j = (each.ravel() for each in np.meshgrid(np.arange(16), np.arange(20), indexing="ij"))
    plate = np.concatenate(
        [
            np.stack([on(i, j), on(i, j + 1), on(i + 1, j + 1)], 1),
            np.stack([on(i, j), on(i + 1, j + 1), on(i + 1, j)], 1),
        ]
    )
    tip = len(tube) + len(disc)
    i = np.arange(16)
    cap = np.stack([at(i, 40), at(i + 1, 40), np.full(16, tip)], axis=1)
    vertices = np.concatenate([tube, disc, [[0, 0, -length]]])
    triangles = np.concatenate([walls[:, ::-1], plate, cap])
    first = np.arange(len(vertices))
    first[len(tube) + np.arange(16) * 21] = np.arange(16) * 41
    used, corner = np.unique(first[triangles], return_inverse=True)
    return vertices[used], corner.reshape(-1, 3)


def test_a_petiole_that_is_a_closed_tube_is_as_wide_as_it_looks():
    vertices = finger()[0]
    kept, petiole, _ = find_petiole(vertices)
    assert petiole.width == pytest.approx(2, rel=0.15)
    assert petiole.length == pytest.approx(31, abs=3)
    assert vertices[kept][:, 2].min() > -2


TIPS = {
    "grass that tapers over its whole length": shapely.Polygon([(0, -6), (300, 0), (0, 6)]),
    "grass": blade(200, 10),
    "long drawn tip": shapely.Polygon([(0, -15), (40, -20), (80, -4), (140, 0), (80, 4), (40, 20), (0, 15)]),
    "ellipse": ellipse(100, 50),
    "lobed": lobed(),
    "shred at the margin": ellipse(100, 50).union(shapely.box(98, -1, 120, 1)),
}


@pytest.mark.few
@pytest.mark.parametrize("noise", [0.0, 0.5])
@pytest.mark.parametrize("tip", TIPS)
def test_a_tip_is_no_petiole(tip, noise):
    for flat in (triangulated(TIPS[tip], 1.2)[0], drawn(TIPS[tip], 1.0)):
        kept, petiole, part = find_petiole(bent(flat, noise), noise)
        assert petiole is None
        assert kept.all()
        assert (part is not None) == (tip == "shred at the margin")


def spindle(length, width):
    """A lobe from the origin along x, pointed at both ends."""
    x = np.linspace(0, 1, 100)
    half = width / 2 * (4 * x * (1 - x)) ** 0.8
    return shapely.Polygon(np.concatenate([np.stack([length * x, half], 1), np.stack([length * x, -half], 1)[::-1]]))


def strap(length, width):
    return shapely.box(0, -width / 2, length, width / 2)


def spread(lobe, turns):
    """A leaf of lobes that are turned about the origin, by degrees."""
    lobes = [shapely.affinity.rotate(lobe, turn, origin=(0, 0)) for turn in turns]
    return shapely.union_all([*lobes, shapely.Point(0, 0).buffer(5)])


LOBED = {
    "three straps": spread(strap(60, 6), (-60, 0, 60)),
    "three spindles": spread(spindle(60, 7), (-50, 0, 50)),
    "five straps": spread(strap(60, 5), (-110, -50, 0, 50, 110)),
    "arrowhead": spread(spindle(50, 9), (-145, 145)).union(spindle(70, 30)),
}


@pytest.mark.few
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("leaf", LOBED)
def test_lobes_are_no_petiole(leaf, seed):
    kept, petiole, part = find_petiole(bent(drawn(LOBED[leaf], 0.6, seed)))
    assert petiole is None
    assert part is None
    assert kept.all()


def test_from_within_a_finger_all_others_are_ends():
    """Their ways begin alike, from 25 down the first one to the palm; the fingers are 60 long."""
    turns = np.radians([-110, -50, 0, 50, 110])
    along = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ways = PointWays(np.pad(drawn(LOBED["five straps"], 0.6), ((0, 0), (0, 1))))
    flat = ways.points[:, :2]
    start = int(np.argmin(np.linalg.norm(flat - 25 * along[0], axis=1)))
    beyond = np.linalg.norm(flat - 43 * along[0], axis=1) < 18
    ends = flat[[end for end, _ in ways.ends_from(start, COMMON, beyond)]]
    assert np.linalg.norm(ends[:, np.newaxis] - 60 * along[1:], axis=2).min(axis=0).max() < tol.FINGER_END


@pytest.mark.few(length=1)
@pytest.mark.parametrize("length", [40.0, 60.0])
def test_the_petiole_of_a_palmate_leaf_is_found_beside_its_lobes(length):
    """Also if it is none of the two ends that are farthest apart."""
    leaf = bent(drawn(LOBED["three spindles"], 0.6))
    rng = np.random.default_rng(3)
    turn, down = rng.uniform([[0.0], [0.0]], [[2 * np.pi], [length]], (2, int(np.pi * 2.6 * length / 0.6**2)))
    base, ahead = rolled(np.array([[-4.0, 0.0], [-3.0, 0.0]]))
    ahead = ahead - base
    side = np.cross(ahead, [0.0, 1.0, 0.3])
    side /= np.linalg.norm(side)
    tube = (
        base
        - np.outer(down, ahead)
        + 1.3 * (np.outer(np.cos(turn), side) + np.outer(np.sin(turn), np.cross(ahead, side)))
    )
    kept, petiole, _ = find_petiole(np.concatenate([leaf, tube]))
    assert petiole.width == pytest.approx(2.6, rel=tol.JUNCTION_WIDTH)
    assert np.mean(kept[: len(leaf)]) > 0.99
    assert np.mean(kept[len(leaf) :]) < 0.05


def heart(gap, spacing=0.7, width=3.0, length=40.0, depth=14.0):
    """Return points of a blade whose lobes go down beside a round petiole, and those of that."""
    lobes = shapely.union_all([shapely.Point(x, 15 - depth).buffer(15) for x in (-15, 15)])
    whole = lobes.union(shapely.Polygon([(-29, 8), (29, 8), (0, 55)])).union(shapely.box(-20, 0, 20, 12))
    flat = drawn(whole.difference(shapely.box(-width / 2 - gap, -60, width / 2 + gap, 0)), spacing)
    rng = np.random.default_rng(9)
    turn, down = rng.uniform([[0.0], [-length]], [[2 * np.pi], [0.0]], (2, int(np.pi * width * length / spacing**2)))
    tube = np.column_stack([width / 2 * np.cos(turn), down, width / 2 * np.sin(turn)])
    return np.column_stack([flat, 0.002 * flat[:, 0] ** 2]), tube


@pytest.mark.parametrize("gap", [0.2, 4.0])
def test_of_lobes_beside_a_petiole_nothing_is_cut_off(gap):
    leaf, tube = heart(gap)
    kept, petiole, _ = find_petiole(np.concatenate([leaf, tube]))
    assert petiole.width == pytest.approx(3.0, rel=tol.JUNCTION_WIDTH)
    assert np.mean(kept[: len(leaf)]) > 0.99
    # Where the lobes touch it, the petiole ends at them; where they do not, at the blade.
    assert np.mean(kept[len(leaf) :]) < (0.3 if gap < 1 else 0.05)


def test_few_points_have_no_petiole():
    kept, petiole, _ = find_petiole(drawn(stalked(), 10.0) @ np.eye(2, 3))
    assert petiole is None
    assert kept.all()
