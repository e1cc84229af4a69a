"""Quality of a leaf frame: round trip, points past its ends, and where it folds or tears."""

from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.trees import query

MAX_ROUND_TRIP = 1e-9
"""Round trip, of the axis' length, above which the coordinates cannot be relied on: Newton's rounding is far below."""
MAX_PAST_ENDS = 0.01
"""Share of points past the ends above which the axis is too short for its leaf."""
MIN_JACOBIAN = 0.2
"""Determinant below which the frame compresses the leaf fivefold: near the focal line, where it folds."""
TORN = 10.0
"""Neighbors in space that are so many times as far apart in leaf coordinates lie on two sides of a tear."""


class Frame(Protocol):
    """Curvilinear coordinates about an axis, such as a `LeafFrame`."""

    @property
    def length(self) -> float:
        """Arc length of the axis, in `unit`."""
        ...

    @property
    def unit(self) -> str | None:
        """Unit of length."""
        ...

    def to_leaf(self, x: FloatArray) -> FloatArray:
        """Return the leaf coordinates of world points."""
        ...

    def to_world(self, y: FloatArray) -> FloatArray:
        """Return the world points of leaf coordinates."""
        ...

    def jacobian(self, y: FloatArray) -> FloatArray:
        """Return the matrices ∂x/∂y of `to_world`."""
        ...


@dataclass(frozen=True)
class FrameQuality:
    r"""Diagnostics of a leaf frame at the points of a scan, and on the blade where that is known.

    The determinant of ∂x/∂y is 1 on a straight axis and falls towards the inside of its bends. At the
    scan's own coordinates it is never negative: they belong to the *closest* point of the axis. A frame
    that folds shows there as a determinant near 0 and as neighbors torn apart, and on the blade, which
    fills the gaps between the points, as a determinant of 0 or less.

    Attributes
    ----------
    points : int
    round_trip : float
        Largest distance of to_world(to_leaf(x)) from x, in `unit`.
    past_ends : int
        Points before the base or beyond the tip of the axis.
    torn : int
        Points whose nearest neighbor is `TORN` times as far in leaf coordinates as in space.
    scan_jacobian, blade_jacobian : float
        Least determinant over the scan, and over the blade inside its outline (None where there is no blade).
    scan_least_at, blade_least_at : tuple of float
        (along, across, up) of it.
    length : float
        Of the axis, in `unit`.
    unit : str or None
    """

    points: int
    round_trip: float
    past_ends: int
    torn: int
    scan_jacobian: float
    scan_least_at: tuple[float, ...]
    length: float
    unit: str | None
    blade_jacobian: float | None = None
    blade_least_at: tuple[float, ...] | None = None

    @classmethod
    def of(cls, frame: Frame, points: FloatArray, blade: FloatArray | None = None) -> "FrameQuality":
        """Measure a frame at the (n, 3) points of a scan and, where given, at (m, 3) leaf points of a blade.

        Raises nothing: a bad frame is what it reports.
        """
        leaf = frame.to_leaf(points)
        trip = np.linalg.norm(frame.to_world(leaf) - points, axis=1)
        gap, nearest = query(cKDTree(points), points, k=2)
        distance = np.linalg.norm(leaf - leaf[nearest[:, 1]], axis=1)
        scan_jacobian, scan_place = _least_jacobian(frame, leaf)
        blade_jacobian, blade_place = (None, None) if blade is None or not len(blade) else _least_jacobian(frame, blade)
        return cls(
            points=len(points),
            round_trip=float(trip.max()),
            past_ends=int(np.sum((leaf[:, 0] < 0) | (leaf[:, 0] > frame.length))),
            torn=int(np.sum(distance > TORN * np.maximum(gap[:, 1], np.median(gap[:, 1])))),
            scan_jacobian=scan_jacobian,
            scan_least_at=scan_place,
            length=frame.length,
            unit=frame.unit,
            blade_jacobian=blade_jacobian,
            blade_least_at=blade_place,
        )

    def __repr__(self) -> str:
        state = "; ".join(self.warnings) or "good"
        return f"FrameQuality({self.points:,} points, least determinant {self.least_jacobian:.3g}: {state})"

    @property
    def least_jacobian(self) -> float:
        """Least determinant over scan and blade."""
        return self.scan_jacobian if self.blade_jacobian is None else min(self.scan_jacobian, self.blade_jacobian)

    @property
    def folded(self) -> bool:
        """True where one place of the leaf has two coordinates, or none."""
        return self.least_jacobian <= 0

    @property
    def warnings(self) -> list[str]:
        """Defects, one line each, with the cure; empty for a good frame."""
        unit, warnings = f" {self.unit}" if self.unit else "", []
        if self.round_trip > MAX_ROUND_TRIP * self.length:
            warnings.append(f"world to leaf to world is off by {self.round_trip:.3g}{unit}; smooth the control points")
        if self.past_ends > MAX_PAST_ENDS * self.points:
            warnings.append(
                f"{self.past_ends} of {self.points} points lie past the ends of the midrib; begin it at the base and "
                "end it at the tip"
            )
        if self.least_jacobian < MIN_JACOBIAN:
            place = self.blade_least_at if self.least_jacobian == self.blade_jacobian else self.scan_least_at
            verb = "folds" if self.folded else "nearly folds"
            warnings.append(
                f"the frame {verb} at along {(place or (0.0,))[0]:.4g}{unit}, determinant {self.least_jacobian:.2g}; "
                "let the midrib bend less there, with fewer or smoother control points"
            )
        if self.torn:
            warnings.append(
                f"{self.torn} of {self.points} points have neighbors far off in leaf coordinates: the leaf touches "
                "itself, or lies inside of a bend; let the midrib bend less, or remove one of the parts that touch"
            )
        return warnings

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain values, for a summary."""
        derived = {"least_jacobian": self.least_jacobian, "folded": self.folded, "warnings": self.warnings}
        return asdict(self) | derived


def _least_jacobian(frame: Frame, leaf: FloatArray) -> tuple[float, tuple[float, ...]]:
    """Return the least determinant of ∂x/∂y over leaf points, and where it is."""
    determinants = np.linalg.det(frame.jacobian(leaf))
    lowest = int(np.argmin(determinants))
    return float(determinants[lowest]), tuple(leaf[lowest].tolist())
