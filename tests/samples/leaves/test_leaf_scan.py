"""Scans of leaves of known shape: points on the surface, as many, as noisy and as hidden as asked for."""

from functools import cache

import numpy as np
import pytest
import shapely
from scipy.spatial import KDTree
from shapely.geometry import box

from o3dleaf.core.errors import InputError
from o3dleaf.samples import LEAF_KINDS, LeafShape, leaf_shape, scan_leaf
from o3dleaf.samples.leaves.sweep import Sweep
from tolerances import LIFTED_DISTANCE, SCAN_SIGMAS

PLAIN = ["curled", "twisted", "wavy", "winding", "eaten", "lobed", "cupped"]


@pytest.fixture(scope="module")
def leaf_of():
    """Each kind's leaf, made once: its area is an integral."""
    return cache(leaf_shape)


@pytest.fixture(scope="module")
def whole_scan(leaf_of):
    """A scan of each kind without gaps."""
    return cache(lambda kind: scan_leaf(leaf_of(kind)))


@pytest.fixture(scope="module")
def eaten(leaf_of):
    return leaf_of("eaten")


@pytest.mark.few(kind=4)
@pytest.mark.parametrize("pattern", ["random", "lines", "stripes", "grid"])
@pytest.mark.parametrize("kind", PLAIN)
def test_without_noise_points_lie_on_the_leaf(leaf_of, kind, pattern):
    leaf = leaf_of(kind)
    scan = scan_leaf(leaf, spacing=1.0, pattern=pattern)
    assert leaf.contains(scan.places).all()
    assert np.abs(scan.points - leaf.lift(scan.places)).max() < LIFTED_DISTANCE
    assert np.abs(leaf(scan.points) - leaf.half_thickness).max() < LIFTED_DISTANCE


@pytest.mark.parametrize("pattern", ["random", "lines", "stripes", "grid"])
def test_the_spacing_is_one_over_the_root_of_the_density(eaten, pattern):
    scan = scan_leaf(eaten, spacing=0.8, pattern=pattern)
    assert len(scan.points) * 0.8**2 == pytest.approx(eaten.area, rel=0.02)


def test_a_random_sample_ends_half_a_spacing_inside_the_margin():
    """In windows two spacings wide the outermost of Poisson's points is 1 / (2 s ρ) = s/2 inside, on the average."""
    leaf = LeafShape("strip", Sweep(200.0, arch=(1.0, 0.0)), box(0.0, -10.0, 200.0, 10.0))
    spacing = 0.5
    places = scan_leaf(leaf, spacing=spacing).places
    window = (places[:, 0] // (2 * spacing)).astype(int)
    gaps = np.concatenate([[10 - (sign * places[window == w, 1]).max() for w in range(200)] for sign in (-1, 1)])
    assert abs(gaps.mean() - spacing / 2) < SCAN_SIGMAS * spacing / 2 / np.sqrt(len(gaps))


def test_a_random_sample_is_even_by_area_on_the_surface():
    leaf = leaf_shape("cupped", radius=25.0)
    places = scan_leaf(leaf, spacing=0.25).places
    inner = shapely.affinity.scale(leaf.outline, 0.5, 0.5)
    part = LeafShape("part", leaf.sweep, inner).area / leaf.area
    deviation = np.sqrt(part * (1 - part) / len(places))
    assert abs(np.mean(shapely.contains_xy(inner, places)) - part) < SCAN_SIGMAS * deviation
    # The plane's share is another one, by nearly twice that: the test can tell.
    assert abs(inner.area / leaf.outline.area - part) > 1.8 * SCAN_SIGMAS * deviation


def test_noise_and_passes_are_in_spacings(eaten):
    scan = scan_leaf(eaten, spacing=0.5, noise=0.3, passes=2, offset=4.0)
    away = scan.points - eaten.lift(scan.places)
    clean = scan_leaf(eaten, spacing=0.5, noise=0.3)
    assert clean.noise == pytest.approx(0.15)
    deviation = (clean.points - eaten.lift(clean.places)).std()
    assert deviation == pytest.approx(0.15, rel=SCAN_SIGMAS / np.sqrt(6 * len(clean.points)))
    second = np.linalg.norm(away, axis=1) > 1.0
    assert np.mean(second) == pytest.approx(0.5, abs=0.03)
    assert np.linalg.norm(away[second].mean(axis=0)) == pytest.approx(2.0, rel=0.02)
    assert np.linalg.norm(away[~second].mean(axis=0)) < SCAN_SIGMAS * 0.15 / np.sqrt((~second).sum()) * np.sqrt(3)


def test_flying_points_lie_behind_the_margin_along_one_beam_and_change_no_others(eaten):
    plain, scan = (scan_leaf(eaten, spacing=0.5, flying=depth) for depth in (0.0, 3.0))
    flying = scan.points[len(plain.points) :]
    assert np.array_equal(scan.points[: len(plain.points)], plain.points)
    rings = [eaten.lift(ring) for ring in eaten.margin_places(0.01)]
    length = sum(np.linalg.norm(np.diff(ring, axis=0), axis=1).sum() for ring in rings)
    assert len(flying) == pytest.approx(length / 0.5, rel=0.01)
    beam = -eaten.normals(np.mean(np.reshape(eaten.outline.bounds, (2, 2)), axis=0, keepdims=True))[0]
    margin = np.concatenate(rings)
    across = np.eye(3) - np.outer(beam, beam)  # a beam is a point of the plane across it
    off, edge = KDTree(margin @ across).query(flying @ across)
    assert off.max() < 0.01
    depth = (flying - margin[edge]) @ beam
    assert depth.min() > -0.01
    assert 1.0 < depth.max() < 1.51


def test_noise_along_the_normal_leaves_points_where_they_are_along_the_surface(eaten):
    scan = scan_leaf(eaten, spacing=0.5, noise=0.3, direction="normal")
    away, normals = scan.points - eaten.lift(scan.places), eaten.normals(scan.places)
    heights = (away * normals).sum(axis=1)
    np.testing.assert_allclose(away, heights[:, np.newaxis] * normals, atol=1e-12)
    assert heights.std() == pytest.approx(0.15, rel=SCAN_SIGMAS / np.sqrt(2 * len(heights)))


@pytest.mark.few(kind=3)
@pytest.mark.parametrize("gaps", ["patches", "band", "margin"])
@pytest.mark.parametrize("kind", sorted(LEAF_KINDS))
def test_nothing_is_seen_in_gaps(leaf_of, whole_scan, kind, gaps):
    leaf = leaf_of(kind)
    scan = scan_leaf(leaf, gaps=gaps)
    assert not shapely.contains_xy(scan.hidden, scan.places).any()
    full = whole_scan(kind)
    lost = len(full.places) - len(scan.places)
    deviation = np.sqrt(len(full.places) * scan.hidden_share)
    assert abs(lost - scan.hidden_share * len(full.places)) < SCAN_SIGMAS * deviation
    assert scan.hidden.difference(leaf.outline.buffer(1e-6)).area == pytest.approx(0, abs=1e-6)
    assert {"patches": 0.002, "band": 0.005, "margin": 0.04}[gaps] < scan.hidden_share < 0.15


def test_a_hidden_margin_is_hidden_over_forty_millimeters():
    scan = scan_leaf(leaf_shape("curled"), gaps="margin")
    low, _, high, _ = scan.hidden.bounds
    assert high - low == pytest.approx(40.0)


def test_a_second_layer_lies_its_height_above(eaten):
    leaf = leaf_shape("layers", height=0.5)
    scan = scan_leaf(leaf)
    above = scan.points[len(scan.places) :]
    assert len(above) * 0.6**2 == pytest.approx(leaf.layer.area, rel=0.01)
    foot, places = leaf.closest(above)
    np.testing.assert_allclose(np.linalg.norm(above - foot, axis=1), 0.5, rtol=1e-6)
    assert (((above - foot) * leaf.normals(places)).sum(axis=1) > 0).all()


def test_a_stalk_is_scanned_as_densely_as_the_blade():
    leaf = leaf_shape("petiole")
    scan = scan_leaf(leaf)
    stalks = scan.points[len(scan.places) :]
    assert len(stalks) * 0.6**2 == pytest.approx(sum(tube.area for tube in leaf.tubes), rel=0.01)
    axis = np.concatenate([tube.path for tube in leaf.tubes])
    assert KDTree(axis).query(stalks)[0].max() < leaf.tubes[1].radius + 0.1


def test_the_same_seed_gives_the_same_points_and_another_one_others(eaten):
    options = {"noise": 0.2, "gaps": "patches", "passes": 2}
    first, again, other = (scan_leaf(eaten, seed=seed, **options).points for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:50], other[:50])


@pytest.mark.parametrize(
    "options",
    [
        {"spacing": 0.0},
        {"pattern": "dots"},
        {"gaps": "all"},
        {"direction": "up"},
        {"noise": -1.0},
        {"passes": 0},
        {"spacing": 500.0},
    ],
)
def test_what_cannot_be_scanned_is_refused(eaten, options):
    with pytest.raises(InputError):
        scan_leaf(eaten, **options)
