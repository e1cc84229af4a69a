import importlib
from pathlib import Path

import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin import sample_region
from o3dleaf.leaf.margin.sample_region import cover_sample
from tolerances import BAYS_COVERED, NARROW_BAYS

SCRIPTS = Path(__file__).parents[3] / "scripts"


def area_of(region):
    return shapely.area(shapely.polygons(region.points[region.triangles])).sum() + region.missing.sum()


def covered_twice(monkeypatch, samples):
    """Yield what samples cover, and what they cover where no bays are looked for."""
    found = [cover_sample(points) for points in samples]
    monkeypatch.setattr(sample_region, "narrow_bays", lambda mesh, *_: np.zeros(len(mesh.triangles), dtype=bool))
    yield from zip(found, map(cover_sample, samples), strict=True)


@pytest.mark.few(leaf=1)
@pytest.mark.parametrize(("leaf", "count"), [("slits 2", 4), ("leaflets 2", 2), ("slits 1.5", 4), ("leaflets 3.5", 2)])
def test_less_of_bays_a_few_spacings_wide_is_covered_than_where_none_are_looked_for(monkeypatch, leaf, count):
    """In spacings: a point for each unit of area. Areas of independent points stray too far for so few samples."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    leaf = importlib.import_module("measure_bays").family(held_out=False)[leaf]
    samples = [leaves.jittered(leaf, round(leaf.area), np.random.default_rng(seed)) for seed in range(count)]
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


@pytest.mark.few(sampler=1)
@pytest.mark.parametrize("sampler", [leaves.uniform, leaves.jittered, leaves.scan_lines, leaves.graded])
def test_leaves_without_bays_are_covered_as_if_none_were_looked_for(monkeypatch, sampler):
    samples = [
        sampler(leaf, 2000, np.random.default_rng(seed))
        for seed, leaf in enumerate((leaves.ellipse(), leaves.strip(20)))
    ]
    for found, twin in covered_twice(monkeypatch, samples):
        assert np.array_equal(found.triangles, twin.triangles)
        assert np.array_equal(found.missing, twin.missing)


def test_hardly_any_of_bays_is_covered(monkeypatch):
    """No point of the leaf at their banks is joined to both, and none is shut where spacings are found anew."""
    monkeypatch.syspath_prepend(str(SCRIPTS))
    bays = importlib.import_module("measure_bays")
    leaf = bays.family(held_out=False)["leaflets 3"]
    between = leaf.buffer(2.0, join_style="mitre").buffer(-2.0, join_style="mitre").difference(leaf)
    covered = []
    for seed in range(2):
        region = cover_sample(bays.independent(leaf, np.random.default_rng(seed)))
        triangles = shapely.polygons(region.points[region.triangles])
        covered.append(shapely.area(shapely.intersection(triangles, between)).sum() / between.area)
    assert np.mean(covered) < BAYS_COVERED
