"""The rings of a covered region as the curves where the leaf ends: grown, their tips restored, and fitted."""

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.edge.edge_excess import with_edge_excess
from o3dleaf.leaf.margin.edge.edge_fit import fit_edge
from o3dleaf.leaf.margin.edge.edge_frame import EdgeSample
from o3dleaf.leaf.margin.edge.edge_noise import with_edge_noise
from o3dleaf.leaf.margin.edge.tip_ends import with_ends
from o3dleaf.leaf.margin.margin_curve import (
    CREASE_WIDTH,
    STEP,
    Spacing,
    grown,
    largest,
    margin_ring,
    polygon_of,
    resample,
    smooth,
)
from o3dleaf.leaf.margin.sample_region import SampleRegion
from o3dleaf.leaf.margin.tips.margin_tips import with_tips

FUSE = 0.02
"""The covered region is grown by this many spacings, so that triangles which meet in a corner alone are one piece."""
MIN_HOLE = 6.0
"""Cells that a hole has at least, once the leaf has grown into it: less is one point that is not there by chance."""
AHEAD = np.array([np.cos(1), np.sin(1)])
"""The direction in which a ring's first corner is farthest out: no axis of a leaf, along which two may be as far."""


def fit_rings(
    region: SampleRegion, local: Spacing, noise: float, thinned_to: float
) -> tuple[list[FloatArray], EdgeSample]:
    """Return the curves (k, 2) where the leaf ends, and what they were fitted to.

    The outer curve comes first, counter-clockwise, then those of holes.

    Parameters
    ----------
    region : SampleRegion
    local : Spacing
    noise, thinned_to : float
        As in `Margin.fit`.

    Raises
    ------
    ReconstructionError
        If no area is left.
    """
    triangles = shapely.polygons(region.points[region.triangles])
    try:
        union = shapely.coverage_union_all(triangles)
    except shapely.GEOSException:  # flat triangles of a lattice overlap by a rounding; this takes ten times as long
        union = shapely.union_all(triangles)
    fuse = FUSE * float(np.median(region.spacing))
    covered = shapely.orient_polygons(largest(union.buffer(fuse, join_style="mitre")))
    if region.traced:
        covered, fuse = shapely.orient_polygons(largest(covered.buffer(-fuse, join_style="mitre"))), 0.0
    rings = [covered.exterior, *covered.interiors]
    cut = np.flatnonzero(region.missing)
    owner = _owners(rings, region.points[cut])
    filled = shapely.multipolygons(shapely.polygons(region.points[region.filled]))
    random = 0.0 if region.traced else region.randomness
    sample = EdgeSample(local, noise, random, filled, thinned_to=thinned_to, lines=region.lines)

    def area_of(number: int) -> shapely.Polygon:
        own = cut[owner == number]
        places = shapely.get_coordinates(rings[number])[:-1]
        curve, growth = margin_ring(places, region.points[own], region.missing[own], local, sample.noise, sample.lines)
        inside, band = polygon_of(curve), grown(curve, np.maximum(growth - fuse, 0.0))
        return largest(inside.difference(band) if number else inside.union(band))

    outer = area_of(0)
    if outer.is_empty:
        raise ReconstructionError("the points cover no area in the chart; give a denser scan")
    begun = begin_ring(outer, local, hole=False)
    sample = with_edge_excess(*begun, with_edge_noise(*begun, sample))
    curves = []
    for number in range(len(rings)):
        area = area_of(number) if number or sample.noise != noise else outer
        if area.is_empty:
            continue
        if number and area.area < MIN_HOLE * np.median(local(shapely.get_coordinates(area.exterior))) ** 2:
            continue  # no hole, once the leaf around it is whole
        start = begun if area is outer else begin_ring(area, local, hole=bool(number))
        curves.append(_finished(*start, sample))
    return curves, sample


def _owners(rings: list[shapely.LinearRing], points: FloatArray) -> IntArray:
    """Return the number (n,) of the ring nearest to each of the points."""
    tree = shapely.STRtree(rings)
    found = tree.query_nearest(shapely.points(points), all_matches=False)
    owner = np.zeros(len(points), dtype=np.int64)
    owner[found[0]] = found[1]
    return owner


def begin_ring(area: shapely.Polygon, local: Spacing, *, hole: bool) -> tuple[FloatArray, FloatArray]:
    """Return the outer ring of an area without creases, in steps of a fraction of the spacing, and its sharp tips."""
    ring = shapely.get_coordinates(shapely.orient_polygons(area).exterior)[:-1]
    # From the corner that is farthest out in some direction: a union begins its rings anywhere.
    ring = np.roll(ring, -int(np.argmax(ring @ AHEAD)), axis=0)
    curve = _simple(smooth(resample(ring, local)[0], CREASE_WIDTH / STEP))
    return (curve[::-1], np.empty((0, 2))) if hole else with_tips(curve, local)


def _finished(curve: FloatArray, apexes: FloatArray, sample: EdgeSample) -> FloatArray:
    """Return the ring of an area as the margin, a simple curve.

    Its sharp tips are known, as the curve is free to turn there; the less the sample is a lattice, the more the
    curve is that of greatest likelihood.
    """
    if sample.randomness > 0:
        fitted = resample(with_ends(fit_edge(curve, apexes, sample), sample), sample.local)[0]
        curve = fitted if shapely.Polygon(fitted).is_valid else curve  # narrower than two points: it crosses itself
    return _simple(curve)


def _simple(curve: FloatArray) -> FloatArray:
    """Return the curve, or where it crosses itself the border of the largest area inside it."""
    polygon = largest(polygon_of(curve))
    return np.asarray(shapely.get_coordinates(shapely.orient_polygons(polygon).exterior)[:-1])
