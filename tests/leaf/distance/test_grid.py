"""Grid files: read back by others they hold what the leaf says at their points, in bounded memory, or do not appear."""

import re
import shutil
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
import SimpleITK

from leaf_fields import leaf_of, texture
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.leaf.distance import grid
from o3dleaf.leaf.distance.around import BoundingBalls

BOX = np.array([[4.0, -1.0, -0.6], [5.5, 0.4, 0.7]])
STEP = np.array([0.11, 0.07, 0.13])


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(lambda x, y, z: 0.31**2 - z**2 + 0.05 * np.sin(np.pi * x)))[0]


def read_vti(path):
    """Values (nx, ny, nz), origin and spacing, by the letter of the format."""
    data = path.read_bytes()
    start = data.index(b'<AppendedData encoding="raw">\n_') + 31
    text = data[:start].decode()
    numbers = {key: np.array(re.search(rf'{key}="([^"]*)"', text)[1].split(), float) for key in ("Origin", "Spacing")}
    extent = np.array(re.search('WholeExtent="([^"]*)"', text)[1].split(), int)
    kind = {"Float32": "<f4", "UInt8": "u1"}[re.search('DataArray type="([^"]*)"', text)[1]]
    size = int.from_bytes(data[start : start + 8], "little")
    values = np.frombuffer(data[start + 8 : start + 8 + size], kind)
    assert data[start + 8 + size :] == b"\n</AppendedData>\n</VTKFile>\n"
    return values.reshape(extent[1::2] + 1, order="F"), numbers["Origin"], numbers["Spacing"]


def read_nrrd(path):
    image = SimpleITK.ReadImage(str(path))
    return SimpleITK.GetArrayFromImage(image).T, np.array(image.GetOrigin()), np.array(image.GetSpacing())


@pytest.mark.few
@pytest.mark.parametrize("what", ["field", "distance", "mask"])
@pytest.mark.parametrize(("suffix", "read"), [(".vti", read_vti), (".nrrd", read_nrrd)])
def test_a_grid_read_back_holds_the_leaf(leaf, tmp_path, monkeypatch, suffix, read, what):
    monkeypatch.setattr(grid, "SLAB", 100)
    leaf.write_grid(tmp_path / f"g{suffix}", STEP, BOX, what=what)
    values, origin, spacing = read(tmp_path / f"g{suffix}")
    axes = [origin[k] + spacing[k] * np.arange(values.shape[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    assert spacing == pytest.approx(STEP)
    assert np.all(points[0, 0, 0] <= BOX[0] + 1e-9)
    assert np.all(points[0, 0, 0] > BOX[0] - STEP)
    assert np.all(points[-1, -1, -1] >= BOX[1] - 1e-9)
    points = points.reshape(-1, 3)
    if what == "mask":
        held = (leaf(points) > 0) & leaf.blade.outline.contains(leaf.blade.flatten(points)[:, :2])
        assert np.array_equal(values.ravel(), held)
    else:
        expected = leaf(points) if what == "field" else leaf.signed_distance(points)
        assert values.ravel() == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_whole_leaf_is_the_default(leaf, tmp_path):
    leaf.write_grid(tmp_path / "g.vti", 0.15, what="mask")
    values, origin, spacing = read_vti(tmp_path / "g.vti")
    assert np.all(origin <= leaf.bounds[0])
    assert values.sum() * spacing.prod() == pytest.approx(20 * 6 * 0.6, rel=0.1)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_grid(leaf, tmp_path, monkeypatch):
    monkeypatch.setattr(grid, "SLAB", 1 << 13)
    leaf.write_grid(tmp_path / "g.nrrd", 1.0, what="mask")
    tracemalloc.start()
    try:
        leaf.write_grid(tmp_path / "g.nrrd", 0.08, what="mask")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    points = (tmp_path / "g.nrrd").stat().st_size
    assert points > 30 * grid.SLAB
    # Coordinates alone would be 24 bytes a point of the whole grid.
    assert peak <= 600 * grid.SLAB < 24 * points


def test_what_the_disk_cannot_hold_is_refused_in_one_line(leaf, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
    with pytest.raises(O3DLeafError, match="GB are free; free some, choose another disk, or coarsen") as error:
        leaf.write_grid(tmp_path / "g.vti", 0.1)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_no_file(leaf, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), progress.listening(stop):
        leaf.write_grid(tmp_path / "g.vti", 0.5)
    assert list(tmp_path.iterdir()) == []


def test_other_formats_and_contents_are_refused(leaf, tmp_path):
    with pytest.raises(InputError, match="suffix"):
        leaf.write_grid(tmp_path / "g.raw", 0.5)
    with pytest.raises(InputError, match="what"):
        leaf.write_grid(tmp_path / "g.vti", 0.5, what="colour")


def test_empty_air_is_left_out_of_a_mask_and_nothing_else(tmp_path):
    bent, _ = leaf_of(texture(lambda x, y, z: 0.31**2 - z**2), bend=10.0)
    box = bent.bounds + [[-1.0], [1.0]]
    bent.write_grid(tmp_path / "g.nrrd", 0.4013, box, what="mask")  # no point on the outline but for rounding
    values, origin, spacing = read_nrrd(tmp_path / "g.nrrd")
    axes = [origin[k] + spacing[k] * np.arange(values.shape[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    held = (bent(points) > 0) & bent.blade.outline.contains(bent.blade.flatten(points)[:, :2])
    assert np.array_equal(values.ravel(), held)
    asked = BoundingBalls.of(bent).rows(points)
    assert held.sum() < len(asked) < len(points) / 2
