"""Finished blocks of a step are not done again, and what goes on after them is what was never stopped."""

from contextlib import nullcontext

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from o3dleaf.commands.patch import PatchJob
from o3dleaf.commands.reconstruct import ReconstructJob
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.core.resume import blocks
from o3dleaf.core.resume.blocks import BlockFile, keeping_blocks, kept, kept_block, run_kept_blocks
from o3dleaf.core.resume.parts import SUFFIX, resuming
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.samples import Torus, wheat_ct


class Stopped(BaseException):
    """What ends a run in the middle."""


def stopping(monkeypatch, count=None):
    """Let `count` blocks be kept, then end the run; return the list of those that were made, by their steps."""
    append, made = BlockFile.append, []

    def stop(self, arrays):
        append(self, arrays)
        made.append(self.path.name)
        if len(made) == count:
            raise Stopped

    monkeypatch.setattr(BlockFile, "append", stop)
    return made


def work(path, count, asked, *, stop=None):
    """Make `count` blocks of two steps of one name, and note which were asked for."""
    with resuming(path, "key", None):
        results = []
        for step in range(2):
            with keeping_blocks("step"):
                for number in range(count):
                    if (step, number) == stop:
                        raise Stopped

                    def make(step=step, number=number):
                        asked.append((step, number))
                        return np.arange(number) + 0.5, np.array([[step, number]], dtype=np.int32)

                    results.append(kept_block(make))
        return results


@pytest.mark.parametrize("torn", [0, 1, 30])
def test_blocks_are_made_once_and_one_that_was_cut_off_again(tmp_path, torn):
    whole, asked = work(tmp_path / "whole.ply", 3, []), []
    with pytest.raises(Stopped):
        work(tmp_path / "a.ply", 3, asked, stop=(1, 2))
    assert asked == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]
    file = tmp_path / f"a.ply{SUFFIX}" / "step-1.blocks"
    if torn:
        file.write_bytes(file.read_bytes()[:-torn])
    asked.clear()
    with pytest.raises(Stopped):
        work(tmp_path / "a.ply", 3, asked, stop=(1, 2))
    assert asked == ([(1, 1)] if torn else [])
    asked.clear()
    again = work(tmp_path / "a.ply", 3, asked)
    assert asked == [(1, 2)]
    for one, other in zip(whole, again, strict=True):
        for first, second in zip(one, other, strict=True):
            assert first.dtype == second.dtype
            np.testing.assert_array_equal(first, second)


def test_a_block_whose_bits_have_changed_is_made_again_and_so_is_what_follows(tmp_path):
    asked = []
    with pytest.raises(Stopped):
        work(tmp_path / "a.ply", 3, asked, stop=(1, 0))
    file = tmp_path / f"a.ply{SUFFIX}" / "step-0.blocks"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    asked.clear()
    work(tmp_path / "a.ply", 3, asked)
    assert asked == [(0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_loop_over_blocks_goes_on_to_what_it_would_have_written(tmp_path, monkeypatch, threads):
    count, size, before = 1000, 3, get_num_threads()
    done = []

    def loop(path):
        numbers, squares = np.empty(count), np.empty((count, 2), dtype=np.int64)

        def task(start, stop):
            done.append((start, stop))
            numbers[start:stop] = np.sqrt(np.arange(start, stop))
            squares[start:stop] = np.arange(start, stop)[:, np.newaxis] ** 2

        with resuming(path, "key", None), keeping_blocks("loop"):
            run_kept_blocks(task, count, size, lambda i, j: (numbers[i:j], squares[i:j]))
        return numbers, squares

    set_num_threads(threads)
    try:
        with monkeypatch.context() as patched:
            stopping(patched, 5)
            with pytest.raises(Stopped):
                loop(tmp_path / "a.ply")
        first, done = done, []
        numbers, squares = loop(tmp_path / "a.ply")
    finally:
        set_num_threads(before)
    assert first
    assert sorted(first + done) == [(i, min(i + size, count)) for i in range(0, count, size)]
    np.testing.assert_array_equal(numbers, np.sqrt(np.arange(count)))
    np.testing.assert_array_equal(squares, np.stack([np.arange(count) ** 2] * 2, axis=1))


def test_what_is_kept_whole_leaves_no_blocks_behind(tmp_path):
    class Number(int):
        def save(self, path):
            path.write_text(str(int(self)))

    with resuming(tmp_path / "a.ply", "key", None):
        kept("sum.o3l", lambda: Number(kept_block(lambda: (np.arange(4),))[0].sum()))
        assert [file.name for file in (tmp_path / f"a.ply{SUFFIX}").glob("sum*")] == ["sum.o3l"]


def torus(path):
    points, normals = Torus().sample(2500, seed=0)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    o3d.io.write_point_cloud(str(path), cloud)
    return path


@pytest.mark.slow
def test_a_reconstruction_goes_on_within_its_fit_and_within_its_surface(tmp_path, monkeypatch):
    """Stopped first in the fit, then after it."""
    job = ReconstructJob(torus(tmp_path / "cloud.ply"), tmp_path / "mesh.ply", resume=True)
    ReconstructJob(job.cloud, tmp_path / "whole.ply").run()

    def run(stop=None):
        with monkeypatch.context() as patched:
            made = stopping(patched, stop)
            with pytest.raises(Stopped) if stop else nullcontext():
                job.run()
        return made

    everything = run()
    assert {"fit-0.blocks", "surface-0.blocks"} <= set(everything)
    fit = everything.count("fit-0.blocks")
    assert [*run(2), *run(fit), *run()] == everything
    assert job.output.read_bytes() == (tmp_path / "whole.ply").read_bytes()


def test_the_block_of_a_patch_goes_on_after_its_finished_slabs(tmp_path, monkeypatch):
    volume, _ = wheat_ct(size=(720, 720, 480))
    o3l.write_volume(volume, tmp_path / "ct.tif")
    asked, values = [], TiledField.__call__
    monkeypatch.setattr(
        TiledField, "__call__", lambda self, points: (asked.append(len(points)), values(self, points))[1]
    )
    monkeypatch.setattr(extract_tile, "__kwdefaults__", extract_tile.__kwdefaults__ | {"slab_size": 1 << 9})

    def run(name, **given):
        asked.clear()
        PatchJob(
            tmp_path / "ct.tif", tmp_path / f"{name}.o3l", tile_solid=tmp_path / f"{name}.ply", spacing=24, **given
        ).run()
        return sum(asked)

    everything = run("whole")
    with monkeypatch.context() as patched:
        made = stopping(patched, 40)
        with pytest.raises(Stopped):
            run("stopped", resume=True)
    assert 0 < run("stopped", resume=True) < everything
    assert "tile-0.blocks" in made
    for suffix in (".o3l", ".ply"):
        assert (tmp_path / f"stopped{suffix}").read_bytes() == (tmp_path / f"whole{suffix}").read_bytes()
    assert blocks.current_parts() is None
