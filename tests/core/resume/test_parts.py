"""A run that was stopped goes on from what it had finished, to the same bytes; other input begins anew."""

import json

import numpy as np
import open3d as o3d
import pytest

import o3dleaf as o3l
from leaf_fields import leaf_of, texture
from o3dleaf.commands.reconstruct import ReconstructJob
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.resume.blocks import kept
from o3dleaf.core.resume.parts import SUFFIX, Parts, key_of, resuming
from o3dleaf.samples import wheat_ct
from o3dleaf.surface.reconstruction import reconstruct


class Stopped(BaseException):
    """What ends a run in the middle."""


def numbers(made):
    """An object that is saved as text."""

    class Number(int):
        def save(self, path):
            path.write_text(str(int(self)))

    made.append(1)
    return Number(len(made))


def test_what_was_made_is_made_once_for_its_key_and_gone_at_the_end(tmp_path):
    path, made = tmp_path / "out.ply", []

    def run(key, *, stop):
        with resuming(path, key, lambda part: int(part.read_text())) as parts:
            got = kept("a.o3l", lambda: numbers(made))
            parts.record("rows", 7)
            if stop:
                raise Stopped
        return got

    for _ in range(2):
        with pytest.raises(Stopped):
            run("one", stop=True)
    assert len(made) == 1
    assert json.loads((tmp_path / f"out.ply{SUFFIX}" / "state.json").read_text()) == {"key": "one", "rows": 7}
    with pytest.raises(Stopped):
        run("two", stop=True)  # of other input: anew
    assert run("two", stop=False) == len(made) == 2
    assert not list(tmp_path.iterdir())
    assert kept("a.o3l", lambda: numbers(made)) == 3  # nothing to be resumed


def test_the_fit_of_a_volume_is_kept(tmp_path, monkeypatch):
    volume, _ = wheat_ct(size=(720, 720, 480))

    def not_again(*given, **options):
        raise AssertionError

    def stopped():
        with resuming(tmp_path / "leaf.ply", "one", o3l.load):
            o3l.create_texture(volume)
            raise Stopped

    with pytest.raises(Stopped):
        stopped()
    whole = o3l.create_texture(volume)
    monkeypatch.setattr(o3l.PUInterpolant, "fit_lattice", not_again)
    with resuming(tmp_path / "leaf.ply", "one", o3l.load):
        goes_on = o3l.create_texture(volume)
    places = np.random.default_rng(0).uniform([0, 0, -100], [400, 400, 100], (200, 3))
    np.testing.assert_array_equal(goes_on(places), whole(places))


def test_a_key_knows_content_and_options(tmp_path):
    (tmp_path / "a").write_bytes(b"1")
    before = key_of([tmp_path / "a"], {"rho": 1.0})
    assert before == key_of([tmp_path / "a"], {"rho": 1.0})
    assert before != key_of([tmp_path / "a"], {"rho": 2.0})
    (tmp_path / "a").write_bytes(b"2")
    assert before != key_of([tmp_path / "a"], {"rho": 1.0})


def test_a_key_knows_the_files_in_folders_of_a_folder(tmp_path):
    """An OME-Zarr volume is one."""
    inner = tmp_path / "a.zarr" / "0" / "c"
    inner.mkdir(parents=True)
    (inner / "0").write_bytes(b"1")
    before = key_of([tmp_path / "a.zarr"], {})
    assert before == key_of([tmp_path / "a.zarr"], {})
    (inner / "0").write_bytes(b"2")
    assert before != key_of([tmp_path / "a.zarr"], {})


@pytest.mark.few
@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
@pytest.mark.parametrize("rows", [1, 2])
def test_a_streamed_leaf_goes_on_after_its_finished_rows(suffix, rows, tmp_path, monkeypatch):
    plan = leaf_of(texture(lambda x, y, z: 0.04 - z**2))[0].plan_mesh(0.1)
    whole, path = tmp_path / f"whole{suffix}", tmp_path / f"leaf{suffix}"
    plan.write(whole)
    record, lifted = Parts.record, []

    def stopping(self, name, value):
        record(self, name, value)
        if value == rows:
            raise Stopped

    with monkeypatch.context() as patched:
        patched.setattr(Parts, "record", stopping)
        with pytest.raises(Stopped), resuming(path, "key", o3l.load):
            plan.write(path)
    assert not path.exists()
    lift = plan.leaf.blade.lift
    monkeypatch.setattr(type(plan.leaf.blade), "lift", lambda self, flat: (lifted.append(len(flat)), lift(flat))[1])
    with resuming(path, "key", o3l.load):
        plan.write(path)
    assert path.read_bytes() == whole.read_bytes()
    assert 0 < sum(lifted) < plan.vertices
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted([whole.name, path.name])


def test_a_reconstruction_goes_on_from_its_fit(tmp_path, monkeypatch):
    points = np.random.default_rng(0).normal(size=(600, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    cloud = tmp_path / "cloud.ply"
    o3d.io.write_point_cloud(str(cloud), o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    ReconstructJob(cloud, tmp_path / "whole.ply").run()

    def fail(*_):
        raise ReconstructionError("stopped")

    job = ReconstructJob(cloud, tmp_path / "mesh.ply", resume=True)
    with monkeypatch.context() as patched:
        patched.setattr(reconstruct, "follow_surface", fail)
        with pytest.raises(ReconstructionError):
            job.run()
    monkeypatch.setattr(reconstruct, "fit_surface", fail)
    job.run()
    assert (tmp_path / "mesh.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()
    assert not (tmp_path / f"mesh.ply{SUFFIX}").exists()
