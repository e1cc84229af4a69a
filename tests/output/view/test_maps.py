"""Maps show the distortion where it is, in colors that are symmetric about none, and what is not held where that is."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

from blade_fields import RolledBlade
from o3dleaf import AlphaShape, HeightMap, HeightMapBlade, LeafFrame
from o3dleaf.core.errors import InputError
from o3dleaf.output.view import View, render_distortion, render_residuals
from o3dleaf.output.view.maps import BLUE, MEASURES, VIOLET
from o3dleaf.output.view.picture import PAPER

SIZE = (320, 200)


@pytest.fixture(scope="module")
def arc():
    """A flat strip along an arc of 20 mm radius: 1.25 times as long at its outer edge, three quarters at its inner."""
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(0, 20, 2000), rng.uniform(-5, 5, 2000)])
    inner = 20 - plane[:, 1]
    scan = np.column_stack([inner * np.sin(plane[:, 0] / 20), 20 - inner * np.cos(plane[:, 0] / 20), np.zeros(2000)])
    turn = np.linspace(0, 1, 9)
    frame = LeafFrame.fit(scan, np.column_stack([20 * np.sin(turn), 20 - 20 * np.cos(turn), np.zeros(9)]), unit="mm")
    leaf = frame.to_leaf(scan)
    return HeightMapBlade(frame, HeightMap.fit(leaf, smoothing=1.0, unit="mm"), AlphaShape(leaf[:, :2]))


def test_the_outer_edge_is_red_and_the_inner_one_blue(arc):
    page = render_distortion(arc, measure="along", flat=True, size=SIZE, scale_bar=False).astype(float)
    leaf = np.abs(page / 255 - PAPER).max(axis=2) > 0.05
    rows = np.flatnonzero(leaf[:, 90:230].all(axis=1))
    first, last = page[rows[3:10], 90:230].mean(axis=(0, 1)), page[rows[-10:-3], 90:230].mean(axis=(0, 1))
    warm = [color[0] - color[2] for color in (first, last)]
    assert min(warm) < -20
    assert max(warm) > 20


@pytest.mark.parametrize("measure", MEASURES)
def test_every_measure_can_be_drawn(arc, measure, tmp_path):
    page = render_distortion(arc, tmp_path / "map.png", measure=measure, spacing=0.5, size=SIZE)
    assert np.array_equal(np.round(imread(tmp_path / "map.png")[:, :, :3] * 255).astype(np.uint8), page)


def test_an_unknown_measure_is_refused(arc):
    with pytest.raises(InputError, match="measure"):
        render_distortion(arc, measure="beauty")


def where(page, color, near=0.15):
    """Return the middle of a color on the page, as shares of its width, and how many pixels have it."""
    shown = page[: -SIZE[1] // 4] / 255
    hue, wanted = (part / np.linalg.norm(part, axis=-1, keepdims=True) for part in (shown, np.array(to_rgb(color))))
    found = (np.linalg.norm(hue - wanted, axis=-1) < near) & (np.abs(shown - PAPER).max(axis=2) > 0.15)
    return float(np.nonzero(found)[1].mean()) / SIZE[0], int(found.sum())


@pytest.fixture(scope="module")
def held():
    """A blade 80 long whose scan is raised about u = 20, missing about u = 60, and goes on as a stalk beyond 80."""
    blade = RolledBlade(radius=1e4)
    points, places = blade.scan(0.4, 0.1)
    points[np.hypot(*(places - [20, 0]).T) < 4, 2] += 3.0
    stalk = np.column_stack([np.linspace(83, 90, 80), np.zeros(80), np.zeros(80)])
    return blade, np.concatenate([points[np.hypot(*(places - [60, 0]).T) > 4], stalk])


def test_what_is_not_held_is_drawn_where_it_is(held):
    blade, scan = held
    page = render_residuals(blade, scan, size=SIZE, spacing=0.5, view=View(direction=(0, 0, 1), tilt=0.0))
    whole = 90.0 / 0.92
    for color, place in ((BLUE, 20), (VIOLET, 86.5)):
        middle, count = where(page, color)
        assert count > 30
        assert middle == pytest.approx(0.04 + place / whole, abs=0.02)
    # The paper is grey too: the gap is what is neither paper nor a color of the map.
    gap, full = (page[130:143, round((0.04 + u / whole) * SIZE[0])].astype(float) for u in (60, 45))
    assert np.ptp(gap, axis=1).max() < 20 < np.ptp(full, axis=1).min()


def test_flat_signed_and_given_maps_are_drawn(held, tmp_path):
    blade, scan = held
    page = render_residuals(blade, scan, tmp_path / "fit.png", flat=True, signed=True, spacing=2.0, size=SIZE)
    for other in ({"flat": True}, {"signed": True}):
        assert not np.array_equal(page, render_residuals(blade, scan, spacing=2.0, size=SIZE, **other))
    assert np.array_equal(np.round(imread(tmp_path / "fit.png")[:, :, :3] * 255).astype(np.uint8), page)


@pytest.mark.slow
def test_other_pieces_and_a_scan_far_away_change_no_map(held, tmp_path):
    blade, scan = held
    page = render_residuals(blade, scan, flat=True, signed=True, spacing=2.0, size=SIZE)
    others = scan + [0, 0, 30.0]
    of_piece = replace(blade, other_pieces=others)
    both = render_residuals(of_piece, np.concatenate([others, scan]), flat=True, signed=True, spacing=2.0, size=SIZE)
    assert np.array_equal(both, page)
    away = render_residuals(blade, scan + [0, 0, 500.0], size=SIZE, spacing=2.0)
    assert away.shape == page.shape
    with pytest.raises(InputError, match="suffix"):
        render_residuals(blade, scan, tmp_path / "fit.txt")
