"""Bends that are tighter than the points show: found by their radius, and left out only past the edge of the sheet."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.surface import ChartSurface
from o3dleaf.leaf.parametric.tight_bends import past_tight_bends, tight_bends, tight_bends_on_sheet
from sheet_shapes import triangulated

SPACING = 0.5
LENGTH, HALF, OVER = 12.0, 3.0, 0.6
"""A strip, flat up to v = HALF and bent beyond over a way OVER."""


def bent(plane, radius):
    """Return points of the strip, which is rolled with a radius from v = HALF on; no length changes."""
    u, v = plane.T
    turn = np.maximum(v - HALF, 0.0) / radius
    return np.column_stack([u, np.minimum(v, HALF) + radius * np.sin(turn), radius * (1 - np.cos(turn))])


def fitted(radius, edge):
    """Return a surface through the strip over a sheet that ends at v = `edge`."""
    outline = [[0, -HALF], [LENGTH, -HALF], [LENGTH, edge], [0, edge]]
    chart, triangles = triangulated(shapely.Polygon(outline), SPACING)
    grid = np.meshgrid(np.arange(0, LENGTH + 0.01, 0.25), np.arange(-HALF, HALF + OVER + 0.01, 0.05), indexing="ij")
    plane = np.stack(grid, axis=-1).reshape(-1, 2)
    surface = ChartSurface.fit(plane, bent(plane, radius), smoothing=0.0)
    mesh = ChartMesh(bent(chart, radius), triangles, chart)
    return SurfaceFit(surface, mesh, bent(plane, radius), plane, np.zeros(len(plane)), None, plane)


@pytest.mark.parametrize(("radius", "tight"), [(2.0 * SPACING, False), (0.6 * SPACING, True)])
def test_a_bend_is_tight_if_its_radius_is_less_than_the_spacing(radius, tight):
    fit = fitted(radius, HALF)
    places = tight_bends(fit.surface, fit.feet, SPACING)
    assert (len(places) > 0) == tight
    assert (places[:, 1] > HALF - SPACING).all()


def test_only_past_the_sheet_points_on_tight_bends_say_nothing_of_the_margin():
    past = fitted(0.6 * SPACING, HALF)
    dropped = past_tight_bends(past, SPACING)
    v = past.feet[:, 1]
    assert dropped[(v > HALF + 0.2) & (v < HALF + OVER - 0.1)].all()
    assert not dropped[v <= HALF].any()
    whole = fitted(0.6 * SPACING, HALF + OVER + 0.1)
    inner = np.abs(whole.feet[:, 0] - LENGTH / 2) < LENGTH / 2 - 1  # off the corners of the sheet
    assert not past_tight_bends(whole, SPACING)[inner].any()
    assert not past_tight_bends(fitted(2.0 * SPACING, HALF), SPACING).any()


def test_the_tight_bends_of_a_sheet_are_on_it():
    past, whole = fitted(0.6 * SPACING, HALF), fitted(0.6 * SPACING, HALF + OVER + 0.1)

    def tight(fit, feet=slice(None), **radius):
        return tight_bends_on_sheet(fit.surface, fit.mesh, fit.feet[feet], SPACING, **radius)

    assert tight(replace(past, surface=fitted(2.0 * SPACING, HALF).surface)).tightest == np.inf
    assert not len(tight(past, past.feet[:, 1] < HALF - 2 * SPACING).radii)
    bends = tight(whole)
    assert (bends.radii < SPACING).all()
    assert (bends.places[:, 1] > HALF - SPACING / 2).all()
    assert bends.tightest == bends.radii.min()
    # Of those, the ones that are tighter still.
    tighter = np.median(bends.radii) / SPACING
    assert np.array_equal(tight(whole, tightest=tighter).places, bends.places[bends.radii < tighter * SPACING])
    # The flat part alone as the sheet: the bend lies past its edge.
    assert not len(tight(fitted(0.6 * SPACING, HALF - 2 * SPACING)).radii)
