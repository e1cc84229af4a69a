import numpy as np
import pytest

from cloud_shapes import slab, sphere, torus
from o3dleaf import OrientedCloud, preprocess_point_cloud, samples
from o3dleaf.surface.cloud import parity_loops
from o3dleaf.surface.cloud.orientation.orientation import orient_normals
from o3dleaf.surface.cloud.orientation.sides import find_sides
from o3dleaf.surface.cloud.winding.consistency import make_consistent
from o3dleaf.surface.cloud.winding.dipole_tree import DipoleTree
from o3dleaf.surface.cloud.winding.dipoles import Dipoles
from o3dleaf.surface.cloud.winding.enclosing import enclosing_signs
from tolerances import ALMOST_ALL, FIFTH_POWER, FOLDED_SIDES, HALF_WINDING, ROUNDING, TREE_GRADIENT, TREE_WINDING


def right(found, true):
    return np.mean(np.einsum("ij,ij->i", found, true) > 0)


def literal(points, flux, width, at):
    """The winding number of softened dipoles at places, by the formula."""
    way = points - at[:, np.newaxis]
    far = np.sqrt((way**2).sum(axis=2) + width**2)
    return np.einsum("ija,ja->ij", way, flux / (4 * np.pi)) / far**3


@pytest.fixture
def sources():
    points, normals = torus(1200)
    area = np.random.default_rng(1).uniform(0.5, 1.5, 1200) * 0.0115
    tree = DipoleTree(points)
    order = tree.order
    return tree, normals[order] * area[order, np.newaxis], 0.8 * np.sqrt(area[order])


def test_the_tree_sums_as_the_formula_does(sources):
    tree, flux, width = sources
    found = tree.winding(flux, width, np.ones(1200, bool))
    assert found[:, 0] == pytest.approx(literal(tree.points, flux, width, tree.points).sum(axis=1), abs=TREE_WINDING)


def test_the_gradient_is_the_limit_of_difference_quotients(sources):
    tree, flux, width = sources
    found = tree.winding(flux, width, np.ones(1200, bool))[:, 1:]
    step = 1e-5
    for axis, shift in enumerate(step * np.eye(3)):
        ahead, behind = (literal(tree.points, flux, width, tree.points + s).sum(axis=1) for s in (shift, -shift))
        error = found[:, axis] - (ahead - behind) / (2 * step)
        assert np.abs(error).max() < TREE_GRADIENT * np.linalg.norm(found, axis=1).mean()


def test_what_errors_pull_is_the_transpose_of_the_winding_number(sources):
    tree, flux, width = sources
    wanted = np.random.default_rng(2).uniform(size=1200) < 0.5
    error = np.where(wanted, np.random.default_rng(3).normal(size=1200), 0.0)
    change = np.where(wanted[:, np.newaxis], flux, 0.0)
    along = error @ tree.winding(change, width, wanted)[:, 0]
    scale = np.abs(error) @ np.abs(tree.winding(change, width, wanted)[:, 0])
    assert np.sum(tree.pull(error, width, wanted) * change) == pytest.approx(along, abs=TREE_WINDING * scale)


def test_points_that_are_not_wanted_get_nothing_and_change_nothing(sources):
    tree, flux, width = sources
    wanted = np.arange(1200) % 3 == 0
    some, all_of_them = (tree.winding(flux, width, mask) for mask in (wanted, np.ones(1200, bool)))
    assert np.array_equal(some[wanted], all_of_them[wanted])
    assert not some[~wanted].any()


@pytest.mark.parametrize("soft", [0.0, 0.5])
def test_moments_up_to_the_second_leave_what_falls_with_the_fifth_power_of_the_distance(soft):
    rng = np.random.default_rng(7)
    points, flux = rng.uniform(-1, 1, (100, 3)), rng.normal(size=(100, 3))
    dipoles, ways = Dipoles.of(points, flux), sphere(50, seed=8)[0]

    def error(distance):
        exact = literal(points, flux, soft, distance * ways).sum(axis=1)
        return np.linalg.norm(dipoles.winding_at(distance * ways, np.full(50, soft)) - exact)

    assert error(200.0) / error(100.0) == pytest.approx(2.0**-5, rel=FIFTH_POWER)


def test_a_dipole_makes_nothing_at_its_own_place():
    points, flux = sphere(40)
    alone = [Dipoles.of(np.delete(points, i, 0), np.delete(flux, i, 0)) for i in range(40)]
    without = [each.winding_at(points[i : i + 1], np.zeros(1))[0] for i, each in enumerate(alone)]
    assert Dipoles.of(points, flux).winding_at(points, np.zeros(40)) == pytest.approx(without, abs=ROUNDING)


@pytest.mark.parametrize("apart", [1e-1, 1e-3, 1e-9])
def test_a_point_makes_half_at_most_however_near_it_lies(apart):
    """A disc that is touched fills half of all directions: its winding number there is 1/2."""
    way = sphere(500)[0]
    number, area = np.empty((500, 1)), 0.01
    flux, soft = np.array([[0.0], [0.0], [area]]), np.array([area / (2 * np.pi)])
    parity_loops.winding(apart * way, np.zeros((3, 1)), flux, np.array([0, 1]), soft, 0, 500, number)
    assert np.abs(number).max() <= 0.5


def test_pairs_of_nearly_coinciding_points_do_not_decide_on_a_side():
    """A tenth of the points have a partner at a thousandth of a spacing, to their inside as seen from the other."""
    points, normals = sphere(4000)
    spacing = np.sqrt(4 * np.pi / 4000)
    twice, directions = np.vstack([points, points[:400]]), np.vstack([normals, normals[:400]])
    twice[4000:] += 1e-3 * spacing * normals[:400]
    area = np.full(4400, spacing**2)
    area[:400] /= 2
    area[4000:] /= 2
    found = enclosing_signs(twice, -directions, area, np.zeros(4400, np.int64))
    assert found.sign == [-1]
    assert found.winding == pytest.approx(0.5, abs=2 * HALF_WINDING)


def test_a_piece_without_area_changes_no_sign():
    """As of points that rounding put on a line."""
    points, normals = sphere(2000)
    piece = np.repeat([0, 1], [1990, 10])
    found = enclosing_signs(points, -normals, np.repeat([4 * np.pi / 2000, 0.0], [1990, 10]), piece)
    assert found.sign.tolist() == [-1, 1]
    assert found.gain[0] > 0 == found.gain[1]


def test_a_body_that_is_turned_is_found_by_the_winding_number_alone():
    """Neighbors agree all over it, and it is of no doubtful points."""
    points, normals = sphere(3000)
    small = sphere(800, seed=2)
    both = np.vstack([points, 0.5 * small[0] + [1.7, 0, 0]])
    given = np.vstack([normals, -small[1]])
    spacing = np.repeat([np.sqrt(4 * np.pi / 3000), np.sqrt(np.pi / 800)], [3000, 800])
    found = make_consistent(both, given, spacing, 0.0, np.zeros(3800, bool))
    assert right(found.normals, np.vstack([normals, small[1]])) == 1
    assert not found.uncertain.any()


@pytest.mark.parametrize("unit", [2.0**-20, 2.0**20])
def test_what_is_consistent_is_so_in_any_unit(unit):
    """Powers of two, so that not a bit differs but in the exponents."""
    points, normals = sphere(1500)
    given = np.where(points[:, :1] > 0.3, -normals, normals)
    spacing = np.full(1500, np.sqrt(4 * np.pi / 1500))
    found, other = (
        make_consistent(points * scale, given, spacing * scale, 0.01 * scale, points[:, 0] > 0.3)
        for scale in (1.0, unit)
    )
    assert right(found.normals, normals) == 1
    assert other.normals == pytest.approx(found.normals, abs=ROUNDING)
    assert (other.uncertain == found.uncertain).all()


@pytest.mark.few(gap=1)
@pytest.mark.parametrize("gap", [0.5, 1.0, 2.0])
def test_rings_that_nearly_touch_are_told_apart(gap):
    points, normals = torus(4000)
    spacing = np.sqrt(4 * np.pi**2 * 0.35 / 4000)
    other = torus(4000, seed=5)
    both = np.vstack([points, other[0] + [0, 0, 0.7 + gap * spacing]]), np.vstack([normals, other[1]])
    cloud = preprocess_point_cloud(both[0], outliers=None, branchings=None)
    assert right(cloud.normals, both[1]) >= (ALMOST_ALL if gap >= 1 else 0.985)


def wires(places, radius=2.0, noise=0.0, seed=0):
    """Return a point per unit area of wires, with noise, and the normals where they came from."""
    solid = samples.Wires(tuple(places), radius, 40.0)
    points, normals = solid.sample(round(solid.area), seed)
    return points + noise * np.random.default_rng(seed).normal(size=points.shape), normals


@pytest.mark.parametrize(("radius", "gap", "noise"), [(1.5, 3.0, 0.4), (2.0, 1.5, 0.2)])
def test_wires_side_by_side_are_no_sheet(radius, gap, noise):
    """Seen from farther off they are one, and nearer by their neighbors contradict one another."""
    points, normals = wires([(k * (2 * radius + gap), 0.0) for k in range(3)], radius, noise, seed=3)
    cloud = OrientedCloud.of(points)
    assert find_sides(cloud.surfels).contradictory
    assert right(orient_normals(cloud).normals, normals) >= ALMOST_ALL


def test_what_the_whole_leaves_in_doubt_is_settled_by_narrower_dipoles():
    """Wires a spacing apart: dipoles two spacings wide leave six in a thousand wrong."""
    points, normals = wires([(0.0, 0.0), (4.0, 0.0), (8.0, 0.0)], radius=1.5)
    found = orient_normals(OrientedCloud.of(points))
    assert any("what the whole encloses" in note for note in found.notes)
    assert right(found.normals, normals) >= ALMOST_ALL


def test_a_bundle_of_wires_that_is_half_settled_is_settled_once_more():
    """One wire among six: its neighbors join it with contrary sides."""
    turn = np.arange(6) * np.pi / 3 + 0.2
    points, normals = wires([(0.0, 0.0), *zip(6 * np.cos(turn), 6 * np.sin(turn), strict=True)], noise=0.3, seed=3)
    assert right(orient_normals(OrientedCloud.of(points)).normals, normals) >= ALMOST_ALL


def test_sides_that_points_do_not_tell_apart_are_counted_with_their_place():
    """Two balls a quarter of a spacing apart, where they are nearest."""
    points, normals = sphere(3000)
    other = sphere(3000, seed=1)
    spacing = np.sqrt(4 * np.pi / 3000)
    both = np.vstack([points, other[0] + [2 + 0.05 * spacing, 0, 0]]), np.vstack([normals, other[1]])
    noisy = both[0] + 0.3 * spacing * np.random.default_rng(4).normal(size=both[0].shape)
    cloud = preprocess_point_cloud(noisy, outliers=None, branchings=None)
    note = next(note for note in cloud.notes if "remain uncertain" in note)
    place = np.array([float(x) for x in note.split("around ")[1].split(";")[0].split()])
    assert np.linalg.norm(place - [1, 0, 0]) < 5 * spacing


def test_a_sheet_that_is_rolled_up_keeps_one_side():
    rng = np.random.default_rng(0)
    turn = rng.uniform(0, 4 * np.pi, 5000)
    radius = 0.2 + 0.06 * turn
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), rng.uniform(0, 2, 5000)])
    across = np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) * radius[:, np.newaxis]
    across += 0.06 * np.column_stack([np.sin(turn), -np.cos(turn), 0 * turn])
    cloud = preprocess_point_cloud(points)
    share = right(cloud.normals, across)
    assert max(share, 1 - share) == 1
    assert any("rolled up" in note for note in cloud.notes)


def test_two_bodies_that_nearly_touch_are_not_joined_with_contrary_sides():
    """Eggs one spacing apart, whose neighbors join them by a few edges: one of them came out inside out."""
    eggs = [sphere(4000, seed) for seed in (0, 9)]
    points = np.vstack([egg[0] * [1, 1, 3] for egg in eggs])
    normals = np.vstack([egg[1] / [1, 1, 3] for egg in eggs])
    points[4000:, 0] += 2 + np.sqrt(4 * np.pi * 2.3 / 4000)
    cloud = preprocess_point_cloud(points)
    assert right(cloud.normals, normals) >= ALMOST_ALL - 0.002
    assert not any("open sheet" in note for note in cloud.notes)


@pytest.mark.few(seed=1)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_narrow_gap_of_a_noisy_fold_is_not_filled_up(seed):
    fold = samples.fold(0.08)
    spacing = 0.08 / 2.3
    exact, _ = fold.sample(round(fold.area / spacing**2), seed)
    points = exact + 0.43 * spacing * np.random.default_rng(seed).normal(size=exact.shape)
    cloud = preprocess_point_cloud(points, outliers=None, branchings=None)
    assert right(cloud.normals, fold.closest(cloud.points).normals) >= FOLDED_SIDES


@pytest.mark.parametrize("thickness", [0.5, 2.0])
def test_a_noisy_sheet_is_no_thin_body(thickness):
    """What lies on both sides of it within the noise could be closed by a pancake."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 1, (4000, 3))
    points[:, 2] = 0.1 * np.sin(4 * points[:, 0]) + thickness / np.sqrt(4000) * rng.normal(size=4000)
    cloud = preprocess_point_cloud(points, outliers=None)
    up = np.sign(cloud.normals[:, 2])
    assert abs(up.mean()) > ALMOST_ALL


def test_uneven_areas_do_no_harm():
    points, normals = slab(6000)
    kept = np.random.default_rng(2).uniform(size=6000) < np.where(points[:, 0] > 0, 1.0, 0.3)
    cloud = OrientedCloud.of(points[kept])
    assert right(preprocess_point_cloud(cloud).normals, normals[kept]) >= ALMOST_ALL
