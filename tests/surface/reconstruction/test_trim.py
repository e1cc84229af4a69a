"""No invented surface: open where data end, closed where they are closed, never pierced by chance."""

import warnings

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mesh_fields import joined, sphere
from o3dleaf import OrientedCloud, distance_mask, extract_isosurface, mesh_report, point_spacing, trim_to_data
from o3dleaf.core.errors import CloudWarning, InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.mesh.topology import EdgeTable
from o3dleaf.surface.reconstruction.trim import _nearest_pieces, cut_below
from tolerances import BOX_INDEPENDENCE, RIM_OF_DATA, TRIMMED_AREA


def plane(step, half=1.5, height=0.0):
    """Return a flat square mesh, |x|, |y| <= half."""
    ticks = np.arange(-half, half + step / 2, step)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    vertices = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def flat(count, seed=5, low=-1.0):
    """Return random points on a rectangle in the plane, and their spacing."""
    xy = np.random.default_rng(seed).uniform([low, -1], 1, size=(count, 2))
    return np.column_stack([xy, np.zeros(count)]), np.sqrt((1 - low) * 2 / count)


def rim_of(mesh):
    """Return the vertices on the boundary of a mesh."""
    vertices, triangles = mesh_arrays(mesh)
    edges = EdgeTable.of(triangles)
    return vertices[np.unique(edges.ends[edges.count == 1])]


@pytest.mark.few(given=1, ratio=1)
@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("ratio", [1.5, 0.5])
def test_a_random_sheet_ends_at_its_data_and_has_no_hole(given, ratio):
    cloud, spacing = flat(20_000)
    trimmed = trim_to_data(plane(ratio * spacing), OrientedCloud.of(cloud, spacing=spacing if given else None))
    report = mesh_report(trimmed)
    assert (report.components, report.holes, report.boundary_loops, report.manifold) == (1, 0, 1, True)
    beyond = (np.abs(rim_of(trimmed)[:, :2]).max(axis=1) - 1) / spacing
    assert np.abs(beyond).mean() < RIM_OF_DATA[0]
    assert beyond.max() < RIM_OF_DATA[1]
    assert report.area == pytest.approx(4, rel=TRIMMED_AREA)


def test_a_hole_wider_than_the_ball_stays_open_and_a_narrower_one_is_closed():
    cloud, spacing = flat(8_000)
    for radius, holes in ((2.5, 0), (6.0, 1)):
        left = np.linalg.norm(cloud, axis=1) > radius * spacing
        trimmed = trim_to_data(plane(spacing), OrientedCloud.of(cloud[left], spacing=spacing))
        assert mesh_report(trimmed).holes == holes
    inner = rim_of(trimmed)
    inner = inner[np.linalg.norm(inner, axis=1) < 0.5]
    assert np.linalg.norm(inner, axis=1).mean() == pytest.approx(6 * spacing, abs=spacing)


def test_closed_data_leave_a_closed_surface_as_it_is():
    ball = extract_isosurface(sphere(), 0.06)
    vertices, triangles = mesh_arrays(ball)
    rng = np.random.default_rng(1)
    cloud = rng.normal(size=(20_000, 3))
    cloud = cloud / np.linalg.norm(cloud, axis=1)[:, None] + vertices.mean(axis=0)
    for given in (None, np.sqrt(4 * np.pi / 20_000)):
        found = mesh_arrays(trim_to_data(ball, OrientedCloud.of(cloud, spacing=given)))
        assert np.array_equal(found[0], vertices)
        assert np.array_equal(found[1], triangles)


def test_noise_along_the_normal_does_not_pierce():
    cloud, spacing = flat(6_000)
    cloud[:, 2] += np.random.default_rng(2).normal(scale=8 * spacing, size=len(cloud))
    data, options = OrientedCloud.of(cloud, spacing=spacing), {"factor": 3.0, "margin": 0.5}
    assert mesh_report(trim_to_data(plane(spacing), data, **options)).holes == 0
    assert mesh_report(trim_to_data(plane(spacing), data, noise=0.0, **options)).holes > 0


def test_the_ball_rolls_along_the_surface_and_not_across_to_another_sheet():
    """A sheet without data, four spacings above: it goes, and the one below is what it is without it."""
    cloud, spacing = flat(5_000)
    below = plane(spacing, 1.5)
    both = joined(below, plane(spacing, 0.6, 4 * spacing))
    data = OrientedCloud.of(cloud, spacing=spacing)
    for one, other in zip(*(mesh_arrays(trim_to_data(mesh, data)) for mesh in (below, both)), strict=True):
        assert np.array_equal(one, other)


def test_a_bubble_beside_the_data_is_dropped_and_a_small_piece_with_data_stays():
    cloud, spacing = flat(5_000)
    bubble, triangles = mesh_arrays(extract_isosurface(sphere(), 0.5))
    near = bubble * spacing + [0.3, 0.2, 1.5 * spacing]
    dropped = trim_to_data(joined(plane(spacing), (near, triangles)), OrientedCloud.of(cloud, spacing=spacing))
    assert mesh_report(dropped).components == 1
    far = bubble * spacing + [0.3, 0.2, 1.0]
    data = OrientedCloud.of(np.concatenate([cloud, far]), spacing=spacing)
    kept = trim_to_data(joined(plane(spacing), (far, triangles)), data)
    assert mesh_report(kept).components == 2


def test_points_that_are_too_few_for_a_piece_do_not_vanish_without_a_word():
    """Twelve points on a bubble far off are told with their place; a bubble beside the data takes none away."""
    cloud, spacing = flat(5_000)
    bubble, triangles = mesh_arrays(extract_isosurface(sphere(), 0.5))
    far = bubble * spacing + [0.25, 0.5, 1.0]
    data = OrientedCloud.of(np.concatenate([cloud, far[:12]]), spacing=spacing)
    with pytest.warns(
        CloudWarning, match=r"^12 points have no surface: 1 piece of too few, the largest of 12 at 0\.2"
    ) as told:
        trim_to_data(joined(plane(spacing), (far, triangles)), data)
    assert told[0].filename == __file__
    near = bubble * spacing + [0.3, 0.2, 1.5 * spacing]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        trim_to_data(joined(plane(spacing), (near, triangles)), OrientedCloud.of(cloud, spacing=spacing))


def test_each_part_of_an_uneven_cloud_ends_by_its_own_spacing():
    dense, fine = flat(20_000, low=0.0)
    thin, coarse = flat(20_000 // 32, seed=6, low=0.0)
    cloud = np.concatenate([dense, thin * [-1, 1, 1]])
    assert coarse == pytest.approx(np.sqrt(32) * fine)
    rim = rim_of(trim_to_data(plane(fine, 1.6), cloud))
    for side, spacing in ((1, fine), (-1, coarse)):
        edge = rim[(side * rim[:, 0] > 0.5) & (np.abs(rim[:, 1]) < 0.8)]
        assert np.abs(np.abs(edge[:, 0]) - 1).mean() < RIM_OF_DATA[0] * spacing
    step = point_spacing(cloud)
    middle = np.abs(np.abs(cloud[:, 0]) - 0.5) < 0.3
    assert np.median(step[middle & (cloud[:, 0] > 0)]) == pytest.approx(fine, rel=0.1)
    assert np.median(step[middle & (cloud[:, 0] < 0)]) == pytest.approx(coarse, rel=0.1)


def test_the_distance_mask_reaches_as_far_as_it_says():
    near = distance_mask(OrientedCloud.of(np.zeros((1, 3)), spacing=0.5), factor=2.0)
    assert near(np.array([[0.99, 0, 0], [1.01, 0, 0]])).tolist() == [True, False]


def test_a_cut_is_where_linear_values_are_zero_and_stays_manifold():
    vertices, triangles = mesh_arrays(extract_isosurface(sphere(), 0.1))
    level = 0.2345
    kept = cut_below(vertices, triangles, vertices[:, 2] - level)
    report, rim = mesh_report(kept), rim_of(kept)
    assert (report.components, report.boundary_loops, report.manifold, report.oriented) == (1, 1, True, True)
    # A vertex is kept a twentieth of its edge, of up to 0.17, from its ends.
    assert np.abs(rim[:, 2] - level).max() < 0.17 / 20
    assert np.median(np.abs(rim[:, 2] - level)) < BOX_INDEPENDENCE
    other = cut_below(vertices, triangles, level - vertices[:, 2])
    assert report.area + mesh_report(other).area == pytest.approx(mesh_report((vertices, triangles)).area)


def test_what_cannot_be_trimmed_says_why():
    cloud, spacing = flat(100)
    with pytest.raises(ReconstructionError, match="no part of the mesh"):
        trim_to_data(plane(0.5), OrientedCloud.of(cloud + 100, spacing=spacing))
    with pytest.raises(InputError, match="margin: is 3"):
        trim_to_data(plane(0.5), OrientedCloud.of(cloud, spacing=spacing), margin=3)
    with pytest.raises(InputError, match="13 points lie in one place"):
        point_spacing(np.zeros((20, 3)))
    with pytest.raises(InputError, match="spacing"):
        OrientedCloud.of(cloud, spacing=np.ones(3))


def test_a_point_belongs_to_the_piece_of_its_nearest_vertex():
    """Two sheets with holes, two spacings apart, and points between them and beside: as a search among all says."""
    rng = np.random.default_rng(3)
    vertices = np.concatenate([rng.uniform([-1, -1, z], [1, 1, z + 0.02], (800, 3)) for z in (0.0, 0.1, 0.2)])
    vertices = vertices[np.linalg.norm(vertices[:, :2], axis=1) > 0.3]
    piece = (vertices[:, 2] / 0.1 + 0.05).astype(np.int64)
    data = OrientedCloud.of(rng.uniform([-1, -1, -0.05], [1, 1, 0.3], (2_000, 3)), spacing=0.05)
    tree = cKDTree(vertices)
    np.testing.assert_array_equal(_nearest_pieces(tree, piece, data), piece[tree.query(data.points)[1]])
