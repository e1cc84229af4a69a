"""Maps show the distortion where it is, in colors that are symmetric about none."""

import numpy as np
import pytest
from matplotlib.image import imread

from o3dleaf import AlphaShape, HeightMap, HeightMapBlade, LeafFrame
from o3dleaf.core.errors import InputError
from o3dleaf.output.view import render_distortion
from o3dleaf.output.view.maps import MEASURES
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
