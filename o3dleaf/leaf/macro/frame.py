"""The leaf frame: (along, across, up) about the midrib, the paper's appendix A."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, make_interp_spline

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive, Unit
from o3dleaf.core.checks.arrays import FloatArray, as_row
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.units import check_unit, tell_length
from o3dleaf.leaf.macro import frame_loops
from o3dleaf.leaf.macro.frame_loops import AxisSamples, FrameSplines
from o3dleaf.leaf.macro.frame_quality import FrameQuality
from o3dleaf.leaf.macro.midrib_normals import consistent_normals, half_width

BLOCK = 4096
SAMPLES_PER_SEGMENT = 24
WORLD_UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class LeafFrame:
    r"""Orthonormal frames (T, A, V) along an axis m(t), and the coordinates they give to a point.

    .. math:: x = m(t) + y_2\,A(t) + y_3\,V(t), \qquad T = m'/|m'|, \quad A = V × T

    with t = y₁ the (global) closest point of the axis to x. Leaf coordinates are (along, across, up),
    right-handed. V is the paper's V; the paper's W is −A. Past its ends the axis goes on straight.

    Attributes
    ----------
    breaks : (S + 1,) ndarray
        Arc length at the control points, in `unit`; base = 0.
    axis, normal : (S, k + 1, 3) ndarrays
        Coefficients of the two splines, on each segment in rising powers of t − breaks[s].
    unit : str or None
    notes : tuple of str
        Choices of the fit: side of up, end of base, radius of the PCA.
    """

    breaks: FloatArray
    axis: FloatArray
    normal: FloatArray
    unit: str | None
    notes: tuple[str, ...] = ()

    @classmethod
    @checked
    def fit(
        cls,
        points: CloudLike,
        midrib: CloudLike,
        *,
        radius: Positive | None = None,
        up: npt.ArrayLike | None = None,
        base: npt.ArrayLike | None = None,
        degree: Count = 3,
        unit: Unit | None = None,
    ) -> "LeafFrame":
        """Fit the axis through the midrib's control points and the normals by PCA of the scan around them.

        Parameters
        ----------
        points : (n, 3) array_like or Open3D point cloud
            The scan, in `unit`.
        midrib : (k, 3) array_like or Open3D point cloud
            Control points of the midrib, in order from base to tip, in `unit`.
        radius : float, optional
            Radius R of the PCA, in `unit`; by default half the blade's width (paper, appendix A).
        up : (3,) array_like, optional
            Direction that the adaxial side faces, on the whole; world +z by default.
        base : (3,) array_like, optional
            A point near the base; the control points are reversed if their last one is nearer to it.
        degree : int
            Degree of the interpolating splines: 3 as in the paper, 5 where curvature is requested.
        unit : str, optional

        Raises
        ------
        InputError
            If there are fewer than two distinct control points or fewer than three scan points.
        """
        scan = points_of(points, "points", least=3)
        control = _distinct(points_of(midrib, "midrib", least=2))
        notes = ["base: the first control point"]
        if base is not None:
            hint = as_points(base, "base", dim=3)[0]
            if np.linalg.norm(control[-1] - hint) < np.linalg.norm(control[0] - hint):
                control = control[::-1]
            notes = ["base: the end nearer to the hint"]
        reach = half_width(scan, control) if radius is None else float(radius)
        facing = as_points(WORLD_UP if up is None else up, "up", dim=3)[0]
        normals = consistent_normals(scan, control, reach, facing)
        notes.append(f"up: {'world +z' if up is None else 'as hinted'}")
        notes.append(f"PCA radius: {tell_length(reach)}")
        order = min(degree, len(control) - 1)
        lengths = arc_lengths(control, order)
        axis = make_interp_spline(lengths, control, k=order)
        tilt = make_interp_spline(lengths, normals, k=order)
        return cls(lengths, _on_segments(axis, lengths), _on_segments(tilt, lengths), check_unit(unit), tuple(notes))

    def __repr__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"LeafFrame({len(self.breaks)} control points, {self.length:.4g}{unit} long)"

    @property
    def splines(self) -> FrameSplines:
        """The two splines, as compiled functions take them."""
        return FrameSplines(self.breaks, self.axis, self.normal)

    @property
    def length(self) -> float:
        """Arc length of the axis between its ends, in `unit`."""
        return float(self.breaks[-1] - self.breaks[0])

    def stations(self, t: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the points m(t) and the unit vectors T, A, V (along, across, up), each (n, 3), at arc lengths (n,)."""
        frames, _ = self._stations(as_row(t, "t"))
        return frames[:, 0], frames[:, 1], frames[:, 2], frames[:, 3]

    def to_leaf(self, x: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) leaf coordinates (along, across, up) of (n, 3) world points, the paper's T, Algorithm 2."""
        points = as_points(x, "x", dim=3)
        leaf = np.empty_like(points)
        samples, splines = self._samples, self.splines

        def task(start: int, stop: int) -> None:
            frame_loops.to_leaf(start, stop, points, samples, splines, leaf)

        run_blocks(task, len(points), BLOCK)
        return leaf

    def to_world(self, y: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points of (n, 3) leaf coordinates: x = m(y₁) + y₂ A(y₁) + y₃ V(y₁)."""
        leaf = as_points(y, "y", dim=3)
        points, splines = np.empty_like(leaf), self.splines

        def task(start: int, stop: int) -> None:
            frame_loops.to_world(start, stop, leaf, splines, points)

        run_blocks(task, len(leaf), BLOCK)
        return points

    def jacobian(self, y: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3, 3) matrices ∂x/∂y of `to_world`; a determinant <= 0 means that the frame folds there."""
        leaf = as_points(y, "y", dim=3)
        frames, derivatives = self._stations(np.ascontiguousarray(leaf[:, 0]))
        along = derivatives[:, 0] + leaf[:, 1, None] * derivatives[:, 2] + leaf[:, 2, None] * derivatives[:, 3]
        return np.stack([along, frames[:, 2], frames[:, 3]], axis=2)

    def quality(self, points: CloudLike) -> FrameQuality:
        """Return the quality of the frame for a scan: round trip, ends, folds; see `Blade.frame_quality`.

        Parameters
        ----------
        points : (n, 3) array_like or Open3D point cloud
            At least two, in `unit`.
        """
        return FrameQuality.of(self, points_of(points, "points", least=2))

    def _stations(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (m, T, A, V) and their derivatives, (n, 4, 3) each."""
        frames, derivatives = np.empty((len(t), 4, 3)), np.empty((len(t), 4, 3))
        splines = self.splines

        def task(start: int, stop: int) -> None:
            frame_loops.fill_stations(start, stop, t, splines, frames, derivatives)

        run_blocks(task, len(t), BLOCK)
        return frames, derivatives

    @cached_property
    def _samples(self) -> AxisSamples:
        """Points of the axis, which find the segments that may contain the closest one."""
        t = np.linspace(self.breaks[0], self.breaks[-1], SAMPLES_PER_SEGMENT * (len(self.breaks) - 1) + 1)
        points = self.stations(t)[0]
        chord = float(np.linalg.norm(np.diff(points, axis=0), axis=1).max())
        reach = []
        for first, last in blocks(len(points), frame_loops.GROUP):
            middle = points[min(first + frame_loops.GROUP // 2, len(points) - 1)]
            reach.append(np.linalg.norm(points[first:last] - middle, axis=1).max())
        return AxisSamples(np.ascontiguousarray(points.T), float(t[1] - t[0]), chord, np.array(reach))


def arc_lengths(control: FloatArray, degree: int) -> FloatArray:
    """Return t_j: arc length at each control point of the spline through them over their index (paper, appendix A)."""
    index = np.arange(len(control), dtype=np.float64)
    velocity = make_interp_spline(index, control, k=degree).derivative()
    nodes, weights = np.polynomial.legendre.leggauss(16)
    positions = index[:-1, None] + 0.5 * (nodes + 1)
    lengths = 0.5 * np.linalg.norm(velocity(positions), axis=2) @ weights
    return np.concatenate([[0.0], np.cumsum(lengths)])


def _on_segments(spline: BSpline, breaks: FloatArray) -> FloatArray:
    """Return the spline's Taylor coefficients at the left end of every segment, (S, k + 1, 3)."""
    terms = [spline(breaks[:-1], nu=k) / math.factorial(k) for k in range(spline.k + 1)]
    return np.ascontiguousarray(np.stack(terms, axis=1))


def _distinct(control: FloatArray) -> FloatArray:
    """Return the control points less those that repeat the one before them."""
    moved = np.linalg.norm(np.diff(control, axis=0), axis=1) > 0
    distinct: FloatArray = control[np.concatenate([[True], moved])]
    if len(distinct) < 2:
        raise InputError("midrib: all its points coincide; give at least two distinct control points, from base to tip")
    return distinct
