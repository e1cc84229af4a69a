"""``o3dleaf clean``: a mesh cleaned, simplified on request, and compared with what it was."""

import inspect
from dataclasses import fields, replace

import numpy as np
import open3d as o3d
import pytest
from typer.testing import CliRunner

import o3dleaf as o3l
from o3dleaf.commands.clean import CleaningOptions, CleanJob
from o3dleaf.commands.cli import app
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays


@pytest.fixture(scope="module")
def ball():
    return mesh_arrays(o3d.geometry.TriangleMesh.create_icosahedron(1.0).subdivide_loop(2))


def test_the_command_shows_before_and_after(ball, tmp_path):
    dirty, clean = tmp_path / "dirty.ply", tmp_path / "clean.ply"
    vertices, triangles = ball
    mesh = build_mesh(vertices, np.concatenate([np.delete(triangles, [0, 3], axis=0), triangles[8:10]]))
    mesh.paint_uniform_color([0.2, 0.4, 0.6])
    o3d.io.write_triangle_mesh(str(dirty), mesh)
    arguments = ["clean", dirty, "--largest-hole", "5", "--triangles", "200", "--quiet", "-o", clean]
    assert CliRunner().invoke(app, [str(each) for each in arguments]).exit_code == 0
    found = o3d.io.read_triangle_mesh(str(clean))
    assert (len(found.triangles), found.is_watertight()) == (200, True)
    arguments[-3:] = ["-o", clean]
    arguments[4:6] = []
    said = CliRunner().invoke(app, [str(each) for each in arguments]).stdout
    table = {line[:22].strip(): line[22:].split() for line in said.splitlines()}
    assert table["duplicate triangles"] == ["2", "0"]
    assert table["boundary edges"] == [str(o3l.mesh_report(mesh).boundary_edges), "0"]
    assert table["triangles"] == ["320", "320"]
    kept = np.asarray(o3d.io.read_triangle_mesh(str(clean)).vertex_colors)
    assert np.allclose(kept, [0.2, 0.4, 0.6])


def test_a_job_keeps_labels_and_measures_what_simplifying_moved(ball, tmp_path):
    labels = np.where(ball[0][ball[1]].mean(axis=1)[:, 2] > 0, 2, 0)
    given = o3l.LabelledMesh(build_mesh(ball[0], ball[1][2:]), labels[2:].astype(np.uint8))
    o3l.export_mesh(given, tmp_path / "dirty.ply")
    job = CleanJob(tmp_path / "dirty.ply", tmp_path / "clean.ply", largest_hole=5.0, triangles=160)
    comparison, written = job.run(), o3l.read_mesh(tmp_path / "clean.ply")
    mesh, left = written.mesh, written.labels
    assert (len(left), set(left), o3l.mesh_report(mesh).watertight) == (len(mesh.triangles), {0, 2}, True)
    assert comparison.table()[-1].split()[-1] == f"{comparison.distance:.6g}"
    assert [report.triangles for report in comparison.reports] == [318, 320, 160]
    assert 0 < comparison.distance < 0.2


def test_the_options_are_the_arguments_of_clean_mesh():
    arguments = list(inspect.signature(o3l.clean_mesh).parameters.values())[1:]
    assert {each.name: each.default for each in arguments} == {
        each.name: each.default for each in fields(CleaningOptions)
    }


@pytest.fixture(scope="module")
def scroll(tmp_path_factory):
    """The file of a sheet of two turns, with a round rim of far more edges than its shape asks for."""
    across = np.linspace(-1.0, 1.0, 81)
    u, v = np.meshgrid(across, across, indexing="ij")
    rows = np.arange(81 * 81).reshape(81, 81)
    one = np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:]], axis=-1).reshape(-1, 3)
    other = np.stack([rows[:-1, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 3)
    angle, radius = 2 * np.pi * u, 1 + 0.3 * u
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), 3 * v], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([one, other])
    round_inside = np.hypot(u.ravel()[triangles].mean(axis=1), v.ravel()[triangles].mean(axis=1)) < 0.95
    path = tmp_path_factory.mktemp("clean") / "scroll.ply"
    o3l.write_mesh(build_mesh(vertices, triangles[round_inside]), path)
    return path


def test_triangles_that_are_left_for_the_rim_are_told(scroll, tmp_path):
    rim = o3l.mesh_report(o3l.read_mesh(scroll).mesh).boundary_edges
    few = CleanJob(scroll, tmp_path / "few.ply", triangles=rim // 2, quiet=True).run()
    left = few.reports[-1]
    assert (left.self_intersections, left.boundary_edges) == (0, rim)
    (line,) = few.warnings
    assert line.startswith(
        f"simplified to {left.triangles:,} triangles, not to the {rim // 2:,} asked for: the {rim:,} "
    )
    more = CleanJob(scroll, tmp_path / "more.ply", triangles=2 * rim, quiet=True).run()
    assert more.reports[-1].triangles <= 2 * rim
    assert not more.warnings
    assert not replace(few, asked=None).warnings


@pytest.mark.slow
def test_a_mesh_that_crossed_itself_and_does_so_more_is_told(scroll, tmp_path):
    vertices, triangles = mesh_arrays(o3l.read_mesh(scroll).mesh)
    pierced = np.concatenate([vertices, [[-0.9, 0, 0], [-0.8, 0.01, 0], [-0.8, 0, 0.01]]])
    through = np.concatenate([triangles, len(vertices) + np.arange(3)[np.newaxis]])
    o3l.write_mesh(build_mesh(pierced, through), tmp_path / "pierced.ply")
    words = ["clean", str(tmp_path / "pierced.ply"), "--triangles", "50", "-o", str(tmp_path / "few.ply")]
    said = " ".join(CliRunner().invoke(app, words).stderr.split())
    assert "the simplified mesh crosses itself" in said
    assert "clean it with --untangle" in said
    said = " ".join(CliRunner().invoke(app, [*words, "--untangle"]).stderr.split())
    assert "crosses itself" not in said
