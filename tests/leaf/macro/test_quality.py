import json

import numpy as np
import pytest

from o3dleaf import AlphaShape, HeightMap, HeightMapBlade, LeafFrame
from tolerances import ARC_OF_CIRCLE, ROUND_TRIP

RADIUS = 40.0


def ring(half_width, radius=RADIUS, turn=1.5, seed=0):
    """A flat strip along an arc, its control points, and its own (along, across)."""
    rng = np.random.default_rng(seed)
    plane = np.column_stack([rng.uniform(0, turn * radius, 4000), rng.uniform(-half_width, half_width, 4000)])
    plane = np.concatenate([plane, [[0.0, -half_width], [0.5 * turn * radius, half_width]]])

    def bend(t, across):
        return np.stack(
            [(radius - across) * np.sin(t / radius), radius - (radius - across) * np.cos(t / radius), 0 * t]
        )

    control = bend(np.linspace(0, turn * radius, 21), np.zeros(21)).T
    return bend(*plane.T).T, control, plane


def flat_blade(frame, plane):
    return HeightMapBlade(
        frame, HeightMap.fit(np.column_stack([plane, np.zeros(len(plane))]), smoothing=1.0), AlphaShape(plane)
    )


def test_on_an_arc_the_least_determinant_is_one_less_half_the_width_over_the_radius():
    scan, control, plane = ring(8.0)
    frame = LeafFrame.fit(scan, control)
    quality = frame.quality(scan)
    assert quality.scan_jacobian == pytest.approx(1 - 8.0 / RADIUS, abs=ARC_OF_CIRCLE)
    assert abs(quality.scan_least_at[1]) == pytest.approx(8.0, abs=1e-3)
    assert quality.blade_jacobian is None
    assert flat_blade(frame, plane).frame_quality(scan).blade_jacobian == pytest.approx(0.8, abs=ARC_OF_CIRCLE)
    assert quality.round_trip <= ROUND_TRIP * frame.length
    assert quality.torn == 0
    assert not quality.folded
    assert quality.warnings == []


def test_points_past_the_ends_are_counted():
    scan, control, _ = ring(5.0)
    frame = LeafFrame.fit(scan, control[4:])
    along = LeafFrame.fit(scan, control).to_leaf(scan)[:, 0]
    start = LeafFrame.fit(scan, control).breaks[4]
    quality = frame.quality(scan)
    assert abs(quality.past_ends - np.sum(along < start)) < 10
    assert ["past the ends" in warning for warning in quality.warnings] == [True]


def test_a_blade_wider_than_the_bend_is_folded_and_says_where():
    """In the gaps between the points too: at the points' own coordinates the determinant cannot be negative."""
    scan, control, plane = ring(10.0, radius=8.0)
    frame = LeafFrame.fit(scan, control)
    alone, quality = frame.quality(scan), flat_blade(frame, plane).frame_quality(scan)
    assert 0 <= alone.scan_jacobian < 0.05
    assert alone.torn > 0
    assert quality.folded
    assert quality.least_jacobian == pytest.approx(1 - 10 / 8, abs=0.05)
    assert any("folds at along" in warning for warning in quality.warnings)
    assert all("\n" not in warning for warning in quality.warnings)


def test_a_leaf_that_touches_itself_is_torn_but_not_folded():
    t = np.linspace(0, 1.97 * np.pi, 400)
    axis = 20 * np.column_stack([np.cos(t), np.sin(t), np.zeros(400)])
    scan = (axis[:, None] + np.linspace(-3, 3, 13)[None, :, None] * [0, 0, 1]).reshape(-1, 3)
    scan = np.concatenate([scan, scan[:13] - [0, 0.7, 0]])
    quality = LeafFrame.fit(scan, axis[::20]).quality(scan)
    assert quality.torn > 0
    assert not quality.folded
    assert any("touches" in warning for warning in quality.warnings)


def test_the_read_out_is_plain_values():
    scan, control, plane = ring(5.0)
    quality = flat_blade(LeafFrame.fit(scan, control), plane).frame_quality(scan)
    read = json.loads(json.dumps(quality.to_dict()))
    assert read["least_jacobian"] == quality.least_jacobian
    assert read["warnings"] == []
    assert read["points"] == len(scan)
