"""A layer with upright hairs, thinned out by a map, on a bent strip."""

import numpy as np

from leaf_fields import leaf_of
from o3dleaf import ThinnedField

TILE, FACE, TIP, RADIUS, STEP = 3.0, 0.15, 0.42, 0.13, 0.1
FEET = np.array(
    [[-1.1, -0.9], [-0.2, -1.0], [0.8, -0.7], [-1.45, 0.2], [-0.4, 0.1], [0.6, 0.4], [1.2, 1.1], [-0.7, 1.2]]
)
AREA = [[0.0, -3.0], [8.0, 3.0]]
HALF = [[0.5]]


def hairy(x, y, z):
    """A layer with waves, and upright hairs in its upper face."""
    blade = FACE + 0.01 * np.cos(2 * np.pi * y / TILE) - np.abs(z)
    away = np.min([np.hypot(x - a, y - b) for a, b in FEET], axis=0)
    return np.maximum(blade, np.minimum(RADIUS - away, np.minimum(TIP - z, z)))


def thinned(tiles, shares, seed=1, **given):
    """A map over the strip that tiles are laid on."""
    return ThinnedField(tiles, shares, AREA, seed=seed, longest=0.5, **given)


def on_strip(field):
    """A strip of 8 by 6, bent about a circle of radius 15."""
    return leaf_of(field, bend=15.0, length=8.0)[0]


def hairs_of(leaf, vertices):
    """The places of what stands out of a leaf, farther than half of what hairs do."""
    flat = leaf.blade.flatten(np.asarray(vertices))
    return flat[flat[:, 2] > (FACE + TIP) / 2]
