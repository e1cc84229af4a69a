"""The committed sample files are what the functions make today."""

import hashlib
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from o3dleaf import read_volume
from o3dleaf.samples import wheat_ct, wheat_scan, write_samples
from tolerances import KEPT_DECIMALS

COMMITTED = Path(__file__).resolve().parents[2] / "data_samples"


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    return write_samples(tmp_path_factory.mktemp("samples") / "new")


def test_regenerated_files_equal_the_committed_ones(fresh):
    """Byte by byte; another NumPy may draw or round differently, and then `scripts/make_samples.py` is due."""
    assert len(fresh) == 4
    for path in fresh:
        assert path.read_bytes() == (COMMITTED / path.name).read_bytes(), path.name


def test_the_page_holds_the_checksums_and_files_are_small(fresh):
    page = (COMMITTED / "README.md").read_text(encoding="utf-8")
    for path in fresh[:3]:
        content = (COMMITTED / path.name).read_bytes()
        assert hashlib.sha256(content).hexdigest() in page
        assert len(content) < 1_000_000


def test_the_files_hold_the_samples():
    scan, (volume, truth) = wheat_scan(seed=0), wheat_ct(seed=0)
    for name, points in (("wheat_scan.ply", np.asarray(scan.cloud.points)), ("wheat_midrib.ply", scan.midrib)):
        read = np.asarray(o3d.io.read_point_cloud(str(COMMITTED / name)).points)
        assert abs(read - points).max() <= KEPT_DECIMALS * 1e-4
    patch = read_volume(COMMITTED / "wheat_ct_24um.tif")
    assert patch.unit == "um"
    assert np.array_equal(patch.bounds, truth.bounds)
    assert abs(patch.data - volume.data).max() <= KEPT_DECIMALS * 1e-5
