"""Memory at the command line: what an option or a shell allows is held to, and memory that runs out is one line."""

import subprocess
import sys

import numpy as np
import open3d as o3d
import pytest

from o3dleaf.commands import cli
from o3dleaf.core.resources import machine, needs
from o3dleaf.core.resources.measured import RECONSTRUCTED_POINT
from o3dleaf.io.clouds.counts import count_points, count_triangles
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import write_mesh

ADDRESSES = 4_000_000
"""KiB, of `ulimit -v`."""
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="ulimit -v counts elsewhere otherwise, or not at all")


def run(monkeypatch, capsys, *words):
    """Run the command line here; return its exit code and its lines."""
    monkeypatch.setattr(sys, "argv", ["o3dleaf", *map(str, words)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    said = capsys.readouterr()
    return end.value.code or 0, said.out.splitlines(), said.err.strip().splitlines()


def sphere(count):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def cloud(tmp_path_factory):
    path = tmp_path_factory.mktemp("cloud") / "cloud.ply"
    o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(sphere(50_000))))
    return path


def test_what_needs_more_is_refused_in_one_line_and_an_estimate_says_how_much(cloud, tmp_path, monkeypatch, capsys):
    job = ("reconstruct", cloud, "-o", tmp_path / "mesh.ply")
    code, out, _ = run(monkeypatch, capsys, *job, "--estimate")
    assert code == 0
    assert float(out[0].split("about ")[1].split(" MB")[0]) == pytest.approx(
        1.3e-6 * RECONSTRUCTED_POINT.bytes * 5e4, rel=0.02
    )
    code, out, errors = run(monkeypatch, capsys, *job, "--memory", "1MB")
    assert (code, out, len(errors)) == (2, [], 1)
    assert "50,000 points need about" in errors[0]
    assert "--memory" in errors[0]
    code, _, errors = run(monkeypatch, capsys, *job, "--estimate", "--memory", "1MB")
    assert (code, len(errors)) == (2, 1)
    code, out, errors = run(monkeypatch, capsys, *job, "--time", "0.1s")
    assert (code, out, len(errors)) == (2, [], 1)
    assert "50,000 points take about" in errors[0]
    assert "--time" in errors[0]
    assert not list(tmp_path.iterdir())


def test_a_mesh_that_there_is_no_room_to_check_is_refused_before_it_is_made(tmp_path, monkeypatch, capsys):
    """Of 5,000 points and 42,000 triangles 30 MB are enough to find the surface, not to load all and check the mesh."""
    path = tmp_path / "cloud.npy"
    np.save(path, sphere(5_000))
    monkeypatch.setattr(needs, "usable_memory", lambda: machine.Limit(30_000_000, "as stated", "state more"))
    job = ("reconstruct", path, "-o", tmp_path / "mesh.ply", "--memory", "1TB")
    code, _, errors = run(monkeypatch, capsys, *job)
    assert code == 2
    assert "triangles need about" in errors[-1]
    assert not (tmp_path / "mesh.ply").exists()


@pytest.mark.parametrize("error", [MemoryError(), MemoryError("of 3 GB"), RuntimeError(cli.NO_THREAD)])
def test_memory_that_runs_out_is_one_line(error, monkeypatch, capsys):
    def fail(**_):
        raise error

    monkeypatch.setattr(cli, "app", fail)
    code, _, errors = run(monkeypatch, capsys)
    assert (code, len(errors)) == (2, 1)
    assert errors[0].startswith("o3dleaf: error: memory ran out")
    assert str(error) in errors[0]


def test_other_errors_of_the_run_are_none_of_memory(monkeypatch):
    def fail(**_):
        raise RuntimeError("another")

    monkeypatch.setattr(cli, "app", fail)
    with pytest.raises(RuntimeError, match="another"):
        cli.main()


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".pts", ".csv"])
def test_points_are_counted_before_they_are_read(suffix, tmp_path):
    path, points = tmp_path / f"cloud{suffix}", sphere(5000)
    if suffix == ".csv":
        np.savetxt(path, points, delimiter=",")
    else:
        o3d.io.write_point_cloud(str(path), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    assert count_points(path) == pytest.approx(len(read_point_cloud(path).points), rel=0.1)


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".off"])
def test_triangles_are_counted_before_they_are_read(suffix, tmp_path):
    mesh, path = o3d.geometry.TriangleMesh.create_sphere(1.0, 20), tmp_path / f"mesh{suffix}"
    o3d.io.write_triangle_mesh(str(path), mesh) if suffix == ".off" else write_mesh(mesh, path)
    count = len(mesh.triangles)
    assert count <= 1.01 * count_triangles(path)
    assert count_triangles(path) < 3 * count


def test_files_that_are_none_count_nothing(tmp_path):
    for name in ("absent.ply", "empty.ply", "words.off", "short.las", "short.pcd"):
        if not name.startswith("absent"):
            (tmp_path / name).write_bytes(b"OFF words")
        assert count_points(tmp_path / name) <= 3
        assert count_triangles(tmp_path / name) == 0


@LINUX
@pytest.mark.slow
@pytest.mark.parametrize("small", [True, False], ids=["small", "large"])
@pytest.mark.parametrize(
    "words",
    [
        "info {mesh}",
        "qa -q {mesh}",
        "clean -q {mesh} -o {out}.ply",
        "export -q {mesh} -o {out}.stl",
        "export -q {ball} --what volume-particles --step {step} -o {out}.vtp",
        "export -q {ball} --what surface-particles --step {step} -o {out}.vtp",
        "render {mesh} -o {out}.png",
        "reconstruct -q {cloud} -o {out}.ply",
        "leaf -q data_samples/wheat_scan.ply --ct data_samples/wheat_ct_24um.tif --spacing {step} -o {out}.ply",
        "patch -q data_samples/wheat_ct_24um.tif -o {out}.o3l",
    ],
)
def test_under_a_limit_of_the_shell_every_job_ends_well_or_is_refused(words, small, tmp_path):
    """By exit code 0, or by one line and exit code 2; and what is small ends well."""
    sphere_mesh = o3d.geometry.TriangleMesh.create_sphere(1.0, 50 if small else 2200)
    write_mesh(sphere_mesh, tmp_path / "mesh.ply")
    write_mesh(o3d.geometry.TriangleMesh.create_sphere(1.0, 30), tmp_path / "ball.ply")
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(sphere(5000 if small else 3_000_000)))
    o3d.io.write_point_cloud(str(tmp_path / "cloud.ply"), cloud)
    names = {name: tmp_path / f"{name}.ply" for name in ("mesh", "ball", "cloud")}
    line = words.format(**names, out=tmp_path / "out", step=0.1 if small else 1e-4)
    limited = f"ulimit -v {ADDRESSES}; exec {sys.executable} -m o3dleaf {line}"
    ended = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, timeout=600, check=False)
    assert ended.returncode in ((0,) if small or "patch" in words else (0, 2)), ended.stderr
    if ended.returncode == 2:
        assert len(ended.stderr.splitlines()) == 1
        assert "need" in ended.stderr
