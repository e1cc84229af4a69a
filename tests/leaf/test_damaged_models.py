"""Model files that were damaged or made up: one line says so, and compiled loops never see them."""

import contextlib
import json
import zlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.io.models.model_file import MAGIC, PREFIX
from o3dleaf.leaf.saved.model_arrays import check_model
from o3dleaf.leaf.saved.models import load
from o3dleaf.samples.scan import wheat_scan

QUERIES = np.random.default_rng(1).uniform(0, 3, (10, 3))


@cache
def patch(local="splines"):
    rng = np.random.default_rng(0)
    points = rng.uniform([0, 0, -1], [4, 3, 1], (600, 3))
    values = np.sin(points[:, 0]) - points[:, 2]
    if local == "splines":
        return o3l.PUInterpolant.fit(points, values, points_per_ball=(40, 80), smoothing="gcv", unit="um")
    if local == "columns":
        return o3l.PUInterpolant.fit(points, np.column_stack([values, points]), points_per_ball=(40, 80))
    if local == "single":
        return o3l.RBFInterpolant.fit(points[:80], values[:80])
    normals = np.column_stack([-np.cos(points[:, 0]), np.zeros(600), np.ones(600)])
    return o3l.PUInterpolant.fit_oriented(points, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis], local=local)


@cache
def leaf(frame):
    sample = wheat_scan(count=250)
    blade = o3l.create_blade(sample.cloud, sample.midrib, options=o3l.BladeOptions(frame=frame))
    return o3l.MultiscaleLeaf(o3l.TiledField(patch()), blade=blade)


MODELS = {
    "splines": patch,
    "columns": lambda: patch("columns"),
    "single": lambda: patch("single"),
    "potentials": lambda: patch(o3l.Hermite()),
    "polynomials": lambda: patch(o3l.MovingLeastSquares()),
    "creases": lambda: patch(o3l.CreasedSplines()),
    "surface": lambda: leaf("surface"),
    "paper": lambda: leaf("paper"),
}


@pytest.fixture(params=MODELS)
def file(request, tmp_path):
    MODELS[request.param]().save(tmp_path / "model.o3l")
    return tmp_path / "model.o3l"


def parts(content):
    """Return header and arrays of a file, as bytes that can be changed."""
    _, length, _ = PREFIX.unpack(content[: PREFIX.size])
    start = PREFIX.size + length
    header = json.loads(content[PREFIX.size : start])
    blocks = header["arrays"]
    sizes = [np.dtype(each["dtype"]).itemsize * int(np.prod(each["shape"])) for each in blocks]
    return header, [bytearray(content[start + b["offset"] :][:size]) for b, size in zip(blocks, sizes, strict=True)]


def assembled(header, arrays):
    """Return a file whose sums are right, whatever it says."""
    data = bytearray(header["bytes"])
    for block, array in zip(header["arrays"], arrays, strict=True):
        block["crc"] = zlib.crc32(array)
        data[block["offset"] : block["offset"] + len(array)] = array
    text = json.dumps(header).encode()
    text += b" " * (-(PREFIX.size + len(text)) % 64)
    return PREFIX.pack(MAGIC, len(text), zlib.crc32(text)) + text + data


@pytest.mark.few(file=7)
def test_a_flipped_bit_of_an_array_is_noticed_wherever_it_is(file):
    whole = file.read_bytes()
    header, arrays = parts(whole)
    start = len(whole) - header["bytes"]
    rng = np.random.default_rng(2)
    for block, array in zip(header["arrays"], arrays, strict=True):
        if array:
            content = bytearray(whole)
            content[start + block["offset"] + rng.integers(len(array))] ^= 1 << rng.integers(8)
            file.write_bytes(content)
            with pytest.raises(InputError, match=r"is damaged.*save the model again"):
                load(file)


def changes(dtype, rng, count):
    """Return arrays that one of `count` numbers of a type may have been replaced by."""
    if dtype.kind == "f":
        yield np.full(count, np.nan)
        return
    yield np.full(count, -1)
    yield np.full(count, 1 << 40)
    yield rng.integers(-(1 << 62), 1 << 62, count)


@pytest.mark.few(file=7)
def test_made_up_numbers_are_refused_or_harmless(file):
    """Numbers that lead out of an array are refused; what is taken can be evaluated, and ends."""
    whole = file.read_bytes()
    header, arrays = parts(whole)
    rng = np.random.default_rng(3)
    for k, block in enumerate(header["arrays"]):
        dtype, count = np.dtype(block["dtype"]), int(np.prod(block["shape"]))
        if dtype.kind not in "if" or not count:
            continue
        for values in (*changes(dtype, rng, count), np.zeros(count), rng.permutation(np.frombuffer(arrays[k], dtype))):
            changed = [*arrays[:k], bytearray(values.astype(dtype).tobytes()), *arrays[k + 1 :]]
            file.write_bytes(assembled(header, changed))
            outcome(file, whole=dtype.kind == "i")


@pytest.mark.few(file=7)
def test_arrays_in_the_place_of_others_are_refused_or_harmless(file):
    header, arrays = parts(file.read_bytes())
    for k in range(len(arrays)):
        for other in (0, (k + 1) % len(arrays)):
            swapped = json.loads(json.dumps(header))
            swapped["arrays"][k] = dict(swapped["arrays"][other])
            changed = [*arrays[:k], arrays[other], *arrays[k + 1 :]]
            file.write_bytes(assembled(swapped, changed))
            outcome(file)


def outcome(file, *, whole=True):
    """Load a file, and evaluate it where that is done, of a leaf the texture if asked; only errors of ours may come."""
    try:
        model = load(file)
    except InputError:
        return
    with np.errstate(all="ignore"), contextlib.suppress(O3DLeafError):
        (model if whole else getattr(model, "texture", model))(QUERIES)


@pytest.mark.parametrize(
    "change",
    [
        lambda header: header.update(arrays=None),
        lambda header: header.update(bytes=-1),
        lambda header: header.update(format="3"),
        lambda header: header.pop("model"),
        lambda header: header["arrays"].pop(),
        lambda header: header["arrays"][0].update(dtype="|O8"),
        lambda header: header["arrays"][0].update(shape=[1 << 40, 1 << 40]),
        lambda header: header["arrays"][0].update(shape=[-1]),
        lambda header: header["arrays"][0].update(offset=-64),
        lambda header: header["model"].pop("state"),
        lambda header: header["model"]["state"].update(cover=None),
        lambda header: header["model"]["state"].update(index=header["model"]["state"]["cover"]),
        lambda header: header["model"]["state"].update(local={"array": 10**6}),
        lambda header: header["model"]["state"]["local"]["state"]["kernel"]["state"].update(power=-3),
        lambda header: header["model"]["state"]["local"]["state"]["kernel"]["state"].update(dimension=2),
        lambda header: header["model"]["state"].update(more=1),
    ],
)
def test_a_header_that_is_whole_but_wrong_is_refused_in_one_line(tmp_path, change):
    file = tmp_path / "model.o3l"
    patch().save(file)
    header, arrays = parts(file.read_bytes())
    data = assembled(header, arrays)[-header["bytes"] :]
    change(header)
    text = json.dumps(header).encode()
    file.write_bytes(PREFIX.pack(MAGIC, len(text), zlib.crc32(text)) + text + data)
    with pytest.raises(InputError, match=r"save the model again|cut off") as caught:
        load(file)
    assert "\n" not in str(caught.value)


def test_nothing_is_as_deep_as_a_header_may_say(tmp_path):
    file = tmp_path / "model.o3l"
    text = (
        (b'{"format": 4, "o3dleaf": "0.1", "bytes": 0, "arrays": [], "model": ' + b"[" * 50_000) + b"]" * 50_000 + b"}"
    )
    file.write_bytes(PREFIX.pack(MAGIC, len(text), zlib.crc32(text)) + text)
    with pytest.raises(InputError, match="save the model again"):
        load(file)


@pytest.mark.parametrize(
    ("place", "part"), [(0, np.ones(2)), (1, np.ones((3, 4, 3, 2))), (2, 9), (2, -1), (2, 1.0), (3, "1"), (None, None)]
)
def test_choices_of_smoothing_that_are_none_are_refused(place, part):
    rng = np.random.default_rng(0)
    points, groups = rng.uniform(0, 1, (200, 3)), np.arange(200) // 2 * 2
    values = points[groups, 0] + 0.1 * rng.normal(size=200)
    local = o3l.PUInterpolant.fit(points, values, smoothing="gcv-per-ball", groups=groups).local
    check_model(local)
    trials = list(local.trials)
    if place is None:
        del trials[-1]
    else:
        trials[place] = part
    with pytest.raises(InputError):
        check_model(replace(local, trials=tuple(trials)))
