"""Particles cover a surface and fill a solid: neither crowded nor missing, and together what the mesh is."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from mesh_fields import sphere, torus
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays, triangle_areas
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.output.export import particles as module
from o3dleaf.output.export.consumers import enclosed_volume
from o3dleaf.output.export.particles import export_particles, fill_particles, sample_particles
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import FILLED_VOLUME, ON_LATTICE, ROUNDING

SPACING = 0.11


@pytest.fixture(scope="module")
def ring():
    """A torus whose triangles are labelled by side."""
    mesh = extract_isosurface(torus(), 0.07)
    vertices, triangles = mesh_arrays(mesh)
    side = (vertices[triangles, 0].mean(axis=1) > 0).astype(np.uint8)
    return LabelledMesh(mesh, side, ("left", "right"), "mm")


@pytest.fixture(scope="module")
def cover(ring):
    return sample_particles(ring, SPACING)


def box(low, high):
    """A closed box of twelve triangles."""
    mesh = o3d.geometry.TriangleMesh.create_box(*np.subtract(high, low))
    return mesh.translate(low)


def test_no_two_particles_are_near_and_none_is_missing(ring, cover):
    tree = cKDTree(cover.points)
    assert tree.query(cover.points, 2)[0][:, 1].min() >= SPACING
    # A part of a triangle is at most half a spacing long, and its middle has a particle within the spacing.
    somewhere = np.asarray(ring.mesh.sample_points_uniformly(20_000).points)
    assert tree.query(somewhere)[0].max() < 1.5 * SPACING
    assert tree.query(somewhere)[0].max() > 0.5 * SPACING


def test_areas_add_up_and_labels_stay(ring, cover):
    vertices, triangles = mesh_arrays(ring.mesh)
    areas = triangle_areas(vertices, triangles)
    assert abs(cover.sizes.sum() / areas.sum() - 1) < ROUNDING
    assert cover.sizes.min() > 0
    assert 1.2 < cover.sizes.mean() / SPACING**2 < 1.7
    assert cover.unit == "mm"
    clear = np.abs(cover.points[:, 0]) > 0.1
    assert np.array_equal(cover.labels[clear], (cover.points[clear, 0] > 0).astype(np.uint8))


def test_normals_are_those_of_the_triangles_and_point_outwards(cover):
    x, y, z = (cover.points - [0.013, -0.021, 0.007]).T
    to_core = 1 - 0.8 / np.hypot(x, y)
    outward = np.stack([x * to_core, y * to_core, z], axis=1)
    assert np.einsum("ij,ij->i", cover.normals, outward).min() > 0
    assert np.abs(np.linalg.norm(cover.normals, axis=1) - 1).max() < ROUNDING


def test_both_faces_of_a_thin_blade_are_covered():
    """A sheet a tenth as thick as the particles' spacing: each face has as many as it would have alone."""
    blade = sample_particles(box([0, 0, 0], [4, 4, 0.02]), 0.2)
    top, bottom = (np.sum(blade.normals[:, 2] * sign > 0.9) for sign in (1, -1))
    for count in (top, bottom):
        assert 1.3 < 16 / count / 0.2**2 < 1.6


def test_covering_says_how_far_it_is(ring, cover):
    said = []
    with progress.listening(lambda done, total: said.append((done, total))):
        again = sample_particles(ring, SPACING)
        assert said[-1][0] == said[-1][1]
    assert np.array_equal(again.points, cover.points)
    done, totals = zip(*said, strict=True)
    assert len(set(totals)) == 1
    assert list(done) == sorted(done)
    assert done[0] < totals[0]


def test_particles_do_not_depend_on_threads_but_on_the_seed(ring, cover):
    before = get_num_threads()
    for threads in (1, 3):
        set_num_threads(threads)
        again = sample_particles(ring, SPACING)
        assert np.array_equal(again.points, cover.points)
        assert np.array_equal(again.sizes, cover.sizes)
    set_num_threads(before)
    assert not np.array_equal(sample_particles(ring, SPACING, seed=1).points[:50], cover.points[:50])


def test_a_filled_solid_is_that_of_ray_casting(ring, monkeypatch):
    monkeypatch.setattr(module, "BLOCK", 300)
    step = 0.043
    filled = fill_particles(ring, step)
    number = filled.points / step - 0.5
    assert np.abs(number - np.round(number)).max() < ON_LATTICE
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(ring.mesh))
    grid = (np.stack(np.meshgrid(*[np.arange(-30, 30)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * step
    inside = grid[scene.compute_occupancy(o3d.core.Tensor(grid.astype(np.float32)), nsamples=3).numpy() > 0]
    assert {tuple(row) for row in np.round(inside / step - 0.5).astype(int)} == {
        tuple(row) for row in np.round(number).astype(int)
    }
    assert abs(filled.sizes.sum() / enclosed_volume(*mesh_arrays(ring.mesh)) - 1) < FILLED_VOLUME


@pytest.mark.parametrize("corner", [0.0, 0.125])
def test_a_box_whose_sides_lie_in_the_columns_holds_as_many_as_it_should(corner):
    """Columns along upright sides, edges and diagonals: one side of the box has them, the other has not."""
    filled = fill_particles(box([corner] * 3, [corner + 1] * 3), 0.25)
    assert len(filled.points) == 64
    assert len(np.unique(filled.points, axis=0)) == 64


def test_two_boxes_that_share_a_side_share_no_particle():
    parts = [fill_particles(box([x, 0, 0], [x + 1, 1, 1]), 0.25).points for x in (0.125, 1.125)]
    assert len(np.unique(np.concatenate(parts), axis=0)) == 2 * 64


@pytest.mark.parametrize("suffix", [".ply", ".csv", ".vtp"])
@pytest.mark.parametrize("inside", [False, True])
def test_particles_written_are_read_back_in_the_unit_asked_for(ring, cover, tmp_path, suffix, inside):
    found = fill_particles(ring, 0.1) if inside else cover
    path = tmp_path / f"p{suffix}"
    export_particles(found, path, to_unit="m")
    size, power = ("volume", 3) if inside else ("area", 2)
    scale = 1e-3
    if suffix == ".ply":
        cloud = o3d.t.io.read_point_cloud(str(path))
        points, sizes = cloud.point.positions.numpy(), cloud.point[size].numpy().ravel()
    elif suffix == ".csv":
        lines = path.read_text(encoding="ascii").splitlines()
        assert lines[0] == "# o3dleaf particles, unit m"
        table = np.array([line.split(",") for line in lines[2:]], dtype=np.float64)
        columns = lines[1].split(",")
        assert columns == ["x", "y", "z", *([] if inside else ["nx", "ny", "nz"]), size, *([] if inside else ["label"])]
        points, sizes = table[:, :3], table[:, columns.index(size)]
    else:
        data = path.read_bytes()
        assert f'NumberOfPoints="{len(found.points)}" NumberOfVerts="{len(found.points)}"'.encode() in data
        start = data.index(b'<AppendedData encoding="raw">\n_') + 31
        points = np.frombuffer(data, "<f8", 3 * len(found.points), start + 8).reshape(-1, 3)
        offset = int(data.split(f'Name="{size}" format="appended" offset="'.encode())[1].split(b'"')[0])
        sizes = np.frombuffer(data, "<f8", len(found.points), start + offset + 8)
    assert np.array_equal(points, found.points * scale)
    assert np.array_equal(sizes, found.sizes * scale**power)


def test_bgeo_has_every_particle_in_single_precision(cover, tmp_path):
    """A head, attributes by their names, a row of big-endian numbers for each, and the end."""
    export_particles(cover, tmp_path / "a.bgeo")
    data, count = (tmp_path / "a.bgeo").read_bytes(), len(cover.points)
    assert data[:5] == b"BgeoV"
    head = np.frombuffer(data, ">i4", 9, 5)
    assert head.tolist() == [5, count, 0, 0, 0, 3, 0, 0, 0]
    rows = np.frombuffer(data[-2 - 36 * count : -2], ">f4").reshape(count, 9)
    assert np.array_equal(rows[:, :3], cover.points.astype(np.float32))
    assert set(rows[:, 3]) == {1.0}
    assert np.array_equal(rows[:, 4:7], cover.normals.astype(np.float32))
    assert np.array_equal(rows[:, 7], cover.sizes.astype(np.float32))
    assert np.array_equal(rows[:, 8].view(">i4"), cover.labels)
    assert data.endswith(b"\x00\xff")
    assert len(data) == 5 + 36 + (2 + 1 + 2 + 4 + 12) + (2 + 4 + 2 + 4 + 4) + (2 + 5 + 2 + 4 + 4) + 36 * count + 2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda ring, _: sample_particles(ring, 0), "above zero"),
        (lambda *_: sample_particles(([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]), 0.1), "no area"),
        (lambda ring, _: fill_particles((ring.mesh.vertices, np.asarray(ring.mesh.triangles)[1:]), 0.1), "open"),
        (lambda *_: fill_particles(extract_isosurface(sphere(0.3), 0.1), 5.0), "no particle"),
        (lambda ring, path: export_particles(sample_particles(ring, 0.5), path / "a.xyz"), "unknown suffix"),
    ],
)
def test_wrong_input_is_refused(ring, tmp_path, call, words):
    with pytest.raises(InputError, match=words):
        call(ring, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_unit_that_is_not_known_is_not_converted(tmp_path):
    bare = fill_particles(build_mesh(*mesh_arrays(box([0, 0, 0], [1, 1, 1]))), 0.5)
    with pytest.raises(UnitError):
        export_particles(bare, tmp_path / "a.ply", to_unit="m")
