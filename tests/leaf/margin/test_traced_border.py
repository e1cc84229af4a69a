from itertools import product

import numpy as np
import pytest
import shapely

import planar_leaves as leaves
from o3dleaf.leaf.margin.edge.lines_variance import lines_variance
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sample_region import cover_sample
from tolerances import TRACED_AREA

SHAPES = {"ellipse": leaves.ellipse(), "lobed": leaves.lobed(), "eaten": leaves.eaten(6)}


INSIDE, DENSE = (leaves.lattice, leaves.uniform, leaves.triangles), (1, 3, 7)
# A Latin square has each pair of shape, density and inside once; the others hold the same by combinations of them.
COMBINED = [
    pytest.param(shape, dense, inside, marks=[pytest.mark.slow] * ((i + j + k) % 3 > 0))
    for (i, shape), (j, dense), (k, inside) in product(*map(enumerate, (SHAPES, DENSE, INSIDE)))
]


def vertices(leaf, count, dense, inside=leaves.lattice):
    """A sample of the inside, and points along the margin, `dense` times as close as points inside."""
    spacing, rng = np.sqrt(leaf.area / count), np.random.default_rng(5)
    deep = inside(leaf.buffer(-0.5 * spacing), count, rng)
    rings = (leaf.exterior, *leaf.interiors)
    rim = [ring.interpolate(np.arange(0, ring.length - spacing / dense / 2, spacing / dense)) for ring in rings]
    return np.unique(np.vstack([deep, shapely.get_coordinates(np.concatenate(rim))]), axis=0)


@pytest.mark.parametrize(("shape", "dense", "inside"), COMBINED)
def test_a_margin_that_vertices_trace_is_the_margin(shape, dense, inside):
    leaf = SHAPES[shape]
    margin = Margin.fit(vertices(leaf, 1500, dense, inside))
    assert margin.area == pytest.approx(leaf.area, rel=TRACED_AREA)
    assert any("the margin runs through them" in note for note in margin.notes)


def test_vertices_far_denser_than_the_sample_inside_fill_no_bays():
    leaf = leaves.lobed()
    margin = Margin.fit(vertices(leaf, 1500, 14))
    assert margin.area == pytest.approx(leaf.area, rel=TRACED_AREA)


@pytest.mark.few(leaf=1, bend=1)
@pytest.mark.parametrize("bend", [0.0, 0.02])
@pytest.mark.parametrize("leaf", [*SHAPES.values(), leaves.strip(20, 16.0)], ids=[*SHAPES, "strip"])
def test_vertices_of_even_triangles_with_a_dense_margin_trace_it(leaf, bend):
    """Half of all points lie along the margin: they make no lines, and what is longer by a stretch makes no bays."""
    points = vertices(leaf, 2500, 7, lambda *args: leaves.triangles(*args, bend=bend))
    margin = Margin.fit(points)
    assert margin.area == pytest.approx(leaf.area, rel=TRACED_AREA)
    assert any("the margin runs through them" in note for note in margin.notes)
    assert lines_variance(points, margin.polygon) == 0


@pytest.mark.parametrize("off", [0.0, 1e-3, 0.02])
def test_vertices_along_straight_rows_that_are_sparser_trace_the_margin(off):
    """Also where they are a little off their line, and the border's triangles so flat that it passes them by."""
    inside = np.stack(np.meshgrid(np.arange(30) + 0.8, np.arange(20) + 0.8), axis=-1).reshape(-1, 2)
    box = shapely.box(0, 0, 30.6, 20.6)
    rim = shapely.get_coordinates(shapely.segmentize(box, 0.4))
    rim = rim[:-1] + off * np.random.default_rng(4).uniform(-1, 1, (len(rim) - 1, 2))
    margin = Margin.fit(np.vstack([inside, rim]))
    assert margin.area == pytest.approx(box.area, rel=TRACED_AREA)


@pytest.mark.few
@pytest.mark.parametrize("sampler", leaves.SAMPLERS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(3))
def test_no_sample_that_a_margin_cuts_is_taken_for_traced(shape, sampler, seed):
    points = leaves.SAMPLERS[sampler](SHAPES[shape], 800, np.random.default_rng(seed))
    assert not cover_sample(points).traced


def test_a_lattice_along_the_margin_is_grown_and_told():
    """Its border is as smooth as a mesh's; so are the rows inside."""
    points = np.stack(np.meshgrid(np.arange(30.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    margin = Margin.fit(points)
    assert margin.area == pytest.approx(600, rel=0.02)
    assert any("half a cell each" in note for note in margin.notes)
