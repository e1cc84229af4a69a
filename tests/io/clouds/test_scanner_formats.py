"""LAS, LAZ and E57: every digit that the file has, and one line for what cannot be read."""

import sys

import numpy as np
import pytest

from o3dleaf import read_point_cloud
from o3dleaf.core.errors import InputError
from tolerances import SINGLE_PRECISION

FAR = np.array([500_000.0, 5_400_000.0, 400.0])
POINTS = np.random.default_rng(3).integers(-100_000, 100_000, (400, 3)) * 1e-5
"""Meters, at a hundredth of a millimeter."""


def write_las(file):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-5), FAR
    las = laspy.LasData(header)
    las.x, las.y, las.z = (POINTS + FAR).T
    las.write(file)
    return file


def write_e57(file, shift):
    pye57 = pytest.importorskip("pye57")
    e57 = pye57.E57(str(file), mode="w")
    turn = np.array([0.0, 0.0, 0.0, 1.0])  # by 180° about z
    for part in np.split(POINTS, 2):
        data = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), np.ascontiguousarray(part.T), strict=True))
        e57.write_scan_raw(data, rotation=turn, translation=shift)
    e57.close()
    return file


COLORS = np.random.default_rng(4).integers(0, 256, POINTS.shape)
UPRIGHT = np.eye(3)[np.random.default_rng(5).integers(0, 3, len(POINTS))]


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("full", [1, 257])
def test_las_has_its_colors_and_normals(tmp_path, suffix, full):
    """Of 8 bits, as many programs write them, or of 16, as the format says."""
    laspy = pytest.importorskip("laspy")
    las = laspy.read(write_las(tmp_path / f"plain{suffix}"))
    plain = read_point_cloud(tmp_path / f"plain{suffix}")
    assert not plain.has_colors()
    assert not plain.has_normals()
    las.red, las.green, las.blue = (full * COLORS).T.astype(np.uint16)
    for name, column in zip(("NormalX", "NormalY", "NormalZ"), UPRIGHT.T, strict=True):
        las.add_extra_dim(laspy.ExtraBytesParams(name=name, type=np.float32))
        las[name] = column
    las.write(tmp_path / f"whole{suffix}")
    cloud = read_point_cloud(tmp_path / f"whole{suffix}")
    assert np.asarray(cloud.colors) == pytest.approx(COLORS / 255)
    assert np.array_equal(np.asarray(cloud.normals), UPRIGHT)


def test_e57_has_its_colors(tmp_path):
    pye57 = pytest.importorskip("pye57")
    e57 = pye57.E57(str(tmp_path / "scan.e57"), mode="w")
    columns = [*POINTS.T, *COLORS.T.astype(np.uint8)]
    names = ("cartesianX", "cartesianY", "cartesianZ", "colorRed", "colorGreen", "colorBlue")
    for half in (slice(0, 150), slice(150, None)):
        e57.write_scan_raw({k: np.ascontiguousarray(c[half]) for k, c in zip(names, columns, strict=True)})
    e57.close()
    cloud = read_point_cloud(tmp_path / "scan.e57")
    assert np.asarray(cloud.colors) == pytest.approx(COLORS / 255)
    assert not read_point_cloud(write_e57(tmp_path / "plain.e57", FAR)).has_colors()


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_keeps_the_digits_of_far_coordinates(tmp_path, suffix):
    """A float32 of 5,400,000 is off by a quarter of a meter; differences here are good to the file's scale."""
    read = np.asarray(read_point_cloud(write_las(tmp_path / f"scan{suffix}")).points)
    assert np.abs(read - FAR - POINTS).max() < 0.5e-5


def test_e57_has_its_scans_in_their_places(tmp_path):
    read = np.asarray(read_point_cloud(write_e57(tmp_path / "scan.e57", FAR)).points)
    assert read - FAR == pytest.approx(POINTS * [-1, -1, 1], abs=SINGLE_PRECISION)


@pytest.mark.parametrize(("suffix", "write"), [(".las", write_las), (".laz", write_las), (".e57", write_e57)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.7, 0.97])
def test_a_damaged_file_is_refused_in_a_line_and_stays(tmp_path, suffix, write, share):
    whole = write(tmp_path / f"whole{suffix}", *([FAR] if suffix == ".e57" else []))
    file = tmp_path / f"cut{suffix}"
    content = whole.read_bytes()[: int(share * whole.stat().st_size)] or b"no such format"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"cut off|cannot be read") as caught:
        read_point_cloud(file)
    assert "\n" not in str(caught.value)
    assert file.read_bytes() == content


@pytest.mark.parametrize(("suffix", "package"), [(".las", "laspy"), (".laz", "laspy"), (".e57", "pye57")])
def test_a_missing_extra_is_named(tmp_path, monkeypatch, suffix, package):
    (tmp_path / f"scan{suffix}").write_bytes(b"LASF")
    monkeypatch.setitem(sys.modules, package, None)
    extra = "e57" if suffix == ".e57" else "las"
    with pytest.raises(InputError, match=rf"needs {package}; run: pip install 'o3dleaf\[{extra}\]'$"):
        read_point_cloud(tmp_path / f"scan{suffix}")
