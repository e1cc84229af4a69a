"""Balls beside a cluster many times as dense as what is around it."""

from dataclasses import replace

import numpy as np
import pytest

from o3dleaf.fitting.cover.contrast import CELL, _occupied, _one_of_each_cell, widen_clusters
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from tolerances import CLUSTER_ERROR


@pytest.mark.few(d=2)
@pytest.mark.parametrize(("d", "ratio"), [(3, 1e7), (2, 1e7), (3, 1e3), (3, 1e4), (3, 1e5), (2, 1e3)])
def test_a_dense_cluster_does_not_spoil_what_is_around_it(d, ratio):
    """Its noise says nothing of a slope beyond it: errors are those of the points around alone, to a fifth."""
    rng = np.random.default_rng(0)
    around = rng.random((2000, d))
    cluster = 0.5 + (1 / ratio) ** (1 / d) * (rng.random((2000, d)) - 0.5)
    points = np.vstack([around, cluster])
    values = np.sin(5 * points).sum(axis=1) + 0.01 * rng.normal(size=4000)
    kernel = "cubic" if d == 3 else "thin_plate_spline"
    queries = rng.uniform(0.05, 0.95, (1000, d))
    truth, errors = np.sin(5 * queries).sum(axis=1), []
    for many in (2000, 4000):
        field = PUInterpolant.fit(points[:many], values[:many], kernel=kernel, rho="gcv")
        errors.append(np.abs(field(queries) - truth))
    assert errors[1].max() < CLUSTER_ERROR * errors[0].max()
    assert np.sqrt(np.mean(errors[1] ** 2)) < CLUSTER_ERROR * np.sqrt(np.mean(errors[0] ** 2))


def test_points_of_one_density_are_left_as_they_are():
    """In space, on a surface, and on a line, in balls that are far from them too."""
    rng = np.random.default_rng(1)
    sphere = rng.normal(size=(3000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    line = np.column_stack([np.sort(rng.random(600)), np.zeros((600, 2))])
    for points, box in ((rng.random((3000, 3)), 1.0), (sphere, 3.0), (line, 1.0)):
        bounds = np.array([points.min(axis=0), points.max(axis=0) + box])
        cover = Cover.fit(points, bounds, (50, 100), 1.1)
        np.testing.assert_array_equal(widen_clusters(cover, points, 50).members, cover.members)


def test_cells_are_as_large_as_their_balls():
    """So that their numbers do not depend on the unit, and are those counted one by one."""
    points = np.random.default_rng(2).random((400, 3))
    bounds = np.array([points.min(axis=0), points.max(axis=0)])
    cover = Cover.fit(points, bounds, (50, 100), 1.1)
    counts = _occupied(points, cover)
    scaled = replace(cover, centers=16 * cover.centers, radii=16 * cover.radii)
    np.testing.assert_array_equal(_occupied(16 * points, scaled), counts)
    for ball, rows in enumerate(np.split(cover.members, cover.offsets[1:-1])):
        away = (points[rows] - cover.centers[ball]) / (CELL * cover.radii[ball])
        inside = np.all(np.abs(away) < 1 / CELL, axis=1)
        assert inside.all()
        assert counts[ball] == len(np.unique(np.floor(away), axis=0)) > 1


@pytest.mark.parametrize("side", [0.11, 1e-25])
def test_one_point_of_each_cell_is_the_first_in_it(side):
    """Cells of as many places on an axis as there are doubles are told apart, too."""
    points = np.random.default_rng(4).random((2000, 3)) * (1.0, 2.0, 0.5)
    cells = np.floor((points - points.min(axis=0)) / side)
    first = {tuple(cell): number for number, cell in reversed(list(enumerate(cells.tolist())))}
    np.testing.assert_array_equal(_one_of_each_cell(points, side), sorted(first.values()))
