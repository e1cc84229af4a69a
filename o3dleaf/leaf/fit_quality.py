"""The read-out of a fit: what a blade holds of its scan and what it does not, by share and by place."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.core.units import measure_in_words, tell_share
from o3dleaf.leaf.blade.blade import SAMPLE_COUNT, Blade
from o3dleaf.leaf.blade.distortion import range_of
from o3dleaf.leaf.blade.outline_area import places_inside
from o3dleaf.leaf.margin.edge.lines_variance import lines_variance
from o3dleaf.leaf.residuals.bent_margin import BentMargin, find_bent_margin
from o3dleaf.leaf.residuals.known_area import area_deviation
from o3dleaf.leaf.residuals.lost_relief import LostRelief, find_lost_relief, tell_lost_relief
from o3dleaf.leaf.residuals.noise import local_noise, shared_residual
from o3dleaf.leaf.residuals.off_blade import find_feet, find_outside, measure_spacing, points_on, rows_of_piece
from o3dleaf.leaf.residuals.places import Place, find_places, tell_places
from o3dleaf.leaf.residuals.rounding import Rounding, find_rounding
from o3dleaf.leaf.residuals.two_layers import TwoLayers, find_two_layers
from o3dleaf.surface.cloud.usable_points import MIN_POINTS, usable_rows

FAR = 3.0
"""Noise deviations beyond which a point is not held: of normal errors one in 370 lies there."""
MIN_FAR = 0.3
"""Spacings within which a point is held whatever the noise: half of what a mesh of a scan is asked to be right to."""
MAX_REPEATED = 0.01
"""Share of points that repeat others above which it is told: fewer change no figure by a hundredth."""
MAX_FAR = 0.01
"""Share of points not held above which it is told: four times what normal errors leave there."""
OUTSIDE = 1.0
"""Spacings beyond the margin from which a point is outside: the margin itself is known no better."""
MAX_OUTSIDE = 0.005
"""Share of points outside above which it is told."""
GAP = 3.0
"""Spacings to the nearest point beyond which a place is in a gap: a random scan leaves exp(−9π) of its area there."""
MAX_GAPS = 0.01
"""Share of the blade in gaps above which it is told."""
MAX_DEVIATION = 0.02
"""Share of the area that its standard deviation exceeds where it is told: one leaf in three errs by more."""
STRETCH = 0.05
"""Stretch of the texture above which it is told: below, it is less than what patches of one leaf differ by."""
SLACK = 2.0
"""Steps between the places at which a blade is measured that it may be nearer to a point than the nearest of them."""


@dataclass(frozen=True, eq=False)
class FitQuality:
    """How well a blade holds its scan: residuals, points off it and beside it, gaps, holes, and the chart's stretch.

    Attributes
    ----------
    plane : (n, 2) ndarray
        (along, across) of the points that are measured: the scan's or, where the blade was made of one piece that was
        asked for, that piece's.
    rows : (n,) ndarray of int64
        Of these points in the scan.
    others : int
        Points of the scan that belong to other pieces, and count in no figure.
    distance : (n,) ndarray
        Of the points from the blade, above it > 0, or from their own of two layers: the residuals, in `unit`.
    layers : TwoLayers or None
        Where the blade runs midway between two layers of points, as both sides of a leaf.
    is_far, is_outside : (n,) ndarrays of bool
        Whether a point lies farther off the blade than `limit`; beside it, beyond its margin or in a hole, by more
        than a spacing and three noise deviations. No point is both, and none that was cut off as petiole is either.
    is_cut : (n,) ndarray of bool
        Whether a point off the blade or beside it is of the petiole that was cut off.
    repeated : float
        Share of the points that repeat others, to a thousandth of the spacing: they say nothing new, and count in no
        other figure.
    rounding : Rounding or None
        The axis and the step that coordinates are rounded to, in `unit`, where that makes terraces of the scan.
    noise, spacing, limit : float
        Standard deviation of the points about the blade, from what neighbors differ by; 1/√(points per area), the
        median over the blade; and `FAR` noise deviations, at least `MIN_FAR` spacings; in `unit`.
    shared : float
        Root mean square of what neighbors are off the blade alike (`shared_residual`), of points neither far nor
        outside; in `unit`.
    residuals : tuple of four floats
        |residual| that half of the points stay below, 95 % and 99 % of them, and the largest; of those not outside.
    far, outside, gaps : float
        Share of the points that are far, share of them outside, and share of the blade's area farther than `GAP`
        spacings from every point.
    far_places, outside_places, gap_places : tuple of Place
        The largest places of each.
    area : (2,) tuple of float
        Of the blade in the world and in its plane, in `unit` squared.
    area_deviation : float
        Standard deviation of the first by the chance of a scan (`known_area`, `lines_variance`), in `unit` squared.
    lost : LostRelief
        What of the first is lacking as relief was smoothed away: its share, the share's deviation, and its places.
    along, across, stretch : (2,) tuples of float
        Length in the world of a unit length of the plane along the midrib, across it, and in its worst and best
        direction: 1 % of the area has less, and 1 % more.
    bent : BentMargin
        Strips along the margin that bend off the blade inside them: shares of its length and of the area, places.
    holes : tuple of dict
        Holes of the scan: place in the world, area, width, and whether they were filled.
    unit : str or None
    """

    plane: FloatArray
    rows: IntArray
    others: int
    distance: FloatArray
    layers: TwoLayers | None
    is_far: BoolArray
    is_outside: BoolArray
    is_cut: BoolArray
    repeated: float
    rounding: Rounding | None
    noise: float
    spacing: float
    limit: float
    shared: float
    residuals: tuple[float, ...]
    far: float
    outside: float
    gaps: float
    far_places: tuple[Place, ...]
    outside_places: tuple[Place, ...]
    gap_places: tuple[Place, ...]
    area: tuple[float, float]
    area_deviation: float
    lost: LostRelief
    along: tuple[float, float]
    across: tuple[float, float]
    stretch: tuple[float, float]
    bent: BentMargin
    holes: tuple[dict[str, Any], ...]
    unit: str | None

    @classmethod
    @checked
    def of(cls, blade: Blade, scan: CloudLike) -> "FitQuality":
        """Measure how well a blade holds its scan, or the piece of it that was asked for.

        Parameters
        ----------
        blade : Blade
        scan : (n, 3) array_like or Open3D point cloud
            Whole, or that piece alone, in the blade's unit.

        Raises
        ------
        InputError
            If fewer than ten points belong to the piece that the blade was made of.
        """
        whole = points_of(scan, "scan", least=MIN_POINTS)
        rows = rows_of_piece(blade, whole)
        points = whole[rows]
        places = places_inside(blade.outline, SAMPLE_COUNT)
        distortion = blade.distortion(places)
        world = points_on(blade, places)
        stretch = distortion.stretch
        step = float(np.sqrt(blade.outline.area / len(places))) * stretch[1]
        plane, distance, feet = find_feet(blade, points, world, SLACK * step)
        once = usable_rows(points, None)
        spacing = measure_spacing(feet[once], world, distortion.area * blade.outline.area / len(places))
        layers = find_two_layers(plane, feet, distance, once, spacing)
        if layers is not None:
            points, distance = layers.onto_blade(points, feet, distance)
        noise = local_noise(feet[once], distance[once])
        limit = max(FAR * noise, MIN_FAR * spacing)
        is_outside = find_outside(blade, plane, max(OUTSIDE * spacing, FAR * noise))
        is_far = (np.abs(distance) > limit) & ~is_outside
        is_cut = _cut_off(blade, points) & (is_far | is_outside)
        is_far, is_outside = is_far & ~is_cut, is_outside & ~is_cut
        in_gap = query(cKDTree(points), world)[0] > np.hypot(GAP * spacing, limit)
        on_it = once[~(is_outside | is_cut)[once]]
        held = on_it[~is_far[on_it]]
        kept = np.abs(distance[on_it if len(on_it) else once])
        near = on_it[np.abs(distance[on_it]) <= max(limit, spacing)]
        of_lines = lines_variance(plane[once[~is_outside[once]], :2], blade.outline.polygon)
        return cls(
            plane=plane,
            rows=rows,
            others=len(whole) - len(rows),
            distance=distance,
            layers=layers,
            is_far=is_far,
            is_outside=is_outside,
            is_cut=is_cut,
            repeated=1 - len(once) / len(points),
            rounding=find_rounding(points[once]),
            noise=noise,
            spacing=spacing,
            limit=limit,
            shared=shared_residual(feet[held], distance[held]) if len(held) > 1 else 0.0,
            residuals=tuple(np.quantile(kept, (0.5, 0.95, 0.99, 1)).tolist()),
            far=float(is_far[once].mean()),
            outside=float(is_outside[once].mean()),
            gaps=float(np.average(in_gap, weights=distortion.area)),
            far_places=find_places(points[once], is_far[once], spacing),
            outside_places=find_places(points[once], is_outside[once], spacing),
            gap_places=find_places(world, in_gap, max(spacing, step)),
            area=(float(blade.outline.area * distortion.area.mean()), float(blade.outline.area)),
            area_deviation=float(np.hypot(area_deviation(blade, spacing, noise), np.sqrt(of_lines))),
            lost=find_lost_relief(plane[near], feet[near], distance[near], spacing),
            along=range_of(distortion.along),
            across=range_of(distortion.across),
            stretch=stretch,
            bent=find_bent_margin(blade, spacing),
            holes=_holes(blade),
            unit=blade.unit,
        )

    def __repr__(self) -> str:
        state = "; ".join(self.warnings) or "good"
        return f"FitQuality({len(self.plane):,} points: {state})"

    @property
    def coverage(self) -> float:
        """Share of the blade's area that is in no gap of the scan."""
        return 1.0 - self.gaps

    @property
    def warnings(self) -> list[str]:
        """Warnings of what the blade does not hold, a line each with how much and where; empty for a good fit."""
        lines = self._warnings_of_scan()
        if self.far > MAX_FAR:
            lines.append(
                f"{tell_share(self.far)} of the points lie more than {self._length(self.limit)} off the blade, "
                f"{tell_places(self.far_places)}"
            )
        if self.lost.told:
            lines.append(tell_lost_relief(self.lost, self._area(self.lost.share * self.area[0])))
        if self.shared > MIN_FAR * self.spacing and not self.lost.is_short:
            lines.append(
                f"neighbors lie off the blade alike, by {self._length(self.shared)} (root mean square): waves that are "
                "too short for the blade to follow, whose area it lacks, or noise that points have in common"
            )
        if self.outside > MAX_OUTSIDE:
            lines.append(
                f"{tell_share(self.outside)} of the points lie beside the blade, outside its margin, "
                f"{tell_places(self.outside_places)}"
            )
        if self.gaps > MAX_GAPS:
            lines.append(
                f"{tell_share(self.gaps)} of the blade is farther than {self._length(GAP * self.spacing)} from every "
                f"point, {tell_places(self.gap_places)}"
            )
        lines += self.bent.warnings
        if self.area_deviation > MAX_DEVIATION * self.area[0]:
            lines.append(
                f"the area is known to {tell_share(self.area_deviation / self.area[0])} only (one standard deviation, "
                "by where points and scan lines happen to lie): the scan has few points, or lines far apart"
            )
        if self.stretch[0] < 1 - STRETCH or self.stretch[1] > 1 + STRETCH:
            lines.append(
                f"the texture is stretched: lengths on the blade are {_span(self.stretch)} of those in its plane, "
                f"along the midrib {_span(self.along)}"
            )
        return lines

    def _warnings_of_scan(self) -> list[str]:
        """Return the lines on the scan itself, by which all others are to be read."""
        lines = []
        if self.repeated > MAX_REPEATED:
            lines.append(
                f"{tell_share(self.repeated)} of the points repeat others of the scan: each counts once; is it merged "
                "with itself, or written twice?"
            )
        if self.rounding is not None:
            lines.append(
                f"{'xyz'[self.rounding.axis]} is rounded to steps of {self._length(self.rounding.step)}, where points "
                f"are {self._length(self.spacing)} apart: the blade has terraces, or comes apart between them; give "
                "the scan with more digits, or averaged in voxels of twice the step (voxel_down_sample)"
            )
        if self.layers is not None:
            lines.append(self.layers.tell(self.unit))
        return lines

    def lines(self) -> list[str]:
        """Return what was measured, a line each, for a terminal."""
        half, most, nearly, largest = map(self._length, self.residuals)
        world = measure_in_words((self.area[0], self.area_deviation), self.unit, power=2, join=" ± ")
        flat = measure_in_words(self.area[1], self.unit, power=2)
        filled = sum(hole["filled"] for hole in self.holes)
        residuals = f"half below {half}, 95 % below {most}, 99 % below {nearly}, largest {largest}"
        holes = f"{len(self.holes) - filled} holes kept, {filled} filled"
        return [
            f"residuals: {residuals}; noise {self._length(self.noise)}",
            f"blade: {world}, {flat} laid flat; {tell_share(self.coverage)} covered by the scan; {holes}",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return all but what belongs to single points as plain values, for a summary."""
        names = ("half", "95 %", "99 %", "largest")
        return {
            "points": len(self.plane),
            **({"others": self.others} if self.others else {}),
            "repeated": self.repeated,
            **({"rounding": self.rounding._asdict()} if self.rounding else {}),
            "noise": self.noise,
            "spacing": self.spacing,
            "shared": self.shared,
            **({"layers": {"apart": self.layers.apart, "share": self.layers.share}} if self.layers else {}),
            "residuals": dict(zip(names, self.residuals, strict=True)),
            "far": {"limit": self.limit, "share": self.far, "places": _listed(self.far_places)},
            "outside": {"share": self.outside, "places": _listed(self.outside_places)},
            "coverage": self.coverage,
            "gaps": {"share": self.gaps, "places": _listed(self.gap_places)},
            "bent": {"margin": self.bent.length, "area": self.bent.area, "places": _listed(self.bent.places)},
            "holes": list(self.holes),
            "area": {"blade": self.area[0], "chart": self.area[1], "deviation": self.area_deviation},
            "relief": {
                "lost": self.lost.share * self.area[0],
                "deviation": self.lost.deviation * self.area[0],
                "share": self.lost.share,
                "is_short": self.lost.is_short,
                "places": _listed(self.lost.places),
            },
            "stretch": {"along": list(self.along), "across": list(self.across), "any": list(self.stretch)},
            "warnings": self.warnings,
        }

    def _length(self, length: float) -> str:
        return measure_in_words(length, self.unit, digits=2)

    def _area(self, area: float) -> str:
        return measure_in_words(area, self.unit, power=2, digits=2)


def _cut_off(blade: Blade, points: FloatArray) -> BoolArray:
    """Return which of the (n, 3) points may be the petiole's that was cut off, if one was."""
    petiole = getattr(blade, "petiole", None)
    return np.zeros(len(points), dtype=bool) if petiole is None else petiole.may_hold(points)


def _holes(blade: Blade) -> tuple[dict[str, Any], ...]:
    """Return the holes that the outline of a blade knows, with their places in the world."""
    holes = getattr(blade.outline, "holes", ())
    if not holes:
        return ()
    centers = points_on(blade, np.array([hole.place for hole in holes])).tolist()
    return tuple(
        {"place": center, "area": hole.area, "width": hole.width, "filled": hole.filled}
        for hole, center in zip(holes, centers, strict=True)
    )


def _listed(places: tuple[Place, ...]) -> list[dict[str, Any]]:
    return [place.to_dict() for place in places]


def _span(pair: tuple[float, float]) -> str:
    return f"{pair[0]:.3g} to {pair[1]:.3g}"
