"""The read-out of a fit: what a blade holds of its scan and what it does not, by share and by place."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import measure_in_words
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.blade.distortion import Distortion
from o3dleaf.leaf.macro.robust import plane_noise

FAR = 3.0
"""Noise deviations beyond which a point is not held: of normal errors one in 370 lies there."""
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
STRETCH = 0.05
"""Stretch of the texture above which it is told: below, it is less than what patches of one leaf differ by."""
QUANTILES = (0.01, 0.99)
"""Of the area, between which the stretch is measured."""
JOINED = 4.0
"""Spacings between points of one place."""
PLACES = 3
"""Places that are named, the largest first."""


@dataclass(frozen=True)
class Place:
    """A place in the world, (x, y, z), and its share of the scan's points or of the blade's area."""

    center: tuple[float, ...]
    share: float

    def __str__(self) -> str:
        return f"{100 * self.share:.2g} % at " + " ".join(f"{part:.4g}" for part in self.center)


@dataclass(frozen=True, eq=False)
class FitQuality:
    """How well a blade holds its scan: residuals, points off it and beside it, gaps, holes, and the chart's stretch.

    Attributes
    ----------
    flat : (n, 3) ndarray
        Flat coordinates of the scan's points; the third are the residuals, heights above the blade, in `unit`.
    noise, spacing : float
        Standard deviation of the points about their local planes, and 1/√(points per area), in `unit`.
    residuals : tuple of four floats
        |residual| of half of the points, of 95 % and 99 % of them, and the largest, in `unit`.
    far, outside, gaps : float
        Share of the points farther from the blade than `FAR` deviations (or `FAR` times what half of the points stay
        within, if that is more), share of points beside it by more than a spacing, and share of the blade's area
        farther than `GAP` spacings from every point.
    far_places, gap_places : tuple of Place
        The largest places of both.
    area : (2,) tuple of float
        Of the blade in the world and in its plane, in `unit` squared.
    along, across, singular : (2,) tuples of float
        Length in the world of a unit length of the plane along the midrib, across it, and in its worst and best
        direction: more than 1 % of the area has less, and less than 1 % more.
    holes : tuple of dict
        The holes of the scan: place, area, diameter, and whether they were filled.
    unit : str or None
    """

    flat: FloatArray
    noise: float
    spacing: float
    residuals: tuple[float, ...]
    far: float
    outside: float
    gaps: float
    far_places: tuple[Place, ...]
    gap_places: tuple[Place, ...]
    area: tuple[float, float]
    along: tuple[float, float]
    across: tuple[float, float]
    singular: tuple[float, float]
    holes: tuple[dict[str, Any], ...]
    unit: str | None

    @classmethod
    def of(cls, blade: Blade, scan: CloudLike) -> "FitQuality":
        """Measure how well a blade holds its scan.

        Parameters
        ----------
        blade : Blade
        scan : (n, 3) array_like or Open3D point cloud
            In the blade's unit.
        """
        points = points_of(scan, "scan", least=3)
        flat, distortion = blade.flatten(points), blade.distortion()
        polygon = blade.outline.polygon
        area = float(polygon.area * distortion.area.mean()), float(polygon.area)
        spacing, noise = float(np.sqrt(area[0] / len(points))), plane_noise(points)
        sizes = np.abs(flat[:, 2])
        beside = shapely.distance(polygon, shapely.points(flat[:, :2])) > OUTSIDE * spacing
        middle, *upper = np.quantile(sizes, (0.5, 0.95, 0.99, 1)).tolist()
        far = (sizes > FAR * max(noise, middle)) & ~beside
        empty = cKDTree(flat[~beside, :2]).query(distortion.plane, workers=-1)[0] > GAP * spacing
        world = blade.lift(np.column_stack([distortion.plane, np.zeros(len(distortion.plane))]))
        return cls(
            flat=flat,
            noise=noise,
            spacing=spacing,
            residuals=(middle, *upper),
            far=float(far.mean()),
            outside=float(beside.mean()),
            gaps=float(empty.mean()),
            far_places=_places(points, far, JOINED * spacing),
            gap_places=_places(world, empty, JOINED * spacing),
            area=area,
            along=_range(distortion.along),
            across=_range(distortion.across),
            singular=_stretch(distortion),
            holes=tuple(getattr(blade.outline, "holes", ())),
            unit=blade.unit,
        )

    def __repr__(self) -> str:
        state = "; ".join(self.warnings) or "good"
        return f"FitQuality({len(self.flat):,} points: {state})"

    @property
    def warnings(self) -> list[str]:
        """What is not held, one line each with how much and where; empty for a good fit."""
        unit, lines = f" {self.unit}" if self.unit else "", []
        if self.far > MAX_FAR:
            limit = FAR * max(self.noise, self.residuals[0])
            lines.append(
                f"{100 * self.far:.2g} % of the points lie more than {limit:.2g}{unit} from the blade: {_list(self.far_places)}"
            )
        if self.outside > MAX_OUTSIDE:
            lines.append(f"{100 * self.outside:.2g} % of the points lie beside the blade, outside its margin")
        if self.gaps > MAX_GAPS:
            lines.append(
                f"{100 * self.gaps:.2g} % of the blade is farther than {GAP * self.spacing:.2g}{unit} from every point: "
                f"{_list(self.gap_places)}"
            )
        if self.singular[0] < 1 - STRETCH or self.singular[1] > 1 + STRETCH:
            lines.append(
                f"the blade cannot be laid flat without stretch: lengths on it are {self.singular[0]:.3g} to "
                f"{self.singular[1]:.3g} of those of the texture, along the midrib {self.along[0]:.3g} to {self.along[1]:.3g}"
            )
        return lines

    def lines(self) -> list[str]:
        """Return what was measured, a line each, for a terminal."""
        unit = f" {self.unit}" if self.unit else ""
        half, most, nearly, largest = (f"{value:.2g}{unit}" for value in self.residuals)
        kept = [hole for hole in self.holes if not hole.get("filled")]
        return [
            f"residuals: half below {half}, 95 % below {most}, 99 % below {nearly}, largest {largest}",
            f"area {measure_in_words(self.area[0], self.unit, power=2)}, {measure_in_words(self.area[1], self.unit, power=2)} flat; "
            f"{len(kept)} holes kept, {len(self.holes) - len(kept)} filled",
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return all but the points as plain values, for a summary."""
        table = {name: value for name, value in asdict(self).items() if name != "flat"}
        return table | {"points": len(self.flat), "warnings": self.warnings}


def _list(places: tuple[Place, ...]) -> str:
    return ", ".join(str(place) for place in places)


def _range(values: FloatArray) -> tuple[float, float]:
    """Return what 1 % of the values are below, and 99 %."""
    low, high = np.quantile(values, QUANTILES).tolist()
    return low, high


def _stretch(distortion: Distortion) -> tuple[float, float]:
    """Return the least and the greatest stretch in the plane, of 99 % of the area each."""
    first, second, shear = distortion.along, distortion.across, np.sin(distortion.shear)
    mean, half = (first**2 + second**2) / 2, np.hypot((first**2 - second**2) / 2, first * second * shear)
    low, _ = _range(np.sqrt(np.maximum(mean - half, 0.0)))
    _, high = _range(np.sqrt(mean + half))
    return low, high


def _places(points: FloatArray, chosen: BoolArray, joined: float) -> tuple[Place, ...]:
    """Return the largest groups of the chosen points, each less than `joined` from the next: middle and share."""
    rows = np.flatnonzero(chosen)
    if not len(rows):
        return ()
    tree = cKDTree(points[rows])
    _, group = connected_components(tree.sparse_distance_matrix(tree, joined), directed=False)
    places = []
    for number in np.argsort(-np.bincount(group), kind="stable")[:PLACES]:
        members = points[rows[group == number]]
        nearest = members[np.argmin(np.linalg.norm(members - members.mean(axis=0), axis=1))]
        places.append(Place(tuple(nearest.tolist()), len(members) / len(points)))
    return tuple(places)
