"""The files of leaf scans hold the scans."""

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.commands.sample import SampleJob
from o3dleaf.samples import LEAF_KINDS, leaf_shape, scan_leaf, write_leaf_scans
from tolerances import KEPT_DECIMALS


@pytest.mark.slow
def test_each_kind_is_a_file_that_holds_its_scan(tmp_path):
    paths = write_leaf_scans(tmp_path / "new", seed=2)
    assert [path.name for path in paths] == [f"leaf_{kind}.ply" for kind in LEAF_KINDS]
    for kind, path in zip(LEAF_KINDS, paths, strict=True):
        points = scan_leaf(leaf_shape(kind), noise=0.2, seed=2).points
        read = np.asarray(o3d.io.read_point_cloud(str(path)).points)
        np.testing.assert_allclose(read, points, rtol=0, atol=KEPT_DECIMALS * 1e-4)


@pytest.mark.slow
def test_the_command_writes_them_when_asked_and_else_not(tmp_path):
    assert len(SampleJob(tmp_path / "few").work()) == 4
    assert len(SampleJob(tmp_path / "all", leaves=True).work()) == 4 + len(LEAF_KINDS)
