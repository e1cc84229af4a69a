import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

import o3dleaf as o3l
from o3dleaf import AlphaShape, HeightMap, LeafFrame, MultiscaleLeaf, PUInterpolant, TiledField, mesh_report
from tolerances import ANALYTIC_VS_DIFFERENCE, SURFACE_ORDER

PERIOD = 1.2


def micro(unit="mm", scale=1.0):
    """A wavy sheet 0.2 mm thick, sampled on a lattice, larger inside; `scale` writes it in another unit."""
    x, y, z = np.meshgrid(
        np.linspace(0, PERIOD, 25), np.linspace(0, PERIOD, 25), np.linspace(-0.3, 0.3, 13), indexing="ij"
    )
    wave = 2 * np.pi / PERIOD
    # Not 0.1: no sample shall lie on the level but for its last bits.
    values = 0.1037 + 0.03 * np.sin(wave * y) + 0.02 * np.sin(wave * x) - np.abs(z)
    points = scale * np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return TiledField(PUInterpolant.fit(points, values.ravel(), points_per_ball=(60, 120), unit=unit, smoothing=0.0))


@pytest.fixture(scope="module")
def parts():
    """A bent strip, 20 mm by 6 mm, with a hump."""
    rng = np.random.default_rng(0)
    along, across = rng.uniform(0, 20, 2500), rng.uniform(-3, 3, 2500)
    bend = 25.0

    def lift(s, c, h):
        return np.stack([(bend + h) * np.sin(s / bend), c, (bend + h) * np.cos(s / bend)], axis=1)

    scan = lift(along, across, 0.4 * np.cos(across / 2) + 0.2 * np.sin(along / 4))
    axis = lift(np.linspace(0, 20, 9), np.zeros(9), np.zeros(9))
    frame = LeafFrame.fit(scan, axis, unit="mm")
    leaf_points = frame.to_leaf(scan)
    return frame, HeightMap.fit(leaf_points, smoothing=1e-3, unit="mm"), AlphaShape(leaf_points[:, :2])


@pytest.fixture(scope="module")
def leaf(parts):
    return MultiscaleLeaf(micro(), *parts)


def test_g_is_the_texture_at_t_star(leaf):
    rng = np.random.default_rng(1)
    flat = np.column_stack([rng.uniform(2, 18, 300), rng.uniform(-2.5, 2.5, 300), rng.uniform(-0.3, 0.3, 300)])
    world = leaf.blade.lift(flat)
    assert np.abs(leaf.blade.flatten(world) - flat).max() <= 1e-9
    leaf_coordinates = leaf.blade.frame.to_leaf(world)
    t_star = leaf_coordinates - np.column_stack([np.zeros((300, 2)), leaf.blade.height_map(leaf_coordinates[:, :2])])
    assert np.abs(leaf(world) - leaf.texture(t_star)).max() <= 1e-9


def test_gradient_equals_central_differences(leaf):
    rng = np.random.default_rng(2)
    flat = np.column_stack([rng.uniform(2, 18, 200), rng.uniform(-2.5, 2.5, 200), rng.uniform(-0.28, 0.28, 200)])
    world, step = leaf.blade.lift(flat), 1e-5
    numeric = np.stack([(leaf(world + step * e) - leaf(world - step * e)) / (2 * step) for e in np.eye(3)], axis=1)
    assert np.abs(numeric - leaf.gradient(world)).max() <= 10 * ANALYTIC_VS_DIFFERENCE


@pytest.mark.slow
def test_the_field_between_the_vertices_falls_with_the_square_of_the_spacing(leaf):
    spacings = np.array([0.03, 0.015, 0.0075])
    errors = []
    for spacing in spacings:
        mesh = leaf.extract_mesh(spacing, [[10, -0.6], [11.2, 0.6]])
        vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
        errors.append(np.sqrt(np.mean(leaf(vertices[triangles].mean(axis=1)) ** 2)))
    order = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert order == pytest.approx(2, abs=SURFACE_ORDER)


@pytest.mark.parametrize("method", ["cubes", "tetrahedra"])
def test_the_mesh_is_two_manifold_sheets_inside_the_outline(leaf, method):
    sheets = leaf.plan_mesh(0.15, method=method).extract()
    report = mesh_report(sheets.mesh)
    assert report.components == 2
    assert report.boundary_loops == 2
    assert report.manifold
    assert report.oriented
    assert mesh_report(sheets.mesh).self_intersections == 0
    plane = leaf.blade.flatten(np.asarray(sheets.mesh.vertices))[:, :2]
    # The flattened vertex is off by the rounding of world -> leaf, so the rim may lie a hair outside.
    shrunk = plane + 1e-9 * np.sign(plane.mean(axis=0) - plane)
    assert np.all(leaf.blade.outline.contains(plane) | leaf.blade.outline.contains(shrunk))


def test_faces_look_outward(leaf):
    mesh = leaf.extract_mesh(0.15)
    mesh.compute_triangle_normals()
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    outward = -leaf.gradient(corners.mean(axis=1))
    assert np.all(np.einsum("ij,ij->i", outward, np.asarray(mesh.triangle_normals)) > 0)


def test_the_mesh_does_not_depend_on_the_unit_of_the_texture(parts, leaf):
    fine = MultiscaleLeaf(micro("um", 1000.0), *parts)
    expected, found = (np.asarray(each.extract_mesh(0.2).vertices) for each in (leaf, fine))
    assert found.shape == expected.shape
    # A sample that is on the level but for its last bits moves its vertex by the clamp of polygonise, 1e-6 of a step.
    assert cKDTree(expected).query(found)[0].max() <= 1e-6 * 0.2 * np.sqrt(3)


def test_a_texture_without_a_unit_does_not_meet_a_frame_with_one(parts):
    with pytest.raises(o3l.errors.UnitError, match="name the unit"):
        MultiscaleLeaf(micro(None), *parts)


def test_a_blade_that_is_not_two_sheets_is_refused(parts):
    holes = micro()
    flooded = PUInterpolant.fit(
        np.random.default_rng(3).uniform([0, 0, -0.3], [PERIOD, PERIOD, 0.3], (500, 3)), np.ones(500), unit="mm"
    )
    del holes
    with pytest.raises(o3l.errors.ReconstructionError, match="two"):
        MultiscaleLeaf(TiledField(flooded), *parts).extract_mesh(0.2)


def test_bounds_hold_the_mesh(leaf):
    vertices = np.asarray(leaf.extract_mesh(0.2).vertices)
    assert np.all(vertices >= leaf.bounds[0])
    assert np.all(vertices <= leaf.bounds[1])


def test_the_blade_alone_is_one_sheet_on_the_height_map(leaf):
    mesh = leaf.blade.extract_mesh(0.25)
    report = mesh_report(mesh)
    assert report.components == 1
    assert report.holes == 0
    assert report.manifold
    assert np.abs(leaf.blade.flatten(np.asarray(mesh.vertices))[:, 2]).max() <= 1e-9
    mesh.compute_triangle_normals()
    up = leaf.blade.frame.stations(leaf.blade.frame.to_leaf(np.asarray(mesh.vertices))[:, 0].copy())[3]
    first = np.asarray(mesh.triangles)[:, 0]
    assert np.all(np.einsum("ij,ij->i", np.asarray(mesh.triangle_normals), up[first]) > 0)


def test_inputs_are_left_as_they_are(leaf):
    points = np.random.default_rng(4).uniform(-5, 30, (50, 3))
    points.setflags(write=False)
    leaf(points)
    leaf.gradient(points)
    assert isinstance(leaf.extract_mesh(0.3), o3d.geometry.TriangleMesh)


def test_the_written_mesh_is_the_extracted_one(leaf, tmp_path):
    leaf.write_mesh(tmp_path / "leaf.ply", 0.2)
    written, extracted = o3d.io.read_triangle_mesh(tmp_path / "leaf.ply"), leaf.extract_mesh(0.2)
    assert np.array_equal(np.asarray(written.vertices), np.asarray(extracted.vertices))
    assert np.array_equal(np.asarray(written.triangles), np.asarray(extracted.triangles))
