import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin import sample_region
from o3dleaf.leaf.margin.sample_region import cover_sample
from tolerances import NARROW_BAYS


def slitted(width):
    """A strip 90 by 26 with six slits 12 deep, from either side by turns."""
    sides = [(90 * (k + 1) / 7, 1 if k % 2 else -1) for k in range(6)]
    slits = [shapely.box(x - width / 2, min(side, 14 * side), x + width / 2, max(side, 14 * side)) for x, side in sides]
    return shapely.box(0, -13, 90, 13).difference(shapely.union_all(slits))


def pinnate(gap):
    """Twelve leaflets 8 by 18 along a rachis 6 wide."""
    begins = 2 + (8 + gap) * np.arange(6)
    leaflets = [shapely.box(x, -21, x + 8, 21) for x in begins]
    return shapely.union_all([shapely.box(0, -3, begins[-1] + 10, 3), *leaflets])


def area_of(region):
    return shapely.area(shapely.polygons(region.points[region.triangles])).sum() + region.missing.sum()


def covered_twice(monkeypatch, samples):
    """Yield what samples cover, and what they cover where no bays are looked for."""
    found = [cover_sample(points) for points in samples]
    monkeypatch.setattr(sample_region, "narrow_bays", lambda mesh, *_: np.zeros(len(mesh.triangles), dtype=bool))
    yield from zip(found, map(cover_sample, samples), strict=True)


@pytest.mark.parametrize(
    ("leaf", "sampler"),
    [
        (slitted(1.5), leaves.jittered),
        (slitted(2.0), leaves.jittered),
        (pinnate(2.0), leaves.jittered),
        (pinnate(3.5), leaves.jittered),
        (pinnate(3.0), leaves.uniform),
    ],
)
def test_less_of_bays_a_few_spacings_wide_is_covered_than_where_none_are_looked_for(monkeypatch, leaf, sampler):
    """In spacings: a point for each unit of area."""
    samples = [sampler(leaf, round(leaf.area), np.random.default_rng(seed)) for seed in range(4)]
    areas = [(area_of(found), area_of(twin)) for found, twin in covered_twice(monkeypatch, samples)]
    error, filled = np.mean(areas, axis=0) - leaf.area
    assert abs(error) < NARROW_BAYS * filled


@pytest.mark.parametrize(("width", "density", "seed"), [(3.0, 0.25, 1), (5.0, 0.4, 3)])
def test_a_sparse_tail_without_deep_points_has_no_bays(monkeypatch, width, density, seed):
    rng, side = np.random.default_rng(seed), width / 2
    leaf = shapely.Polygon([(0, -8), (50, -8), (60, -side), (100, -side), (100, side), (60, side), (50, 8), (0, 8)])
    points = leaves.jittered(leaf, round(leaf.area), rng)
    points = points[(points[:, 0] < 55) | (rng.uniform(size=len(points)) < density)]
    for found, twin in covered_twice(monkeypatch, [points]):
        assert np.array_equal(found.triangles, twin.triangles)


@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered, leaves.scan_lines, leaves.graded])
def test_leaves_without_bays_are_covered_as_if_none_were_looked_for(monkeypatch, sampler):
    samples = [
        sampler(leaf, 2000, np.random.default_rng(seed))
        for seed, leaf in enumerate(3 * (leaves.ellipse(), leaves.strip(20)))
    ]
    for found, twin in covered_twice(monkeypatch, samples):
        assert np.array_equal(found.triangles, twin.triangles)
        assert np.array_equal(found.missing, twin.missing)
