"""Leaves that rest on one another are told apart where anything shows which points are whose; single ones are not."""

import re
from dataclasses import replace

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.leaf.sheet.pieces.minimum_cut import CROSSING, Links, minimum_cut
from o3dleaf.leaf.sheet.pieces.nearer_surface import HUBER, INSIDE, NEAREST, Heights, tell_by_surface
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.samples.leaves.resting import drawn_leaves
from tolerances import RESTING_AREA, RESTING_WRONG, RIDGED

SAID = "lie on one another"


def scan_of(number, spacing, **family):
    """The wider the spacing, the sooner; it is as wide as the theorem allows."""
    return replace(drawn_leaves(number, **family), spacing=spacing).scan()


def told(sheet):
    return [note for note in sheet.notes if SAID in note]


@pytest.mark.few(number=1)
@pytest.mark.parametrize(
    ("number", "spacing"), [(1, 1.0), (3, 0.8), (10, 1.0), (14, 1.0)], ids=["tip hidden", "tip", "middle", "noise"]
)
def test_two_leaves_of_which_one_rests_on_the_other_are_two_pieces(number, spacing):
    scan = scan_of(number, spacing)
    sheet = find_sheet(scan.points)
    pieces = [np.bincount(scan.leaf[rows], minlength=2) for rows in sheet.leftovers.pieces]
    assert len(pieces) == 2
    assert {int(piece.argmax()) for piece in pieces} == {0, 1}
    for piece in pieces:
        assert piece.min() <= RESTING_WRONG * np.bincount(scan.leaf)[piece.argmin()]
    (note,) = told(sheet)
    assert f"`piece` takes one of {sheet.leftovers.listed()}" in note


@pytest.mark.slow
def test_the_sheet_of_the_whole_scan_says_how_many_points_are_the_lesser_leafs():
    scan = scan_of(9, 1.2)
    sheet = find_sheet(scan.points)
    lesser = np.bincount(scan.leaf[sheet.rows]).min()
    (note,) = told(sheet)
    said = int(note.split("taken as one sheet, with ")[1].split(" points")[0].replace(",", ""))
    assert said == pytest.approx(lesser, rel=RESTING_WRONG)


@pytest.mark.slow
def test_a_leaf_that_another_one_hides_the_middle_of_is_two_pieces():
    scan = scan_of(0, 1.2)
    pieces = [np.bincount(scan.leaf[rows], minlength=2) for rows in find_sheet(scan.points).leftovers.pieces]
    assert [piece.argmax() for piece in pieces] == [1, 0, 0]
    assert sum(piece.min() for piece in pieces) == 0


@pytest.mark.slow
def test_each_leaf_has_a_blade_of_its_own():
    scan = scan_of(9, 1.2)
    for piece, leaf in ((1, 1), (2, 0)):
        blade = o3l.create_blade(scan.points, unit="mm", options=o3l.BladeOptions(piece=piece))
        assert blade.outline.area == pytest.approx(scan.areas[leaf], rel=RESTING_AREA)


@pytest.mark.slow
def test_a_blade_of_both_says_so_with_the_pieces_that_there_are():
    scan = scan_of(9, 1.2)
    blade = o3l.create_blade(scan.points, unit="mm")
    assert max(scan.areas) < blade.outline.area
    (note,) = (note for note in blade.notes if SAID in note)
    assert re.search(r"taken as one sheet, with .* `piece` takes one of 2: 1: .*; 2: .*", note)


@pytest.mark.slow
def test_leaves_that_nothing_tells_apart_are_said_to_be_such():
    scan = scan_of(2, 1.0, held_out=True)
    sheet = find_sheet(scan.points)
    (note,) = told(sheet)
    assert "nothing shows which points are whose" in note
    assert len(sheet.leftovers.pieces) == 1


@pytest.mark.few(kind=1, noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("kind", ["curled", "layers", "eaten"])
def test_a_single_leaf_is_one(kind, noise):
    leaf = o3l.samples.leaf_shape(kind)
    for passes, offset in ((1, 0.0), (2, 2.0)):
        points = o3l.samples.scan_leaf(leaf, spacing=1.5, noise=noise, passes=passes, offset=offset, seed=7).points
        assert not told(find_sheet(points))


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_leaf_folded_onto_itself_is_one(noise):
    """Bent by 175° over a radius of two spacings, seen from all around."""
    rng = np.random.default_rng(5)
    flat = rng.uniform([0, -14], [70, 14], (70 * 28, 2))
    flat = flat[(flat[:, 0] / 35 - 1) ** 2 + (flat[:, 1] / 14) ** 2 < 1]
    way = flat @ [0.8, 0.6] - 32
    bend = np.clip(way / 2, 0, np.radians(175))
    over = np.maximum(way - 2 * bend, 0)
    along = np.where(way < 0, way, 2 * np.sin(bend) + over * np.cos(bend))
    up = np.where(way < 0, 0, 2 * (1 - np.cos(bend)) + over * np.sin(bend))
    points = np.column_stack([along, flat @ [-0.6, 0.8], up])
    assert not told(find_sheet(points + rng.normal(0, noise, points.shape)))


@pytest.mark.parametrize("width", [6, 12])
def test_two_sheets_that_a_bridge_joins_are_parted_across_it_along_its_width(width):
    """On a square lattice a row has one link along it across each line, two of the next ones, and two over a point."""
    lattice = np.stack(np.meshgrid(np.arange(-40.0, 41.0), np.arange(-19.5, 20.0)), axis=-1).reshape(-1, 2)
    lattice = lattice[(np.abs(lattice[:, 0]) > 5) | (np.abs(lattice[:, 1]) < width / 2)]
    points = np.column_stack([lattice, np.zeros(len(lattice))])
    links = Links.of(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), 1.0)
    first, second, length = minimum_cut(links, points[:, 0] < -30, points[:, 0] > 30)
    assert first[points[:, 0] < -6].all()
    assert second[points[:, 0] > 6].all()
    assert np.array_equal(first, ~second)
    assert length == pytest.approx((5 * width - 2) / CROSSING)


def crossing(rng, gap, noise, both):
    """Two sheets over one another, a gap apart at the middle from where the upper one rises, and which is which."""
    low, high = ((rng.uniform(-25, 25, (2500, 2))) for _ in range(2))
    if not both:
        low = low[np.abs(low).max(axis=1) > 12]
        high = high[np.abs(high).max(axis=1) <= 12]
    points = np.concatenate(
        [np.column_stack([low, 0 * low[:, 0]]), np.column_stack([high, gap + 0.01 * (high**2).sum(axis=1)])]
    )
    upper = np.arange(len(points)) >= len(low)
    return points + rng.normal(0, noise, points.shape), upper


def test_points_of_two_surfaces_go_to_the_one_that_they_are_nearer_to():
    points, upper = crossing(np.random.default_rng(1), 1.5, 0.2, both=True)
    free = np.flatnonzero(np.hypot(*points[:, :2].T) < 10)
    begin = upper.copy()
    begin[free] = False
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    told_apart = tell_by_surface(points, normals, begin, free, 1 / np.sqrt(2), 0.2)
    assert len(told_apart.rows) == len(free)
    # Of a normal error 0.9999 is less than half a gap of 7.5 deviations.
    assert (told_apart.first == upper[told_apart.rows]).mean() > 0.99
    assert told_apart.unsure == 0


def test_where_one_sheet_hides_the_other_heights_tell_nothing():
    points, upper = crossing(np.random.default_rng(2), 0.2, 0.2, both=False)
    free = np.flatnonzero(np.hypot(*points[:, :2].T) < 20)
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    assert tell_by_surface(points, normals, upper, free, 1.0, 0.2) is None


def test_heights_found_anew_where_points_changed_sides_are_those_found_from_all_points():
    rng = np.random.default_rng(4)
    points, upper = crossing(rng, 1.5, 0.2, both=True)
    places, normals = points[:600], np.tile([0.0, 0.0, 1.0], (600, 1))
    kept, before = Heights.unknown(len(places)), np.zeros(len(points), bool)
    for now in (upper, upper ^ (rng.random(len(points)) < 0.002), upper):
        kept.update(places, normals, points[now], points[now != before])
        fresh = Heights.unknown(len(places))
        fresh.update(places, normals, points[now], points)
        assert all(np.array_equal(*each) for each in zip(kept, fresh, strict=True))
        before = now


def test_heights_are_those_of_fits_by_huber_s_loss_written_out():
    rng = np.random.default_rng(6)
    points = np.column_stack([rng.uniform(-12, 12, (900, 2)), rng.normal(0, 0.1, 900)])
    points[:, 2] += 0.02 * points[:, 0] ** 2 + 2 * (rng.random(900) < 0.1)
    places = rng.uniform(-12, 12, (40, 3)) * [1, 1, 0.1]
    normals = rng.normal(0, 0.1, (40, 3)) + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = Heights.unknown(len(places))
    found.update(places, normals, points, points)
    for place, normal, height, inside in zip(places, normals, found.height, found.inside, strict=True):
        near = points[np.argsort(np.linalg.norm(points - place, axis=1))[:NEAREST]] - place
        size = np.linalg.norm(near[-1])
        (u, v), w = np.linalg.svd(normal[np.newaxis])[2][1:] @ near.T / size, near @ normal / size
        assert inside == (np.hypot(u.mean(), v.mean()) < INSIDE * np.sqrt((u**2 + v**2).mean()))
        terms, weight = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v]), np.ones_like(u)
        for _ in range(2):
            root = np.sqrt(weight)
            fit = np.linalg.lstsq(root[:, np.newaxis] * terms, root * w, rcond=None)[0]
            off = np.abs(w - terms @ fit)
            weight = 1 / np.maximum(1.0, off / (HUBER * np.median(off)))
        assert height == pytest.approx(-size * fit[0], abs=RIDGED)
    assert 0 < found.inside.mean() < 1
