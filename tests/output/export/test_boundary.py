"""A boundary in layers: on the surface itself, whole spacings below it, nowhere crowded, thin parts filled once."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from leaf_fields import leaf_of, texture
from mesh_fields import sphere
from o3dleaf.commands.export import ExportJob
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays, triangle_areas
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.output.export.boundary import layer_counts, sample_boundary
from o3dleaf.output.export.particles import export_particles
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from tolerances import FACET_OF_SPHERE, OF_PARTICLES, ROUNDING

SPACING = 0.1
CENTER = np.array([0.013, -0.021, 0.007])
REGION = ((8.0, -1.2), (10.4, 1.2))


def hairy(x, y, z):
    """Ridges along x, and a hair 0.3 wide upon them, in the middle of a tile."""
    top = 0.24 + 0.08 * np.cos(np.pi * y)
    hair = 0.15**2 - x**2 - y**2
    return np.where(z > 0, np.maximum(top - z, 12 * hair * (z < 0.42)), z + 0.25)


@pytest.fixture(scope="module")
def leaf():
    return leaf_of(texture(hairy, n=21, per_ball=80), bend=30.0)[0]


@pytest.fixture(scope="module")
def solid(leaf):
    return leaf.plan_mesh(0.15, REGION, closed=True).extract()


@pytest.fixture(scope="module")
def ball():
    mesh = extract_isosurface(sphere(), 0.1)
    return mesh, sample_boundary(mesh, SPACING, layers=4)


def nearest(points):
    """The distance of each point to the nearest other one."""
    return cKDTree(points).query(points, 2)[0][:, 1]


def slab(thickness):
    return o3d.geometry.TriangleMesh.create_box(3.0, 3.0, thickness)


def test_layers_lie_whole_spacings_below_a_sphere(ball):
    _, found = ball
    depth = 1 - np.linalg.norm(found.points - CENTER, axis=1)
    assert np.abs(depth - found.layers * SPACING).max() < FACET_OF_SPHERE
    outward = np.einsum("ij,ij->i", found.normals, found.points - CENTER)
    assert np.abs(outward - 1 + depth).max() < FACET_OF_SPHERE
    assert nearest(found.points).min() >= 0.75 * SPACING
    # A sphere's layers are smaller the deeper they lie, and each is covered as the first.
    counts = np.array(layer_counts(found))
    assert np.abs(counts / counts[0] / (1 - SPACING * np.arange(4)) ** 2 - 1).max() < 0.1
    assert 0.8 < 4 * np.pi / SPACING**2 / counts[0] < 1.25


def test_areas_of_each_layer_are_those_above_it(ball):
    mesh, found = ball
    area = triangle_areas(*mesh_arrays(mesh)).sum()
    for k in range(4):
        assert abs(found.sizes[found.layers == k].sum() / area - 1) < ROUNDING


def test_particles_are_on_the_field_and_apart(leaf, solid):
    """To a hundredth of the spacing, whatever the mesh; and nowhere closer than 0.7 of it, whatever the face."""
    found = sample_boundary(solid, SPACING, field=leaf)
    faces = (found.layers == 0) & (found.labels < 2)
    points = found.points[faces]

    def off(places):
        return np.abs(leaf(places)) / np.linalg.norm(leaf.gradient(places), axis=1) / SPACING

    assert off(points).max() < OF_PARTICLES
    assert np.abs(found.normals[faces] - leaf.normals(points)).max() < ROUNDING
    assert nearest(found.points).min() >= 0.7 * SPACING
    bare = sample_boundary(solid, SPACING)
    assert off(bare.points[(bare.layers == 0) & (bare.labels < 2)]).max() > 0.01
    # Inside, all of them, three quarters of their depth below both faces of the mesh, which is this far off the field.
    vertices, triangles = mesh_arrays(solid.mesh)
    corners = vertices[triangles[solid.labels < 2]]
    middles = np.concatenate([corners.mean(axis=1), *((corners[:, k] + corners[:, k - 1]) / 2 for k in range(3))])
    sag = np.abs(leaf.signed_distance(middles)).max()
    assert sag < SPACING / 2
    deep = found.points[found.layers == 1]
    assert leaf.signed_distance(deep).max() < sag - 0.75 * SPACING


@pytest.mark.few(thickness=3)
@pytest.mark.parametrize(("thickness", "layers"), [(0.05, 1), (0.15, 1), (0.2, 2), (0.25, 2), (0.4, 3), (0.7, 4)])
def test_a_thin_part_is_filled_once(thickness, layers):
    """Layer k where the part is at least 2k - 1/4 spacings thick: none lies among those of the other face."""
    found = sample_boundary(slab(thickness), SPACING, layers=4)
    assert len(layer_counts(found)) == layers
    assert nearest(found.points).min() >= 0.75 * SPACING
    assert found.points.min() >= -ROUNDING
    assert found.points.max(axis=0)[2] <= thickness + ROUNDING
    top = np.abs(found.points[found.layers == 0, 2] - thickness) < ROUNDING
    # Faces half a spacing apart share the room; a spacing and a half apart each is covered.
    assert 0.4 < top.sum() * SPACING**2 / 9 < (0.8 if thickness < 0.75 * SPACING else 1.25)


def test_particles_do_not_depend_on_threads_but_on_the_seed(ball):
    mesh, found = ball
    before = get_num_threads()
    for threads in (1, 3):
        set_num_threads(threads)
        again = sample_boundary(mesh, SPACING, layers=4)
        assert np.array_equal(again.points, found.points)
        assert np.array_equal(again.sizes, found.sizes)
    set_num_threads(before)
    assert not np.array_equal(sample_boundary(mesh, SPACING, layers=1, seed=1).points[:50], found.points[:50])


def test_an_open_mesh_has_a_surface_and_no_layers(tmp_path):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), [[0, 1, 2], [0, 2, 3]]
    found = sample_boundary(square, SPACING, layers=1)
    assert set(found.layers.tolist()) == {0}
    with pytest.raises(InputError, match="open"):
        sample_boundary(square, SPACING)
    export_particles(found, tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_text(encoding="ascii").splitlines()[1] == "x,y,z,nx,ny,nz,area,layer"


@pytest.mark.slow
def test_the_command_writes_them(leaf, solid, tmp_path):
    leaf.save(tmp_path / "leaf.o3l")
    given = {"consumer": "sph", "step": SPACING, "spacing": 0.15, "region": REGION, "origin": (1.0, 2.0, 3.0)}
    ExportJob(tmp_path / "leaf.o3l", tmp_path / "a.csv", to_unit="m", **given, quiet=True).run()
    table = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=2)
    found = sample_boundary(solid, SPACING, field=leaf)
    assert np.array_equal(table[:, :3], (found.points - [1.0, 2.0, 3.0]) * 1e-3)
    assert np.array_equal(table[:, 8], found.layers)
    with pytest.raises(InputError, match="step: is missing for sph"):
        ExportJob(tmp_path / "leaf.o3l", tmp_path / "b.csv", consumer="sph", spacing=0.15).run()
