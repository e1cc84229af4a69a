"""The truth of the macro-structure: a whole wheat blade that bends, twists, curls and tapers to a tip."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import KDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Unit
from o3dleaf.core.checks.arrays import FloatArray, as_lengths, as_pairs, as_row
from o3dleaf.core.checks.coordinates import as_near
from o3dleaf.core.checks.scalars import as_number
from o3dleaf.samples.domain import evaluate, inside_by_distance

NODES = 401
"""Stations of the axis; the cubic through them, tangents given, is exact to 1e-9 of the length."""
SEEDS = (801, 41)
"""Points along and across that start the search for the closest point."""
STEPS = 60


@checked
@dataclass(frozen=True, eq=False, repr=False)
class WheatBlade:
    r"""A zero-thickness wheat blade, as a Field: ``half_thickness`` less the distance to it, in millimeters.

    .. math:: S(t, v) = m(t) + v\, a(t) + H(t, v)\, n(t), \qquad 0 \le t \le L,\ |v| \le w(t),

    with the axis m by arc length, the frame (m′, a, n) = (along, across, up), right-handed, twisted
    about m′, and a height H that folds the blade into a gentle V and waves its margins.

    Attributes
    ----------
    length : float
        Arc length L of the axis, in millimeters.
    width : float
        Full width where the blade is widest, in millimeters.
    base : (3,) ndarray
        The axis at t = 0, in millimeters, in world coordinates.
    rise, droop : float
        Elevation of the axis at the base and at the tip, in radians.
    swing : float
        Turn of the axis in plan from base to tip, in radians.
    twist : float
        Turn of the blade about its axis from base to tip, in radians.
    half_thickness : float
        Half the thickness of the leaf whose outside is F < 0, in millimeters.
    """

    length: Positive = 200.0
    width: Positive = 11.3
    base: FloatArray = field(default_factory=lambda: np.array([360.0, 730.0, 96.0]))
    rise: float = np.radians(55.0)
    droop: float = np.radians(-70.0)
    swing: float = np.radians(25.0)
    twist: float = np.radians(80.0)
    half_thickness: Positive = 0.1
    unit: Unit = "mm"
    bounds: FloatArray = field(init=False)
    area: float = field(init=False)
    _axis: CubicHermiteSpline = field(init=False, repr=False)
    _seeds: tuple[KDTree, FloatArray] = field(init=False, repr=False)

    def __repr__(self) -> str:
        return f"WheatBlade({self.length:g} × {self.width:g} {self.unit})"

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", as_row(self.base, "base", count=3))
        for name in ("rise", "droop", "swing", "twist"):
            as_number(getattr(self, name), name)
        t = np.linspace(0.0, self.length, NODES)
        # Gauss-Legendre inside each interval: arc length is exact, for the tangent has length one.
        nodes, weights = np.polynomial.legendre.leggauss(5)
        half = 0.5 * (t[1] - t[0])
        inside = (0.5 * (t[1:] + t[:-1]))[:, np.newaxis] + half * nodes
        steps = half * np.einsum("q,iqc->ic", weights, self.frame(inside.ravel())[0].reshape(-1, 5, 3))
        path = self.base + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        object.__setattr__(self, "_axis", CubicHermiteSpline(t, path, self.frame(t)[0]))
        grid = np.meshgrid(np.linspace(0.0, self.length, SEEDS[0]), np.linspace(-1.0, 1.0, SEEDS[1]), indexing="ij")
        stations = np.stack(grid, axis=-1).reshape(-1, 2)
        surface = self._at(stations)
        object.__setattr__(self, "_seeds", (KDTree(surface), stations))
        pad = self.half_thickness + 1.0
        object.__setattr__(self, "bounds", np.stack([surface.min(axis=0) - pad, surface.max(axis=0) + pad]))
        object.__setattr__(self, "area", _area(surface.reshape(*SEEDS, 3)))

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return half the thickness less the distance to the blade, (n,), at (n, 3) points in millimeters."""
        return evaluate(self._inside, self.bounds, points)[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) gradients at (n, 3) points, towards the closest point of the blade; 0 on it."""
        return evaluate(self._inside, self.bounds, points)[1]

    def axis(self, along: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) points of the axis at (n,) arc lengths, in millimeters."""
        return np.asarray(self._axis(as_lengths(along, "along")))

    def frame(self, along: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the unit vectors (along, across, up), each (n, 3), at (n,) arc lengths."""
        s = as_lengths(along, "along") / self.length
        sag = self.rise + (self.droop - self.rise) * 0.5 * (1 + np.tanh(4 * s - 2) / np.tanh(2))
        plan, turn = self.swing * s, self.twist * (s - 0.3)
        tangent = np.column_stack([np.cos(sag) * np.cos(plan), np.cos(sag) * np.sin(plan), np.sin(sag)])
        lift = np.column_stack([-np.sin(sag) * np.cos(plan), -np.sin(sag) * np.sin(plan), np.cos(sag)])
        side = np.cross(lift, tangent)
        cos, sin = np.cos(turn)[:, np.newaxis], np.sin(turn)[:, np.newaxis]
        return tangent, cos * side + sin * lift, cos * lift - sin * side

    def half_width(self, along: npt.ArrayLike) -> FloatArray:
        """Return half the width (n,) at (n,) arc lengths, in millimeters: a long blade that tapers to a tip."""
        s = np.clip(as_lengths(along, "along") / self.length, 0.0, 1.0)
        return 0.5 * self.width * (0.02 + 0.98 * (1 - s**2.5) * (0.65 + 0.35 * np.sin(np.pi * s * (2 - s))))

    def height(self, along: npt.ArrayLike, across: npt.ArrayLike) -> FloatArray:
        """Return H (n,) above the axis's (along, across) plane, in millimeters: the fold and the wavy margins."""
        t, v = as_pairs(along, across, ("along", "across"))
        fold = 0.28 * (1 - 0.7 * t / self.length) * (np.sqrt(v**2 + 1.0) - 1.0)
        return fold + 0.006 * v**2 * np.sin(2 * np.pi * t / 47.0 + 0.5 * np.tanh(v))

    def surface(self, along: npt.ArrayLike, across: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) world points of the blade at leaf coordinates (n,) along and (n,) across."""
        t, v = as_pairs(along, across, ("along", "across"))
        _, a, n = self.frame(t)
        return self.axis(t) + v[:, np.newaxis] * a + self.height(t, v)[:, np.newaxis] * n

    def closest(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the closest points of the blade (n, 3), and their leaf coordinates (along, across) (n, 2).

        The search starts at the nearest of a fine set of seeds and is refined by damped Gauss-Newton
        steps that keep to the blade.
        """
        p = as_near(points, self.bounds)
        tree, stations = self._seeds
        x = stations[tree.query(p)[1]]
        miss, damping = ((p - self._at(x)) ** 2).sum(axis=1), np.full(len(p), 1e-6)
        for _ in range(STEPS):
            step = self._step(p, x, damping)
            trial = np.clip(x + step, [0.0, -1.0], [self.length, 1.0])
            trial_miss = ((p - self._at(trial)) ** 2).sum(axis=1)
            better = trial_miss < miss
            settled = abs(trial - x).max(initial=0.0) < 1e-9
            x, miss = np.where(better[:, np.newaxis], trial, x), np.where(better, trial_miss, miss)
            damping = np.where(better, 0.2 * damping, 10.0 * damping)
            if settled:
                break
        return self._at(x), np.column_stack([x[:, 0], x[:, 1] * self.half_width(x[:, 0])])

    def _step(self, p: FloatArray, x: FloatArray, damping: FloatArray) -> FloatArray:
        """Return a damped Gauss-Newton step (n, 2) in (arc length, share of half width); bounds that hold stay."""
        steps = np.array([[1e-4, 0.0], [0.0, 1e-5]])
        J = np.stack([(self._at(x + h) - self._at(x - h)) / (2 * h.sum()) for h in steps], axis=-1)
        g = np.einsum("nck,nc->nk", J, p - self._at(x))
        A = np.einsum("nck,ncl->nkl", J, J)
        A[:, [0, 1], [0, 1]] *= 1 + damping[:, np.newaxis]
        low, high = np.array([0.0, -1.0]), np.array([self.length, 1.0])
        at_bound = ((x <= low) & (g < 0)) | ((x >= high) & (g > 0))
        g[at_bound] = 0.0
        A[:, 0, 1] = A[:, 1, 0] = np.where(at_bound.any(axis=1), 0.0, A[:, 0, 1])
        return np.linalg.solve(A, g[:, :, np.newaxis])[:, :, 0]

    def _at(self, x: FloatArray) -> FloatArray:
        """Points (n, 3) at (arc length, share of the half width) (n, 2)."""
        return self.surface(x[:, 0], x[:, 1] * self.half_width(x[:, 0]))

    def _inside(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        return inside_by_distance(points, self.closest(points)[0], self.half_thickness)


def _area(grid: FloatArray) -> float:
    """Area of a (rows, columns, 3) grid of points, two triangles a cell."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    triangles = np.cross(b - a, c - a), np.cross(c - a, d - a)
    return float(sum(0.5 * np.linalg.norm(t, axis=-1).sum() for t in triangles))
