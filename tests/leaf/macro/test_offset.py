"""Thickness along the blade's normal, and what the map from flat coordinates to the world does to a texture."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.offset import NormalOffsets
from o3dleaf.leaf.macro.outline import AlphaShape
from tolerances import ANALYTIC_VS_DIFFERENCE, CURVATURE, FAR_ROUND_TRIP, FLAT_ROUND_TRIP, FOOT, STRAIGHT_SLOPE, SVD

THICKNESS = 0.3


def strip(rng, lift, smoothing=1e-3):
    """The parts of a blade 30 mm by 6 mm: a scan and an axis lifted from (along, across, height)."""
    plane = np.column_stack([rng.uniform(0, 30, 4000), rng.uniform(-3, 3, 4000)])
    scan = lift(*plane.T)
    axis = lift(np.linspace(0, 30, 9), np.zeros(9))
    frame = LeafFrame.fit(scan, axis, unit="mm")
    leaf = frame.to_leaf(scan)
    return frame, HeightMap.fit(leaf, smoothing=smoothing, unit="mm"), AlphaShape(leaf[:, :2])


def humped(along, across):
    bend, height = 25.0, 0.4 * np.cos(across / 2) + 0.2 * np.sin(along / 4) - 0.4
    return np.stack([(bend + height) * np.sin(along / bend), across, (bend + height) * np.cos(along / bend)], axis=1)


def roof(along, across):
    """A plane that falls across by 3 in 4: its slope has the cosine 0.8."""
    return np.stack([along, across, 0.75 * across], axis=1)


@pytest.fixture(scope="module")
def parts():
    return strip(np.random.default_rng(0), humped)


@pytest.fixture(scope="module")
def blade(parts):
    return HeightMapBlade(*parts, "normal")


@pytest.fixture(scope="module")
def flat(blade):
    rng = np.random.default_rng(1)
    flat = np.column_stack([rng.uniform(*blade.outline.bounds, (6000, 2)), rng.uniform(-THICKNESS, THICKNESS, 6000)])
    return flat[blade.outline.contains(flat[:, :2])]


def test_flatten_is_the_inverse_of_lift(blade, flat):
    assert np.abs(blade.flatten(blade.lift(flat)) - flat).max() <= FLAT_ROUND_TRIP


def test_flatten_is_the_inverse_of_lift_far_from_the_origin(parts, flat):
    """The micro-structure stays where it is when the scanner's origin is elsewhere."""
    frame, height_map, outline = parts
    moved = frame.axis.copy()
    moved[:, 0] += 1e6
    blade = HeightMapBlade(LeafFrame(frame.breaks, moved, frame.normal, "mm"), height_map, outline, "normal")
    assert np.abs(blade.flatten(blade.lift(flat)) - flat).max() <= FAR_ROUND_TRIP


def test_a_height_along_the_normal_is_the_distance_from_the_blade(blade, flat):
    """The foot is the closest point of the surface: no neighbour of it is closer."""
    world = blade.lift(flat)
    foot = blade.lift(flat * [1, 1, 0])
    height = np.linalg.norm(world - foot, axis=1)
    assert height == pytest.approx(np.abs(flat[:, 2]), abs=1e-12)
    for step in ([0.01, 0, 0], [-0.01, 0, 0], [0, 0.01, 0], [0, -0.01, 0]):
        inner = blade.outline.contains(flat[:, :2] + step[:2])
        beside = blade.lift(flat * [1, 1, 0] + step)
        assert np.all(np.linalg.norm(world - beside, axis=1)[inner] > height[inner])


def test_the_slope_of_lift_equals_central_differences(blade, flat):
    step = 1e-5
    away = (np.abs(flat[:, :1] - blade.frame.breaks).min(axis=1) > step) & (flat[:, 0] > step)
    numeric = np.stack(
        [(blade.lift(flat + step * e) - blade.lift(flat - step * e)) / (2 * step) for e in np.eye(3)], axis=2
    )
    found = NormalOffsets.at(blade.frame, blade.height_map, flat)
    assert np.abs(found.points - blade.lift(flat)).max() <= 1e-12
    assert np.abs(numeric - found.jacobian)[away].max() <= ANALYTIC_VS_DIFFERENCE


@pytest.mark.parametrize("offset", ["up", "normal"])
def test_pull_back_is_the_gradient_of_what_is_put_on_the_blade(parts, flat, offset):
    blade = HeightMapBlade(*parts, offset)
    inner = flat[np.all(np.abs(flat[:, :2] - [15, 0]) < [14.5, 2.5], axis=1)][:500]
    wave = np.array([1.3, 0.7, 2.1])
    world, step = blade.lift(inner), 1e-5
    gradient = np.cos(inner @ wave)[:, None] * wave
    numeric = [
        (np.sin(blade.flatten(world + step * e) @ wave), np.sin(blade.flatten(world - step * e) @ wave))
        for e in np.eye(3)
    ]
    numeric = np.stack([(after - before) / (2 * step) for after, before in numeric], axis=1)
    away = np.abs(inner[:, :1] - blade.frame.breaks).min(axis=1) > 1e-4
    for x in (None, world):
        assert np.abs(numeric - blade.pull_back(inner, gradient, x))[away].max() <= 10 * ANALYTIC_VS_DIFFERENCE


def test_on_a_slope_the_normal_keeps_the_thickness_and_up_takes_its_cosine():
    frame, height_map, outline = strip(np.random.default_rng(2), roof, smoothing=0.0)
    # An axis along the roof with V held at world up: the frame of a blade that is not level across.
    upright = np.zeros_like(frame.normal)
    upright[:, 0] = [0, 0, 1]
    frame = LeafFrame(frame.breaks, frame.axis, upright, "mm")
    scan = frame.to_leaf(roof(*np.random.default_rng(3).uniform([0, -3], [30, 3], (2000, 2)).T))
    height_map, outline = HeightMap.fit(scan, smoothing=1.0, unit="mm"), AlphaShape(scan[:, :2])
    middle = np.array([[15.0, 1.0, 0.0]])
    roof_normal = np.array([0, -0.6, 0.8])
    for offset, thickness in (("up", 0.8), ("normal", 1.0)):
        blade = HeightMapBlade(frame, height_map, outline, offset)
        above, below = blade.lift(middle + [0, 0, 0.5]), blade.lift(middle - [0, 0, 0.5])
        assert (above - below) @ roof_normal == pytest.approx([thickness], abs=STRAIGHT_SLOPE)
        found = blade.distortion(middle[:, :2])
        assert found.thickness == pytest.approx([thickness], abs=STRAIGHT_SLOPE)
        assert found.across == pytest.approx([1.25], abs=STRAIGHT_SLOPE)
        assert found.along == pytest.approx([1.0], abs=STRAIGHT_SLOPE)
        assert found.area == pytest.approx([1.25], abs=STRAIGHT_SLOPE)
        assert found.shear == pytest.approx([0.0], abs=STRAIGHT_SLOPE)


@pytest.mark.parametrize("offset", ["up", "normal"])
def test_distortion_is_the_slope_of_lift_at_the_blade(parts, flat, offset):
    blade = HeightMapBlade(*parts, offset)
    plane, step = flat[:400, :2], 1e-5
    plane = plane[np.abs(plane[:, :1] - blade.frame.breaks).min(axis=1) > step]
    base = np.column_stack([plane, np.zeros(len(plane))])
    slope = np.stack(
        [(blade.lift(base + step * e) - blade.lift(base - step * e)) / (2 * step) for e in np.eye(3)], axis=2
    )
    found = blade.distortion(plane)
    lengths = np.linalg.norm(slope, axis=1)
    for values, expected in (
        (found.along, lengths[:, 0]),
        (found.across, lengths[:, 1]),
        (np.sin(found.shear), np.einsum("ni,ni->n", slope[:, :, 0], slope[:, :, 1]) / lengths[:, 0] / lengths[:, 1]),
        (found.volume, np.linalg.det(slope)),
        (found.jacobian, slope),
        (found.singular_values, np.linalg.svd(slope, compute_uv=False)),
    ):
        assert values == pytest.approx(expected, abs=ANALYTIC_VS_DIFFERENCE)
    assert found.volume == pytest.approx(found.singular_values.prod(axis=1), abs=SVD)


@pytest.fixture(scope="module")
def cylinder():
    """An arch of 8 mm radius over the midrib, and the same with heights along up."""

    def arch(along, across):
        return np.stack([along, 8 * np.sin(across / 8), 8 * np.cos(across / 8)], axis=1)

    parts = strip(np.random.default_rng(4), arch, smoothing=0.0)
    return HeightMapBlade(*parts, "normal"), HeightMapBlade(*parts)


def test_a_cylinder_folds_at_its_own_radius(cylinder):
    normal, up = cylinder
    middle = np.column_stack([np.linspace(8, 22, 50), np.linspace(-1.5, 1.5, 50)])
    assert np.median(normal.distortion(middle).focal) == pytest.approx(8.0, rel=CURVATURE)
    assert np.all(up.distortion(middle).focal > 100)


def test_what_room_is_left_falls_to_none_at_the_focal_surface(cylinder):
    """On a cylinder the share of the way to its axis, up to what its curvature is wrong by; outside nothing folds."""
    blade, height = cylinder[0], np.linspace(-12, 6, 50)
    flat = np.column_stack([np.linspace(8, 22, 50), np.zeros(50), height])
    room = NormalOffsets.at(blade.frame, blade.height_map, flat).room
    assert np.median(np.abs(room - np.minimum(1, 1 + height / 8)) / np.abs(height)) <= CURVATURE


@pytest.mark.parametrize("radius", [4.0, 20.0])
def test_heights_end_at_the_focal_surface_but_not_on_the_other_side(cylinder, radius):
    """Half way to the centre of a cylinder, and outside of it at one and a half times its radius."""
    angle = np.linspace(-0.1, 0.1, 9)
    world = np.column_stack([np.linspace(10, 20, 9), radius * np.sin(angle), radius * np.cos(angle)])
    flat = cylinder[0].flatten(world)
    assert flat[:, 2] == pytest.approx(radius - 8, abs=FOOT)
    assert np.abs(cylinder[0].lift(flat) - world).max() <= FLAT_ROUND_TRIP


def test_beyond_the_focal_surface_coordinates_and_gradients_are_those_along_up(cylinder):
    normal, up = cylinder
    rng, wave, step = np.random.default_rng(7), np.array([1.3, 0.7, 2.1]), 1e-5
    world = rng.uniform([10, -1, -3], [20, 1, -2], (50, 3))
    flat = normal.flatten(world)
    assert np.array_equal(flat, up.flatten(world))
    numeric = np.stack(
        [normal.flatten(world + step * e) @ wave - normal.flatten(world - step * e) @ wave for e in np.eye(3)], axis=1
    )
    found = normal.pull_back(flat, np.broadcast_to(wave, (50, 3)), world)
    assert np.abs(found - numeric / (2 * step)).max() <= 10 * ANALYTIC_VS_DIFFERENCE


def test_everywhere_coordinates_are_finite(blade):
    world = np.random.default_rng(5).uniform(-300, 300, (5000, 3))
    flat = blade.flatten(world)
    assert np.isfinite(flat).all()
    gradient = blade.pull_back(flat, np.ones_like(flat), world)
    assert np.isfinite(gradient).all()


def test_a_kernel_without_second_derivatives_is_refused(parts):
    frame, _, outline = parts
    leaf = np.column_stack([outline.points, np.zeros(len(outline.points))])[:500]
    rough = HeightMap.fit(leaf, kernel="thin_plate_spline", smoothing=1.0, unit="mm")
    assert np.isfinite(HeightMapBlade(frame, rough, outline).lift([[10.0, 0, 0.1]])).all()
    with pytest.raises(InputError, match="cubic"):
        HeightMapBlade(frame, rough, outline, "normal")
    with pytest.raises(InputError, match="offset"):
        HeightMapBlade(*parts, "sideways")


def test_the_option_is_saved_with_the_leaf(parts, blade, tmp_path):
    rng = np.random.default_rng(6)
    points = rng.uniform([0, 0, -0.3], [1, 1, 0.3], (600, 3))
    texture = o3l.TiledField(o3l.PUInterpolant.fit(points, 0.1 - np.abs(points[:, 2]), unit="mm"))
    leaf = o3l.MultiscaleLeaf(texture, *parts, offset="normal")
    leaf.save(tmp_path / "leaf.o3l")
    world = blade.lift(rng.uniform([1, -2.5, -0.2], [29, 2.5, 0.2], (200, 3)))
    found = o3l.load(tmp_path / "leaf.o3l")
    assert found.blade.offset == "normal"
    assert np.array_equal(found(world), leaf(world))
    assert not np.array_equal(leaf(world), o3l.MultiscaleLeaf(texture, *parts)(world))
