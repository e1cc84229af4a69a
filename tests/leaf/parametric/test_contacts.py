"""A blade that would pass through itself ends before that, if an end of few points does, and only there."""

import numpy as np
import pytest
import shapely

from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.margin.sheet_mesh import triangulate
from o3dleaf.leaf.parametric.contacts import CLEARANCE, MAX_CUT, end_before_contacts
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.surface.mesh.crossings import find_crossings

SPACING = 0.5
LENGTH, HALF, RADIUS = 20.0, 4.0, 3.0
DOWN = LENGTH + 1.5 * np.pi * RADIUS
"""Where a tail comes down again that turns up, back and over from u = LENGTH on."""
THROUGH = DOWN + RADIUS
"""Where it meets the strip that it comes from."""
PAST = 3.0
"""How far it goes on: less would be lost of the strip, if it could have a hole."""


def coiled(plane):
    """Return points of the strip and its tail; no length changes."""
    u, v = plane.T
    turn = np.clip((u - LENGTH) / RADIUS, 0, 1.5 * np.pi)
    x, z = np.minimum(u, LENGTH) + RADIUS * np.sin(turn), RADIUS * (1 - np.cos(turn))
    return np.column_stack([x, v, z - np.maximum(u - DOWN, 0)])


@pytest.fixture(scope="module")
def surface():
    grid = np.meshgrid(np.arange(0, THROUGH + PAST + 1, 0.25), np.arange(-HALF, HALF + 0.01, 0.25), indexing="ij")
    plane = np.stack(grid, axis=-1).reshape(-1, 2)
    return ChartSurface.fit(plane, coiled(plane), smoothing=0.0)


def margin_with(half, end):
    """Return the margin of a strip with a tail as wide as 2 half, up to u = end."""
    tail = shapely.box(LENGTH - 1, -half, end, half)
    whole = shapely.box(0, -HALF, LENGTH, HALF).union(tail).segmentize(SPACING)
    ring = shapely.get_coordinates(shapely.orient_polygons(whole).exterior)[:-1]
    return Margin(ring, ring, spacing=SPACING)


def crossings(surface, polygon, step):
    plane, triangles = triangulate(polygon, step)
    return int(find_crossings(surface.jet(plane, 0)[0], triangles).sum())


def test_a_narrow_end_that_passes_through_the_blade_stops_before_that(surface):
    half = 0.5
    margin = margin_with(half, THROUGH + PAST)
    assert crossings(surface, margin.polygon, 0.2) > 0
    ended, notes = end_before_contacts(surface, margin, SPACING)
    assert len(notes) == 1
    for step in (0.1, 0.2, 0.4, 0.8):
        assert crossings(surface, ended.polygon, step) == 0
    # All of the tail that lies past the crossing goes, by what the margin keeps from it and the triangles are wide.
    gone = margin.polygon.difference(ended.polygon)
    assert 2 * half * PAST <= gone.area <= 2 * half * (PAST + CLEARANCE * SPACING + SPACING)
    assert not ended.polygon.interiors
    assert ended.polygon.bounds[2] <= THROUGH - SPACING / 4
    assert gone.bounds[0] >= THROUGH - CLEARANCE * SPACING - SPACING
    assert margin.polygon.buffer(1e-9).contains(ended.polygon)


def test_where_more_would_be_lost_than_an_end_has_or_nothing_crosses_the_margin_stays(surface):
    wide = margin_with(3.0, THROUGH + PAST)
    assert 2 * 3.0 * PAST > MAX_CUT * SPACING**2
    assert crossings(surface, wide.polygon, 0.2) > 0
    assert end_before_contacts(surface, wide, SPACING) == (wide, ())
    apart = margin_with(0.5, THROUGH - PAST)
    assert end_before_contacts(surface, apart, SPACING) == (apart, ())
