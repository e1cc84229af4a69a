"""Files written from an assembly: every bit that the format holds, of the size that was said, whole or not at all."""

import os
import shutil
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import open3d as o3d
import pytest

from o3dleaf import get_num_threads, set_num_threads
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.io import obj, stl
from o3dleaf.io.labelled_mesh import LABELS, RIM
from o3dleaf.io.mesh_stream import Arrays, file_bytes, mesh_file
from o3dleaf.io.ply import PlyFile, PlyLayout
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from tile_fields import LATTICE, assemble, layer, outline

COMMENTS = ("spacing 0.05", "made by a test, in µm")
suffixes = pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])


@pytest.fixture(scope="module")
def solid():
    """The layer as a closed solid, and its arrays in the world."""
    assembly, _ = assemble(extract_tile(layer, LATTICE), outline(), closed=True)
    arrays = Arrays(assembly)
    assembly.emit(arrays, to_world)
    return assembly, arrays


def to_world(flat):
    """Somewhere that no coordinate is round."""
    return flat @ np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) / 3 + [100.0, -7.0, 1e-3]


@pytest.fixture(params=[1, 3])
def _threads(request):
    before = get_num_threads()
    set_num_threads(request.param)
    yield
    set_num_threads(before)


def write(path, assembly, comments=COMMENTS):
    with mesh_file(path, assembly, comments) as sink:
        assembly.emit(sink, to_world)


def parse_ply(path):
    """The header's lines, vertices, corners and labels, by the letter of the format."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    count, faces = (int(line.split()[-1]) for line in lines if line.startswith("element"))
    vertices = np.frombuffer(body, "<f8", 3 * count).reshape(-1, 3)
    row = np.dtype([("n", "u1"), ("corners", "<i4", 3), ("label", "u1")])
    records = np.frombuffer(body, row, offset=24 * count)
    assert len(records) == faces
    assert (records["n"] == 3).all()
    return lines, vertices, records["corners"], records["label"]


@pytest.mark.usefixtures("_threads")
def test_a_ply_file_holds_the_arrays_bit_for_bit(solid, tmp_path):
    assembly, arrays = solid
    write(tmp_path / "leaf.ply", assembly)
    lines, vertices, corners, labels = parse_ply(tmp_path / "leaf.ply")
    assert np.array_equal(vertices, arrays.vertices)
    assert np.array_equal(corners, arrays.triangles)
    assert np.array_equal(labels, arrays.labels)
    assert lines[:4] == ["ply", "format binary_little_endian 1.0", f"comment {COMMENTS[0]}", f"comment {COMMENTS[1]}"
                         .replace("µ", "?")]  # fmt: skip
    read = o3d.io.read_triangle_mesh(tmp_path / "leaf.ply")
    assert np.array_equal(np.asarray(read.vertices), arrays.vertices)
    assert np.array_equal(np.asarray(read.triangles), arrays.triangles)


@pytest.mark.parametrize("block", [1000, stl.BLOCK])
def test_an_stl_file_holds_the_corners_in_single_precision_their_normals_and_the_labels(
    solid, tmp_path, block, monkeypatch
):
    monkeypatch.setattr(stl, "BLOCK", block)
    assembly, arrays = solid
    write(tmp_path / "leaf.stl", assembly)
    data = (tmp_path / "leaf.stl").read_bytes()
    assert not data.startswith(b"solid")  # what a text file begins with
    assert np.frombuffer(data, "<u4", 1, 80)[0] == assembly.triangles
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("label", "<u2")])
    records = np.frombuffer(data, row, offset=84)
    corners = arrays.vertices[arrays.triangles]
    assert np.array_equal(records["corners"], corners.astype(np.float32))
    assert np.array_equal(records["label"], arrays.labels)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    dot = np.einsum("ij,ij->i", normal, records["normal"])
    assert np.all(np.abs(dot - length) <= 1e-6 * length)
    read = o3d.io.read_triangle_mesh(tmp_path / "leaf.stl")
    assert np.array_equal(np.asarray(read.vertices)[np.asarray(read.triangles)], records["corners"].astype(float))


@pytest.mark.parametrize("block", [1000, obj.BLOCK])
def test_an_obj_file_holds_every_digit_and_a_group_for_each_label(solid, tmp_path, block, monkeypatch):
    monkeypatch.setattr(obj, "BLOCK", block)
    assembly, arrays = solid
    write(tmp_path / "leaf.obj", assembly)
    lines = (tmp_path / "leaf.obj").read_text(encoding="utf-8").splitlines()
    assert lines[:2] == [f"# {line}" for line in COMMENTS]
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    assert np.array_equal(vertices, arrays.vertices)
    assert [line for line in lines if line.startswith("g ")] == [f"g {name}" for name in LABELS]
    at = [lines.index(f"g {name}") for name in LABELS] + [len(lines)]
    for label, (start, stop) in enumerate(pairwise(at)):
        corners = np.array([line.split()[1:] for line in lines[start + 1 : stop]], dtype=int) - 1
        assert np.array_equal(corners, arrays.triangles[arrays.labels == label])
    read = o3d.io.read_triangle_mesh(tmp_path / "leaf.obj")
    assert len(read.triangles) == assembly.triangles


@suffixes
@pytest.mark.parametrize("comments", [(), COMMENTS])
def test_files_have_the_size_that_was_said(solid, tmp_path, suffix, comments):
    assembly, _ = solid
    path = tmp_path / f"leaf{suffix}"
    write(path, assembly, comments)
    said, size = file_bytes(suffix, assembly, comments)[0], path.stat().st_size
    if suffix == ".obj":
        assert 0.6 * said < size <= said
    else:
        assert size == said
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_the_suffix_may_be_in_capitals_and_must_be_known(solid, tmp_path):
    write(tmp_path / "leaf.PLY", solid[0])
    assert parse_ply(tmp_path / "leaf.PLY")[1].shape == (solid[0].vertices, 3)
    with pytest.raises(InputError, match="suffix"), mesh_file(tmp_path / "leaf.vtk", solid[0]):
        pass
    with pytest.raises(InputError, match="folder"), mesh_file(tmp_path / "none" / "leaf.ply", solid[0]):
        pass


@pytest.mark.few
@suffixes
@pytest.mark.parametrize("error", [ValueError("in a worker"), KeyboardInterrupt()])
@pytest.mark.usefixtures("_threads")
def test_a_failure_in_the_middle_leaves_nothing_and_an_old_file_as_it_was(solid, tmp_path, suffix, error):
    assembly, _ = solid
    new, old, seen = tmp_path / f"new{suffix}", tmp_path / f"old{suffix}", []
    old.write_bytes(b"as it was")

    def failing(flat):
        seen.append(len(flat))
        if sum(seen) > assembly.vertices / 2:
            raise error
        return to_world(flat)

    for path in (new, old):
        seen.clear()
        with pytest.raises(type(error)), mesh_file(path, assembly) as sink:
            assembly.emit(sink, failing)
    assert old.read_bytes() == b"as it was"
    assert [entry.name for entry in tmp_path.iterdir()] == [old.name]


@pytest.mark.parametrize("suffix", [".stl", ".obj"])
def test_a_failure_while_the_scratch_file_is_turned_leaves_nothing(solid, tmp_path, suffix, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PlyFile, "triangle_block", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / f"leaf{suffix}", solid[0])
    assert not list(tmp_path.iterdir())


@suffixes
def test_a_disk_that_fills_up_is_one_clear_line_and_leaves_nothing(solid, tmp_path, suffix, monkeypatch):
    real, written = os.write, []

    def full(file, data):
        written.append(len(data))
        if sum(written) > 1 << 19:
            raise OSError(28, "No space left on device")
        return real(file, data)

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(O3DLeafError, match="No space left on device") as caught:
        write(tmp_path / f"leaf{suffix}", solid[0])
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows lists no open files of a process")
def test_a_header_that_cannot_be_written_leaves_no_open_file(solid, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    before = set(os.listdir("/dev/fd"))  # noqa: PTH208 - names, not paths
    with pytest.raises(O3DLeafError, match="No space"):
        write(tmp_path / "leaf.ply", solid[0])
    assert len(set(os.listdir("/dev/fd")) - before) == 0  # noqa: PTH208


@suffixes
def test_a_disk_without_room_is_refused_before_anything_is_written(solid, tmp_path, suffix, monkeypatch):
    assembly, _ = solid
    old = tmp_path / f"leaf{suffix}"
    old.write_bytes(b"as it was")
    need = sum(file_bytes(suffix, assembly, COMMENTS))
    calls = []

    def disk(free):
        return lambda _: SimpleNamespace(total=need, used=0, free=free)

    monkeypatch.setattr(shutil, "disk_usage", disk(need - 1))
    with pytest.raises(O3DLeafError, match="GB of disk") as caught, mesh_file(old, assembly, COMMENTS):
        calls.append(1)
    assert not calls
    assert "\n" not in str(caught.value)
    assert old.read_bytes() == b"as it was"
    assert [entry.name for entry in tmp_path.iterdir()] == [old.name]
    monkeypatch.setattr(shutil, "disk_usage", disk(need))
    write(old, assembly)
    assert old.stat().st_size > need // 4


def test_a_write_that_the_system_takes_in_parts_is_finished(solid, tmp_path, monkeypatch):
    real = os.write
    monkeypatch.setattr(os, "write", lambda file, data: real(file, data[: max(1, len(data) // 2)]))
    write(tmp_path / "leaf.ply", solid[0])
    _, vertices, corners, _ = parse_ply(tmp_path / "leaf.ply")
    assert np.array_equal(vertices, solid[1].vertices)
    assert np.array_equal(corners, solid[1].triangles)


def test_blocks_of_many_threads_are_written_to_and_read_from_their_places(tmp_path, monkeypatch):
    """A pause after each way to a place lets any other thread in that may come in."""
    vertices, triangles = np.arange(1200.0).reshape(-1, 3), np.arange(1200, dtype=np.int32).reshape(-1, 3)
    seek = os.lseek

    def slow(*place):
        there = seek(*place)
        time.sleep(1e-3)
        return there

    with (tmp_path / "mesh.ply").open("w+b") as out:
        file = PlyFile(out, PlyLayout(len(vertices), len(triangles)))

        def write_and_read(start):
            rows = slice(start, start + 10)
            file.put_triangles(start, triangles[rows])
            file.put_vertices(start, vertices[rows])
            return file.vertex_block(rows.start, rows.stop), file.triangle_block(rows.start, rows.stop)[0]

        monkeypatch.setattr(os, "lseek", slow)
        with ThreadPoolExecutor(8) as pool:
            read = list(pool.map(write_and_read, range(0, len(vertices), 10)))
        assert np.array_equal(file.vertex_block(0, len(vertices)), vertices)
        assert np.array_equal(file.triangle_block(0, len(triangles))[0], triangles)
    assert np.array_equal(np.concatenate([found for found, _ in read]), vertices)
    assert np.array_equal(np.concatenate([found for _, found in read]), triangles)


def test_the_labels_in_a_file_are_those_of_the_faces(solid):
    """Rim triangles have a corner of their own; the others' normals point up or down."""
    _, arrays = solid
    corners = arrays.vertices[arrays.triangles]
    up = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    plain = arrays.labels != RIM
    assert np.array_equal(up[plain] > 0, arrays.labels[plain] == 0)
