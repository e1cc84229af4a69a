"""Models on disk: what comes back is what was saved, bit for bit, or an error that says why not."""

import json
import struct
import zlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import o3dleaf as o3l
from leaf_fields import FRAMES
from o3dleaf.core.errors import InputError
from o3dleaf.io.models.model_file import FORMAT, MAGIC, OLDEST, PREFIX, _read_header, write_model
from o3dleaf.leaf.saved.models import CLASSES, load
from o3dleaf.samples.scan import wheat_scan


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, -1], [4, 3, 1], (1500, 3))
    return points, np.sin(points[:, 0]) - points[:, 2]


@pytest.fixture(scope="module")
def interpolant(data):
    return o3l.PUInterpolant.fit(*data, points_per_ball=(40, 80), smoothing="gcv", unit="um")


@cache
def blade_in(frame):
    """A scan, and its blade in a frame."""
    sample = wheat_scan(count=400)
    return sample, o3l.create_blade(sample.cloud, sample.midrib, options=o3l.BladeOptions(frame=frame))


@pytest.fixture
def file(interpolant, tmp_path):
    interpolant.save(tmp_path / "model.o3l")
    return tmp_path / "model.o3l"


QUERIES = np.random.default_rng(1).uniform(-1, 5, (500, 3))


def test_an_interpolant_comes_back_bit_for_bit(interpolant, file):
    found = load(file)
    assert np.array_equal(found(QUERIES), interpolant(QUERIES))
    assert np.array_equal(found.gradient(QUERIES), interpolant.gradient(QUERIES))
    assert (found.unit, found.data_hash) == (interpolant.unit, interpolant.data_hash)
    assert found.local.smoothing == interpolant.local.smoothing
    assert found.local.kernel == interpolant.local.kernel


def test_a_single_interpolant_and_a_tiled_field_come_back(data, interpolant, tmp_path):
    single = o3l.RBFInterpolant.fit(data[0][:200], data[1][:200], kernel="linear", degree=1)
    for name, model in {"single": single, "tiled": o3l.TiledField(interpolant, (3.5, 2.5))}.items():
        model.save(tmp_path / f"{name}.o3l")
        assert np.array_equal(o3l.load(tmp_path / f"{name}.o3l")(QUERIES), model(QUERIES))


@pytest.mark.parametrize("frame", FRAMES)
def test_a_whole_leaf_comes_back(interpolant, tmp_path, frame):
    sample, blade = blade_in(frame)
    leaf = o3l.MultiscaleLeaf(o3l.TiledField(interpolant), blade=blade)
    leaf.save(tmp_path / "leaf.o3l")
    found = o3l.load(tmp_path / "leaf.o3l")
    points = np.asarray(sample.cloud.points)
    assert type(found.blade) is type(blade)
    assert np.array_equal(found(points), leaf(points))
    assert np.array_equal(found.gradient(points), leaf.gradient(points))
    assert found.blade.outline.area == leaf.blade.outline.area
    assert found.unit == leaf.unit


NAMES = {
    "AlphaShape": {"points", "alpha"},
    "Cover": {"centres", "radii", "offsets", "members", "bounds"},
    "HeightMap": {"interpolant", "choice"},
    "LeafFrame": {"breaks", "axis", "normal", "unit", "notes"},
    "MultiscaleLeaf": {"texture", "offset", "frame", "height_map", "outline"},
    "RobustChoice": {"smoothing", "bandwidth", "noise", "trust"},
    "TiledField": {"field", "period"},
}
"""Classes and their fields in files of format 3, which version 0.1 wrote."""


def test_a_file_has_the_names_that_all_versions_know(interpolant, tmp_path):
    _, blade = blade_in("paper")
    leaf = o3l.MultiscaleLeaf(o3l.TiledField(interpolant), blade.frame, blade.height_map, blade.outline)
    leaf.save(tmp_path / "leaf.o3l")
    found = {}

    def collect(tree):
        if isinstance(tree, list):
            for each in tree:
                collect(each)
        elif isinstance(tree, dict) and "class" in tree:
            found.setdefault(tree["class"], set()).update(tree["state"])
            collect(list(tree["state"].values()))

    header, _ = _read_header(tmp_path / "leaf.o3l")
    collect(header["model"])
    assert {name: found[name] for name in NAMES} == NAMES
    assert set(found) <= set(CLASSES)


@pytest.mark.parametrize("frame", FRAMES)
def test_a_leaf_of_several_patches_comes_back(interpolant, tmp_path, frame):
    sample, blade = blade_in(frame)
    textures = [o3l.TiledField(interpolant, (3.0, 2.2), (0.4, y), fade=0.2, shift=0.0) for y in (0.3, 0.5)]
    blend = o3l.PatchBlend(textures, [30_000.0])
    leaf = o3l.MultiscaleLeaf(blend, blade=blade)
    leaf.save(tmp_path / "leaf.o3l")
    points = np.asarray(sample.cloud.points)
    assert np.array_equal(o3l.load(tmp_path / "leaf.o3l")(points), leaf(points))


def test_the_same_model_makes_the_same_bytes(interpolant, file, tmp_path):
    interpolant.save(tmp_path / "again.o3l")
    assert (tmp_path / "again.o3l").read_bytes() == file.read_bytes()


def test_the_hash_is_that_of_the_data(data, interpolant):
    points, values = data
    same = o3l.PUInterpolant.fit(points.copy(), values.copy(), points_per_ball=(30, 60))
    other = o3l.PUInterpolant.fit(points, values + 1e-12, points_per_ball=(40, 80))
    assert same.data_hash == interpolant.data_hash != other.data_hash


def test_arrays_are_mapped_and_changing_them_leaves_the_file_alone(file):
    before = file.read_bytes()
    found = load(file)
    base = found.local.sites
    while isinstance(base.base, np.ndarray):
        base = base.base
    assert isinstance(base, np.memmap)
    found.local.weights[:] = 0
    assert file.read_bytes() == before


def test_a_file_that_was_cut_off_is_refused(file):
    whole = file.read_bytes()
    for length in (0, 5, PREFIX.size, 500, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"empty|cut off|no o3dleaf model"):
            load(file)


def test_a_damaged_header_is_refused(file):
    content = bytearray(file.read_bytes())
    content[PREFIX.size + 40] ^= 1
    file.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        load(file)


def rewrite_header(file, change):
    content = file.read_bytes()
    _, length, _ = PREFIX.unpack(content[: PREFIX.size])
    header = json.loads(content[PREFIX.size : PREFIX.size + length])
    change(header)
    text = json.dumps(header).encode().ljust(length)
    assert len(text) == length
    file.write_bytes(PREFIX.pack(MAGIC, length, zlib.crc32(text)) + text + content[PREFIX.size + length :])


def test_a_file_from_the_future_is_refused(file):
    rewrite_header(file, lambda header: header.update(format=FORMAT + 1))
    with pytest.raises(InputError, match="update o3dleaf"):
        load(file)


def test_a_file_from_before_the_first_release_is_refused(file):
    rewrite_header(file, lambda header: header.update(format=OLDEST - 1))
    with pytest.raises(InputError, match="fit and save the model again"):
        load(file)


def test_a_file_from_before_balls_chose_for_themselves_is_read(interpolant, file):
    def older(header):
        local = header["model"]["state"]["local"]["state"]
        del local["amounts"], local["trust"], local["smoothing"]["state"]["score"]

    rewrite_header(file, older)
    found = load(file)
    assert np.array_equal(found(QUERIES), interpolant(QUERIES))
    assert np.array_equal(found.diagnostics([0]).score, interpolant.diagnostics([0]).score)


def test_a_file_without_sums_of_its_arrays_is_read(interpolant, file):
    """As those of format 3, which brought the tree of their index along."""

    def older(header):
        header.update(format=3)
        header["model"]["state"]["index"]["state"]["tree"] = []
        for block in header["arrays"]:
            del block["crc"]

    rewrite_header(file, older)
    assert np.array_equal(load(file)(QUERIES), interpolant(QUERIES))


def test_only_known_classes_come_out(file):
    rewrite_header(file, lambda header: header["model"].update({"class": "Popen"}))
    with pytest.raises(InputError, match="Popen"):
        load(file)
    assert all(each.__module__.startswith("o3dleaf.") for each in CLASSES.values())


def test_other_files_are_refused(tmp_path):
    (tmp_path / "mesh.ply").write_text("ply\n" + 100 * "x")
    with pytest.raises(InputError, match="no o3dleaf model"):
        load(tmp_path / "mesh.ply")
    assert struct.calcsize("<8sQI") == PREFIX.size


def test_what_cannot_be_read_back_is_not_written(data, tmp_path):
    class Constant:
        unit = None

        def __init__(self, points, values):
            self.bounds = np.array([points.min(axis=0), points.max(axis=0)])
            self.value = values.mean()

        def __call__(self, points):
            return np.full(len(points), self.value)

        def gradient(self, points):
            return np.zeros_like(points)

    fit = o3l.PUInterpolant.fit(*data, local=Constant, points_per_ball=400)
    with pytest.raises(InputError, match="cannot be saved"):
        fit.save(tmp_path / "model.o3l")
    assert list(Path(tmp_path).iterdir()) == []


def test_a_failure_leaves_the_old_file(interpolant, file, monkeypatch):
    before = file.read_bytes()
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(o3l.errors.O3DLeafError, match="No space"):
        write_model(interpolant, file)
    monkeypatch.undo()
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_the_paper_s_blade_keeps_its_name_in_files(tmp_path):
    sample, blade = blade_in("paper")
    write_model(blade, tmp_path / "blade.o3l")
    header, _ = _read_header(tmp_path / "blade.o3l")
    assert header["model"]["class"] == "Blade"
    found = load(tmp_path / "blade.o3l")
    assert isinstance(found, o3l.HeightMapBlade)
    points = np.asarray(sample.cloud.points)
    assert np.array_equal(found.flatten(points), blade.flatten(points))


def test_a_leaf_takes_a_blade_or_all_parts_of_one(interpolant):
    (_, blade), texture = blade_in("paper"), o3l.TiledField(interpolant)
    assert o3l.MultiscaleLeaf(texture, blade=blade).blade is blade
    with pytest.raises(InputError, match="blade: is missing"):
        o3l.MultiscaleLeaf(texture, blade.frame)
    with pytest.raises(InputError, match="beside parts"):
        o3l.MultiscaleLeaf(texture, blade.frame, blade=blade)
