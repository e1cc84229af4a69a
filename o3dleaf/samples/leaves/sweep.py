"""A circular arc carried along a curve: developable, helical, spherical and wavy surfaces in one formula."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.samples.solids import TURN

NODES = 1025
"""Places at which the frame is known; between them it turns by one step of Magnus's series, right to 1e-10."""
FLAT = 1e-12
"""Less curved than this, per millimeter, a section is straight."""


class SweepJet(NamedTuple):
    """World points (n, 3), and derivatives along u and along v, each (n, 3)."""

    points: FloatArray
    along: FloatArray
    across: FloatArray


@dataclass(frozen=True, eq=False)
class Sweep:
    r"""The surface S(u, v) = m(u) + X(v) a(u) + Z(v) n(u): an arc (X, Z) across, carried by the frame (t, a, n) of m.

    .. math::

        m' = t,\quad t' = κ_n n + κ_a a,\quad a' = −κ_a t + τ n,\quad n' = −κ_n t − τ a,
        \qquad X' = \cos(v κ_c),\ Z' = \sin(v κ_c).

    Each rate of turning is c/ℓ + w (π/ℓ) sin(2πu/ℓ): over the length ℓ it turns by c, and by w to and fro.
    With τ = κ_a = 0 and either κ_n = 0 or κ_c = 0 the surface is isometric to the plane of (u, v), with κ_n = κ_c
    constant it is a part of a sphere, with τ alone a helicoid. Its derivatives are exact, so that lengths,
    areas and stretches are known.

    Attributes
    ----------
    length : float
        ℓ, in millimeters.
    arch, sway, twist : (2,) tuples
        Turns (c, w) in radians: of the leaf up and down (κ_n), sideways in its own plane (κ_a), about its axis (τ).
    curl : float
        κ_c, curvature of the section, per millimeter.
    base : (3,) tuple
        m(0) in world coordinates, in millimeters.
    """

    length: float
    arch: tuple[float, float] = (0.0, 0.0)
    sway: tuple[float, float] = (0.0, 0.0)
    twist: tuple[float, float] = (0.0, 0.0)
    curl: float = 0.0
    base: tuple[float, float, float] = (40.0, -25.0, 110.0)
    _start: float = field(init=False, repr=False)
    _step: float = field(init=False, repr=False)
    _frames: FloatArray = field(init=False, repr=False)
    _curve: CubicHermiteSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        # The curve goes on beyond base and tip, for petioles and for outlines that reach over.
        step, start = 2 * self.length / (NODES - 1), -0.6 * self.length
        nodes = start + step * np.arange(NODES, dtype=np.float64)
        turns = self._turn(nodes[:-1], np.full(NODES - 1, step))
        frames = np.empty((NODES, 3, 3))
        frames[0] = np.eye(3)
        for i, turn in enumerate(turns):
            frames[i + 1] = frames[i] @ turn
        base = int(np.argmin(np.abs(nodes)))
        at_base = frames[base] @ self._turn(nodes[base : base + 1], -nodes[base : base + 1])[0]
        frames = TURN @ at_base.T @ frames
        # Gauss-Legendre inside each interval: the curve is by arc length to rounding.
        places, weights = np.polynomial.legendre.leggauss(4)
        inside = 0.5 * step * (1 + places)
        steps = np.zeros((NODES - 1, 3))
        for h, w in zip(inside, weights, strict=True):
            steps += 0.5 * step * w * (frames[:-1] @ self._turn(nodes[:-1], np.full(NODES - 1, h)))[:, :, 0]
        path = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        curve = CubicHermiteSpline(nodes, path, frames[:, :, 0])
        object.__setattr__(self, "_start", start)
        object.__setattr__(self, "_step", step)
        object.__setattr__(self, "_frames", frames)
        object.__setattr__(self, "_curve", CubicHermiteSpline(nodes, path - curve(0.0) + self.base, frames[:, :, 0]))

    def frame(self, u: FloatArray) -> FloatArray:
        """Return the (n, 3, 3) matrices with columns (t, a, n) at (n,) arc lengths."""
        row = np.clip(np.floor((u - self._start) / self._step).astype(int), 0, NODES - 1)
        node = self._start + self._step * row
        return np.asarray(self._frames[row] @ self._turn(node, u - node))

    def axis(self, u: FloatArray) -> FloatArray:
        """Return the (n, 3) points m at (n,) arc lengths."""
        return np.asarray(self._curve(u))

    def jet(self, plane: FloatArray) -> SweepJet:
        """Return the points and derivatives of the surface at (n, 2) places (u, v)."""
        u, v = plane.T
        frame = self.frame(u)
        t, a, n = frame.transpose(2, 0, 1)
        x, z, dx, dz = (values[:, np.newaxis] for values in self._section(v))
        twist, arch, sway = (rate[:, np.newaxis] for rate in self._rates(u))
        along = t * (1 - sway * x - arch * z) + twist * (x * n - z * a)
        return SweepJet(self.axis(u) + x * a + z * n, along, dx * a + dz * n)

    def _section(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return X, Z and their derivatives at (n,) lengths across."""
        if abs(self.curl) < FLAT:
            return v, np.zeros_like(v), np.ones_like(v), np.zeros_like(v)
        angle = v * self.curl
        return np.sin(angle) / self.curl, (1 - np.cos(angle)) / self.curl, np.cos(angle), np.sin(angle)

    def _rates(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (τ, κ_n, κ_a) at (n,) arc lengths, per millimeter."""
        wave = np.pi * np.sin(2 * np.pi * u / self.length)
        twist, arch, sway = ((c + w * wave) / self.length for c, w in (self.twist, self.arch, self.sway))
        return twist, arch, sway

    def _turn(self, u: FloatArray, h: FloatArray) -> FloatArray:
        """Return the (n, 3, 3) turns of the frame from u to u + h in the frame at u, of fourth order (Magnus)."""
        reach = np.sqrt(3) / 6
        first, second = (self._spin(u + h * (0.5 + sign * reach)) for sign in (-1.0, 1.0))
        width = h[:, np.newaxis]
        vector = 0.5 * width * (first + second) + 0.5 * reach * width**2 * np.cross(first, second)
        return np.asarray(Rotation.from_rotvec(vector).as_matrix())

    def _spin(self, u: FloatArray) -> FloatArray:
        """Return the frame's angular velocities (n, 3) in its own axes."""
        twist, arch, sway = self._rates(u)
        return np.column_stack([twist, -arch, sway])
