"""One command for many files: each result is that of its own command, and no file stops the others."""

import csv
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.commands.batch import BatchJob, Piece
from o3dleaf.commands.reconstruct import ReconstructJob
from o3dleaf.core.errors import InputError
from o3dleaf.core.processes.cluster import cluster_of
from o3dleaf.samples import Torus


@pytest.fixture
def scans(tmp_path):
    """A folder of two clouds."""
    folder = tmp_path / "scans"
    folder.mkdir()
    for seed, name in enumerate(("a", "b")):
        points, _ = Torus().sample(600, seed=seed)
        o3d.io.write_point_cloud(folder / f"{name}.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    return folder


def run(tmp_path, **given):
    job = BatchJob(**{"output": tmp_path / "out", "command": "reconstruct", **given})
    rows = job.run()
    return job, rows


def test_each_result_is_that_of_its_own_command_and_a_broken_file_stops_none(tmp_path, scans):
    (scans / "broken.ply").write_text("ply\nformat ascii 1.0\nelement vertex 3\n")
    job, rows = run(tmp_path, files=[scans])
    ReconstructJob(cloud=scans / "b.ply", output=tmp_path / "alone.ply").run()
    assert (tmp_path / "out" / "b.ply").read_bytes() == (tmp_path / "alone.ply").read_bytes()
    assert [(Path(row.file).name, row.done) for row in rows] == [
        ("a.ply", True), ("b.ply", True), ("broken.ply", False),
    ]  # fmt: skip
    assert job.exit_code(rows) == 1
    assert job.lines(rows)[0].startswith(f"{scans / 'broken.ply'}: ")
    assert job.line(rows).endswith("2 of 3 files done")
    with (tmp_path / "out" / "batch.csv").open(newline="") as stream:
        table = list(csv.DictReader(stream))
    assert [row["genus"] for row in table] == ["1", "1", ""]
    assert float(table[0]["area"]) == rows[0].figures["area"]
    assert not (tmp_path / "out" / "broken.ply").exists()


def test_a_file_that_vanishes_or_needs_too_much_is_a_line_of_the_table(tmp_path, scans):
    (scans / ".hidden.ply").write_text("no scan")
    many = np.random.default_rng(0).random((300_000, 3))
    o3d.io.write_point_cloud(scans / "b.ply", o3d.geometry.PointCloud(o3d.utility.Vector3dVector(many)))
    job = BatchJob(files=[scans], output=tmp_path / "out", command="reconstruct", memory="1MB")
    job.check()
    assert job.estimate() == []
    first, second = job.pieces
    (scans / "a.ply").unlink()
    gone, large = first.run(), second.run()
    assert (gone.done, large.done) == (False, False)
    assert "a.ply" in gone.said
    assert "300,000 points need" in large.said


def test_what_is_done_is_left_out_until_its_input_or_its_options_are_others(tmp_path, scans):
    def written():
        return {file.name: file.stat().st_mtime_ns for file in (tmp_path / "out").glob("?.ply")}

    run(tmp_path, files=[scans])
    first = written()
    _, rows = run(tmp_path, files=[scans], resume=True)
    assert written() == first
    assert [row.done for row in rows] == [True, True]
    os.utime(scans / "a.ply", (1, 1))
    run(tmp_path, files=[scans], resume=True)
    again = written()
    assert again["a.ply"] != first["a.ply"]
    assert again["b.ply"] == first["b.ply"]
    (tmp_path / "out" / "batch.json").write_text("{")
    run(tmp_path, files=[scans], resume=True, command="reconstruct --untrimmed")
    assert written()["b.ply"] != first["b.ply"]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"command": "qa"}, "begin with one of leaf, reconstruct, clean, patch"),
        ({"command": ""}, "begin with one of"),
        ({"command": "reconstruct --help"}, "leave it out"),
        ({"command": "reconstruct 'x"}, "close its quotes"),
        ({"command": "reconstruct --closed sideways"}, "unknown 'sideways'"),
        ({"workers": 0}, "at least 1"),
    ],
)
def test_what_no_file_can_have_is_refused_before_the_first(tmp_path, scans, given, says):
    with pytest.raises(InputError, match=says):
        run(tmp_path, files=[scans], **given)
    assert not (tmp_path / "out").exists()


def test_a_file_that_is_missing_and_a_folder_of_none_are_refused_before_the_first(tmp_path, scans):
    (tmp_path / "empty").mkdir()
    for place, says in ((scans / "c.ply", "no such file"), (tmp_path / "empty", "holds no file")):
        with pytest.raises(InputError, match=says):
            run(tmp_path, files=[scans, place])


def test_two_files_of_one_name_are_refused(tmp_path, scans):
    np.savetxt(scans / "a.xyz", np.zeros((3, 3)))
    with pytest.raises(InputError, match=r"a\.ply"):
        run(tmp_path, files=[scans])


def test_without_dask_the_line_says_what_to_install(tmp_path, scans, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'o3dleaf\[cluster\]'"):
        run(tmp_path, files=[scans], workers=2)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("o3dleaf.core.processes.cluster.SECONDS", "200ms")
    with (
        pytest.raises(InputError, match="nothing answers at tcp"),
        cluster_of(scheduler="tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.slow
def test_two_workers_write_the_bytes_of_none(tmp_path, scans):
    run(tmp_path, files=[scans], output=tmp_path / "plain")
    _, rows = run(tmp_path, files=[scans], workers=2)
    assert all(row.done for row in rows)
    for name in ("a.ply", "b.ply"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "plain" / name).read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_an_interrupt_does_not_wait_for_what_workers_do():
    """Dask alone takes four seconds, and what they do here takes a minute."""
    with pytest.raises(KeyboardInterrupt), cluster_of(2) as cluster:  # noqa: PT012 - the clock starts inside
        processes = cluster.processes()
        threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
        started = time.monotonic()
        list(cluster.map(time.sleep, [60.0] * 4))
    assert time.monotonic() - started < 3.0
    for process in processes:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_what_a_killed_worker_had_is_done_by_another_to_the_same_bytes(tmp_path, scans):
    for number in range(6):
        points, _ = Torus().sample(4000, seed=number)
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        o3d.io.write_point_cloud(scans / f"more{number}.ply", cloud)
    job = BatchJob(files=[scans], output=tmp_path / "out", command="reconstruct")
    (tmp_path / "out").mkdir()
    rows = {}
    with cluster_of(2) as cluster:
        first, _ = cluster.processes()
        for number, row in cluster.map(Piece.run, job.pieces):
            if not rows:
                os.kill(first, signal.SIGKILL)
            rows[number] = row
    assert len(rows) == 8
    assert all(row.done for row in rows.values())
    made = {file.name: file.read_bytes() for file in (tmp_path / "out").glob("*.ply")}
    run(tmp_path, files=[scans], output=tmp_path / "plain")
    assert made == {file.name: file.read_bytes() for file in (tmp_path / "plain").glob("*.ply")}
