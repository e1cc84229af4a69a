"""Field to triangles: on the surface, closed, the right way out, whatever the box, the block or the noise."""

import numpy as np
import pytest
from scipy import ndimage

from mesh_fields import CENTRE, Analytic, hashed_noise, sphere, torus, wavy_sheets
from o3dleaf import PUInterpolant, extract_isosurface, get_num_threads, mesh_report, set_num_threads
from o3dleaf.core import progress
from o3dleaf.core.errors import InputError, MemoryBudgetError, ReconstructionError
from o3dleaf.core.lattice import Lattice, sample_lattice
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION
from o3dleaf.surface.isosurface.polygonize import METHODS, polygonize
from o3dleaf.surface.mesh.components import connected_components
from tolerances import BOX_INDEPENDENCE, ISOSURFACE_ORDER, LATTICE_EDGE, SPHERE_VOLUME

both = pytest.mark.parametrize("method", METHODS)


@both
def test_vertices_approach_a_sphere_with_the_square_of_the_spacing(method):
    spacings = np.array([0.2, 0.1, 0.05, 0.025])
    errors = []
    for spacing in spacings:
        vertices, _ = mesh_arrays(extract_isosurface(sphere(), spacing, method=method))
        errors.append(np.abs(np.linalg.norm(vertices - CENTRE, axis=1) - 1).max())
    rate = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert abs(rate - 2) < ISOSURFACE_ORDER


@both
def test_a_sphere_is_closed_outward_and_has_no_handle(method):
    report = mesh_report(extract_isosurface(sphere(), 0.06, method=method))
    assert report.watertight
    assert report.manifold
    assert report.oriented
    assert (report.components, report.genus, report.boundary_edges) == (1, 0, 0)
    assert report.vertices - 3 * report.triangles // 2 + report.triangles == 2
    assert report.volume == pytest.approx(4 / 3 * np.pi, rel=SPHERE_VOLUME)


@both
def test_a_torus_has_one_handle(method):
    report = mesh_report(extract_isosurface(torus(), 0.07, method=method))
    assert (report.components, report.genus, report.watertight) == (1, 1, True)
    assert report.volume > 0


@both
def test_a_slab_that_leaves_the_box_is_two_open_sheets_without_a_hole(method):
    report = mesh_report(extract_isosurface(wavy_sheets(), 0.07, [[-1, -1, -0.9], [1, 1, 0.9]], method=method))
    assert (report.components, report.boundary_loops, report.holes, report.genus) == (2, 2, 0, 0)
    assert report.manifold
    assert not report.watertight
    assert report.volume is None


@pytest.mark.few
@both
@pytest.mark.parametrize(("levels", "level"), [(None, 0.0), (3, 0.5), (3, 1.0), (10, 4.5), (10, 5.0)])
def test_noise_gives_a_closed_oriented_manifold(method, levels, level):
    """Whole numbers tie in the ambiguous faces, and lie on the level itself where it is whole too."""
    for seed in range(6):
        report = mesh_report(polygonize(hashed_noise(seed, levels=levels), level, method))
        assert report.boundary_edges == 0
        assert report.manifold
        assert report.oriented
        assert report.volume > 0


@pytest.mark.few
@both
@pytest.mark.parametrize("seed", range(4))
def test_meshes_of_noise_do_not_intersect_themselves_says_meshlab(seed, method):
    """On normal deviates: MeshLab's filter takes some pairs that are apart in one plane for crossing."""
    assert mesh_report(polygonize(hashed_noise(seed), 0.3, method)).self_intersections == 0


@pytest.mark.parametrize("seed", range(4))
def test_cubes_join_inside_samples_along_the_axes_only(seed):
    """Every 6-connected piece of the inside has one outer surface of its own, whatever the ambiguous faces."""
    samples = hashed_noise(seed)
    mesh = polygonize(samples, 0.3, "cubes")
    labels, areas = connected_components(mesh)
    corners = mesh[0][mesh[1]]
    volumes = np.bincount(labels, np.linalg.det(corners - corners.mean(axis=(0, 1))) / 6, len(areas))
    assert (volumes > 0).sum() == ndimage.label(samples > 0.3)[1]


@pytest.mark.parametrize(("levels", "level"), [(None, 0.0), (3, 1.0), (10, 4.5)])
def test_tetrahedra_never_intersect_themselves(levels, level):
    """The proof: each tetrahedron holds one triangle, or two with a common edge, and nothing sticks out of it.

    A point of cell (i, j, k) lies in the tetrahedron of an order of the axes if its fractions fall in
    that order; the triangle's middle says which one it is, its corners must be in the closure.
    """
    vertices, triangles = polygonize(hashed_noise(2, levels=levels), level, "tetrahedra")
    corners = vertices[triangles]
    cell = np.floor(corners.mean(axis=1))
    inside = corners - cell[:, np.newaxis]
    order = np.argsort(-inside.mean(axis=1), axis=1)
    falling = np.take_along_axis(inside, order[:, np.newaxis], axis=2)
    assert (falling[:, :, 0] <= 1).all()
    assert (np.diff(falling, axis=2) <= LATTICE_EDGE).all()
    assert (falling[:, :, 2] >= 0).all()
    _, tetrahedron, count = np.unique(np.hstack([cell, order]), axis=0, return_inverse=True, return_counts=True)
    assert count.max() == 2
    pairs = np.argsort(tetrahedron.ravel(), kind="stable")[np.repeat(count == 2, count)].reshape(-1, 2)
    common = (triangles[pairs[:, 0], :, np.newaxis] == triangles[pairs[:, 1], np.newaxis]).sum(axis=(1, 2))
    assert (common == 2).all()


@both
def test_vertices_are_where_the_linear_interpolant_takes_the_level(method):
    """The literal twin: every vertex on a lattice edge, at the crossing of its two samples, in float64."""
    samples, level = hashed_noise(4), 0.1
    vertices, _ = polygonize(samples, level, method)
    low, high = np.floor(vertices).astype(int), np.ceil(vertices).astype(int)
    assert (high - low).sum(axis=1).max() == (1 if method == "cubes" else 3)
    for vertex, a, b in zip(vertices, low, high, strict=True):
        here, there = samples[tuple(a)], samples[tuple(b)]
        fraction = np.clip((level - here) / (there - here), MIN_FRACTION, 1 - MIN_FRACTION)
        assert np.abs(vertex - (a + (b - a) * fraction)).max() < LATTICE_EDGE


@both
def test_every_crossed_edge_of_the_lattice_has_its_one_vertex(method):
    samples = hashed_noise(5)
    vertices, triangles = polygonize(samples, 0.0, method)
    inside = samples > 0
    along_axes = sum(int((np.diff(inside.astype(int), axis=axis) != 0).sum()) for axis in range(3))
    on_axes = ((vertices != np.floor(vertices)).sum(axis=1) == 1).sum()
    assert on_axes == along_axes
    assert len(np.unique(vertices, axis=0)) == len(vertices) == len(np.unique(triangles))


@both
def test_the_surface_does_not_depend_on_the_box(method):
    spacing, field = 0.09, torus()
    small = np.array([[-0.5, -1.17, -0.4], [1.2, 0.6, 0.41]])
    one, _ = mesh_arrays(extract_isosurface(field, spacing, method=method))
    other, _ = mesh_arrays(extract_isosurface(field, spacing, small, method=method))
    box = Lattice.covering(small, spacing).bounds + np.array([[spacing], [-spacing]]) / 9
    common, same = (points[((points > box[0]) & (points < box[1])).all(axis=1)] for points in (one, other))
    assert len(common) == len(same) > 900
    order = [np.lexsort(np.round(points, 6).T) for points in (common, same)]
    assert np.abs(common[order[0]] - same[order[1]]).max() < BOX_INDEPENDENCE


@both
def test_vertices_of_an_open_rim_lie_on_the_box(method):
    vertices, triangles = mesh_arrays(extract_isosurface(wavy_sheets(), 0.1, [[-1, -1, -1], [1, 1, 1]], method=method))
    half = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    edges, count = np.unique(half, axis=0, return_counts=True)
    rim = vertices[np.unique(edges[count == 1])]
    assert np.abs(np.abs(rim[:, :2]).max(axis=1) - 1).max() < BOX_INDEPENDENCE


@pytest.mark.parametrize("block", [1, 17, 1000, 1 << 20])
def test_samples_do_not_depend_on_the_block(block):
    lattice = Lattice.covering([[-1.0, -0.5, -0.3], [1.0, 0.5, 0.3]], 0.13)
    calls = []
    with progress.listening(lambda *done: calls.append(done)):
        samples = sample_lattice(torus(), lattice, block=block)
        assert calls[-1][0] == calls[-1][1]
    whole = torus()(lattice.positions(np.argwhere(np.ones(lattice.shape)))).reshape(lattice.shape)
    assert np.array_equal(samples, whole)


@pytest.mark.few
@both
@pytest.mark.parametrize("step", [1.0, 0.9])
@pytest.mark.parametrize("smoothing", [0.0, 1e-3])
def test_rough_samples_make_the_mesh_that_exact_ones_do(method, smoothing, step):
    """To the last bit: also where values lie within their error of the level, on its plateau, and on faces that cut."""
    axis = np.linspace(-1, 1, 18)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    values = np.maximum(np.round(8 * (1.1 - np.sqrt(x**2 + y**2 + z**2))) / 8, 0)
    field = PUInterpolant.fit_lattice(
        values, spacing=1.0, origin=[0.3, -7.2, 5.0], smoothing=smoothing, points_per_ball=80
    )
    level = 0.125 if smoothing == 0 else 0.1
    exact = Analytic(lambda *x: field(np.column_stack(x)), bounds=field.bounds)
    points = np.random.default_rng(0).uniform(*field.bounds, (2000, 3))
    assert 0 < np.abs(field.rough(points) - field(points)).max() < field.rough_error < 0.05
    for one, other in zip(
        *(mesh_arrays(extract_isosurface(each, step, isovalue=level, method=method)) for each in (field, exact)),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


@both
def test_the_mesh_does_not_depend_on_the_number_of_threads(method):
    samples, threads = hashed_noise(6, (70, 9, 8)), get_num_threads()
    try:
        meshes = []
        for count in (1, 3):
            set_num_threads(count)
            meshes.append(polygonize(samples, 0.0, method))
    finally:
        set_num_threads(threads)
    assert np.array_equal(meshes[0][0], meshes[1][0])
    assert np.array_equal(meshes[0][1], meshes[1][1])


def test_a_lattice_covers_its_box_with_whole_multiples_of_the_spacing():
    lattice = Lattice.covering([[-0.3, 0.1, 0.0], [0.3, 0.25, 1.0]], [0.1, 0.1, 0.25])
    assert lattice.shape == (7, 3, 5)
    assert np.allclose(lattice.bounds, [[-0.3, 0.1, 0.0], [0.3, 0.3, 1.0]])
    assert lattice.columns().shape == (21, 2)
    assert np.allclose(lattice.columns()[:4], [[-0.3, 0.1], [-0.3, 0.2], [-0.3, 0.3], [-0.2, 0.1]])


def test_inputs_stay_as_they_were():
    samples = hashed_noise(7)
    samples.flags.writeable = False
    for method in METHODS:
        polygonize(samples, 0.0, method)


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"spacing": -1}, InputError, "spacing"),
        ({"spacing": np.nan}, InputError, "spacing"),
        ({"spacing": 1e-5}, MemoryBudgetError, "coarsen"),
        ({"spacing": 0.1, "isovalue": 7.0}, ReconstructionError, "not crossed"),
        ({"spacing": 0.1, "method": "squares"}, InputError, "cubes, tetrahedra"),
        ({"spacing": 0.1, "bounds": [[1, 1, 1], [0, 0, 0]]}, InputError, "bounds"),
    ],
)
def test_what_cannot_be_meant_is_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        extract_isosurface(sphere(), **arguments)


def test_samples_that_are_no_lattice_are_refused():
    with pytest.raises(InputError, match="shape"):
        polygonize(np.zeros((3, 3)), 0.0)
    with pytest.raises(InputError, match="NaN"):
        polygonize(np.full((3, 3, 3), np.nan), 0.0)
    with pytest.raises(InputError, match="field values"):
        sample_lattice(Analytic(lambda x, y, z: x * np.nan), Lattice.covering([[0] * 3, [1] * 3], 0.5))
    empty = polygonize(np.ones((3, 3, 3)), 0.0)
    assert [part.shape for part in empty] == [(0, 3), (0, 3)]


def test_a_field_of_the_plane_has_no_isosurface():
    points = np.random.default_rng(2).uniform(size=(200, 2))
    with pytest.raises(InputError, match="field: is a function in 2-D"):
        extract_isosurface(PUInterpolant.fit(points, points[:, 0]), 0.1)


def test_a_field_without_bounds_says_so():
    with pytest.raises(InputError, match=r"field: has no bounds \(2, 3\); give"):
        extract_isosurface(Analytic(lambda x, y, z: x, bounds=None), 0.1)
