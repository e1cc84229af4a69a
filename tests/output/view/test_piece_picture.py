"""Each piece has its color, and its number stands beside it."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread

import o3dleaf as o3l
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.output.view.leaf_picture import COLORS, render_refusal

SIZE = (480, 300)
PLANE = np.column_stack([*np.random.default_rng(0).uniform(0, 10, (2, 900)), np.zeros(900)])
SCAN = np.concatenate([PLANE, PLANE[:400] * 0.5 + [16, 0, 0], [[13.0, 9.0, 0.0]]])
ROWS = (np.arange(900), np.arange(900, 1300))


def share(picture, color):
    """Return the share of pixels of a color's hue: lit and shaded ones of it have the same, paper and ink have not."""
    pixels, wanted = picture.reshape(-1, 3) / 255.0, np.array(to_rgb(color)) ** 2.2
    light = pixels**2.2
    cosine = (light @ wanted) / (np.linalg.norm(light, axis=1) * np.linalg.norm(wanted) + 1e-9)
    return np.mean(cosine > 0.99)


@pytest.fixture(scope="module")
def pieces():
    number = np.zeros(len(SCAN), dtype=np.int64)
    number[ROWS[0]], number[ROWS[1]] = 1, 2
    places = np.array([[5.0, 5, 0], [18.5, 2.5, 0]])
    return o3l.ScanPieces(SCAN, number, np.array([100.0, 25.0]), places, ("1: large", "2: small"))


def test_pieces_have_colors_and_numbers(pieces, tmp_path):
    drawn = o3l.view.render_pieces(pieces, tmp_path / "pieces.svg", size=SIZE, unit="mm")
    large, small = share(drawn, COLORS[0]), share(drawn, COLORS[1])
    assert large > 1.5 * small > 0
    written = (tmp_path / "pieces.svg").read_text()
    for text in ("<!-- 1 -->", "<!-- 2 -->", "<!-- 1: large -->", "<!-- 2: small -->"):
        assert text in written


@pytest.mark.few
@pytest.mark.parametrize("places", [None, np.array([[5.0, 5.0, 0.0]])])
@pytest.mark.parametrize("pieces", [(), tuple(SCAN[rows] for rows in ROWS)])
def test_a_refusal_that_names_pieces_shows_them(small_pictures, tmp_path, places, pieces):
    """With marks or without; where none are named the points have the color of any cloud."""
    render_refusal(SCAN, ReconstructionError("no sheet", places, pieces), tmp_path / "refused.png", "mm")
    drawn = np.uint8(255 * imread(tmp_path / "refused.png")[..., :3])
    assert (share(drawn, COLORS[0]) > 0) == bool(pieces)
