"""A seedling of two blades that leave a sheath to both sides, and a scan that says which points are whose."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.samples.leaves.leaf_pair_scan import LeafPairScan
from o3dleaf.samples.leaves.outlines import SHARPNESS, WIDEST

COLLAR = 4.0
"""Radii of the sheath along which a blade, half of the sheath at its foot, opens and leans out."""
CHANNEL = 0.6
"""Angle in radians that half of a blade's section is bent by past its collar."""
STATIONS = 400
DIFFERENCE = 1e-4
"""Of places, in millimeters, whose lifts tell the element of area."""
NOISES = (0.0, 0.2, 0.5)


@dataclass(frozen=True, kw_only=True)
class Seedling:
    """Two blades on a round sheath; millimeters and degrees, noise in spacings.

    Attributes
    ----------
    gap : float
        Of the sheath's circle that is missing below a place where the blades part: a sheath that is not closed.
    opening : float
        Between the blades where they leave their collars.
    lengths, widths : (2,) tuples
        Of the blades.
    radius, height : float
        Of the sheath.
    arch : float
        By which a blade bends down along its length.
    noise : float
    spacing : float
    seed : int
    """

    gap: float = 0.0
    opening: float = 80.0
    lengths: tuple[float, float] = (40.0, 30.0)
    widths: tuple[float, float] = (9.0, 7.0)
    radius: float = 1.5
    height: float = 6.0
    arch: float = 30.0
    noise: float = 0.0
    spacing: float = 0.5
    seed: int = 0

    def scan(self) -> LeafPairScan:
        """Return the points of the blades, 0 and 1, and of the sheath, 2."""
        rng = np.random.default_rng(self.seed)
        parts = [self._draw(number, rng) for number in range(2)]
        missing = np.radians(self.gap)
        area = (2 * np.pi - missing) * self.radius * self.height
        around = rng.uniform(-0.5 * (np.pi - missing), 0.5 * (3 * np.pi - missing), round(area / self.spacing**2))
        down = rng.uniform(-self.height, 0.0, len(around))
        parts.append(np.column_stack([self.radius * np.cos(around), self.radius * np.sin(around), down]))
        counts = np.array([len(part) for part in parts])
        points = np.concatenate(parts)
        points += rng.normal(0.0, self.noise * self.spacing, points.shape)
        return LeafPairScan(points, np.repeat([0, 1, 2], counts), counts * self.spacing**2)

    def _draw(self, number: int, rng: np.random.Generator) -> FloatArray:
        """Return random points (n, 3) of a blade, uniform by area."""
        length = self.lengths[number]
        widest = max(self.widths[number], np.pi * self.radius)
        many = int(20 * length * widest / self.spacing**2)
        u, v = rng.uniform(0.0, length, many), rng.uniform(-0.5, 0.5, many)
        lifted = self._lift(number, u, v)
        along = self._lift(number, u + DIFFERENCE, v) - lifted
        across = self._lift(number, u, v + DIFFERENCE) - lifted
        element = np.linalg.norm(np.cross(along, across), axis=1) / DIFFERENCE**2
        kept = lifted[rng.random(many) < element / element.max()]
        return np.asarray(kept[: round(element.mean() * length / self.spacing**2)])

    def _lift(self, number: int, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the points (n, 3) at lengths along a blade and shares of its width, from -1/2 to 1/2, across."""
        length, width, foot = self.lengths[number], self.widths[number], np.pi * self.radius
        share = np.linspace(0.0, 1.0, STATIONS)
        opened = _smooth(length * share / (COLLAR * self.radius))
        lean = np.radians(self.opening / 2 * opened + self.arch * share)
        step = length / (STATIONS - 1)
        rates = np.sin(lean), np.cos(lean)
        out, up = (step * (np.cumsum(rate) - (rate + rate[0]) / 2) for rate in rates)
        out, up, lean, opened = (np.interp(u, length * share, each) for each in (out, up, lean, opened))
        rise = foot + (width - foot) * np.sin(0.5 * np.pi * np.clip(u / length / WIDEST, 0.0, 1.0))
        wide = rise * (1 - np.clip((u / length - WIDEST) / (1 - WIDEST), 0.0, 1.0) ** SHARPNESS)
        bend = (1 - opened) / self.radius + opened * CHANNEL / width
        side, high = np.sin(v * wide * bend) / bend, (1 - np.cos(v * wide * bend)) / bend
        way = 1 - 2 * number
        return np.column_stack([way * (self.radius + out - high * np.cos(lean)), way * side, up + high * np.sin(lean)])


def drawn_seedling(number: int, *, held_out: bool = False) -> Seedling:
    """Return one of a family: sheaths closed and open and noises in turn, all else by chance."""
    rng = np.random.default_rng((7700 if held_out else 500) + number)
    return Seedling(
        gap=rng.uniform(60, 150) if number % 2 else 0.0,
        opening=rng.uniform(30, 150),
        lengths=(rng.uniform(30, 60), rng.uniform(20, 50)),
        widths=(rng.uniform(6, 12), rng.uniform(5, 10)),
        radius=rng.uniform(0.9, 2.5),
        height=rng.uniform(0, 12),
        arch=rng.uniform(0, 60),
        noise=NOISES[number // 2 % 3],
        spacing=rng.uniform(0.4, 0.7),
        seed=number + (900 if held_out else 0),
    )


def _smooth(share: FloatArray) -> FloatArray:
    share = np.clip(share, 0.0, 1.0)
    return np.asarray(share**2 * (3 - 2 * share))
