"""The whole road on the real wheat leaf, with the synthetic CT patch: what the mesh must be."""

from dataclasses import replace
from functools import cache

import numpy as np
import open3d as o3d
import pytest
import shapely
from scipy.spatial import cKDTree

import o3dleaf as o3l
from leaf_fields import FRAMES, MAIN_FRAME
from o3dleaf import (
    BladeOptions,
    HeightMapBlade,
    MultiscaleLeaf,
    ParametricBlade,
    TextureOptions,
    create_blade,
    create_multiscale_leaf,
    create_texture,
    mesh_report,
)
from o3dleaf.errors import InputError
from o3dleaf.leaf import paper_pipeline, pipeline
from o3dleaf.leaf.macro.midrib import find_midrib
from o3dleaf.samples import wheat_ct, wheat_scan
from tolerances import ON_SURFACE, SURFACE_ORDER, TAKEN_INSIDE, THINNED_AREA, THINNED_NOISES


@pytest.fixture(scope="module")
def wheat(real_scan):
    scan = o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf.ply")))
    midrib = o3d.io.read_point_cloud(str(real_scan("wheat/wheat_leaf_midrib.ply")))
    return scan, midrib


@pytest.fixture(scope="module")
def texture():
    return create_texture(wheat_ct()[0])


PAPER = BladeOptions(frame="paper")


@pytest.fixture(scope="module")
def blade_in(wheat):
    """The blade in a frame, with the midrib picked by hand, of half the points unless all are asked for."""

    @cache
    def made(frame, every=2):
        scan, midrib = wheat
        return create_blade(scan.uniform_down_sample(every), midrib, options=BladeOptions(frame=frame))

    return made


@pytest.fixture(scope="module", params=MAIN_FRAME)
def blade(request, blade_in):
    return blade_in(request.param)


@pytest.fixture(scope="module")
def leaf(blade, texture):
    return MultiscaleLeaf(texture, blade=blade)


@pytest.fixture(scope="module")
def paper_blade(blade_in):
    return blade_in("paper")


def f_score(mesh, points, threshold, count=100_000):
    """Harmonic mean of the share of the surface near the scan and the share of the scan near the surface."""
    o3d.utility.random.seed(0)
    on_surface = np.asarray(mesh.sample_points_uniformly(count).points)
    precision = np.mean(cKDTree(points).query(on_surface)[0] <= threshold)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    distance = scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
    recall = np.mean(distance <= threshold)
    return 2 * precision * recall / (precision + recall)


AREA = {HeightMapBlade: (1330, 1450), ParametricBlade: (1430, 1560)}
"""Of the real leaf in mm²: inside its outermost points and without its folded tip, and inside its margin."""


def check_blade(blade, scan):
    """One sheet that no leaf would be ashamed of."""
    points, mesh = np.asarray(scan.points), blade.extract_mesh(0.2)
    report = mesh_report(mesh)
    assert report.components == 1
    assert report.holes == 0
    assert report.manifold
    assert report.self_intersections == 0
    assert AREA[type(blade)][0] <= report.area <= AREA[type(blade)][1]
    spacing = np.median(cKDTree(points).query(points, k=2)[0][:, 1])
    assert f_score(mesh, points, 2 * spacing) >= 0.90


def test_the_blade_of_the_real_leaf(wheat, blade):
    check_blade(blade, wheat[0])


@pytest.mark.slow
@pytest.mark.parametrize("frame", FRAMES)
def test_the_blade_of_all_points_of_the_real_leaf(wheat, blade_in, frame):
    check_blade(blade_in(frame, 1), wheat[0])


@pytest.mark.slow
@pytest.mark.parametrize(("frame", "every"), [("surface", 2), ("paper", 1)])
def test_the_blade_of_the_real_leaf_without_a_midrib(wheat, frame, every):
    """Of half the points a surface is fitted in half the time; their outline, as the paper finds it, has holes."""
    scan = wheat[0].uniform_down_sample(every)
    check_blade(create_blade(scan, options=BladeOptions(frame=frame)), scan)


@pytest.mark.slow
def test_the_height_map_of_the_real_leaf_is_not_steep(paper_blade):
    plane = paper_blade.flatten(np.asarray(paper_blade.extract_mesh(0.2).vertices))[:, :2]
    assert np.percentile(np.linalg.norm(paper_blade.height_map.gradient(plane), axis=1), 99) <= 1.2


def test_the_multiscale_leaf_is_two_clean_sheets(leaf):
    surface = leaf.plan_mesh(0.3)
    sheets = surface.extract()
    report = mesh_report(sheets.mesh)
    assert report.components == 2
    assert report.holes == 0
    assert report.manifold
    assert report.oriented
    assert report.self_intersections == 0
    assert surface.voids > 0
    plane = leaf.blade.flatten(np.asarray(sheets.mesh.vertices))[:, :2]
    beside = shapely.distance(leaf.blade.outline.polygon, shapely.points(plane))
    assert beside.max() <= (TAKEN_INSIDE * 0.3 if leaf.blade.open_edges == "cut" else 1e-9)
    # Both faces cover the outline: each is at least as large as the plane under it, less the rim's steps.
    assert report.area > 2 * 0.95 * leaf.blade.outline.area


@pytest.mark.slow
def test_g_is_zero_at_the_vertices_and_falls_with_the_square_of_the_spacing_between_them(leaf):
    window = [[100, -0.2], [100.4, 0.2]]
    spacings, errors = np.array([0.025, 0.018, 0.0125]), []  # below the voxels', so that hairs are resolved
    for spacing in spacings:
        mesh = leaf.extract_mesh(spacing, window)
        vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
        off, middles = (
            np.abs(leaf(each)) / np.linalg.norm(leaf.gradient(each), axis=1)
            for each in (vertices, vertices[triangles].mean(axis=1))
        )
        # Where triangles are cut along the window, corners lie between two that are on the surface.
        plane = leaf.blade.flatten(vertices)[:, :2]
        inner = np.abs(plane - np.mean(window, axis=0)).max(axis=1) < 0.2 - spacing / 2
        assert off[inner if leaf.cuts_edges else ...].max() < ON_SURFACE * spacing
        errors.append(np.sqrt(np.mean(middles**2)))
    assert np.polyfit(np.log(spacings), np.log(errors), 1)[0] == pytest.approx(2, abs=SURFACE_ORDER)
    assert errors[0] < 0.1 * spacings[0]


def test_leaf_to_world_to_leaf_is_the_identity_inside_the_outline(paper_blade):
    outline, frame = paper_blade.outline, paper_blade.frame
    plane = np.random.default_rng(0).uniform(*outline.bounds, (20_000, 2))
    plane = plane[outline.contains(plane)]
    coordinates = np.column_stack([plane, paper_blade.height_map(plane)])
    assert np.abs(frame.to_leaf(frame.to_world(coordinates)) - coordinates).max() <= 1e-9 * frame.length
    assert np.linalg.det(frame.jacobian(coordinates)).min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("frame", MAIN_FRAME)
def test_the_synthetic_leaf_is_recovered(frame):
    """The blade of a scan whose truth is known lies on the truth, within half the scanner's noise on the whole."""
    sample = wheat_scan(count=800)
    blade = create_blade(sample.cloud, sample.midrib, options=BladeOptions(frame=frame))
    vertices = np.asarray(blade.extract_mesh(0.5).vertices)
    off = np.linalg.norm(vertices - sample.truth.closest(vertices)[0], axis=1)
    assert np.median(off) < 0.1
    assert np.quantile(off, 0.95) < 0.4


@pytest.mark.slow
@pytest.mark.parametrize("frame", MAIN_FRAME)
def test_the_result_does_not_depend_on_the_number_of_threads(texture, frame):
    sample, before, found = wheat_scan(count=500), o3l.get_num_threads(), []
    try:
        for threads in (1, 3):
            o3l.set_num_threads(threads)
            leaf = create_multiscale_leaf(sample.cloud, texture, sample.midrib, blade=BladeOptions(frame=frame))
            found.append(np.asarray(leaf.extract_mesh(0.05, [[90, -1], [92, 1]]).vertices))
    finally:
        o3l.set_num_threads(before)
    assert np.array_equal(*found)


@pytest.mark.parametrize("unit", ["um", "m"])
def test_a_scan_in_the_wrong_unit_is_refused(unit):
    with pytest.raises(o3l.errors.UnitError, match=rf"is its unit really {unit}\? It would be .*in mm "):
        create_blade(wheat_scan(count=500).cloud, unit=unit)


def test_a_volume_in_the_wrong_unit_is_refused():
    volume, _ = wheat_ct()
    for unit in ("mm", "nm"):
        with pytest.raises(o3l.errors.UnitError, match="is its unit really"):
            create_texture(o3l.Volume(volume.data, volume.spacing, volume.origin, unit))


def test_options_reach_their_stage(wheat):
    scan, midrib = wheat
    blade = create_blade(scan, midrib, options=replace(PAPER, alpha=3.0, smoothing=10.0, up=(0, 0, -1)))
    assert blade.outline.alpha == 3.0
    assert blade.height_map.choice is None
    assert blade.frame.stations(np.array([50.0]))[3][0, 2] < 0
    with pytest.raises(o3l.errors.InputError, match="rho: is 'best'"):
        create_texture(wheat_ct()[0], options=TextureOptions(rho="best"))


@pytest.mark.slow
def test_a_dense_scan_makes_the_leaf_of_its_means(monkeypatch):
    """Midrib, frame and height map of fewer points lie within the noise of those of all; the outline has all points."""
    scan = np.asarray(wheat_scan(count=2000).cloud.points)
    whole = create_blade(scan, options=PAPER)
    asked = []
    monkeypatch.setattr(paper_pipeline, "MAX_POINTS", 800)
    monkeypatch.setattr(paper_pipeline, "find_midrib", lambda points: asked.append(len(points)) or find_midrib(points))
    thinned = create_blade(scan, options=PAPER)
    assert asked[0] <= 800
    assert len(thinned.outline.points) == len(whole.outline.points)
    flat = np.column_stack([whole.outline.points, np.zeros(len(whole.outline.points))])
    inner = whole.outline.polygon.buffer(-1.0)
    flat = flat[[inner.contains(shapely.Point(*each)) for each in flat[:, :2]]]
    apart = np.abs(thinned.flatten(whole.lift(flat))[:, 2])
    assert np.quantile(apart, 0.99) < THINNED_NOISES * whole.height_map.choice.noise
    assert thinned.outline.area == pytest.approx(whole.outline.area, rel=THINNED_AREA)


@pytest.mark.parametrize("option", ["thickness", "hair_density"])
def test_a_map_that_is_none_is_refused_before_the_volume_is_looked_at(option, monkeypatch, tmp_path):
    monkeypatch.setattr(pipeline, "_build_texture", lambda *_: pytest.fail("it was looked at"))
    options = BladeOptions(**{option: tmp_path / "missing.csv"})
    with pytest.raises(InputError, match=r"missing\.csv: no such file"):
        create_multiscale_leaf(wheat_scan(count=100).cloud, wheat_ct(size=(600, 600, 480))[0], blade=options)
