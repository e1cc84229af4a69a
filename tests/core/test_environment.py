"""The same bytes whatever the place, the language, the hash seed, the optimization or the number of threads."""

import hashlib
import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SMALL = """
import hashlib, sys
import numpy as np, o3dleaf as o3l
from o3dleaf.core.parallel import set_num_threads
set_num_threads(int(sys.argv[1]))
points = np.random.default_rng(0).uniform(size=(800, 3))
field = o3l.PUInterpolant.fit(points, np.sin(points @ [3.0, 2.0, 1.0]), points_per_ball=(30, 60), rho="gcv")
field.save(sys.argv[2])
print(hashlib.sha256(open(sys.argv[2], "rb").read() + field.gradient(points).tobytes()).hexdigest())
"""
"""A fit over balls on some threads, its model file and its gradients."""

LARGE = """
import hashlib, sys
import numpy as np, open3d as o3d, o3dleaf as o3l
from o3dleaf.core.parallel import set_num_threads
from o3dleaf.io.models.model_file import write_model
set_num_threads(int(sys.argv[1]))
points, normals = o3l.samples.Torus().sample(4000, seed=1)
cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
mesh, field = o3l.create_from_point_cloud_rbfpu(cloud)
o3l.write_mesh(o3l.clean_mesh(mesh), sys.argv[2] + ".ply")
field.save(sys.argv[2])
content = b"".join(open(name, "rb").read() for name in (sys.argv[2], sys.argv[2] + ".ply"))
leaf = o3l.create_blade(o3l.samples.wheat_scan(count=400).cloud)
write_model(leaf, sys.argv[2])
print(hashlib.sha256(content + open(sys.argv[2], "rb").read()).hexdigest())
"""
"""A surface from a cloud without normals, its field, and a blade."""

ENVIRONMENTS = {
    "as it is": ([], {}, 2),
    "C": ([], {"LANG": "C", "LC_ALL": "C", "PYTHONHASHSEED": "0", "TERM": "dumb"}, 1),
    "optimized": (["-O"], {"PYTHONHASHSEED": "4242", "OMP_NUM_THREADS": "3", "OPENBLAS_NUM_THREADS": "2"}, 4),
    "no home": ([], {"HOME": os.devnull, "XDG_CACHE_HOME": os.devnull, "PYTHONHASHSEED": "7"}, 3),
    "docstrings left out": (["-OO"], {"PYTHONHASHSEED": "1"}, 2),
    "isolated from the user": (["-s", "-B"], {"PYTHONUTF8": "0"}, 5),
}


def sum_of(code, folder, name):
    options, extra, threads = ENVIRONMENTS[name]
    place = folder / name
    place.mkdir()
    path = os.pathsep.join(each or str(Path.cwd()) for each in sys.path)
    run = subprocess.run(
        [sys.executable, *options, "-c", code, str(threads), "model.o3l"],
        cwd=place, env=os.environ | {"PYTHONPATH": path} | extra, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr[-2000:]
    return run.stdout.split()[-1]


def test_a_fit_is_the_same_anywhere(tmp_path, monkeypatch, capsys):
    """In a process of its own as in this one."""
    monkeypatch.setattr(sys, "argv", ["here", "2", str(tmp_path / "here.o3l")])
    exec(SMALL, {})
    assert sum_of(SMALL, tmp_path, "optimized") == capsys.readouterr().out.strip()


@pytest.mark.slow
def test_a_surface_and_a_blade_are_the_same_anywhere(tmp_path):
    assert len({sum_of(LARGE, tmp_path, name) for name in ENVIRONMENTS}) == 1


@pytest.mark.slow
def test_code_that_was_just_compiled_gives_the_same_bytes(tmp_path, monkeypatch):
    """As code that was loaded: nothing is found in an empty folder, the second run finds what the first one kept."""
    cached = sum_of(SMALL, tmp_path, "as it is")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    fresh = sum_of(SMALL, tmp_path, "C")
    assert any((tmp_path / "cache").rglob("*.code"))
    assert cached == fresh == sum_of(SMALL, tmp_path, "optimized")


@pytest.fixture
def _threads_as_before():
    from o3dleaf.core.parallel import get_num_threads, set_num_threads

    before = get_num_threads()
    yield
    set_num_threads(before)


def fit_and_extract(threads):
    """The bytes of a fit, of its gradients and of its surface, on some threads; at the top, where spawn finds it."""
    import o3dleaf as o3l
    from o3dleaf.core.parallel import set_num_threads

    set_num_threads(threads)
    points, _ = o3l.samples.Torus().sample(600, seed=3)
    field = o3l.PUInterpolant.fit(points, np.sin(points @ [9.0, 7.0, 8.0]), points_per_ball=(30, 60))
    mesh = o3l.extract_isosurface(field, 0.1)
    parts = field(points), field.gradient(points), np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    assert len(parts[-1]) > 100
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no fork")
@pytest.mark.usefixtures("_threads_as_before")
@pytest.mark.parametrize("threads", [1, 3])
def test_a_forked_process_gives_the_same_bytes(threads):
    """Of fit and surface as the parent, whose threads it has not."""
    before = fit_and_extract(2)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map(fit_and_extract, [threads] * 2, chunksize=1) == [before] * 2
    assert fit_and_extract(4) == before  # the parent's threads work on


@pytest.mark.slow
@pytest.mark.usefixtures("_threads_as_before")
@pytest.mark.parametrize("way", ["spawn", "forkserver"])
def test_a_process_that_begins_anew_gives_the_same_bytes(way):
    if way not in multiprocessing.get_all_start_methods():
        pytest.skip("Windows has no fork")
    with multiprocessing.get_context(way).Pool(2) as pool:
        assert set(pool.map(fit_and_extract, [1, 4], chunksize=1)) == {fit_and_extract(2)}


def test_several_threads_call_at_once(tmp_path):
    """Each gets what it would get alone, though all share one pool."""
    from concurrent.futures import ThreadPoolExecutor

    import o3dleaf as o3l

    points = np.random.default_rng(0).uniform(size=(600, 2))

    def fit(number):
        field = o3l.PUInterpolant.fit(points, np.sin(number * points[:, 0]), points_per_ball=(20, 40))
        return field(points), field.gradient(points)

    alone = [fit(number) for number in range(6)]
    with ThreadPoolExecutor(6) as threads:
        together = list(threads.map(fit, range(6)))
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_beside_other_users_of_openmp_and_blas():
    """Open3D's OpenMP loops and BLAS at all cores run in threads beside ours: nobody waits, nothing changes."""
    import threading

    import open3d as o3d

    import o3dleaf as o3l

    points = np.random.default_rng(0).uniform(size=(600, 2))

    def ours():
        return o3l.PUInterpolant.fit(points, np.sin(points[:, 0]), points_per_ball=(20, 40))(points)

    alone, stop, rounds = ours(), threading.Event(), []
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.random.default_rng(1).uniform(size=(2000, 3))))
    matrix = np.random.default_rng(2).uniform(size=(300, 300))

    def others():
        while not stop.is_set():
            cloud.estimate_normals()
            np.linalg.solve(matrix, matrix)
            rounds.append(1)

    thread = threading.Thread(target=others)
    thread.start()
    try:
        while not rounds:
            pass
        beside = [ours() for _ in range(3)]
    finally:
        stop.set()
        thread.join()
    for one in beside:
        np.testing.assert_array_equal(one, alone)
