"""Blades of known leaves: each point of a scan without noise says where the leaf ends, and noise is averaged."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

import o3dleaf as o3l
import tolerances as tol
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays, triangle_areas
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.blade.outline_area import places_inside
from o3dleaf.leaf.chart import petiole as petiole_module
from o3dleaf.leaf.chart.petiole import NarrowPart
from o3dleaf.leaf.chart.stalk.stretches import StalkStretch
from o3dleaf.leaf.fit_quality import MAX_OUTSIDE, FitQuality
from o3dleaf.leaf.options import BladeOptions
from o3dleaf.leaf.parametric import build, surface_fit
from o3dleaf.leaf.parametric.build import fit_noise
from o3dleaf.leaf.parametric.fitted import ChartMesh
from o3dleaf.leaf.parametric.surface_fit import fit_chart_surface
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from sheet_shapes import triangulated

INSIDE = 0.98
"""Share of a noiseless scan's points within the margin: all but those of the tip, where it is less than a spacing
wide. Held against their median alone, residuals let 0.72 of them in."""
SPACING = np.sqrt(40 * 16 / 2500)
"""Of points in a plane of 40 by 16."""
TIP = 6.0
"""Spacings between a sharp tip and the margin, found 4.3: points thin out towards it, and the last one is 8.6 short.
Without what is beyond the sheet, 17."""
LEFT = 0.35
"""Of the noise's deviation: what is left of it in the surface, 0.25. Balls that grew with the smoothing left 0.49."""


def test_a_point_nearer_than_half_a_spacing_says_where_the_leaf_ends():
    leaf = o3l.samples.leaf_shape("wavy", length=40)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.6, pattern="grid")
    blade = o3l.create_blade(scan.points, unit="mm")
    assert np.mean(blade.outline.contains(blade.flatten(scan.points)[:, :2])) > INSIDE


@pytest.mark.few(kind=1, seed=1)
@pytest.mark.parametrize(("kind", "seed"), [("wavy", 0), ("winding", 0), ("twisted", 1)])
def test_a_rounding_of_the_scan_is_one_of_the_blade(kind, seed):
    """The sheet, its chart, the margin and the surface: none of them chooses by a rounding."""
    leaf, random = o3l.samples.leaf_shape(kind, length=40), np.random.default_rng(2)
    points = o3l.samples.scan_leaf(leaf, seed=seed, spacing=0.9, noise=0.2).points
    moved = points + 1e-12 * random.normal(size=points.shape)
    area, again = (o3l.create_blade(each, unit="mm").extract_mesh(0.9).get_surface_area() for each in (points, moved))
    assert again == pytest.approx(area, rel=tol.BLADE_MOVED)


@pytest.mark.slow
def test_a_tip_too_sparse_for_a_sheet_belongs_to_the_leaf():
    leaf = o3l.samples.leaf_shape("winding")
    scan = o3l.samples.scan_leaf(leaf, seed=1, spacing=0.5, noise=0.2)
    blade = o3l.create_blade(scan.points, unit="mm")
    ring = blade.lift(np.column_stack([blade.outline.ring, np.zeros(len(blade.outline.ring))]))
    assert np.linalg.norm(ring - leaf.lift([[150.0, 0.0]]), axis=1).min() < TIP * scan.spacing
    assert not any("left out" in note for note in blade.notes)


@pytest.mark.slow
def test_a_ruffled_leaf_has_its_area():
    """Its waves lie over each other in the plane: where the chart of its sheet does, or that of a round, areas lack."""
    leaf = o3l.samples.leaf_shape("curled", length=40, width=30, angle=40)

    def ruffled(places):
        u, v = places.T
        wave = 5.0 * np.abs(v / 15) ** 3 * np.sin(2 * np.pi * u / 9)
        return leaf.lift(places) + wave[:, np.newaxis] * leaf.normals(places)

    blade = o3l.create_blade(ruffled(o3l.samples.scan_leaf(leaf, spacing=0.8, seed=0).places), unit="mm")
    lifted = blade.lift_with_jacobian(np.pad(places_inside(blade.outline, 4000), ((0, 0), (0, 1))))
    area = blade.outline.area * np.linalg.norm(np.cross(lifted.columns[:, 0], lifted.columns[:, 1]), axis=1).mean()
    flat, triangles = triangulated(leaf.outline, 0.2)
    assert area == pytest.approx(triangle_areas(ruffled(flat), triangles).sum(), rel=tol.AREA_OF_RUFFLES)


@pytest.mark.few(kind=1, spacing=1)
@pytest.mark.parametrize(("kind", "spacing"), [("eaten", 0.8), ("wavy", 0.5)])
def test_a_leaf_without_gaussian_curvature_is_laid_flat_without_stretch_up_to_its_margin(kind, spacing):
    leaf = o3l.samples.leaf_shape(kind, length=40)
    scan = o3l.samples.scan_leaf(leaf, seed=3, spacing=spacing)
    blade = o3l.create_blade(scan.points, unit="mm")
    places = places_inside(blade.outline, 4000)
    lifted = blade.lift_with_jacobian(np.column_stack([places, np.zeros(len(places))]))
    stretch = np.linalg.svd(lifted.columns[:, :2], compute_uv=False)
    assert np.quantile(np.abs(stretch - 1), 0.99) < tol.STRETCH_OF_A_BEND


def test_a_leaf_rolled_until_its_margins_nearly_meet_is_cut_open_between_them():
    leaf = o3l.samples.leaf_shape("curled", angle=165, length=40, width=24)
    scan = o3l.samples.scan_leaf(leaf, seed=2, spacing=0.9)
    blade = o3l.create_blade(scan.points, unit="mm")
    assert any("rolled up" in note for note in blade.notes)
    assert blade.outline.area == pytest.approx(leaf.area, rel=tol.AREA_OF_ROLLED_LEAF)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.1, 0.0])
def test_the_two_sides_of_a_leaf_thicker_than_its_points_are_apart_are_one_surface_between_them(noise):
    """Without noise they lie exactly as far off it, many times what neighbors on one side differ by."""
    leaf = o3l.samples.leaf_shape("curled", length=40, width=16, angle=60)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.7, noise=noise)
    sides = np.random.default_rng(1).choice([-0.6, 0.6], len(scan.places))
    blade = o3l.create_blade(scan.points + sides[:, np.newaxis] * leaf.normals(scan.places), unit="mm")
    mesh = blade.extract_mesh(0.5)
    middle = leaf(np.asarray(mesh.vertices))
    assert np.mean(leaf.half_thickness - middle) < tol.MIDDLE_OF_SIDES * scan.spacing
    assert mesh.get_surface_area() == pytest.approx(leaf.area, rel=tol.AREA_OF_SIDES)
    assert any("both sides of the leaf" in note for note in blade.notes)


@pytest.mark.slow
@pytest.mark.parametrize(("thickness", "share"), [(4.0, 0.5), (3.0, 0.25)])
def test_the_area_of_both_sides_is_that_of_one_where_neighbors_lie_on_either(thickness, share):
    """From two to five spacings apart half of a point's neighbors lie on its own side, and planes run from one to the
    other."""
    leaf = o3l.samples.leaf_shape("cupped", length=40, width=30)
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=1.0, noise=0.1)
    side = np.where(np.random.default_rng(1).random(len(scan.places)) < share, 0.5, -0.5)
    points = scan.points + (thickness * side)[:, np.newaxis] * leaf.normals(scan.places)
    blade = o3l.create_blade(points, unit="mm")
    assert blade.extract_mesh(0.5).get_surface_area() == pytest.approx(leaf.area, rel=tol.AREA_OF_SIDES)
    assert any("both sides of the leaf" in note for note in blade.notes)


def test_what_steps_from_a_leaf_to_the_ground_is_refused_with_its_place(monkeypatch):
    leaf = o3l.samples.leaf_shape("eaten", length=40, width=16)
    points = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.8).points

    def torn(*arguments, **options):
        fit = fit_chart_surface(*arguments, **options)
        lower = fit.mesh.chart[:, 0] < np.quantile(fit.mesh.chart[:, 0], 0.3)
        stretched = fit.mesh.vertices * np.where(lower, 5.0, 1.0)[:, np.newaxis]
        return replace(fit, mesh=replace(fit.mesh, vertices=stretched))

    monkeypatch.setattr(build, "fit_chart_surface", torn)
    with pytest.raises(ReconstructionError, match=r"steps there from one thing to another") as refusal:
        o3l.create_blade(points, unit="mm")
    assert len(refusal.value.places)


def over_ground():
    """Return a leaf, its scan over ground that is no plane, one spacing above it at the middle, and how far that is."""
    step = 0.8
    leaf = o3l.samples.leaf_shape("eaten", length=40, width=16)
    points = o3l.samples.scan_leaf(leaf, seed=0, spacing=step).points
    points = points - [*points[:, :2].mean(axis=0), points[:, 2].min() - step]
    reach = np.abs(points[:, :2]).max(axis=0) * 2
    plane = np.random.default_rng(2).uniform(-reach, reach, (int(4 * reach.prod() / step**2), 2))
    seen = plane[cKDTree(points[:, :2]).query(plane)[0] > step]
    return leaf, np.concatenate([points, np.column_stack([seen, -(seen[:, 0] ** 2) / 400])]), reach + step


def test_a_leaf_scanned_with_ground_that_is_no_plane_is_refused_at_once(monkeypatch):
    """More smoothing would not make one surface of both, and is not tried."""
    _, scan, reach = over_ground()
    settled = []
    settle = surface_fit._settle
    monkeypatch.setattr(surface_fit, "_settle", lambda *given: settled.append(given) or settle(*given))
    with pytest.raises(
        ReconstructionError, match=r"steps there from one thing .*; give `piece` to take one"
    ) as refusal:
        o3l.create_blade(scan, unit="mm")
    assert len(settled) == 1
    assert "pieces are 2: 1: " in str(refusal.value)
    assert (np.abs(refusal.value.places[:, :2]) <= reach).all()


@pytest.mark.slow
def test_its_piece_is_the_leaf():
    leaf, scan, _ = over_ground()
    blade = o3l.create_blade(scan, unit="mm", options=BladeOptions(piece=2))
    assert blade.outline.area == pytest.approx(leaf.area, rel=tol.AREA_OF_A_PIECE)


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.2, 0.5])
def test_the_noise_of_a_fit_is_that_of_its_points(noise):
    rng = np.random.default_rng(0)
    plane = rng.uniform([0, -8], [40, 8], (2500, 2))
    points = np.column_stack([plane, 0.002 * plane[:, 0] ** 2]) + rng.normal(0, noise * SPACING, (2500, 3))
    grid = np.stack(np.meshgrid(np.linspace(0, 40, 41), np.linspace(-8, 8, 17)), axis=-1).reshape(-1, 2)
    triangles = Delaunay(grid).simplices.astype(np.int64)
    mesh = ChartMesh(np.column_stack([grid, 0.002 * grid[:, 0] ** 2]), triangles, grid)
    assert fit_noise(fit_chart_surface(points, mesh)) == pytest.approx(noise * SPACING, rel=tol.NOISE_OF_FIT)


@pytest.mark.slow
def test_noise_of_half_a_spacing_is_averaged():
    leaf = o3l.samples.leaf_shape("lobed")
    scan = o3l.samples.scan_leaf(leaf, seed=0, spacing=0.7, noise=0.5)
    blade = o3l.create_blade(scan.points, unit="mm")
    vertices = np.asarray(blade.extract_mesh(scan.spacing).vertices)
    distance = distance_to_mesh(*leaf.mesh(scan.spacing / 4), vertices)
    assert np.sqrt(np.mean(distance**2)) < LEFT * scan.noise


@pytest.mark.slow
def test_what_is_told_of_a_scan_has_the_same_lengths_in_every_unit():
    points = o3l.samples.scan_leaf(o3l.samples.leaf_shape("petiole"), seed=2, spacing=1.6).points
    in_meters, in_micrometers = (
        told_lengths(o3l.create_blade(points * unit_scale("mm", unit), unit=unit).notes) for unit in ("m", "um")
    )
    assert len(in_meters) >= 2  # the petiole's length and width
    np.testing.assert_allclose(in_micrometers, in_meters, rtol=tol.THREE_DIGITS)


def told_lengths(notes):
    """Return the lengths in words, in meters; areas are left out."""
    told = re.findall(r"([\d.,]*\d) (nm|µm|mm|cm|m)(?![²\w])", "; ".join(notes))
    return [float(number.replace(",", "")) * unit_scale(name, "m") for number, name in told]


@pytest.mark.parametrize("is_sure", [True, False])
def test_what_may_be_a_petiole_is_a_line_of_the_read_out_and_the_base_if_it_is_no_shred(monkeypatch, is_sure):
    points = np.random.default_rng(0).uniform(0, 20, (500, 3)) * [1, 1, 0]
    end = points[0]
    part = NarrowPart(StalkStretch(0.0, 9.0, 2.0, is_sure), end, points, "reason")
    monkeypatch.setattr(build, "find_petiole", lambda some, _: (np.ones(len(some), bool), None, part))
    left, parted = build._part_petiole(points, BladeOptions())
    assert left is points
    (line,) = parted.notes
    assert "9 long and 2 wide" in line
    assert parted.base is (end if is_sure else None)
    assert parted.junction is parted.cut is None


@pytest.mark.slow
def test_the_base_of_a_blade_is_the_end_of_a_petiole_that_is_kept(monkeypatch):
    """By its shape alone it is the other end, which is wider."""
    monkeypatch.setattr(petiole_module, "find_junction", lambda *_: None)
    leaf = o3l.samples.leaf_shape("petiole")
    scan = o3l.samples.scan_leaf(leaf, spacing=1.0, seed=2)
    blade = o3l.create_blade(scan.points, unit="mm")
    assert blade.petiole is None
    assert any("kept as blade" in note for note in blade.notes)
    base, tip = leaf.lift(np.reshape(leaf.outline.bounds, (2, 2)) * [1, 0])
    start = blade.lift([[0.0, 0.0, 0.0]])[0]
    assert np.linalg.norm(start - base) < np.linalg.norm(start - tip) / 2


@pytest.mark.parametrize("smoothing", ["robust", 1e-3])
def test_folds_are_left_out_and_told_but_not_where_a_smoothing_was_asked_for(monkeypatch, smoothing):
    """Of noise that is followed all of a blade is folded."""
    asked = []

    def told(fit, margin):
        asked.append(fit)
        return margin, ("folded",)

    monkeypatch.setattr(build, "without_folds", told)
    scan = o3l.samples.scan_leaf(o3l.samples.leaf_shape("twisted"), spacing=1.6, noise=0.5, seed=2)
    blade = build.build_parametric_blade(scan.points, None, "mm", BladeOptions(smoothing=smoothing))
    assert len(asked) == (smoothing == "robust")
    assert ("folded" in blade.notes) == (smoothing == "robust")


@pytest.mark.slow
@pytest.mark.parametrize("order", [None, 1, 2])
def test_a_crumpled_leaf_keeps_its_lobes_in_any_order_of_its_points_and_crosses_nowhere(real_scan, order):
    """More smoothing until no fold is left loses one in seven of the soybean's points and a sixth of its area."""
    points = np.asarray(o3l.read_point_cloud(real_scan("leaves/soybean_with_normals.ply")).points)
    points = points if order is None else np.random.default_rng(order).permutation(points)
    blade = o3l.create_blade(points, unit="mm")
    spacing = np.median(cKDTree(points).query(points, 2)[0][:, 1])
    mesh = blade.extract_mesh(spacing)
    assert np.mean(distance_to_mesh(*mesh_arrays(mesh), points) <= 2 * spacing) > 0.9
    assert o3l.mesh_report(mesh).self_intersections == 0
    assert any("left out" in note and "folded" in note for note in blade.notes)


def test_a_petiole_that_was_cut_off_does_not_lie_beside_the_blade():
    scan = o3l.samples.scan_leaf(o3l.samples.leaf_shape("petiole"), spacing=1.5, noise=0.2, seed=2)
    blade = build.build_parametric_blade(scan.points, None, "mm", BladeOptions())
    assert blade.petiole is not None
    quality = FitQuality.of(blade, scan.points)
    assert quality.outside <= MAX_OUTSIDE
    assert not (quality.is_cut & (quality.is_far | quality.is_outside)).any()
    stalk = np.linalg.norm(scan.points - np.array(blade.petiole.end), axis=1) < blade.petiole.length / 2
    assert stalk.any()
    assert quality.is_cut[stalk].all()
    # What lies beside it elsewhere is told as before.
    far = scan.truth.lift([[40.0, 0.0]]) + [0, 40.0, 0] + np.random.default_rng(0).normal(0, 2, (200, 3))
    quality = FitQuality.of(blade, np.concatenate([scan.points, far]))
    assert quality.is_outside[-200:].sum() + quality.is_far[-200:].sum() == 200
