"""Coordinates whose squares leave double precision end in one line, wherever a cloud goes in."""

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import InputError

POINTS = np.random.default_rng(0).normal(size=(300, 3))
POINTS /= np.linalg.norm(POINTS, axis=1, keepdims=True)
JOBS = {
    "create_from_point_cloud_rbfpu": o3l.create_from_point_cloud_rbfpu,
    "preprocess_point_cloud": o3l.preprocess_point_cloud,
    "estimate_normals": o3l.estimate_normals,
    "orient_normals": o3l.orient_normals,
    "estimate_noise": o3l.estimate_noise,
    "find_midrib": o3l.find_midrib,
    "PUInterpolant.fit": lambda points: o3l.PUInterpolant.fit(points, points[:, 0]),
}


@pytest.mark.parametrize("job", JOBS)
@pytest.mark.parametrize("scale", [1e-200, 1e154, 1e300])
def test_sizes_beyond_double_precision_are_refused(job, scale):
    with pytest.raises(InputError, match=r"give lengths in a unit in which they are 1e-(30|100) to"):
        JOBS[job](scale * POINTS)
