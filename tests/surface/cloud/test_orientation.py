import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from cloud_shapes import block, moebius, pipe, slab, sphere, torus
from o3dleaf import (
    OrientedCloud,
    create_from_point_cloud_rbfpu,
    estimate_normals,
    get_num_threads,
    orient_normals,
    preprocess_point_cloud,
    set_num_threads,
)
from o3dleaf.core.errors import CloudWarning, InputError, OrientationError
from o3dleaf.samples import fins, fold
from o3dleaf.surface.cloud.normals import find_opposed, repair_normals
from o3dleaf.surface.cloud.winding.enclosing import enclosing_signs
from tolerances import (
    ALMOST_ALL,
    CUT_SHARE,
    GROUPS_ANGLE,
    HALF_WINDING,
    MOST_OF_THIN,
    MOST_OF_THIN_UNDER_NOISE,
    MOST_OF_VESSEL,
    OPPOSED_LEFT,
)

SHAPES = {"sphere": sphere, "torus": torus, "block": block, "slab": slab}


def noisy(points, share, seed=3):
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    return points + share * diagonal * np.random.default_rng(seed).normal(size=points.shape)


def right(found, true):
    return np.mean(np.einsum("ij,ij->i", found, true) > 0)


@pytest.mark.parametrize("shape", SHAPES)
def test_all_normals_of_a_closed_surface_point_outward(shape):
    points, normals = SHAPES[shape](2500)
    cloud = preprocess_point_cloud(points)
    assert right(cloud.normals, normals) == 1
    assert cloud.notes == ()


@pytest.mark.few(shape=1)
@pytest.mark.parametrize(
    ("shape", "count", "share"), [("sphere", 10000, 0.01), ("torus", 40000, 0.005), ("block", 10000, 0.004)]
)
def test_under_noise_as_thick_as_the_spacing_too(shape, count, share):
    points, normals = SHAPES[shape](count)
    cloud = preprocess_point_cloud(noisy(points, share))
    assert right(cloud.normals, normals) >= ALMOST_ALL
    angle = np.degrees(np.arccos(np.median(np.einsum("ij,ij->i", cloud.normals, normals))))
    assert angle < GROUPS_ANGLE


def test_two_sheets_without_a_rim_face_away_from_one_another():
    points, normals = slab(10000)
    faces = np.abs(normals[:, 2]) > 0.5
    assert right(preprocess_point_cloud(points[faces]).normals, normals[faces]) >= ALMOST_ALL


def test_a_cavity_is_oriented_into_itself_and_separate_bodies_outward():
    outer, inner = sphere(3000), sphere(1000, seed=1)
    shell = np.concatenate([outer[0], 0.5 * inner[0]]), np.concatenate([outer[1], -inner[1]])
    pair = np.concatenate([outer[0], 0.5 * inner[0] + [1.6, 0, 0]]), np.concatenate([outer[1], inner[1]])
    for points, normals in (shell, pair):
        assert right(preprocess_point_cloud(points).normals, normals) == 1


def test_the_winding_number_is_a_half_on_a_closed_surface():
    points, normals = sphere(4000)
    found = enclosing_signs(points, -normals, np.full(4000, 4 * np.pi / 4000), np.zeros(4000, np.int64))
    assert found.sign == [-1]
    assert found.winding == pytest.approx(0.5, abs=HALF_WINDING)


def test_an_open_sheet_has_one_side_and_a_note():
    x, y = np.random.default_rng(5).uniform(0, 1, (2, 2500))
    points = np.column_stack([x, y, 0.2 * np.sin(5 * x) * y])
    cloud = preprocess_point_cloud(points)
    assert abs(np.sum(np.sign(cloud.normals[:, 2]))) == 2500
    assert "open sheet" in cloud.notes[0]
    assert orient_normals(points).is_open
    assert not orient_normals(sphere(1000)[0]).is_open


@pytest.mark.few(half_width=1)
@pytest.mark.parametrize(("half_width", "share"), [(0.1, 0.0), (0.25, 0.0), (0.25, 0.005)])
def test_a_one_sided_sheet_is_cut_across_and_has_two_sides_then(half_width, share):
    points = noisy(moebius(5000, half_width)[0], share)
    cloud = preprocess_point_cloud(points, outliers=None)
    assert cloud.removed.cut == len(points) - len(cloud)
    assert 0 < cloud.removed.cut < CUT_SHARE * len(points)
    assert "one side" in cloud.notes[-1]
    gone = np.setdiff1d(np.arange(len(points)), cKDTree(points).query(cloud.points)[1])
    place = np.array([float(x) for x in cloud.notes[-1].split("around ")[1].split()])
    assert np.linalg.norm(points[gone] - place, axis=1).min() < 1e-3
    angle = np.arctan2(*(points[gone] - 0).T[1::-1])
    assert np.abs(np.angle(np.exp(1j * (angle - np.median(angle))))).max() < np.pi / 2
    assert find_opposed(cloud.points, cloud.normals, cloud.neighbors.row[:, :9]).mean() < OPPOSED_LEFT


@pytest.mark.few(angles=1)
@pytest.mark.parametrize("angles", [(90.0, 210.0, 330.0), (180.0, 0.0, 30.0), (180.0, 0.0, 90.0)])
def test_of_sheets_that_branch_each_has_one_side(angles):
    rng = np.random.default_rng(8)
    u, v = rng.uniform(-1, 1, (4500, 2)).T, rng.uniform(0, 1, 4500)
    angle = np.repeat(np.radians(angles), 1500)
    points = np.column_stack([u[0], v * np.cos(angle), v * np.sin(angle)])
    cloud = preprocess_point_cloud(points, outliers=None)
    apart = np.linalg.norm(cloud.points[:, 1:], axis=1)
    for turn in np.radians(angles):
        flat = np.abs(cloud.points[:, 1:] - apart[:, np.newaxis] * [np.cos(turn), np.sin(turn)]).max(axis=1) < 1e-9
        sheet = flat & (apart > 10 * cloud.spacing)
        side = cloud.normals[sheet] @ [0.0, -np.sin(turn), np.cos(turn)]
        assert np.abs(side.mean()) > 1 - OPPOSED_LEFT


@pytest.mark.slow
def test_a_one_sided_sheet_has_a_surface():
    with pytest.warns(CloudWarning, match="cut out there"):
        mesh, _ = create_from_point_cloud_rbfpu(moebius(2500, 0.25)[0])
    assert mesh.is_orientable()
    assert mesh.get_surface_area() == pytest.approx(np.pi, rel=0.15)


def test_points_that_fill_a_volume_are_refused():
    with pytest.raises(OrientationError, match="no surface at any scale"):
        preprocess_point_cloud(np.random.default_rng(6).normal(size=(2500, 3)))


@pytest.mark.few(spacings=2)
@pytest.mark.parametrize("spacings", [0.5, 1.0, 2.0])
def test_sheets_closer_than_their_spacing_still_face_away_from_one_another(spacings):
    points, normals = slab(5000, spacings)
    faces = np.abs(normals[:, 2]) > 0.5
    cloud = preprocess_point_cloud(points[faces])
    assert right(cloud.normals, normals[faces]) >= ALMOST_ALL
    assert spacings > 1 or any("close together" in note for note in cloud.notes)


@pytest.mark.few(solid=1)
@pytest.mark.parametrize(
    ("solid", "seed"),
    [
        (fold, 1),
        pytest.param(fold, 3, marks=pytest.mark.slow),
        (fins, 5),
        pytest.param(fins, 6, marks=pytest.mark.slow),
    ],
)
def test_thin_parts_close_to_one_another_have_their_sides_under_noise(solid, seed):
    """Two spacings thick, noise of 0.4, 0.5: neighborhoods reach other sheets, and groups do not show their sides."""
    points, normals = solid().sample(10_000)
    cloud = preprocess_point_cloud(noisy(points, 0.005, seed))
    assert right(cloud.normals, normals) >= MOST_OF_THIN_UNDER_NOISE
    assert not any("open sheet" in note for note in cloud.notes)


def voxels(step, half):
    """Return the points of a lattice that are up to half a thickness off the unit sphere."""
    ticks = step * np.arange(-np.ceil(1 / step) - 2, np.ceil(1 / step) + 3)
    points = np.stack(np.meshgrid(*3 * [ticks], indexing="ij"), axis=-1).reshape(-1, 3)
    return points[np.abs(np.linalg.norm(points, axis=1) - 1) < half]


@pytest.mark.parametrize(("step", "half"), [(0.05, 0.025), (0.07, 0.07)])
def test_layers_of_voxels_are_not_two_sheets(step, half):
    """Their heights are spread evenly, as those of two sheets under noise nearly are."""
    cloud = preprocess_point_cloud(voxels(step, half), outliers=None)
    assert not any("two sheets" in note for note in cloud.notes)
    assert any("rounded to steps" in note for note in cloud.notes)
    assert right(cloud.normals, cloud.points) >= ALMOST_ALL


@pytest.mark.parametrize("step", [0.0, 0.05])
def test_two_sheets_within_the_noise_are_told_however_finely_they_are_rounded(step):
    """Two spacings apart, under noise of 0.6: heights with an excess kurtosis of −1.1. Steps are in spacings."""
    spacing, rng = np.sqrt(4 * np.pi / 6000), np.random.default_rng(0)
    radius = 1 + spacing * (rng.choice([-1.0, 1.0], 6000) + 0.6 * rng.normal(size=6000))
    points = radius[:, np.newaxis] * sphere(6000)[0]
    points = np.round(points / (step * spacing)) * step * spacing if step else points
    cloud = preprocess_point_cloud(points, outliers=None)
    assert any("two sheets lie within the noise" in note for note in cloud.notes)
    assert not any("rounded" in note for note in cloud.notes)


@pytest.mark.parametrize("share", [0.0, 0.0015])
def test_the_wall_of_a_vessel_has_two_sides_though_its_hollow_is_enclosed(share):
    """A pipe of a wall 1.5 spacings thick: groups show one sheet between its sides, which encloses the hollow."""
    points, normals = pipe(8000)
    cloud = preprocess_point_cloud(noisy(points, share))
    assert right(cloud.normals, normals) >= MOST_OF_VESSEL
    assert any("close together" in note for note in cloud.notes)


def test_a_ball_of_even_noise_is_one_sheet():
    """Noise that is spread evenly has two ends but no two sheets: its excess kurtosis is -1.2."""
    normals = np.random.default_rng(2).normal(size=(6000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = normals * np.random.default_rng(5).uniform(0.9, 1.1, size=(6000, 1))
    cloud = preprocess_point_cloud(points)
    assert right(cloud.normals, cloud.points) >= MOST_OF_VESSEL


@pytest.fixture(scope="module")
def plates():
    return fins(0.048).sample(7_000)


@pytest.mark.few(share=1)
@pytest.mark.parametrize("share", [0.0, 0.0024])
def test_sides_of_thin_plates_are_found_under_noise(plates, share):
    """Plates two and a half spacings thick that cross one another, to the noise of a quarter of a spacing."""
    points, normals = plates
    assert right(preprocess_point_cloud(noisy(points, share)).normals, normals) >= ALMOST_ALL


def test_sides_of_thin_plates_are_found_where_groups_mix_them(plates):
    """Half a spacing of noise on plates of five: what single points enclose tells, groups make an open sheet of it."""
    points, normals = plates
    cloud = preprocess_point_cloud(noisy(points, 0.006))
    assert right(cloud.normals, normals) >= MOST_OF_THIN
    assert any("by what the whole encloses" in note for note in cloud.notes)


@pytest.mark.few(spacings=1)
@pytest.mark.parametrize("spacings", [1.0, 2.0, 3.0])
def test_noise_on_a_narrow_strip_is_not_its_other_side(spacings):
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.uniform(size=(10_000, 2)) * [5, 0.2], np.zeros(10_000)])
    points[:, 2] = 0.1 * np.sin(3 * points[:, 0]) + spacings / 100 * rng.normal(size=10_000)
    assert any("encloses no volume" in note for note in preprocess_point_cloud(points).notes)


def test_lines_of_a_scanner_are_a_surface_and_a_curve_is_none():
    x, y = np.meshgrid(np.linspace(0, 1, 2000), np.linspace(0, 1, 20))
    lines = np.column_stack([x.ravel(), y.ravel(), 0.3 * (x * y).ravel()])
    lines[:, 0] += np.random.default_rng(9).uniform(0, 1e-3, len(lines))
    cloud = preprocess_point_cloud(lines)  # without the points of a line that lie within a thousandth of others
    assert len(cloud) > 0.999 * len(lines)
    true = np.column_stack([-0.3 * cloud.points[:, [1, 0]], np.ones(len(cloud))])
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    assert np.median(np.abs(np.einsum("ij,ij->i", cloud.normals, true))) > np.cos(np.radians(GROUPS_ANGLE))
    t = np.linspace(0, 6, 3000)
    with pytest.raises(OrientationError, match="along lines"):
        preprocess_point_cloud(np.column_stack([np.cos(t), np.sin(t), t]))


@pytest.mark.slow
def test_two_sheets_within_the_noise_are_not_taken_for_one_without_a_word():
    points, normals = slab(40000)
    points = noisy(points, 0.005)
    assert any("two sheets" in note for note in preprocess_point_cloud(points).notes)
    given = preprocess_point_cloud(points, normals=normals)
    assert given.normals == pytest.approx(normals)
    assert any("two sheets" in note for note in given.notes)


@pytest.mark.parametrize("shape", ["block", "torus"])
def test_a_rigid_motion_commutes(shape):
    points, _ = SHAPES[shape](4000)
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    moved = preprocess_point_cloud(points @ turn.T + [3.0, -2, 1])
    assert right(moved.normals, preprocess_point_cloud(points).normals @ turn.T) == 1


def test_not_a_bit_depends_on_the_number_of_threads():
    points = noisy(torus(4000)[0], 0.008)
    threads = get_num_threads()
    try:
        set_num_threads(1)
        alone = preprocess_point_cloud(points)
    finally:
        set_num_threads(threads)
    assert np.array_equal(alone.normals, preprocess_point_cloud(points).normals)


def test_normals_given_inward_or_at_random_are_turned_outward():
    points, normals = torus(4000)
    inward = preprocess_point_cloud(points, normals=-normals)
    assert inward.normals == pytest.approx(normals)
    assert inward.notes == ("all normals pointed inward and were flipped",)
    sign = np.random.default_rng(8).choice([-1.0, 1.0], (4000, 1))
    assert preprocess_point_cloud(points, normals=sign * normals).normals == pytest.approx(normals)


def test_the_steps_do_alone_what_they_do_together():
    points, _ = block(4000)
    together = preprocess_point_cloud(points, outliers=None).normals
    estimated = estimate_normals(points)
    assert np.linalg.norm(estimated, axis=1) == pytest.approx(np.ones(4000))
    assert right(orient_normals(points, estimated).normals, together) == 1
    left = preprocess_point_cloud(points, outliers=None, orient=None).normals
    assert np.abs(np.einsum("ij,ij->i", left, estimated)) == pytest.approx(np.ones(4000))


def test_voxels_average_the_two_sides_of_a_sheet_apart():
    points, normals = slab(20000)
    cloud = preprocess_point_cloud(points, normals=normals, voxel_size=0.1)
    faces = np.abs(cloud.normals[:, 2]) > 0.9
    half = np.ptp(points[:, 2]) / 2
    assert cloud.removed.averaged == 20000 - len(cloud.points)
    assert cloud.points[faces, 2] == pytest.approx(np.sign(cloud.normals[faces, 2]) * half, abs=0.6 * half)
    assert (cloud.points[faces, 2] * cloud.normals[faces, 2] > 0).all()


def test_normals_of_another_number_than_the_points_are_refused():
    points, normals = sphere(100)
    for call in (orient_normals, lambda x, n: preprocess_point_cloud(x, normals=n)):
        with pytest.raises(InputError, match="99 for 100"):
            call(points, normals[1:])


@pytest.mark.few(name=1)
@pytest.mark.parametrize("name", ["homer", "interlocked_tori"])
def test_the_normals_of_real_figures_are_recovered(real_scan, name):
    cloud = o3d.io.read_point_cloud(real_scan(f"oriented/{name}.ply"))
    given = np.asarray(cloud.normals)
    assert right(preprocess_point_cloud(np.asarray(cloud.points)).normals, given) >= (0.99 if name == "homer" else 1)
    assert np.array_equal(preprocess_point_cloud(cloud).normals > 0, given > 0)


@pytest.mark.few(name=1)
@pytest.mark.parametrize("name", ["leaves/sugarbeet", "leaves/soybean_with_normals", "wheat/wheat_leaf"])
def test_real_leaves_are_open_sheets(real_scan, name):
    cloud = o3d.io.read_point_cloud(real_scan(f"{name}.ply"))
    cloud.normals = o3d.utility.Vector3dVector()
    found = preprocess_point_cloud(cloud)
    assert any("open sheet" in note for note in found.notes)
    # Neighbors seen from each point: none is alone on its side.
    facing = np.einsum("ia,ika->ik", found.normals, found.normals[found.neighbors.row[:, 1:]])
    assert (facing > 0).any(axis=1).all()


def test_the_two_walls_of_a_thin_shell_face_out_of_it_and_into_its_cavity():
    (outer, out), (inner, _) = sphere(4000), sphere(4000, seed=1)
    wall = np.sqrt(4 * np.pi / 4000)
    points = np.concatenate([outer, (1 - wall) * inner])
    cloud = preprocess_point_cloud(points)
    assert right(cloud.normals, np.concatenate([out, -inner])) >= ALMOST_ALL
    assert any("close together" in note for note in cloud.notes)


def test_noise_on_a_thin_sheet_is_averaged_on_each_of_its_sides():
    points, normals = slab(5000)
    cloud = preprocess_point_cloud(noisy(points, 0.005))
    assert right(cloud.normals, normals) > 0.99
    angle = np.degrees(np.arccos(np.median(np.einsum("ij,ij->i", cloud.normals, normals))))
    assert angle < GROUPS_ANGLE


@pytest.mark.parametrize(("side", "turned"), [(2, True), (3, False)])
def test_points_lifted_off_a_sheet_are_no_sheet_but_a_patch_is(side, turned):
    """Four points above a sheet that face down to it are noise; nine may be a sheet, and keep their side."""
    ticks = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1).reshape(-1, 3)
    patch = np.stack(np.meshgrid(np.arange(side), np.arange(side), [0.8]), axis=-1).reshape(-1, 3) + [8.5, 8.5, 0]
    points = np.vstack([ticks, patch])
    normals = np.tile([0.0, 0, 1], (len(points), 1))
    normals[400:, 2] = -1
    found = repair_normals(points, normals, OrientedCloud.of(points).neighbors.row).normals
    assert (found[:400, 2] == 1).all()
    assert (found[400:, 2] == (1 if turned else -1)).all()


def test_a_leaflet_with_a_bit_of_another_sheet_is_cut_where_they_meet(real_scan):
    points = np.asarray(o3d.io.read_point_cloud(str(real_scan("leaves/tomato_leaflet_two_layers.ply"))).points)
    cloud = preprocess_point_cloud(points)
    assert 0 < cloud.removed.cut < CUT_SHARE * len(points)
    assert "were cut out there, around -5" in cloud.notes[-1]


@pytest.mark.few(thickness=1)
@pytest.mark.parametrize("thickness", [2.0, 3.0])
def test_right_normals_of_thin_fins_are_kept(thickness):
    """At their rims most neighbors lie on other sides of the plate; matter is behind each point all the same."""
    solid = fins(0.06)
    points, normals = solid.sample(int(solid.area * (thickness / 0.06) ** 2))
    cloud = preprocess_point_cloud(points, normals=normals)
    truth = solid.closest(cloud.points).normals
    assert (np.einsum("ij,ij->i", cloud.normals, truth) > 0).all()


def test_wrong_normals_on_thin_fins_are_turned():
    solid = fins(0.06)
    points, normals = solid.sample(int(solid.area * (3.0 / 0.06) ** 2))
    wrong = np.random.default_rng(5).random(len(points)) < 0.005
    cloud = preprocess_point_cloud(points, normals=np.where(wrong[:, np.newaxis], -normals, normals))
    truth = solid.closest(cloud.points).normals
    assert (np.einsum("ij,ij->i", cloud.normals, truth) < 0).sum() < 0.1 * wrong.sum()


def turned_at_random(normals, share, seed=7):
    wrong = np.random.default_rng(seed).random(len(normals)) < share
    return np.where(wrong, -1, 1)[:, np.newaxis] * normals


@pytest.mark.few
@pytest.mark.parametrize("shape", ["sphere", "torus"])
@pytest.mark.parametrize("share", [0.1, 0.2, 0.25, 0.4])
def test_of_given_normals_that_were_turned_at_random_none_is_left_so(shape, share):
    """Of a fifth some are the majority among their neighbors, which repair none there."""
    points, normals = SHAPES[shape](2500)
    assert right(preprocess_point_cloud(points, normals=turned_at_random(normals, share)).normals, normals) == 1


@pytest.mark.parametrize("share", [0.2, 0.3])
def test_open_sheets_face_as_most_of_their_given_normals_do_each_by_itself(share):
    x, y = np.random.default_rng(5).random((2, 1500))
    sheet = np.column_stack([x, y, 0.3 * x * x])
    up = np.column_stack([-0.6 * x, 0 * x, np.ones_like(x)]) / np.sqrt(1 + 0.36 * x * x)[:, np.newaxis]
    points, normals = np.vstack([sheet, sheet + [2, 0, 0]]), np.vstack([up, -up])
    for side in (1, -1):
        cloud = preprocess_point_cloud(points, normals=turned_at_random(side * normals, share))
        assert right(cloud.normals, side * normals) == 1
        assert "most of the given normals" in cloud.notes[-1]
