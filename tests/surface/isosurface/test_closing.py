"""A surface that its box cuts is closed there, on the box, whatever the units; or left open where that is asked for."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from mesh_fields import CENTRE, Analytic, hashed_noise, sphere, torus, wavy_sheets
from o3dleaf import PUInterpolant, extract_isosurface, mesh_report, remesh
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.isosurface.polygonize import METHODS
from tolerances import CAP_DISTANCE, CUT_VOLUME, LATTICE_EDGE, UNITS

both = pytest.mark.parametrize("method", METHODS)


class Trilinear:
    """Samples on whole numbers, in between trilinear; outside nothing that could close a surface."""

    unit = None

    def __init__(self, samples):
        self.samples, self.bounds = samples, np.array([[0.0] * 3, np.array(samples.shape) - 1.0])

    def __call__(self, points):
        outside = np.any((points < self.bounds[0]) | (points > self.bounds[1]), axis=1)
        return np.where(outside, 1e9, ndimage.map_coordinates(self.samples, points.T, order=1, mode="nearest"))

    def gradient(self, points):
        raise NotImplementedError


class Endless:
    """A slab that its bounds do not end."""

    unit = None

    def __init__(self, slab):
        self.function, self.bounds = slab.function, slab.bounds

    def __call__(self, points):
        return self.function(*points.T)

    gradient = Analytic.gradient


def is_solid(mesh):
    report = mesh_report(mesh)
    return report.boundary_edges == 0 and report.manifold and report.oriented and report.volume > 0


@pytest.mark.few
@both
@pytest.mark.parametrize("step", [1.0, 0.4, 0.73, 1.31])
def test_noise_that_the_box_cuts_everywhere_is_a_closed_oriented_manifold(method, step):
    for seed in range(3):
        noise = hashed_noise(seed, (7, 6, 8))[1:-1, 1:-1, 1:-1]
        assert is_solid(extract_isosurface(Trilinear(noise), step, method=method))


@both
@pytest.mark.parametrize("step", [0.1, 0.07])
def test_a_slab_is_closed_by_caps_that_lie_on_the_box(method, step):
    """Its four cut sides: where the box is a whole number of steps, and where it is not."""
    mesh = extract_isosurface(wavy_sheets(), step, method=method)
    assert is_solid(mesh)
    vertices, triangles = mesh_arrays(mesh)
    assert np.abs(vertices).max() == 1.2
    corners = vertices[triangles]
    flat = np.abs(corners[:, :, :2]) == 1.2
    caps = np.any(flat.all(axis=1), axis=1)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert area[caps].sum() == pytest.approx(4 * 2.4 * 0.3, rel=CUT_VOLUME)
    assert mesh_report(mesh).volume == pytest.approx(2.4 * 2.4 * 0.3, rel=CUT_VOLUME)


@both
def test_a_corner_of_the_box_is_a_corner_of_the_solid(method):
    """An eighth of a ball about a corner: three caps that meet in one vertex."""
    ball = Analytic(lambda x, y, z: 1 - np.sqrt(x**2 + y**2 + z**2), bounds=np.array([[0.0] * 3, [2.0] * 3]))
    mesh = extract_isosurface(ball, 0.06, method=method)
    assert is_solid(mesh)
    assert mesh_report(mesh).volume == pytest.approx(np.pi / 6, rel=CUT_VOLUME)
    assert np.any(np.all(mesh_arrays(mesh)[0] == 0, axis=1))


@pytest.mark.parametrize(("value", "length"), [(1e-6, 1.0), (255.0, 1.0), (1e6, 1e-6), (2.0**-40, 2.0**30), (1.0, 1e6)])
def test_neither_the_unit_of_values_nor_that_of_lengths_matters(value, length):
    """A volume like a bone of a micro-CT, which all faces of its box cut: same triangles, corners in proportion."""
    samples = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(14, 13, 12)), 1.2)
    samples = 255 * (samples - samples.min()) / np.ptp(samples)

    def surface(value, length):
        options = {"spacing": length, "isovalue": value * 128.0, "points_per_ball": 60}
        return extract_isosurface(PUInterpolant.fit_lattice(value * samples, **options), 0.7 * length)

    plain, other = surface(1.0, 1.0), surface(value, length)
    assert is_solid(other)
    np.testing.assert_array_equal(mesh_arrays(other)[1], mesh_arrays(plain)[1])
    found, expected = mesh_arrays(other)[0] / length, mesh_arrays(plain)[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=UNITS)


def test_a_surface_that_the_box_does_not_cut_has_no_cap():
    whole, open_too = extract_isosurface(torus(), 0.05), extract_isosurface(torus(), 0.05, closed=False)
    for one, other in zip(mesh_arrays(whole), mesh_arrays(open_too), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=LATTICE_EDGE)


def test_what_is_closed_and_what_is_open_where_a_box_is_given():
    slab = wavy_sheets()
    inner, own, wider = ([[-size, -size, -0.9], [size, size, 0.9]] for size in (1.0, 1.2, 3.0))
    assert mesh_report(extract_isosurface(slab, 0.1, inner)).boundary_edges > 0
    for box in (own, wider):
        assert is_solid(extract_isosurface(slab, 0.1, box))
    assert is_solid(extract_isosurface(slab, 0.1, inner, closed=True))
    for box in (None, inner, own):
        assert mesh_report(extract_isosurface(slab, 0.1, box, closed=False)).boundary_edges > 0
    mesh = extract_isosurface(slab, 0.07, [[-0.75, -1, -0.9], [1, 0.33, 0.9]], closed=True)
    assert mesh.get_min_bound()[:2].tolist() == [-0.75, -1]
    assert mesh.get_max_bound()[:2].tolist() == [1, 0.33]


@pytest.mark.parametrize("step", [0.1, 0.07])
def test_a_surface_that_is_followed_from_seeds_is_closed_by_the_box_too(step):
    """One that goes on without end otherwise."""
    mesh = extract_isosurface(Endless(wavy_sheets()), step, seeds=[[0.0, 0.0, 0.15]])
    assert is_solid(mesh)
    assert np.abs(mesh_arrays(mesh)[0]).max() == 1.2
    assert mesh_report(mesh).volume == pytest.approx(2.4 * 2.4 * 0.3, rel=step)


def test_caps_are_the_field_s_surface_to_a_report_and_stay_flat_when_remeshed():
    slab = Endless(wavy_sheets())
    mesh = extract_isosurface(slab, 0.1)
    assert mesh_report(mesh, field=slab).field_distance_max < CAP_DISTANCE
    even = remesh(mesh, 0.1, field=slab)
    assert is_solid(even)
    assert np.abs(mesh_arrays(even)[0]).max() == 1.2
    report = mesh_report(even, field=slab)
    assert report.volume == pytest.approx(2.4 * 2.4 * 0.3, rel=2 * CUT_VOLUME)
    assert report.self_intersections == 0


def test_a_ball_beyond_the_bounds_is_not_there():
    whole = replace(sphere(), bounds=np.array([[-1.2] * 3, [1.2, 1.2, CENTRE[2]]]))
    mesh = extract_isosurface(whole, 0.05)
    assert is_solid(mesh)
    assert mesh_report(mesh).volume == pytest.approx(2 / 3 * np.pi, rel=CUT_VOLUME)
    with pytest.raises(InputError, match="bounds: lie outside"):
        extract_isosurface(whole, 0.05, [[-1, -1, 0.1], [1, 1, 1]])
    full = Analytic(lambda x, y, z: 1 + 0 * x)
    with pytest.raises(ReconstructionError, match="not crossed"):
        extract_isosurface(full, 0.2)
