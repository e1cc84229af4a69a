"""The steps of the job share what they find, each alone would have found the same, and all report how far they are."""

from contextlib import contextmanager

import numpy as np
import open3d as o3d
import pytest

from cloud_shapes import torus
from o3dleaf import (
    OrientedCloud,
    adaptive_down_sample,
    create_from_point_cloud_rbfpu,
    preprocess_point_cloud,
    trim_to_data,
)
from o3dleaf.core.journal import Journal
from o3dleaf.core.mesh_arrays import mesh_arrays


class Reported(Journal):
    """Keeps what the stages report last of their progress: before the journal ends their bars."""

    def __init__(self):
        super().__init__()
        self.now, self.last = {}, {}

    @contextmanager
    def stage(self, name):
        with super().stage(name) as report:
            yield report
            self.last.update({name: self.now[name]} if name in self.now else {})

    @contextmanager
    def show(self, name):
        yield lambda done, total: self.now.__setitem__(name, (done, total))


def bare(cloud):
    """Return the same cloud without anything that was found of it but its spacing, which the order of points tells."""
    alone = OrientedCloud(cloud.points, cloud.normals, cloud.weights)
    vars(alone)["spacing"] = cloud.spacing
    return alone


@pytest.mark.few(noise=1)
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_steps_that_share_nothing_make_the_same_mesh(noise):
    points, normals = torus(2500)
    points += noise * np.random.default_rng(0).normal(size=points.shape)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points[points[:, 0] < 0.5]))
    cloud.normals = o3d.utility.Vector3dVector(normals[points[:, 0] < 0.5])
    with Reported() as journal:
        shared, _ = create_from_point_cloud_rbfpu(cloud)
    with Reported():
        alone, _ = create_from_point_cloud_rbfpu(
            cloud,
            prepare=lambda held: bare(preprocess_point_cloud(held)),
            merge=lambda ready: bare(adaptive_down_sample(ready)),
            trim=lambda mesh, data: trim_to_data(mesh, bare(data)),
        )
    for one, other in zip(mesh_arrays(shared), mesh_arrays(alone), strict=True):
        assert np.array_equal(one, other)
    assert np.array_equal(np.asarray(shared.vertex_colors), np.asarray(alone.vertex_colors))
    assert {"prepare cloud", "follow surface", "trim to data", "measure support"} <= set(journal.last)
    assert all(done == total for done, total in journal.last.values())
