"""The taper of the thickness towards the margin: a function of the distance, smooth, from the floor to 1."""

from functools import cache

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from leaf_fields import leaf_of
from leaf_fields import texture as texture_of
from margin_fields import leaf_shape
from o3dleaf import Margin, MultiscaleLeaf, ParametricBlade, mesh_report
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.parallel import get_num_threads, set_num_threads
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.leaf.margin.taper import Taper
from o3dleaf.leaf.meshing import MeshPlan
from tolerances import RIM_DISTANCE, RIM_FOOT, RIM_FOOT_99, TAPER_ROUNDING, TAPER_SLOPE

HALF = 0.2037


def places(shape, count=5000, seed=0):
    """Points about a shape, as many of them near its margin."""
    rng = np.random.default_rng(seed)
    low, high = np.reshape(shape.bounds, (2, 2))
    anywhere = rng.uniform(low - 1, high + 1, (count, 2))
    at = shapely.get_coordinates(shape.boundary.interpolate(rng.random(count), normalized=True))
    return np.concatenate([anywhere, at + rng.normal(0, 0.1, at.shape)])


def exact(shape, radius, least, points):
    """The literal twin: the formula, and the cubic below it, of the distance that shapely finds."""
    inside = shapely.contains_xy(shape, *points.T)
    depth = np.where(inside, shapely.distance(shape.boundary, shapely.points(points)), 0) / radius
    circle = np.sqrt(1 - (1 - np.clip(depth, 0, 1)) ** 2)
    height = min(2 * least, (1 + least) / 2)
    blend = 1 - np.sqrt(1 - height**2)
    slope = blend * (1 - blend) / height
    s = depth / blend
    cubic = least + (3 * (height - least) - slope) * s**2 + (slope - 2 * (height - least)) * s**3
    return np.where(depth >= 1, 1, np.where(depth >= blend, circle, cubic)), depth


@pytest.mark.few(radius=1)
@pytest.mark.parametrize(("radius", "least"), [(0.3, 0.1), (0.05, 0.02), (1.5, 0.5)])
def test_it_is_the_profile_of_the_distance(radius, least):
    shape = leaf_shape()
    points = places(shape)
    found = Taper(shape, radius, least).values(points)
    expected, depth = exact(shape, radius, least, points)
    assert np.abs(found - expected).max() < TAPER_ROUNDING
    assert np.all(found[depth >= 1] == 1)
    assert np.all(found[depth <= 0] == least)
    assert found.min() >= least


def test_it_rises_with_the_depth_and_has_no_jump_of_slope():
    """On a half plane, where the distance is smooth: differences of the slope fall with the step everywhere."""
    shape = shapely.box(0, -50, 50, 50)
    for least in (0.02, 0.1, 0.5):
        taper = Taper(shape, 2.0, least)
        jumps = []
        for count in (4001, 16001):
            # The bend above the floor is least² of the radius wide.
            depth = 4 * least**2 * np.linspace(-1, 4, count)
            thickness, *gradient = taper.jet(np.column_stack([depth, 0 * depth])).T
            assert np.all(np.diff(thickness) >= 0)
            assert np.all(gradient[1] == 0)
            assert np.all(gradient[0] >= 0)
            jumps.append(np.abs(np.diff(gradient[0])).max())
        assert jumps[1] < 0.3 * jumps[0]


def test_its_gradient_is_the_limit_of_differences():
    shape, radius, step = leaf_shape(), 0.4, 1e-6
    taper, points = Taper(shape, radius), places(shape, 5000, seed=1)
    found = taper.jet(points)[:, 1:]
    ahead, behind = (
        np.stack([taper.values(points + sign * step * np.eye(2)[axis]) for axis in range(2)], axis=1)
        for sign in (1, -1)
    )
    differences = (ahead - behind) / (2 * step)
    off = np.linalg.norm(found - differences, axis=1)
    # But on the ridge, where two sides of the margin are equally near.
    assert np.mean(off > TAPER_SLOPE) < 1e-3
    assert np.mean(np.linalg.norm(found, axis=1) > 0.1) > 0.2


def test_a_hole_and_a_notch_have_an_edge_too():
    shape = leaf_shape()
    taper = Taper(shape, 0.2)
    rim = shapely.get_coordinates(shape.interiors[0])
    outward = rim - rim.mean(axis=0)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.all(taper.values(rim - 0.01 * outward) == taper.least)
    assert np.all(taper.values(rim + 0.21 * outward) == 1)
    assert np.all(taper.values(rim + 0.1 * outward) < 1)


def test_it_does_not_depend_on_threads_or_on_the_turn_of_rings():
    shape, points = leaf_shape(), places(leaf_shape(), 40_000)
    found, threads = [], get_num_threads()
    try:
        for count in (1, 3):
            set_num_threads(count)
            found.append(Taper(shape, 0.3).jet(points))
    finally:
        set_num_threads(threads)
    assert np.array_equal(*found)
    turned = shapely.Polygon(shape.exterior.coords[::-1], [ring.coords[::-1] for ring in shape.interiors])
    assert np.abs(Taper(turned, 0.3).values(points) - found[0][:, 0]).max() < TAPER_ROUNDING


@pytest.mark.parametrize("given", [(0.0, 0.1), (-1.0, 0.1), (0.3, 0.0), (0.3, 0.7)])
def test_what_is_no_taper_is_refused(given):
    with pytest.raises(InputError, match=r"radius|least"):
        Taper(leaf_shape(), *given)


def star(points=7):
    """A star whose concave corners are sharp."""
    angle = np.linspace(0, 2 * np.pi, 2 * points, endpoint=False)
    radius = np.where(np.arange(2 * points) % 2, 1.2, 2.6)[:, np.newaxis]
    return radius * np.column_stack([np.cos(angle), np.sin(angle)]) + [10.0, 0.0]


@pytest.fixture(scope="module")
def pointed():
    """A wavy slab on a bent strip, tapered towards the margin of a star."""
    wavy = texture_of(lambda x, y, z: HALF + 0.05 * np.cos(2 * np.pi * x) + 0.04 * np.sin(2 * np.pi * y) - np.abs(z))
    surface = leaf_of(wavy, bend=15.0)[0].blade.surface
    return MultiscaleLeaf(wavy, blade=ParametricBlade(surface, Margin(star(), star(), spacing=0.25), rim_radius=0.3))


def rim_of(blade, mesh):
    """Heights of the vertices of a mesh's rim over the blade, and how far they are from the margin."""
    vertices, triangles = mesh_arrays(mesh.mesh)
    places, heights, _ = blade.surface.feet(vertices[np.unique(triangles[mesh.labels == RIM])], samples=blade.samples)
    return np.abs(heights), shapely.distance(blade.outline.polygon.boundary, shapely.points(places))


def require_embedded(mesh):
    report = mesh_report(mesh.mesh)
    assert report.watertight
    assert (report.components, report.self_intersections) == (1, 0)


@pytest.mark.few(step=1)
@pytest.mark.parametrize("step", [0.2, 0.07])
def test_a_tapered_solid_is_embedded_and_thin_all_along_its_rim(pointed, step):
    """The chords of the rim lie inside the margin, where the thickness has risen."""
    mesh = MeshPlan(pointed, step, closed=True).extract()
    require_embedded(mesh)
    heights, _ = rim_of(pointed.blade, mesh)
    # The texture is at most so high.
    assert heights.max() <= Taper(pointed.blade.outline.polygon, 0.3).least * (HALF + 0.1)


def test_the_sides_of_a_region_are_embedded_and_as_thick_as_the_leaf(pointed):
    rng = np.random.default_rng(0)
    for _ in range(4):
        middle = star()[1::2][rng.integers(7)] + rng.normal(0, 0.2, 2)
        mesh = MeshPlan(pointed, 0.07, middle + 0.7 * np.array([[-1], [1]]), closed=True).extract()
        require_embedded(mesh)
        heights, away = rim_of(pointed.blade, mesh)
        assert heights[away > 0.35].min() > HALF - 0.12


@cache
def slab_with(radius):
    """A flat slab of a rectangle, tapered towards its margin."""
    slab = texture_of(lambda x, y, z: HALF**2 - z**2 + 0 * x * y)
    surface = leaf_of(slab)[0].blade.surface
    ring = np.array([[6.0, -2], [14, -2], [14, 2], [6, 2]])
    return MultiscaleLeaf(slab, blade=ParametricBlade(surface, Margin(ring, ring, spacing=0.25), rim_radius=radius))


@pytest.mark.slow
def test_the_distance_beside_a_tapered_rim_is_the_way_to_it():
    """Level with the rim, which is a tenth as high as the slab."""
    leaf, rng = slab_with(0.3), np.random.default_rng(0)
    gap, height = rng.uniform(0.001, 0.05, 300), rng.uniform(-0.9, 0.9, 300) * 0.1 * HALF
    x = np.column_stack([rng.uniform(8, 12, 300), 2 + gap, height])
    assert np.abs(leaf.signed_distance(x, closed=True) - gap).max() <= RIM_DISTANCE


@pytest.mark.few(radius=2)
@pytest.mark.parametrize("radius", [0.15, 0.3, 1.0])
@pytest.mark.parametrize("closed", [False, True])
def test_distances_around_a_tapered_rim_are_those_to_its_section(radius, closed):
    """Brute force in the plane across a straight margin: the nearest of 120,000 points of the curve."""
    leaf, rng, count = slab_with(radius), np.random.default_rng(0), 600
    depth = (radius + 0.5) * np.linspace(0, 1, 60_000) ** 2
    height = HALF * leaf.blade.taper.values(np.column_stack([9 + 0 * depth, 2 - depth]))
    wall = np.column_stack([np.full(2001, 2.0), np.linspace(-height[0], height[0], 2001)])
    curve = np.column_stack([2 - depth, height])
    tree = cKDTree(np.concatenate([curve, curve * [1, -1], wall]))
    y, z = 2 + rng.uniform(-radius - 0.1, 0.15, count), rng.uniform(-0.35, 0.35, count)
    points = np.column_stack([rng.uniform(8, 12, count), y, z])
    expected, _ = tree.query(points[:, 1:])
    inside = (y < 2) & (np.abs(z) < HALF * leaf.blade.taper.values(points[:, :2]))
    found, step = leaf.signed_distance(points, closed=closed), leaf.index_of(closed=closed).tile.step
    off = np.abs(np.abs(found) - expected) / step
    assert off.max() < RIM_FOOT
    assert np.quantile(off, 0.99) < RIM_FOOT_99
    assert np.array_equal(found < 0, inside)
