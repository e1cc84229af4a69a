"""Lines along which three sheets meet are found and cut; creases, corners, thin sheets and touching bodies are not."""

import numpy as np
import pytest

from cloud_shapes import block, slab, sphere
from o3dleaf.core.errors import CloudWarning
from o3dleaf.samples import Figure
from o3dleaf.surface.cloud.branchings.find import find_branchings
from o3dleaf.surface.cloud.preprocess import preprocess_point_cloud
from o3dleaf.surface.mesh.mesh_report import mesh_report
from o3dleaf.surface.reconstruction.reconstruct import create_from_point_cloud_rbfpu
from tolerances import BRANCH_AREA, BRANCH_CUT, BRANCH_END, BRANCH_OFF, BRANCH_TURN

Y, T, SLANTED, NARROW = (90.0, 210.0, 330.0), (0.0, 90.0, 180.0), (0.0, 60.0, 180.0), (0.0, 60.0, 120.0)
DENSITY = 2000.0


def half_planes(angles, noise=0.0, seed=0, density=DENSITY, half=1.0):
    """Return points of half planes 2 `half` by 1 that leave the x-axis at some angles, and their spacing."""
    rng, spacing = np.random.default_rng(seed), density**-0.5
    parts = []
    for turn in np.radians(angles):
        x, r = rng.uniform(-half, half, int(2 * half * density)), rng.uniform(0, 1, int(2 * half * density))
        parts.append(np.column_stack([x, r * np.cos(turn), r * np.sin(turn)]))
    points = np.concatenate(parts)
    return points + rng.normal(0, 1, points.shape) * noise * spacing, spacing


@pytest.mark.few
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize("angles", [Y, T, SLANTED, NARROW])
@pytest.mark.parametrize("density", [1000.0, 4000.0])
def test_a_line_where_three_sheets_meet_is_found_along_all_of_it(angles, noise, density):
    points, spacing = half_planes(angles, noise, density=density)
    met = find_branchings(points)
    assert (met.sheets == 3).all()
    assert set(met.line) == {0}
    assert np.linalg.norm(met.places[:, 1:], axis=1).max() < BRANCH_OFF * spacing
    assert np.abs(met.directions[:, 0]).min() > BRANCH_TURN
    ends = met.places[:, 0] + np.outer([-1, 1], met.half)
    assert ends.min() < -1 + BRANCH_END * spacing
    assert ends.max() > 1 - BRANCH_END * spacing
    line = np.column_stack([np.linspace(-0.9, 0.9, 200), np.zeros((200, 2))])
    assert met.nearness(line).max() < 1


def test_the_line_moves_and_grows_with_the_cloud():
    points, _ = half_planes(T)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    moved = find_branchings(1000 * points @ turn.T + [5.0, -300.0, 70.0])
    back = (moved.places - [5.0, -300.0, 70.0]) @ turn / 1000
    assert np.linalg.norm(back[:, 1:], axis=1).max() < BRANCH_OFF * DENSITY**-0.5


@pytest.mark.few
@pytest.mark.parametrize("noise", [0.0, 0.2])
@pytest.mark.parametrize(
    "make",
    [
        lambda: block(12000)[0],
        lambda: slab(8000, 3.0)[0],
        lambda: slab(8000, 1.0)[0],
        lambda: slab(8000, 6.0)[0],
        lambda: sphere(6000)[0],
        lambda: half_planes((0.0, 90.0))[0],
        lambda: half_planes((0.0, 60.0))[0],
        lambda: half_planes((0.0, 90.0, 180.0, 270.0))[0],
    ],
    ids=["corners", "thin", "thinner", "slab", "smooth", "crease", "sharp crease", "bodies that touch"],
)
def test_creases_corners_thin_sheets_and_bodies_that_touch_are_no_branchings(make, noise):
    points = make()
    area = 12000 / DENSITY  # of the blocks and slabs less: the noise is the larger for them
    points = points + np.random.default_rng(2).normal(0, noise * np.sqrt(area / len(points)) / 2, points.shape)
    assert find_branchings(points) is None


@pytest.mark.slow
@pytest.mark.parametrize(("count", "noise", "seed"), [(8000, 0.0015, 0), (8000, 0.002, 0), (9000, 0.002, 1)])
def test_noise_in_the_crotches_of_a_solid_makes_no_branchings(count, noise, seed):
    points, _ = Figure().sample(count)
    width = noise * np.linalg.norm(np.ptp(points, axis=0))
    assert find_branchings(points + np.random.default_rng([count, seed]).normal(0, width, points.shape)) is None


def ribbed(thickness, density=DENSITY):
    """Return points of a plane with a thin rib along the x-axis, a part of a solid, and outward normals."""
    rng, count = np.random.default_rng(3), int(2 * density)
    x, r = rng.uniform(-1, 1, (4, count)), rng.uniform(0, 1, (4, count))
    half, zero, one = thickness / 2, np.zeros(count), np.ones(count)
    points = [
        [x[0], half + r[0], zero],
        [x[1], -half - r[1], zero],
        [x[2], half * one, r[2]],
        [x[3], -half * one, r[3]],
    ]
    normals = np.repeat([[0.0, 0, 1], [0, 0, 1], [0, 1, 0], [0, -1, 0]], count, axis=0)
    return np.concatenate([np.transpose(each) for each in points]), normals


@pytest.mark.few(thickness=1)
@pytest.mark.parametrize("thickness", [0.25, 1.0, 2.0])
def test_a_thin_rib_is_told_from_a_sheet_by_its_normals(thickness):
    points, normals = ribbed(thickness * DENSITY**-0.5)
    assert preprocess_point_cloud(points, normals=normals, outliers=None).branchings is None


def test_without_normals_a_thin_rib_is_a_sheet():
    assert (find_branchings(ribbed(0.25 * DENSITY**-0.5)[0]).sheets == 3).all()


def test_the_points_beside_a_line_are_left_out_and_told():
    points, spacing = half_planes(T)
    cloud = preprocess_point_cloud(points)
    assert cloud.removed.cut == len(points) - len(cloud)
    off = np.linalg.norm(cloud.points[:, 1:], axis=1)
    assert off.min() > spacing
    assert len(points) - len(cloud) < np.sum(np.linalg.norm(points[:, 1:], axis=1) < BRANCH_CUT * spacing)
    note = next(note for note in cloud.notes if "sheets meet at" in note)
    assert note.startswith("3 sheets meet at ")
    assert note.endswith(f"; cut there, {cloud.removed.cut:,} points left out")
    place = np.array([float(x) for x in note.split(";")[0].split(" at ")[1].split()])
    assert np.linalg.norm(place[1:]) < BRANCH_OFF * spacing
    assert preprocess_point_cloud(points, branchings=None).branchings is None


@pytest.mark.slow
@pytest.mark.parametrize(("angles", "noise"), [(Y, 0.2), (T, 0.0), (SLANTED, 0.0)])
def test_three_sheets_that_meet_have_surfaces_that_end_at_the_line(angles, noise):
    points, spacing = half_planes(angles, noise, half=0.3)
    with pytest.warns(CloudWarning, match="3 sheets meet at"):
        mesh, _ = create_from_point_cloud_rbfpu(points, measure=None)
    report = mesh_report(mesh)
    assert report.manifold
    assert (report.components, report.genus, report.self_intersections) == (3, 0, 0)
    off = np.linalg.norm(np.asarray(mesh.vertices)[:, 1:], axis=1)
    assert spacing < off.min() < BRANCH_CUT * spacing
    assert report.area == pytest.approx(1.8, rel=BRANCH_AREA)
