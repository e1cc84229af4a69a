"""Leaves with deep lobes, bent and wavy: what looks like leaves that cross, by its outline."""

import numpy as np
from shapely.geometry import Polygon

from o3dleaf.samples.leaves.leaf_scan import LeafScan, scan_leaf
from o3dleaf.samples.leaves.leaf_shape import LeafShape
from o3dleaf.samples.leaves.sweep import Sweep

LOBES, NOISES = (4, 5, 3, 6, 7, 4), (0.0, 0.2, 0.5)
CORNERS = 1499


def drawn_lobes(number: int, *, held_out: bool = False) -> LeafScan:
    """Return a scan of one of a family: numbers of lobes and noises in turn, all else by chance.

    The outline is r(φ) = 1 + d sign(c) |c|^p, c = cos(lobes φ), d from 0.5 to 0.85 and p from 0.6 to 1.6, longer to one
    side and wavy.
    """
    rng = np.random.default_rng((99_000 if held_out else 7100) + number)
    lobes, angle = LOBES[number % 6], np.linspace(-np.pi, np.pi, CORNERS + 1)[:-1]
    depth, power, wave = rng.uniform(0.5, 0.85), rng.uniform(0.6, 1.6), np.cos(lobes * angle)
    radius = 1 + depth * np.sign(wave) * np.abs(wave) ** power
    radius *= 1 + rng.uniform(0, 0.3) * np.cos(angle + rng.uniform(-0.3, 0.3))
    radius += radius * rng.uniform(0, 0.04) * np.cos(int(rng.integers(20, 40)) * angle)
    size, aspect = rng.uniform(18, 28), rng.uniform(0.8, 1.2)
    ring = size * radius[:, np.newaxis] * np.column_stack([np.cos(angle), aspect * np.sin(angle)])
    outline = Polygon(ring - [ring[:, 0].min(), 0.0])
    _, low, length, high = outline.bounds
    arch = np.radians(rng.uniform(-60, 60)), np.radians(rng.uniform(0, 50))
    curl = 2 * np.radians(rng.uniform(-50, 50)) / (high - low)
    leaf = LeafShape("lobed", Sweep(length, arch=arch, curl=curl), outline)
    return scan_leaf(leaf, spacing=rng.uniform(0.7, 1.0), noise=NOISES[number // 6 % 3], seed=number)
