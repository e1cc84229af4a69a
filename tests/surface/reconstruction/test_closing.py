"""Closed or open by evidence: no hole where data close around, the true ones kept, and said why."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from cloud_shapes import sphere
from o3dleaf import OrientedCloud, create_from_point_cloud_rbfpu, fit_surface, mesh_report, offset_constraints
from o3dleaf.core.errors import InputError
from o3dleaf.core.journal import Journal
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.fitting.local.fitter import ScatteredData
from o3dleaf.surface.reconstruction.fit import surface_data
from o3dleaf.surface.reconstruction.overshoots import Overshoots, Surroundings
from o3dleaf.surface.reconstruction.proximity import data_around
from tolerances import BOX_INDEPENDENCE, CLOSED_GAP, SITES_TO_DATA


class Notes(Journal):
    """Keeps what is said."""

    def __init__(self):
        super().__init__()
        self.notes = []

    def note(self, text):
        self.notes.append(text)


def reconstructed(points, normals, **options):
    """Return the mesh and what was said of it."""
    with Notes() as journal:
        mesh, _ = create_from_point_cloud_rbfpu(OrientedCloud.of(points, normals), measure=None, **options)
    return mesh, [note for note in journal.notes if "the surface is" in note]


def lens(count, thickness, noise=0.0, seed=0):
    """Return points of an ellipsoid so many spacings thick, with noise in spacings, and its normals."""
    half = thickness / 2 * np.sqrt(2 * np.pi * 0.6 / count)
    rng = np.random.default_rng(seed)
    flat = rng.normal(size=(count, 3))
    flat /= np.linalg.norm(flat, axis=1)[:, np.newaxis]
    # Even in the plane, which a thin lens nearly is.
    radius, angle = np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * np.pi, count)
    height = np.sqrt(1 - radius**2) * np.where(rng.uniform(size=count) < 0.5, 1, -1)
    unit = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    axes = np.array([1.0, 0.6, half])
    normals = unit / axes
    normals /= np.linalg.norm(normals, axis=1)[:, np.newaxis]
    return unit * axes + 2 * half / thickness * noise * rng.normal(size=unit.shape), normals


def opened(count, degrees, seed=1):
    """Return points of a sphere without the cap of so many degrees about its pole, and their normals."""
    points, normals = sphere(count, seed)
    left = points[:, 2] < np.cos(np.radians(degrees))
    return points[left], normals[left]


def tube(count, length, noise, seed=1):
    """Return points of a tube of radius 1, one end of which is a half sphere, with noise in spacings, and normals."""
    rng = np.random.default_rng(seed)
    along, angle = rng.uniform(-length, 1, count), rng.uniform(0, 2 * np.pi, count)
    height = np.maximum(along, 0)
    across = np.sqrt(1 - height**2)
    normals = np.column_stack([across * np.cos(angle), across * np.sin(angle), height])
    spacing = np.sqrt(2 * np.pi * (length + 1) / count)
    return normals + np.minimum(along, 0)[:, np.newaxis] * [0, 0, 1] + noise * spacing * rng.normal(
        size=normals.shape
    ), normals


def test_a_thin_solid_is_closed_whatever_its_field_does_beyond_the_rim():
    thickness, noise = 1.5, 0.25
    mesh, said = reconstructed(*lens(3_000, thickness, noise))
    found = mesh_report(mesh)
    assert (found.components, found.boundary_edges) == (1, 0)
    assert said[0].startswith("the surface is closed")
    assert "it had run on past data that close around them" in said[0]
    assert mesh_report(reconstructed(*lens(3_000, thickness, noise), closed=False)[0]).boundary_edges > 0


@pytest.mark.slow
@pytest.mark.parametrize("local", ["hermite", "mls"])
def test_so_it_is_of_whatever_is_fitted_in_the_balls(local):
    points, normals = lens(1_200, 1.5, 0.15)
    mesh, said = reconstructed(points, normals, local=local)
    found = mesh_report(mesh)
    assert (found.components, found.boundary_edges) == (1, 0)
    assert "it had run on past data that close around them" in said[0]
    assert mesh_report(reconstructed(points, normals, local=local, closed=False)[0]).boundary_edges > 0


@pytest.mark.few(degrees=1)
@pytest.mark.parametrize("degrees", [60, 90, 120])
def test_open_data_are_left_as_they_are(degrees):
    """A bowl is no gap in a sphere: of no field beyond its rim is it known that it is wrong."""
    points, normals = opened(3_000, degrees)
    auto, said = reconstructed(points, normals)
    assert said[0].startswith("the surface is open: 1 rim,")
    for one, other in zip(mesh_arrays(auto), mesh_arrays(reconstructed(points, normals, closed=False)[0]), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.few(length=1)
@pytest.mark.parametrize(("length", "noise"), [(4, 0.0), (4, 0.7), (8, 0.3)])
def test_the_open_end_of_a_narrow_tube_is_left_as_it_is(length, noise):
    """Past its rim it shows as little as a blunt tip does; the gap in front is 10 spacings wide, or 7.5."""
    points, normals = tube(800, length, noise)
    auto, said = reconstructed(points, normals)
    assert said[0].startswith("the surface is open: 1 rim,")
    for one, other in zip(mesh_arrays(auto), mesh_arrays(reconstructed(points, normals, closed=False)[0]), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_gap_stays_open_unless_it_is_to_be_closed():
    """A hole of five spacings: its rim is where it was, or the level of the winding number closes it."""
    spacing = np.sqrt(4 * np.pi / 3_000)
    points, normals = opened(3_000, np.degrees(5 * spacing))
    mesh, said = reconstructed(points, normals)
    assert mesh_report(mesh).boundary_loops == 1
    assert "closed=True closes them" in said[0]
    mesh, said = reconstructed(points, normals, closed=True)
    found, radius = mesh_report(mesh), np.linalg.norm(mesh_arrays(mesh)[0], axis=1)
    assert (found.components, found.boundary_edges, found.genus) == (1, 0, 0)
    assert said == [
        "the surface is closed: at 1 place gaps were closed, half way between what the data have inside and outside"
    ]
    # Not beyond the sphere, and not below the flat disc in the rim.
    assert np.cos(5 * spacing) - CLOSED_GAP * spacing < radius.min()
    assert radius.max() < 1 + CLOSED_GAP * spacing


def test_closed_is_one_of_three():
    with pytest.raises(InputError, match="closed: is 'maybe'"):
        create_from_point_cloud_rbfpu(sphere(500)[0], closed="maybe")


@pytest.mark.parametrize("creases", [False, 30.0])
def test_more_points_change_the_balls_that_contain_them_alone(creases):
    rng = np.random.default_rng(8)
    points = rng.uniform(-1, 1, (2_400, 3))
    side = np.arange(len(points)) % 3
    points[np.arange(len(points)), side] = np.sign(points[np.arange(len(points)), side])
    normals = np.where(np.abs(points) == 1, points, 0.0)
    cloud = OrientedCloud.of(points, normals)
    field, known = fit_surface(cloud, rho=None, creases=creases), surface_data(cloud)
    site, value = np.array([[1.3, 0.1, 0.2]]), np.array([-0.5])
    more = ScatteredData(
        np.concatenate([known.points, site]),
        np.append(known.values, value),
        np.append(known.weights, 1.0),
        np.append(known.groups, len(known.groups)),
    )
    changed = field.with_points(more, 1)
    assert changed(site) == pytest.approx(value, abs=BOX_INDEPENDENCE)
    asked = rng.uniform(-1.2, 1.2, (2_000, 3))
    near = np.linalg.norm(field.cover.centers - site, axis=1) < field.cover.radii
    reached = (np.linalg.norm(asked[:, np.newaxis] - field.cover.centers[near], axis=2) < field.cover.radii[near]).any(
        axis=1
    )
    assert 0 < reached.sum() < len(asked)
    np.testing.assert_array_equal(changed(asked[~reached]), field(asked[~reached]))
    assert not np.array_equal(changed(asked[reached]), field(asked[reached]))
    assert changed.cover.members.max() == len(known.points)


def test_a_field_is_corrected_by_the_constraints_that_it_was_fitted_to():
    points, normals = lens(3000, 1.5)
    found = []

    def constraints(cloud):
        found.append(offset_constraints(cloud))
        return found[-1]

    cloud = OrientedCloud.of(points, normals)
    _, said = reconstructed(points, normals, constraints=constraints)
    assert "it had run on past data" in said[0]
    assert len(found) == 1
    for some in (cloud, cloud.with_normals(-cloud.normals)):
        off, data = constraints(some), surface_data(some, constraints)
        np.testing.assert_array_equal(data.points[len(points) :], off.sites)
        np.testing.assert_array_equal(surface_data(some, constraints).points, data.points)
    assert len(found) == 5


def test_sites_in_a_gap_are_no_denser_than_the_data_around_it():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(6000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    dense = points[:, 2] < -0.5
    points = points[dense | (rng.random(len(points)) < 1 / 16)]  # spacings of one and four
    cloud = OrientedCloud.of(points, points)
    start = points[np.argmin(points[:, 2])][np.newaxis] * (1 - 2 * cloud.point_spacing.min())
    over = Overshoots(start, start[:0])
    sites = Surroundings(cloud).sites(lambda at: np.full(len(at), -1.0), over).sites
    spacing = cloud.point_spacing[cloud.tree.query(sites)[1]]
    nearest = cKDTree(sites).query(sites, k=2)[0][:, 1]
    assert (spacing > 2 * spacing.min()).any()  # the gap leads from close data to sparse ones
    sparse = spacing > 2 * spacing.min()
    assert np.median(nearest[sparse] / spacing[sparse]) >= SITES_TO_DATA


@pytest.mark.parametrize("noise", [0.0, 0.4])
def test_noisy_data_are_asked_nearer_and_the_truth_is_half_a_spacing_nearer_than_they_are(noise):
    points, normals = sphere(2_000)
    spacing = np.sqrt(4 * np.pi / 2_000)
    cloud = OrientedCloud.of(points + noise * spacing * np.random.default_rng(4).normal(size=points.shape), normals)
    around, above = Surroundings(cloud), np.array([[1 + 2 * spacing, 0, 0], [0, 1 + 2 * spacing, 0]])
    sites, values = around.sites(lambda at: np.ones(len(at)), Overshoots(above, above[:0]))
    reach, nearest = data_around(cloud, sites)
    own, past = cloud.point_spacing[nearest], 0.5 if noise else 0.0
    assert ((reach / own).min() < 1.2) == around.noisy == (noise > 0)
    np.testing.assert_allclose(values, around.depth(sites) * (cloud.tree.query(sites)[0] - past * own))
    some = sites[(reach / own > 1.05) & (reach / own < 1.45)]
    assert around.is_far(some).all() == around.noisy


def test_a_gap_is_followed_place_by_place():
    """Each of its places once, and around them no more than six others each, however long it is."""
    points, normals = sphere(3_000)
    cloud = OrientedCloud.of(points, normals)
    around = Surroundings(cloud)
    reach = float(np.linalg.norm(points, axis=1).mean() - 2 * cloud.spacing)
    judged, judge = [], Surroundings._correction
    over = Overshoots(np.array([[0.0, 0.0, -reach]]), np.empty((0, 3)))

    def counted(self, field, over, pitch, cells):
        judged.append(len(cells))
        return judge(self, field, over, pitch, cells)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Surroundings, "_correction", counted)
        sites = around.sites(lambda at: np.full(len(at), -1.0), over).sites
    assert len(judged) > 20  # from one pole to the other
    assert len(sites) > 500
    assert len(np.unique(sites, axis=0)) == len(sites)
    assert sites[:, 2].max() > 0.8 * reach
    assert sum(judged) < 6 * len(sites)
