"""One volume on the workers of a cluster: the bytes are those of a run without, whoever dies."""

import os
import pickle
import signal
import socket
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest

import o3dleaf as o3l
from o3dleaf.commands.batch import BatchJob
from o3dleaf.commands.patch import PatchJob
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.processes import spread as spreads
from o3dleaf.core.processes.spread import Spread, each_block
from o3dleaf.leaf.ct.voxel_file import VoxelFile
from o3dleaf.leaf.instancing.extraction.extract import extract_tile
from o3dleaf.samples import wheat_ct


class Pickled:
    """A cluster whose work crosses to it and back as pickles, and is ready in an order of its own."""

    def __init__(self):
        self.sent, self.returned = Counter(), Counter()

    def map(self, task, arguments):
        results, name = [], type(task.args[1]).__name__
        for number, each in enumerate(arguments):
            sent = pickle.dumps((task, each))
            function, argument = pickle.loads(sent)
            returned = pickle.dumps(function(argument))
            self.sent[name] += len(sent)
            self.returned[name] += len(returned)
            results.append((number, pickle.loads(returned)))
        yield from reversed(results)


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A volume in a file, with hairs that go on past the window that is read of it."""
    volume, _ = wheat_ct(size=(720, 720, 480))
    path = tmp_path_factory.mktemp("scan") / "ct.tif"
    o3l.write_volume(volume, path)
    return path


def fit(scan, folder, **given):
    folder.mkdir()
    PatchJob(scan, folder / "patch.o3l", tile_solid=folder / "tile.ply", spacing=24, **given).run()
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


def fit_on(cluster, scan, folder, **given):
    """Fit by the workers of a cluster that is no Dask."""
    job = PatchJob(scan, folder / "patch.o3l", tile_solid=folder / "tile.ply", spacing=24, **given)
    folder.mkdir()
    spread = Spread(cluster)
    token = spreads._spread.set(spread)
    try:
        job.build(spread)
    finally:
        spreads._spread.reset(token)
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


@pytest.mark.few(given=1)
@pytest.mark.parametrize("given", [{}, {"ct_crop": [[0, 30, -300], [700, 700, 200]], "tiles": "wang"}])
def test_blocks_that_are_done_elsewhere_come_to_the_same_bytes(tmp_path, scan, monkeypatch, given):
    monkeypatch.setitem(extract_tile.__kwdefaults__, "slab_size", 1 << 12)
    cluster = Pickled()
    assert fit_on(cluster, scan, tmp_path / "spread", **given) == fit(scan, tmp_path / "plain", **given)
    assert cluster.sent.keys() == {"_Layers", "WorkerSolver", "partial"}
    # Each batch would be sent all voxels, or its own, which are as many as its coefficients; where they lie is less.
    assert cluster.sent["WorkerSolver"] < cluster.returned["WorkerSolver"] / 2


@pytest.mark.parametrize("crop", [None, [[24, 0, 48], [400, 300, 200]]])
def test_parts_of_a_file_are_those_of_the_volume(tmp_path, scan, crop):
    volume = o3l.read_volume(scan) if crop is None else o3l.open_volume(scan).crop(crop)
    file = pickle.loads(pickle.dumps(VoxelFile.of(scan, volume.shape, crop)))
    for part in [
        (slice(None),) * 3,
        (slice(2, 5), slice(0, 100), slice(1, 2)),
        (slice(0, 2), slice(-3, None), slice(1)),
    ]:
        np.testing.assert_array_equal(file(part), volume.data[part])
        assert file(part).dtype == volume.data.dtype


def test_a_block_that_is_lost_for_good_is_an_error():
    class Losing:
        def map(self, task, arguments):
            yield 0, O3DLeafError("lost")

    token = spreads._spread.set(Spread(Losing()))
    try:
        with pytest.raises(O3DLeafError, match="lost"):
            list(each_block(lambda each: (np.array([each]),), [1, 2]))
    finally:
        spreads._spread.reset(token)


def test_a_batch_of_patches_has_its_own_workers(tmp_path, scan):
    with pytest.raises(InputError, match="give --workers or --scheduler to batch alone"):
        BatchJob(files=[scan], output=tmp_path / "out", command="patch --workers=2").run()


@pytest.mark.slow
def test_two_workers_write_the_bytes_of_none(tmp_path, scan):
    assert fit(scan, tmp_path / "spread", workers=2) == fit(scan, tmp_path / "plain")


@pytest.mark.slow
def test_chunks_of_zarr_are_read_by_workers(tmp_path):
    zarr = pytest.importorskip("zarr")
    volume, _ = wheat_ct(size=(720, 720, 480))
    array = zarr.create_array(tmp_path / "ct.zarr", shape=volume.shape, chunks=(8, 8, 8), dtype="float32")
    array[:] = volume.data
    given = {"voxel_spacing": 24.0, "ct_unit": "um", "ct_layout": "axes=xyz"}
    spread = fit(tmp_path / "ct.zarr", tmp_path / "spread", workers=2, **given)
    assert spread == fit(tmp_path / "ct.zarr", tmp_path / "plain", **given)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_what_a_killed_worker_had_is_done_by_another(tmp_path, scan, monkeypatch):
    each, killed = Spread.each, []

    def killing(self, function, arguments):
        for number, result in each(self, function, arguments):
            if type(function).__name__ == "WorkerSolver" and not killed:
                killed.append(self.cluster.processes()[0])
                os.kill(killed[0], signal.SIGKILL)
            yield number, result

    monkeypatch.setattr(Spread, "each", killing)
    assert fit(scan, tmp_path / "spread", workers=2) == fit(scan, tmp_path / "plain")
    assert len(killed) == 1


@pytest.mark.slow
def test_a_scheduler_and_workers_that_run_elsewhere(tmp_path, scan):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    path = os.environ | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    port = address.rpartition(":")[2]
    commands = [
        ["dask_scheduler", "--host", "127.0.0.1", "--port", port, "--dashboard-address", ":0"],
        *[["dask_worker", address, "--nthreads", "1", "--local-directory", str(tmp_path / name)] for name in "ab"],
    ]
    running = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]], env=path, cwd=tmp_path,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for words in commands
    ]  # fmt: skip
    try:
        assert fit(scan, tmp_path / "spread", scheduler=address) == fit(scan, tmp_path / "plain")
    finally:
        for each in reversed(running):
            each.terminate()
            each.wait(60)
