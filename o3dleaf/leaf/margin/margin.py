"""The margin: the closed curve in the chart where the leaf ends, with its holes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import NotNegative, Positive, Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points, as_sites
from o3dleaf.core.checks.scalars import as_number, require_positive
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.blade.outline_area import in_polygon
from o3dleaf.leaf.margin.edge.edge_excess import tell_excess
from o3dleaf.leaf.margin.edge.least_distance import least_distance
from o3dleaf.leaf.margin.gaps.hole import Hole
from o3dleaf.leaf.margin.margin_curve import Spacing, largest
from o3dleaf.leaf.margin.margin_rings import fit_rings
from o3dleaf.leaf.margin.sample_region import SampleRegion, cover_sample
from o3dleaf.leaf.margin.scan_planes import Lift

ROOM = 1.05
"""Times the width of a hole that is named to fill it: more than a figure of three digits is rounded by."""
TOLD = 0.002
"""Share of the points that may lie outside, or of the area that may be taken as covered, without a note."""
TOGETHER = 0.1
"""Of the sample's extent, within which half of some points lie that have one place."""


@checked
class Margin:
    """The outline of the leaf in the chart (u, v): a smooth closed curve where the leaf ends.

    Attributes
    ----------
    points : (n, 2) ndarray
        The places in the chart that it was fitted to.
    ring : (k, 2) ndarray
        The outer curve, counter-clockwise, without its first point again.
    hole_rings : tuple of (k, 2) ndarray
        The curves of the holes kept, clockwise.
    spacing : float
        Median point spacing √(area per point) of the sample.
    holes : tuple of Hole
        Holes larger than the sample's gaps, kept and filled, the largest first.
    notes : tuple of str
        What the margin does not hold, in sentences; empty where there is nothing to say.
    unit : str or None
    """

    def __init__(
        self,
        points: npt.ArrayLike,
        ring: npt.ArrayLike,
        hole_rings: tuple[npt.ArrayLike, ...] = (),
        *,
        spacing: Positive,
        holes: tuple[Hole, ...] = (),
        notes: tuple[str, ...] = (),
        unit: Unit | None = None,
    ) -> None:
        self.points = as_sites(points, "points", dim=2)
        self.ring = as_sites(ring, "ring", dim=2, least=3)
        self.hole_rings = tuple(as_sites(hole, "hole_rings", dim=2, least=3) for hole in hole_rings)
        self.spacing, self.holes, self.notes, self.unit = float(spacing), tuple(holes), tuple(notes), unit
        self.polygon = shapely.Polygon(self.ring, self.hole_rings)
        shapely.prepare(self.polygon)

    @classmethod
    @checked
    def fit(
        cls,
        uv: npt.ArrayLike,
        *,
        spacing: Positive | None = None,
        fill_holes: NotNegative | None = None,
        noise: NotNegative = 0.0,
        thinned_to: NotNegative | None = None,
        lift: Lift | None = None,
        unit: Unit | None = None,
    ) -> "Margin":
        """Fit the margin of a sample of the leaf.

        The triangles that the sample covers (`cover_sample`) are smoothed along their border and grown by what a
        sample leaves out there (`missing_area`), less what noise has added; sharp tips are found. For a random
        sample the curve then moves to where it is most likely (`fit_edge`), and so do both flanks of tips together.
        A border that a mesh's vertices trace is the margin itself (`border_of`).

        Parameters
        ----------
        uv : (n, 2) array-like
            Feet of the scan's points in a chart that keeps areas, so that their density is the scan's.
        spacing : float, optional
            The least spacing to resolve: denser places are taken to be no denser. Default: the sample's own.
        fill_holes : float, optional
            Holes and slits of up to this width are filled. By default holes no wider than the widest gap over which
            pieces of the sample had to be joined, none if it is in one piece: such a sample cannot tell its gaps from
            holes.
        noise : float
            Standard deviation of the points that is expected in the plane, where it carries some of them over the edge.
            For random samples it is found from how the edge is blurred (`edge_noise`), as a scanner's may lie along its
            beam.
        thinned_to : float, optional
            Distance in space below which points were left out, as CloudCompare and MeshLab do; 0: none were. By default
            it is that of nearest neighbors in the chart, if they are as far apart in a sharp minimum.
        lift : callable, optional
            ``lift(uv)``: places (k, 2) to the points (k, 3) of the surface whose chart it is, and its derivatives
            (k, 2, 3) by u and v. With it gaps that lie along the planes of a line scanner, which pass by them, are no
            holes and no bays.
        unit : str, optional

        Raises
        ------
        InputError
            If there are fewer than three points or they lie on one line.
        ReconstructionError
            If no area is left.
        """
        points = as_sites(uv, "uv", dim=2, least=3)
        given = None if fill_holes is None else as_number(fill_holes, "fill_holes")
        least = 0.0 if spacing is None else require_positive(spacing, "spacing")
        found = least_distance(points) if thinned_to is None else as_number(thinned_to, "thinned_to")
        region = cover_sample(UniqueRows.of(points).rows, 0.0 if given is None else given, lift)
        local = Spacing(cKDTree(region.points), np.maximum(region.spacing, least))
        limit = region.widest if given is None else given
        (outer, *inner), sample = fit_rings(region, local, as_number(noise, "noise"), found)
        holes = [Hole.of(ring, limit) for ring in inner]
        order = sorted(range(len(holes)), key=lambda i: -holes[i].area)
        polygon = shapely.Polygon(outer)
        for i in order:
            if not holes[i].filled:
                polygon = largest(polygon.difference(shapely.Polygon(inner[i])))
        if polygon.is_empty:
            raise ReconstructionError("the points cover no area in the chart; give a denser scan")
        ring, *hole_rings = _rings_of(polygon)
        return cls(
            points,
            ring,
            tuple(hole_rings),
            spacing=float(np.median(region.spacing)),
            holes=tuple(holes[i] for i in order),
            notes=tell_excess(sample) + _notes(region, holes, polygon.area),
            unit=unit,
        )

    def __repr__(self) -> str:
        kept = len(self.hole_rings)
        return f"Margin({len(self.points):,} points, area {self.area:.6g}, {kept} holes, spacing {self.spacing:.4g})"

    def state(self) -> dict[str, Any]:
        """Return what the margin is made of, for `o3dleaf.io.models.model_file`."""
        names = ("points", "ring", "hole_rings", "spacing", "holes", "notes", "unit")
        return {name: getattr(self, name) for name in names}

    @property
    def rounded(self) -> shapely.Polygon:
        """The polygon itself: it is smooth, and open and closed meshes end on the same curve."""
        return self.polygon

    @property
    def bounds(self) -> FloatArray:
        """(2, 2) bounding box of the margin."""
        return np.array(self.polygon.bounds).reshape(2, 2)

    @property
    def area(self) -> float:
        """Area inside the margin, without holes."""
        return float(self.polygon.area)

    def contains(self, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return for each of the (n, 2) points whether it lies inside the margin or on it."""
        return in_polygon(self.polygon, as_points(points, dim=2))


def _rings_of(polygon: shapely.Polygon) -> list[FloatArray]:
    """Return the corners (k, 2) of a polygon's rings: the outer one first, counter-clockwise, then those of holes."""
    polygon = shapely.orient_polygons(polygon)
    return [shapely.get_coordinates(ring)[:-1] for ring in (polygon.exterior, *polygon.interiors)]


def carry_margin(margin: Margin, carry: Callable[[FloatArray], FloatArray]) -> Margin:
    """Return a margin in another chart, to which `carry` takes places (n, 2) of its own."""
    holes = tuple(replace(hole, place=carry(hole.place[np.newaxis])[0]) for hole in margin.holes)
    ring, *hole_rings = (carry(ring) for ring in (margin.ring, *margin.hole_rings))
    state = margin.state() | {"holes": holes, "ring": ring, "hole_rings": tuple(hole_rings)}
    return Margin(**state | {"points": carry(margin.points)})


def cut_margin(margin: Margin, polygon: shapely.Polygon) -> Margin:
    """Return a margin around a part of its polygon."""
    ring, *hole_rings = _rings_of(polygon)
    return Margin(**margin.state() | {"ring": ring, "hole_rings": tuple(hole_rings)})


def _notes(region: SampleRegion, holes: list[Hole], area: float) -> tuple[str, ...]:
    """Return what the region does not hold, of the margin's area, and which holes may be the scanner's."""
    notes = []
    narrow = [hole.width for hole in holes if not hole.filled and hole.width <= region.void]
    if narrow:
        said = f"holes no wider than chance leaves between points, {len(narrow)} of up to {tell_length(max(narrow))}"
        fill = f"fill_holes {ROOM * max(narrow):.3g} would fill them"
        notes.append(f"{said}: tears, or slits that the scanner left; {fill}")
    if region.border is not None and region.border.smooth:
        notes.append(region.border.note(float(region.missing.sum() / (region.spacing**2).sum())))
    if region.passed_by > TOLD * area:
        share = region.passed_by / area
        notes.append(f"{share:.1%} of the area lies along the scanner's planes, which pass by it: taken as covered")
    if region.bridged:
        notes.append(f"{region.bridged + 1} pieces of the scan were joined over gaps wider than the scan's own")
    if len(region.left_out) > TOLD * len(region.points):
        share = len(region.left_out) / len(region.points)
        where = _where(region.points[region.left_out], np.ptp(region.points, axis=0))
        notes.append(f"{len(region.left_out):,} points ({share:.1%}) lie apart and are left out, {where}")
    return tuple(notes)


def _where(places: FloatArray, extent: FloatArray) -> str:
    """Return where places (k, 2) of a chart lie, in words: all along a margin, their middle is in none of them."""
    middle = np.median(places, axis=0)
    away = np.median(np.linalg.norm(places - middle, axis=1))
    return f"most about u {middle[0]:.4g}, v {middle[1]:.4g}" if away <= TOGETHER * extent.max() else "scattered"
