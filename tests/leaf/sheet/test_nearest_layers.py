"""What lies above and below the points of a sheet."""

import numpy as np
import pytest

from o3dleaf.leaf.sheet.open_sheets import nearest_layers
from tolerances import ROUNDING

REACH, STEEP = 0.2, 0.8


def literal(points, normals, rows):
    """Look at every pair: the distances (r, 2), cosines (r, 2) and rows (r, 2) of what is nearest above and below."""
    distance, facing, row = np.full((len(rows), 2), np.inf), np.zeros((len(rows), 2)), np.full((len(rows), 2), -1)
    for k, i in enumerate(rows):
        for j in range(len(points)):
            way = points[j] - points[i]
            length, height = np.sqrt((way**2).sum()), way @ normals[i]
            side = int(height < 0)
            if 0 < length <= REACH and abs(height) >= STEEP * length and length <= distance[k, side]:
                distance[k, side], facing[k, side], row[k, side] = length, normals[i] @ normals[j], j
    return distance, facing, row


@pytest.mark.parametrize("rows", [None, np.array([7, 3, 250])], ids=["all", "some"])
def test_above_and_below_is_what_the_nearest_of_all_pairs_are(rows):
    rng = np.random.default_rng(5)
    points = rng.random((300, 3)) * [1.0, 1.0, 0.4]
    points[-2:] = points[0] + [[0.0, 0.0, 0.01], [0.0, 0.0, 0.01]]  # as near: the last one counts
    points[17] = points[3]  # in one place: neither above nor below
    normals = rng.normal(size=(300, 3)) + [0.0, 0.0, 2.0]
    normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
    normals[0] = [0.0, 0.0, 1.0]
    found = nearest_layers(points, normals, REACH, STEEP, rows)
    distance, facing, row = literal(points, normals, np.arange(300) if rows is None else rows)
    assert np.array_equal(found.row, row)
    np.testing.assert_allclose(found.distance, distance, rtol=ROUNDING)
    np.testing.assert_allclose(found.facing, facing, atol=ROUNDING)
    assert np.isfinite(distance).any()
