"""The read-out of a fit says what a blade does not hold, how much of it and where, and nothing of a good fit."""

import json

import numpy as np
import pytest
import shapely
from scipy.spatial.transform import Rotation

from blade_fields import KnownHole, KnownOutline, RolledBlade
from o3dleaf.core.errors import InputError
from o3dleaf.io.models.model_file import write_model
from o3dleaf.leaf.fit_quality import FAR, MAX_OUTSIDE, MIN_FAR, FitQuality
from o3dleaf.leaf.options import BladeOptions
from o3dleaf.leaf.pipeline import create_blade
from o3dleaf.leaf.residuals.bent_margin import MAX_BENT, find_bent_margin
from o3dleaf.leaf.residuals.lost_relief import MAX_POINTS
from o3dleaf.leaf.residuals.rounding import find_rounding
from o3dleaf.leaf.saved.models import load
from o3dleaf.samples import leaf_shape, scan_leaf
from tolerances import (
    AREA_OF_STRIPS,
    ERRORS_OF_AREAS,
    MOVED_READ_OUT,
    NOISE_OF_NEIGHBORS,
    PERIMETER_OF_CHORDS,
    SHARE_OF_A_SAMPLE,
    SHARED_OF_WAVES,
    STRETCH_OF_A_LATTICE,
)

SPACING = 0.5
BLADE = RolledBlade()


def raised(blade, points, places, chosen, height):
    """Return the points, the chosen ones raised above the blade."""
    flat = np.column_stack([places, np.zeros(len(places))])
    up = blade.lift(flat + [0, 0, height]) - blade.lift(flat)
    return points + up * chosen[:, np.newaxis]


@pytest.mark.few
@pytest.mark.parametrize("noise", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("spacing", [0.3, 0.6, 1.0])
def test_of_a_good_fit_nothing_is_told(noise, spacing):
    """Random points, to the margin and into the sharp tips, with normal errors along every axis."""
    quality = FitQuality.of(BLADE, BLADE.scan(spacing, noise)[0])
    assert [line for line in quality.warnings if "area is known" not in line] == []
    assert quality.noise == pytest.approx(noise * spacing, rel=NOISE_OF_NEIGHBORS, abs=1e-9)
    assert quality.spacing == pytest.approx(spacing, rel=NOISE_OF_NEIGHBORS)
    assert quality.outside <= MAX_OUTSIDE / 5
    assert ("good" in repr(quality)) == (quality.warnings == [])


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_patch_off_the_blade_is_told_with_share_and_place(noise):
    points, places = BLADE.scan(SPACING, noise)
    patch = np.hypot(*(places - [30, 2]).T) < 3
    quality = FitQuality.of(BLADE, raised(BLADE, points, places, patch, 2.0))
    assert quality.far == pytest.approx(patch.mean(), abs=SHARE_OF_A_SAMPLE)
    (place,) = quality.far_places
    assert place.share == pytest.approx(patch.mean(), rel=SHARE_OF_A_SAMPLE)
    assert np.linalg.norm(np.array(place.center) - BLADE.lift(np.array([[30, 2, 2.0]]))) < SPACING + 3 * noise
    (line,) = [line for line in quality.warnings if "off the blade" in line]
    assert str(place) in line
    assert np.median(quality.distance[patch]) == pytest.approx(2.0, rel=NOISE_OF_NEIGHBORS)


@pytest.mark.few
@pytest.mark.parametrize("share", [0.3, 0.5])
@pytest.mark.parametrize("apart", [0.5, 2.0])
def test_passes_that_disagree_are_no_noise(share, apart):
    points, places = BLADE.scan(SPACING, 0.1)
    other = np.random.default_rng(1).random(len(points)) < share
    quality = FitQuality.of(BLADE, raised(BLADE, points, places, other, apart))
    assert quality.noise < 2.5 * 0.1 * SPACING
    assert quality.limit == FAR * quality.noise > MIN_FAR * quality.spacing
    assert quality.far == pytest.approx(other.mean(), rel=SHARE_OF_A_SAMPLE)
    assert "scattered" in quality.warnings[0] or str(quality.far_places[0]) in quality.warnings[0]


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.1, 0.5])
def test_waves_that_a_blade_does_not_follow_are_told_though_no_point_is_far(noise):
    points, places = BLADE.scan(SPACING, noise)
    waves = 0.8 * SPACING * np.sin(2 * np.pi * places[:, 0] / (4 * SPACING))
    quality = FitQuality.of(BLADE, raised(BLADE, points, places, waves, 1.0))
    assert quality.shared == pytest.approx(0.8 * SPACING / np.sqrt(2), rel=SHARED_OF_WAVES)
    assert any("alike" in line for line in quality.warnings)
    assert FitQuality.of(BLADE, points).shared < MIN_FAR * SPACING / 2


def test_points_beside_the_blade_are_told_and_not_its_residuals():
    points, _ = BLADE.scan(SPACING)
    stalk = np.column_stack([np.linspace(-12, -2, 60), np.zeros(60), np.zeros(60)])
    quality = FitQuality.of(BLADE, np.concatenate([points, BLADE.lift(stalk)]))
    assert quality.outside == pytest.approx(60 / (len(points) + 60), rel=1e-12)
    assert quality.far == 0
    assert quality.residuals[-1] < 1e-9
    assert quality.outside_places[0].center[0] == pytest.approx(-7, abs=0.2)
    assert ["outside its margin" in line for line in quality.warnings] == [True]


def test_a_gap_is_told_with_share_and_place():
    points, places = BLADE.scan(SPACING, 0.2)
    hidden = np.hypot(*(places - [50, 0]).T) < 4
    quality = FitQuality.of(BLADE, points[~hidden])
    # What is three spacings from every point is a disc of less radius; curvature brings its rim nearer.
    inner = np.pi * (4 - 3 * SPACING) ** 2 / BLADE.outline.area
    assert inner / 1.5 < quality.gaps < 1.5 * inner
    assert quality.coverage == 1 - quality.gaps
    assert np.linalg.norm(np.array(quality.gap_places[0].center) - BLADE.lift(np.array([[50, 0, 0.0]]))) < SPACING
    assert ["from every point" in line for line in quality.warnings] == [True]


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (0.9, 1.0), (1.0, 1.2), (0.8, 1.3)])
def test_stretch_is_that_of_the_surface(stretch):
    blade = RolledBlade(stretch=stretch)
    quality = FitQuality.of(blade, blade.scan(SPACING)[0])
    exact = {"rel": STRETCH_OF_A_LATTICE}
    assert quality.along == pytest.approx((stretch[0],) * 2, **exact)
    assert quality.across == pytest.approx((stretch[1],) * 2, **exact)
    assert quality.stretch == pytest.approx((min(stretch), max(stretch)), **exact)
    assert quality.area[0] == pytest.approx(np.prod(stretch) * quality.area[1], **exact)
    assert bool(quality.warnings) == (stretch != (1.0, 1.0))


@pytest.mark.parametrize(("spacing", "noise", "told"), [(0.3, 0.0, False), (1.0, 0.0, False), (1.0, 0.5, True)])
def test_the_area_is_known_as_well_as_its_margin(spacing, noise, told):
    """√(P s² (s / 2 + σ)), with the holes' margins, in the world whatever the plane's stretch."""
    hole = shapely.Point(40, 0).buffer(2, 64)
    blade = RolledBlade(outline=KnownOutline(BLADE.outline.polygon - hole), stretch=(2.0, 2.0))
    quality = FitQuality.of(blade, blade.scan(2 * spacing, noise)[0])
    length = 2 * (BLADE.outline.polygon.length + hole.length)
    known = np.sqrt(length * quality.spacing**2 * (quality.spacing / 2 + quality.noise))
    assert quality.area_deviation == pytest.approx(known, rel=PERIMETER_OF_CHORDS)
    assert any("area is known" in line for line in quality.warnings) == told


@pytest.mark.slow
def test_areas_of_random_scans_err_as_they_are_said_to():
    """Of eight scans of a flat ellipse the errors over their deviations are of the size of one."""
    outline = shapely.Point(0, 0).buffer(1, 256)
    outline = shapely.affinity.scale(outline, 30, 18)
    errors = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        places = random.uniform(outline.bounds[:2], outline.bounds[2:], (250, 2))
        points = np.pad(places[shapely.contains_xy(outline, *places.T)], ((0, 0), (0, 1)))
        quality = FitQuality.of(create_blade(points, unit="mm"), points)
        errors.append((quality.area[0] - outline.area) / quality.area_deviation)
    least, most = ERRORS_OF_AREAS
    assert least < np.sqrt(np.mean(np.square(errors))) < most


@pytest.mark.few(scale=1)
@pytest.mark.parametrize(("scale", "share"), [(1e-3, 0.3), (1.0, 1.0)])
def test_points_that_are_there_twice_change_no_figure(scale, share):
    """What repeats others up to single precision is told by its share, and nothing else."""
    points = scale * BLADE.scan(3 * SPACING, 0.2)[0]
    again = np.random.default_rng(8).random(len(points)) < share
    unit = {1.0: "mm", 1e-3: "m"}[scale]
    scans = points, np.concatenate([points, points[again].astype(np.float32)])
    one, other = (FitQuality.of(create_blade(scan, unit=unit), scan).to_dict() for scan in scans)
    assert other["repeated"] == pytest.approx(again.sum() / len(scans[1]), rel=1e-12)
    (told,) = (line for line in other["warnings"] if line not in one["warnings"])
    assert "repeat others" in told
    for name in set(one) - {"points", "repeated", "warnings"}:
        assert other[name] == one[name]


def bowed(*, lattice=False):
    """Return points of a sheet that rises by up to a quarter, a spacing of 1 apart, random or on a lattice."""
    x, y = np.random.default_rng(3).uniform(0, [[120], [30]], (2, 3600))
    if lattice:
        x, y = (each.ravel() for each in np.meshgrid(np.arange(120.0), np.arange(30.0)))
    return np.column_stack([x, y, (x - 60) ** 2 / 480])


@pytest.mark.parametrize("step", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_coordinates_in_terraces_are_told_with_their_axis_and_step(step, axis, dtype):
    points = np.roll(bowed(), axis - 2, axis=1)
    points[:, axis] = step * np.round(points[:, axis] / step)
    points = points[points[:, axis] != step]  # a level that a gap of the scan hides
    found = find_rounding((1e-3 * points).astype(dtype).astype(np.float64))
    assert found.axis == axis
    assert found.step == pytest.approx(1e-3 * step, rel=1e-5)


def test_what_is_no_terrace_is_none():
    """Fine steps; the lattice of a camera; lines of a scanner, or slices; pressed leaves, on a table, on steps."""
    fine, lines = bowed(), bowed()
    fine[:, 2] = 0.3 * np.round(fine[:, 2] / 0.3)
    lines[:, 1] = 8 * np.round(lines[:, 1] / 8)
    flat = bowed() * [1, 1, 0]
    steps = np.concatenate([flat + [0, 0, z] for z in (0, 5, 9.3, 17.1)])
    for points in (bowed(), fine, bowed(lattice=True), lines, flat, np.concatenate([flat, flat + [0, 0, 5]]), steps):
        assert find_rounding(points) is None


def test_terraces_are_told_in_the_read_out():
    points = BLADE.scan(2 * SPACING, 0.2)[0]
    points[:, 2] = 3 * SPACING * np.round(points[:, 2] / (3 * SPACING))
    quality = FitQuality.of(BLADE, points)
    (told,) = (line for line in quality.warnings if "rounded" in line)
    assert told.startswith(f"z is rounded to steps of {3 * SPACING:g} mm")
    assert quality.to_dict()["rounding"] == {"axis": 2, "step": pytest.approx(3 * SPACING)}


@pytest.mark.few(kind=1)
@pytest.mark.parametrize("kind", ["lobed", "petiole"])
def test_points_behind_the_edge_are_told_with_the_area_that_they_add(kind):
    """Between the edge of a leaf and what is behind it a scanner sees points, which the blade takes in."""
    leaf, quality = judged(kind, 4.0)
    assert len([line for line in quality.warnings if "of the margin" in line]) == 1
    assert quality.bent.length > 0.6
    assert quality.bent.area == pytest.approx(quality.area[0] / leaf.area - 1, rel=AREA_OF_STRIPS)
    rim = leaf.lift(np.concatenate(leaf.margin_places(0.5)))
    for place in quality.bent.places:
        assert np.linalg.norm(rim - place.center, axis=1).min() < (4.0 + 1) * 1.5


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["lobed", "petiole"])
def test_where_there_are_none_nothing_is_told_of_the_margin(kind):
    _, quality = judged(kind, 0.0)
    assert (quality.bent.length, quality.bent.area) == (0.0, 0.0)
    assert not [line for line in quality.warnings if "of the margin" in line]


def judged(kind, flying):
    """Return a leaf and what its blade is judged, of a scan with points behind its edge."""
    leaf = leaf_shape(kind)
    points = scan_leaf(leaf, spacing=1.5, noise=0.2, flying=flying, seed=3).points
    return leaf, FitQuality.of(create_blade(points, unit="mm"), points)


@pytest.mark.parametrize(("radius", "told"), [(6.0, False), (2.0, True)])
def test_margins_bend_off_where_they_turn_by_more_than_half_a_right_angle(radius, told):
    """Of a sheet rolled about a cylinder normals turn by 3 s / r over three spacings, everywhere across."""
    blade = RolledBlade(radius=radius)
    bent = find_bent_margin(blade, 1.0)
    assert (bent.length > MAX_BENT) == told == bool(bent.warnings)
    assert (bent.area > 0) == told


def test_a_sheared_plane_is_stretched_along_its_diagonals():
    """Of x = u + s v, y = v the singular values are those of a 2 by 2 matrix."""
    shear = np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])

    class ShearedBlade(RolledBlade):
        def flatten(self, x):
            return x @ np.linalg.inv(shear).T

        def lift_with_jacobian(self, flat):
            lifted = super().lift_with_jacobian(flat)
            return type(lifted)(flat @ shear.T, np.tile(shear.T, (len(flat), 1, 1)))

    blade = ShearedBlade()
    quality = FitQuality.of(blade, blade.scan(SPACING)[0])
    known = np.linalg.svd(shear[:2, :2], compute_uv=False)
    assert quality.stretch == pytest.approx((known[1], known[0]), rel=STRETCH_OF_A_LATTICE)


def test_the_read_out_moves_with_the_leaf():
    points, places = BLADE.scan(SPACING, 0.2)
    points = raised(BLADE, points, places, places[:, 0] > 70, 1.5)[places[:, 0] < 75]
    rotation, shift = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix(), np.array([500.0, -200.0, 30.0])
    one, other = FitQuality.of(BLADE, points), FitQuality.of(BLADE.moved(rotation, shift), points @ rotation.T + shift)
    assert other.distance == pytest.approx(one.distance, abs=MOVED_READ_OUT)
    assert (other.far, other.outside, other.gaps) == pytest.approx((one.far, one.outside, one.gaps), rel=MOVED_READ_OUT)
    assert (other.noise, other.spacing) == pytest.approx((one.noise, one.spacing), rel=MOVED_READ_OUT)
    for place, same in zip(one.far_places + one.gap_places, other.far_places + other.gap_places, strict=True):
        assert same.center == pytest.approx(rotation @ place.center + shift, abs=SPACING / 2)


def test_holes_stand_in_the_world_and_points_in_them_are_outside():
    hole = shapely.Point(40, 1).buffer(2.5, 64)
    known = KnownHole(np.array([40.0, 1.0]), hole.area, 5.0, filled=False)
    blade = RolledBlade(outline=KnownOutline(BLADE.outline.polygon - hole, (known,)))
    points, places = BLADE.scan(SPACING)
    quality = FitQuality.of(blade, points)
    assert quality.holes[0]["place"] == pytest.approx(BLADE.lift(np.array([[40.0, 1.0, 0.0]]))[0], rel=1e-12)
    # A spacing inside its rim nothing is told.
    deep = np.mean(np.hypot(*(places - [40, 1]).T) < 2.5 - quality.spacing)
    assert quality.outside == pytest.approx(deep, rel=SHARE_OF_A_SAMPLE)
    assert "1 holes kept, 0 filled" in quality.lines()[1]


def test_the_read_out_is_json_and_a_scan_of_many_points_is_no_other():
    points, _ = BLADE.scan(0.16, 0.2)
    quality = FitQuality.of(BLADE, points)
    assert len(points) > MAX_POINTS
    assert quality.warnings == []
    table = json.loads(json.dumps(quality.to_dict(), allow_nan=False))
    assert table["points"] == len(points)
    assert table["residuals"]["half"] == quality.residuals[0]
    assert quality.residuals[0] == pytest.approx(0.6745 * 0.2 * 0.16, rel=NOISE_OF_NEIGHBORS)
    assert table["warnings"] == []
    assert len(quality.lines()) == 2


def test_the_read_out_of_a_piece_is_that_of_a_scan_of_this_piece():
    """Also of a blade that was saved, and of a scan in single precision."""
    points, _ = BLADE.scan(SPACING, 0.2)
    points = np.append(points, points[:200] + [0, 0, 2.0], axis=0)
    others = BLADE.scan(SPACING, 0.2)[0] + [0.0, 3.0, 2.5]
    blade = RolledBlade(other_pieces=others)
    whole, alone = (FitQuality.of(blade, scan) for scan in (np.concatenate([others, points]), points))
    assert alone.to_dict() == FitQuality.of(BLADE, points).to_dict()
    assert whole.to_dict() == {**alone.to_dict(), "others": len(others)}
    assert np.array_equal(whole.rows, len(others) + alone.rows)
    single = np.concatenate([others, points]).astype(np.float32)
    assert np.array_equal(FitQuality.of(blade, single).rows, whole.rows)
    with pytest.raises(InputError, match=r"0 of its .* points are of the piece"):
        FitQuality.of(blade, others)


@pytest.mark.slow
@pytest.mark.parametrize("piece", [2, 1])
def test_a_piece_that_was_asked_for_is_what_its_blade_is_judged_by(piece, tmp_path):
    large, small = (
        scan_leaf(leaf_shape("cupped", length=length, width=20), seed=0, spacing=1.1).points for length in (30, 24)
    )
    points = np.concatenate([small + [0, 60, 0], large])
    own, other = ((large, small), (small, large))[piece - 1]
    blade = create_blade(points, unit="mm", options=BladeOptions(piece=piece))
    quality = FitQuality.of(blade, points)
    assert len(quality.rows) == len(own)
    assert (quality.others, quality.warnings) == (len(other), [])
    (line,) = (note for note in blade.notes if "other pieces" in note)
    assert f"piece {piece}: {len(other):,} of the scan's {len(points):,} points" in line
    write_model(blade, tmp_path / "blade.o3l")
    assert FitQuality.of(load(tmp_path / "blade.o3l"), points).to_dict() == quality.to_dict()


@pytest.mark.slow
def test_the_piece_of_a_scan_of_one_is_the_scan():
    small = scan_leaf(leaf_shape("cupped", length=24, width=20), seed=0, spacing=1.4).points
    assert create_blade(small, unit="mm", options=BladeOptions(piece=1)).notes == create_blade(small, unit="mm").notes


def test_a_scan_beside_the_blade_altogether_is_told():
    points, _ = BLADE.scan(SPACING)
    quality = FitQuality.of(BLADE, points + [200.0, 0, 0])
    assert (quality.outside, quality.gaps) == (1.0, 1.0)
    assert ["100 % of the" in line for line in quality.warnings[:2]] == [True, True]
