"""What has a name and is no file keeps it; a link leads to what is written."""

import os
import shutil
import socket
import stat
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mesh_fields import sphere
from o3dleaf.core.atomic_files import require_free, require_writable, whole_file, whole_folder, write_json, write_text
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.io.triangle_mesh import write_mesh
from o3dleaf.leaf.ct.formats.tiff import write_volume
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.output.export.consumers import export_mesh
from o3dleaf.output.export.particles import Particles, export_particles
from o3dleaf.surface.isosurface.isosurface import extract_isosurface

pipes = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pipes, sockets and devices among its files")
links = pytest.mark.skipif(sys.platform == "win32", reason="Windows lets few users make links")


def make(kind, path):
    """Put what is no regular file at a path."""
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as ear:
            ear.bind(str(path))
    else:
        path.symlink_to("/dev/null")


@pipes
@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("kind", ["folder", "pipe", "socket", "device"])
def test_what_is_no_file_is_refused_and_stays(tmp_path, monkeypatch, kind, linked):
    monkeypatch.chdir(tmp_path)  # the name of a socket has 100 letters at most
    make(kind, tmp_path / "out.ply")
    if linked:
        (tmp_path / "link.ply").symlink_to("out.ply")
    name = "link.ply" if linked else "out.ply"
    before = {path.name: path.stat() for path in tmp_path.iterdir()}

    def write():
        with whole_file(name):
            pytest.fail("a name to write to was given")

    for refuse in (write, lambda: require_writable(name, (".ply",)), lambda: require_writable(name)):
        with pytest.raises(InputError, match=rf"{name}: is a {kind}.*; give the name of a file"):
            refuse()
    assert {path.name: path.stat() for path in tmp_path.iterdir()} == before


@links
@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path, there):
    for folder in ("here", "far"):
        (tmp_path / folder).mkdir()
    target, link = tmp_path / "far" / "model.bin", tmp_path / "here" / "model.o3l"
    link.symlink_to("../far/model.bin")
    if there:
        target.write_text("old")
    require_writable(link, (".o3l",))
    require_free(link, 1)
    with whole_file(link) as temporary:
        assert temporary.suffix == ".o3l"
        temporary.write_text("new")
        assert not target.exists() or target.read_text() == "old"
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert [path.name for folder in ("here", "far") for path in (tmp_path / folder).iterdir()] == [
        link.name,
        target.name,
    ]


@links
def test_a_link_that_leads_nowhere_is_refused(tmp_path):
    for link, target in (("ring", "ring"), ("lost", "no folder/file")):
        (tmp_path / link).symlink_to(target)
        with pytest.raises(InputError, match=r"written.*; choose another"):
            require_writable(tmp_path / link)
        assert (tmp_path / link).is_symlink()


@pipes
def test_every_writer_asks(tmp_path):
    os.mkfifo(tmp_path / "ct.tif")
    os.mkfifo(tmp_path / "ball.ply")
    with pytest.raises(InputError, match="is a pipe"):
        write_volume(Volume(np.zeros((2, 2, 2)), np.ones(3), np.zeros(3), "um"), tmp_path / "ct.tif")
    with pytest.raises(InputError, match="is a pipe"):
        write_mesh(extract_isosurface(sphere(), 0.3), tmp_path / "ball.ply")
    assert all(stat.S_ISFIFO(path.stat().st_mode) for path in tmp_path.iterdir())


@pipes
@pytest.mark.parametrize(
    "words",
    [
        ("leaf", "missing.ply", "-o", "pipe.ply"),
        ("leaf", "missing.ply", "-o", "leaf.ply", "--model", "pipe.o3l"),
        ("leaf", "missing.ply", "-o", "pipe.stl"),  # its picture
        ("reconstruct", "missing.ply", "-o", "pipe.ply"),
        ("patch", "missing.tif", "-o", "model.o3l", "--tile-solid", "pipe.ply", "--spacing", "1"),
        ("info", "missing.ply", "--json", "pipe.json"),
        ("qa", "missing.ply", "--json", "pipe.json"),
        ("qa", "missing.ply", "--html", "pipe.html"),
        ("clean", "missing.ply", "-o", "pipe.ply"),
        ("export", "missing.ply", "-o", "pipe.ply"),
    ],
    ids=" ".join,
)
def test_a_command_refuses_before_it_reads(run, tmp_path, monkeypatch, words):
    """The input is not there, and the command never gets to say so."""
    monkeypatch.chdir(tmp_path)
    for suffix in ("ply", "o3l", "json", "html", "png"):
        os.mkfifo(f"pipe.{suffix}")
    result = run(*words)
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert "is a pipe" in result.stderr
    assert all(stat.S_ISFIFO(path.stat().st_mode) for path in tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="elsewhere nobody's files are removed")
def test_what_a_killed_process_left_goes_with_the_next_run(tmp_path):
    """And nothing else: not what a running process is writing, nor what another machine or a person made."""
    code = "import os, signal, sys\nfrom o3dleaf.core.atomic_files import whole_file\n"
    code += "with whole_file(sys.argv[1]):\n    os.kill(os.getpid(), signal.SIGKILL)"
    subprocess.run([sys.executable, "-c", code, tmp_path / "mesh.ply"], check=False, timeout=60)
    left = [path.name for path in tmp_path.iterdir()]
    assert len(left) == 1
    assert left[0].startswith(".mesh.o3dleaf-")
    others = [left[0].replace("o3dleaf-", "o3dleaf-elsewhere"), ".mesh.o3dleaf-notes.ply", left[0][1:]]
    for name in others:
        (tmp_path / name).touch()
    with whole_file(tmp_path / "other.ply") as new:
        require_writable(tmp_path / "third.ply")
        assert new.exists()
        assert not (tmp_path / left[0]).exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*others, "other.ply"])


@pytest.mark.parametrize("write", [require_writable, lambda path: write_text("", path)], ids=["asked for", "written"])
def test_an_interruption_as_a_file_is_made_leaves_nothing(tmp_path, monkeypatch, write):
    def interrupted(*words):
        os.close(make_file(*words))
        raise KeyboardInterrupt

    make_file = os.open
    monkeypatch.setattr(os, "open", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "leaf.ply")
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_as_a_folder_is_made_leaves_nothing(tmp_path, monkeypatch):
    def interrupted(folder):
        make_folder(folder)
        raise KeyboardInterrupt

    make_folder = Path.mkdir
    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "case", "case.json", "*.csv"):
        pass
    assert list(tmp_path.iterdir()) == []


def nearly_full(monkeypatch, free):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free))


@pytest.mark.parametrize("name", ["ball.ply", "ball.stl", "ball.obj", "foam.stl", "web.glb", "view.vtp"])
def test_room_for_a_mesh_is_asked_for_before_it_is_written(tmp_path, monkeypatch, name):
    mesh = extract_isosurface(sphere(), 0.3)
    consumer = {"foam": "openfoam", "web": "web", "view": "paraview"}.get(name.split(".")[0])

    def write():
        if consumer is None:
            write_mesh(mesh, tmp_path / name)
        else:
            export_mesh(mesh, tmp_path / name, unit="mm", consumer=consumer)

    write()
    size = (tmp_path / name).stat().st_size
    (tmp_path / name).unlink()
    # Of a text of digits the least that it can take is known.
    nearly_full(monkeypatch, size // 8 if name.endswith(".obj") else 0.95 * size)
    with pytest.raises(O3DLeafError, match=rf"{name}: could not be written \(it takes .* are free\); free space"):
        write()
    assert not list(tmp_path.iterdir())
    nearly_full(monkeypatch, size)
    write()
    assert (tmp_path / name).stat().st_size == size


def test_room_for_what_is_no_mesh_is_asked_for_too(tmp_path, monkeypatch):
    points = np.random.default_rng(0).uniform(size=(500, 3))
    particles = Particles(points, None, np.ones(500))
    volume = Volume(np.arange(1000.0).reshape(10, 10, 10), np.ones(3), np.zeros(3), "um")
    write = {
        "ct.tif": lambda path: write_volume(volume, path),
        "note.json": lambda path: write_json({"a": "b" * 5000}, path),
        "points.csv": lambda path: export_particles(particles, path),
        "points.vtp": lambda path: export_particles(particles, path),
        "points.ply": lambda path: export_particles(particles, path),
    }
    nearly_full(monkeypatch, 2000)
    for name, written in write.items():
        with pytest.raises(O3DLeafError, match=rf"{name}.*free"):
            written(tmp_path / name)
        assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="elsewhere files have no such permissions")
def test_a_new_file_has_the_permissions_of_any_other_and_the_mask_is_left_alone(tmp_path, monkeypatch):
    """Another thread would make its files while it is changed."""
    (tmp_path / "plain").write_text("1")
    monkeypatch.setattr(os, "umask", None)
    write_text("1", tmp_path / "whole")
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode
