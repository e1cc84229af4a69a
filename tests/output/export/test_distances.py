"""Distances on a grid: those of the shape, by every reader, and the sign told exactly."""

import json
import re

import numpy as np
import pytest
import SimpleITK

from mesh_fields import CENTRE, sphere
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.output.export import distance_grid as module
from o3dleaf.output.export.distance_grid import export_distance
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import CHORD, SINGLE_LENGTH

STEP = 0.11
BOX = np.array([[-0.8, -1.3, -0.5], [1.4, 0.6, 1.2]])


@pytest.fixture(scope="module")
def ball():
    return extract_isosurface(sphere(), 0.05)


def read_vti(path):
    data = path.read_bytes()
    start = data.index(b'<AppendedData encoding="raw">\n_') + 31
    text = data[:start].decode()
    origin, spacing = (np.array(re.search(f'{key}="([^"]*)"', text)[1].split(), float) for key in ("Origin", "Spacing"))
    extent = np.array(re.search('WholeExtent="([^"]*)"', text)[1].split(), int)
    size = int.from_bytes(data[start : start + 8], "little")
    values = np.frombuffer(data[start + 8 : start + 8 + size], "<f4")
    return values.reshape(extent[1::2] + 1, order="F"), origin, spacing


def read_nrrd(path):
    image = SimpleITK.ReadImage(str(path))
    return SimpleITK.GetArrayFromImage(image).T, np.array(image.GetOrigin()), np.array(image.GetSpacing())


def read_npy(path):
    about = json.loads(path.with_suffix(".json").read_text())
    return np.load(path).T, np.array(about["origin"]), np.full(3, about["spacing"])


@pytest.mark.few
@pytest.mark.parametrize("bounds", [None, BOX])
@pytest.mark.parametrize(("suffix", "read"), [(".vti", read_vti), (".nrrd", read_nrrd), (".npy", read_npy)])
def test_distances_read_back_are_those_of_the_sphere(ball, tmp_path, monkeypatch, suffix, read, bounds):
    monkeypatch.setattr(module, "SLAB", 1000)
    export_distance(ball, tmp_path / f"d{suffix}", STEP, bounds, unit="mm")
    values, origin, spacing = read(tmp_path / f"d{suffix}")
    assert np.allclose(spacing, STEP, rtol=1e-12)
    low, high = origin, origin + STEP * (np.array(values.shape) - 1)
    wanted = BOX if bounds is not None else np.array(CENTRE) + np.array([[-1.0], [1.0]]) * (1 + 4 * STEP)
    assert (low <= wanted[0] + 0.01).all()
    assert (high >= wanted[1] - 0.01).all()
    assert (low > wanted[0] - STEP - 0.01).all()
    points = origin + STEP * np.stack(np.meshgrid(*map(np.arange, values.shape), indexing="ij"), axis=-1)
    truth = np.linalg.norm(points - CENTRE, axis=-1) - 1
    assert np.abs(values - truth).max() < CHORD
    assert (values < 0).any()
    assert (values > 0).any()


def test_a_unit_is_that_of_coordinates_and_distances(ball, tmp_path):
    export_distance(ball, tmp_path / "mm.npy", STEP, BOX, unit="mm")
    export_distance(ball, tmp_path / "um.npy", STEP, BOX, unit="mm", to_unit="um")
    values, origin, spacing = read_npy(tmp_path / "mm.npy")
    others, place, step = read_npy(tmp_path / "um.npy")
    assert np.abs(others / 1000 - values).max() < SINGLE_LENGTH * 2
    assert np.allclose([place / 1000, step / 1000], [origin, spacing], rtol=1e-12)
    assert json.loads((tmp_path / "um.json").read_text())["unit"] == "um"


def test_an_open_mesh_has_no_inside(ball, tmp_path):
    vertices, triangles = mesh_arrays(ball)
    with pytest.raises(InputError, match="open"):
        export_distance((vertices, triangles[1:]), tmp_path / "d.vti", STEP)
    assert list(tmp_path.iterdir()) == []
