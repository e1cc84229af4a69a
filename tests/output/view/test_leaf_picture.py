"""The inset of a leaf's picture shows a place that the picture shows."""

import numpy as np
import pytest
import shapely

from leaf_fields import leaf_of, texture
from o3dleaf.output.view.leaf_picture import STEPS, inset_step, inset_window


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.2 - np.abs(z) + 0 * x * y))[0]


@pytest.mark.parametrize("region", [None, ((1, -1), (3, 1)), ((15, 1), (16, 2)), ((17, 2), (40, 9))])
def test_the_inset_lies_in_the_part_that_is_drawn(leaf, region):
    """Its middle does; all of it, where the part is a rectangle of the blade."""
    outline = leaf.blade.outline.polygon
    shown = outline if region is None else outline & shapely.box(*np.ravel(region))
    window = inset_window(leaf, region)
    assert shown.contains(shapely.Point(window.mean(axis=0)))
    assert np.ptp(window, axis=0) == pytest.approx(np.ptp(window[:, 0]))
    if region is None or outline.contains(shapely.box(*np.ravel(region))):
        assert shown.buffer(1e-9).contains(shapely.box(*window.ravel()))
    assert np.ptp(window[:, 0]) / STEPS == pytest.approx(inset_step(leaf.unit, region))
