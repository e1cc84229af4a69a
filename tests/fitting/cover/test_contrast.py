"""Balls beside a cluster many times as dense as what is around it."""

import numpy as np
import pytest

from o3dleaf.fitting.cover.contrast import widen_clusters
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from tolerances import CLUSTER_ERROR


@pytest.mark.parametrize(("d", "ratio"), [(3, 1e3), (3, 1e4), (3, 1e5), (3, 1e7), (2, 1e3), (2, 1e7)])
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
