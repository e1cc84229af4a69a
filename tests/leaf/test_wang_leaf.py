"""A leaf of Wang tiles: its mesh lies where G is zero, is closed and streamed; what it lacks is refused by name."""

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from leaf_fields import FRAMES, leaf_of, off_the_field, texture
from o3dleaf import WangField
from o3dleaf.core.errors import InputError
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.surface.mesh.mesh_report import mesh_report
from tolerances import ON_SURFACE

WAVES = np.random.default_rng(5).normal(0, 6, (30, 2))
STEP = 0.1


def rough(x, y, z):
    return 0.2 + 0.006 * np.cos(np.stack([x, y], axis=-1) @ WAVES.T + np.arange(30)).sum(axis=-1) - np.abs(z)


@pytest.fixture(scope="module")
def tiles():
    return WangField(texture(rough, tile=3.0, n=21).field, seed=2)


@pytest.fixture(scope="module")
def leaf(tiles):
    """A strip of 8 by 6, bent about a circle of radius 15."""
    return leaf_of(tiles, bend=15.0, length=8.0)[0]


@pytest.fixture(scope="module")
def solid(leaf):
    return leaf.plan_mesh(STEP, closed=True)


def test_the_solid_is_closed_and_its_faces_lie_on_the_field(leaf, solid):
    made = solid.extract()
    report = mesh_report(made.mesh)
    # Whether the wall of so coarse a margin crosses a face is not what this is about.
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    vertices, triangles = np.asarray(made.mesh.vertices), np.asarray(made.mesh.triangles)
    assert len(triangles) == solid.triangles
    faces = np.setdiff1d(triangles[made.labels != RIM], triangles[made.labels == RIM])
    cut = np.abs(leaf(vertices[faces])) / np.linalg.norm(leaf.gradient(vertices[faces]), axis=1)
    # Cells that the margin cuts keep vertices of whole ones, and some of the triangles of these are cut.
    assert np.quantile(cut, 0.98) < ON_SURFACE
    assert cut.max() < STEP


@pytest.mark.slow
def test_open_sheets_are_two_and_a_window_is_part_of_them(leaf):
    whole, window = (leaf.extract_mesh(STEP, region) for region in (None, [[3.0, -1.0], [6.0, 1.0]]))
    assert mesh_report(whole).components == 2
    places = {row.tobytes() for row in np.asarray(whole.vertices)}
    inside = np.abs(leaf.blade.flatten(np.asarray(window.vertices))[:, :2] - [4.5, 0]) < [1.5 - STEP, 1 - STEP]
    assert all(row.tobytes() in places for row in np.asarray(window.vertices)[inside.all(axis=1)])


def test_what_is_streamed_is_what_is_extracted(solid, tmp_path):
    solid.write(tmp_path / "leaf.ply")
    written, made = read_mesh(tmp_path / "leaf.ply").mesh, solid.extract().mesh
    assert np.array_equal(np.asarray(written.triangles), np.asarray(made.triangles))
    assert np.allclose(np.asarray(written.vertices), np.asarray(made.vertices))
    assert (tmp_path / "leaf.ply").stat().st_size == solid.bytes(tmp_path / "leaf.ply")


@pytest.mark.slow
def test_tiles_are_simplified_each_by_itself(leaf, solid):
    plan = leaf.plan_mesh(STEP, closed=True, simplify=0.5)
    assert plan.triangles < solid.triangles
    report = mesh_report(plan.extract().mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)


@pytest.mark.slow
def test_a_leaf_that_was_saved_has_the_same_mesh(leaf, solid, tmp_path):
    leaf.save(tmp_path / "leaf.o3l")
    again = o3l.load(tmp_path / "leaf.o3l").plan_mesh(STEP, closed=True).extract()
    assert np.array_equal(np.asarray(again.mesh.vertices), np.asarray(solid.extract().mesh.vertices))


def test_the_block_of_a_tile_is_the_torus_of_all(leaf):
    block = leaf.extract_tile(0.15)
    vertices = np.asarray(block.mesh.vertices)
    assert mesh_report(block.mesh).watertight
    assert np.allclose(np.ptp(vertices[:, :2], axis=0), 4 * leaf.texture.period)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("frame", FRAMES)
def test_a_window_is_as_fine_as_it_is_to_be_and_what_is_around_it_stays(tiles, frame, closed):
    leaf = leaf_of(tiles, bend=15.0, length=8.0, frame=frame)[0]
    step = 0.16
    region = np.array([[3.0, -0.9], [5.2, 0.6]])
    made = leaf.extract_levels(step, [(region, step / 2)], closed=closed)
    report = mesh_report(made.mesh)
    assert (report.manifold, report.oriented, report.genus, report.holes) == (True, True, 0, 0)
    assert (report.components, report.boundary_loops) == ((1, 0) if closed else (2, 2))
    vertices, triangles = np.asarray(made.mesh.vertices), np.asarray(made.mesh.triangles)
    places = leaf.blade.flatten(vertices)[:, :2]
    within = ((places > region[0]) & (places < region[1])).all(axis=1)
    size = np.linalg.norm(np.diff(vertices[triangles[within[triangles].all(axis=1)]][:, :2], axis=1)[:, 0], axis=1)
    assert step / 4 < np.median(size) < step
    # Beside the curtain vertices lie where the samples are zero between two columns.
    inner = ((places > region[0] + step / 2) & (places < region[1] - step / 2)).all(axis=1)
    off = np.abs(leaf(vertices[inner])) / np.linalg.norm(leaf.gradient(vertices[inner]), axis=1)
    assert off.max() < ON_SURFACE * step
    around = ((places < region[0] - 2 * step) | (places > region[1] + 2 * step)).any(axis=1)
    around &= ((places > step) & (places < [8 - step, np.inf])).all(axis=1) & (np.abs(places[:, 1]) < 3 - 2 * step)
    plain = {row.tobytes() for row in np.asarray(leaf.plan_mesh(step, closed=closed).extract().mesh.vertices)}
    assert around.sum() > 1000
    assert all(row.tobytes() in plain for row in vertices[around])


@pytest.mark.slow
def test_a_closed_solid_of_the_paper_has_a_rim_and_its_faces_lie_on_the_field(tiles):
    leaf = leaf_of(tiles, bend=15.0, length=8.0, frame="paper")[0]
    plan = leaf.plan_mesh(STEP, closed=True)
    made = plan.extract()
    report = mesh_report(made.mesh)
    assert (report.watertight, report.components, report.genus, report.self_intersections) == (True, 1, 0, 0)
    assert len(np.asarray(made.mesh.triangles)) == plan.triangles
    assert set(np.unique(made.labels)) == {0, 1, RIM}
    assert off_the_field(leaf, made).max() < ON_SURFACE * STEP


def test_options_give_wang_tiles():
    volume, _ = o3l.samples.wheat_ct(seed=1, spacing=48)
    laid = o3l.create_texture(volume, options=o3l.TextureOptions(tiles="wang", seed=3))
    assert isinstance(laid, WangField)
    assert laid.seed == 3
    with pytest.raises(InputError, match="shift"):
        o3l.create_texture(volume, options=o3l.TextureOptions(tiles="wang", shift=0.5))


@pytest.fixture(scope="module")
def scattered(leaf):
    """World points in and around a part of the strip that holds several tiles."""
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(1, 7, 1000), rng.uniform(-2.5, 2.5, 1000), rng.uniform(-0.6, 0.6, 1000)])
    return leaf.blade.lift(flat)


@pytest.mark.slow
@pytest.mark.parametrize("closed", [pytest.param(False, marks=pytest.mark.slow), True])
def test_distances_are_those_to_a_fine_mesh(leaf, scattered, closed):
    """As those of a periodic leaf: but for places to which several feet are near, which the mesh is off by."""
    step = 0.05
    mesh = o3d.t.geometry.TriangleMesh.from_legacy(leaf.extract_mesh(step, closed=True))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh)
    exact = scene.compute_signed_distance(o3d.core.Tensor(scattered.astype(np.float32))).numpy()
    found = leaf.signed_distance(scattered, closed=closed)
    off = np.abs(np.abs(found) - np.abs(exact))
    assert np.quantile(off, 0.9) < 2 * step**2
    assert off.max() < leaf.index_of(closed=closed).tile.step / 2
    sure = np.abs(exact) > step**2
    assert np.array_equal(np.sign(found[sure]), np.sign(exact[sure]))


@pytest.mark.slow
def test_closest_points_lie_on_the_field_and_at_the_distance(leaf, scattered):
    feet = leaf.closest_points(scattered)
    assert np.allclose(np.linalg.norm(feet - scattered, axis=1), np.abs(leaf.signed_distance(scattered)))
    inner = np.abs(leaf.blade.flatten(feet)[:, :2] - [4, 0]) < [3.5, 2.8]
    feet = feet[inner.all(axis=1)]
    assert np.abs(leaf(feet) / np.linalg.norm(leaf.gradient(feet), axis=1)).max() < 1e-3


@pytest.mark.slow
def test_a_remeshed_leaf_has_good_triangles_on_the_field(leaf):
    region, edge = [[1.2, -1.0], [4.6, 1.2]], 0.15
    made = leaf.plan_mesh(STEP, region, closed=True).extract(remesh=edge)
    report = mesh_report(made.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    off = off_the_field(leaf, made)
    assert np.quantile(off, 0.99) < ON_SURFACE * edge
    # A window's corners have slivers, as those of a periodic leaf do.
    assert report.share_below_10deg < 0.02


@pytest.mark.slow
def test_tiles_are_remeshed_each_on_its_own_surface(leaf):
    plan = leaf.plan_mesh(0.15, closed=True, remesh_tile=0.18)
    made = plan.extract()
    report = mesh_report(made.mesh)
    assert (report.manifold, report.boundary_edges, report.components) == (True, 0, 1)
    off = off_the_field(leaf, made)
    assert np.quantile(off, 0.97) < ON_SURFACE
