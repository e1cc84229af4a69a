"""A layer with upright hairs, thinned out by a map, on a bent strip."""

import numpy as np

from leaf_fields import leaf_of, texture
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


def hollow(x, y, z):
    """A layer with a thick hair in the middle of each tile of 2 by 2; a void is high in it, another in the layer."""
    hair = np.minimum(0.35 - np.hypot(x, y), np.minimum(0.75 - z, z))
    voids = np.minimum(np.sqrt(x**2 + y**2 + (z - 0.5) ** 2), np.sqrt((x - 0.8) ** 2 + y**2 + z**2)) - 0.12
    return np.minimum(np.maximum(0.2 - np.abs(z), hair), voids)


def hollow_leaf():
    """A strip of it with a part of its hairs, the middles of nine tiles, and which of them have theirs."""
    leaf = on_strip(thinned(texture(hollow, half=0.9, tile=2.0, n=33), HALF, seed=2, longest=1.2))
    tiles = np.stack(np.meshgrid(np.arange(1, 4), np.arange(-1, 2), indexing="ij"), axis=-1).reshape(-1, 2) * 2.0
    return leaf, tiles, leaf.values(np.column_stack([tiles + [0.25, 0], np.full(len(tiles), 0.5)])) > 0


def thinned(tiles, shares, seed=1, longest=0.5, **given):
    """A map over the strip that tiles are laid on."""
    return ThinnedField(tiles, shares, AREA, seed=seed, longest=longest, **given)


def on_strip(field):
    """A strip of 8 by 6, bent about a circle of radius 15."""
    return leaf_of(field, bend=15.0, length=8.0)[0]


def hairs_of(leaf, vertices):
    """The places of what stands out of a leaf, farther than half of what hairs do."""
    flat = leaf.blade.flatten(np.asarray(vertices))
    return flat[flat[:, 2] > (FACE + TIP) / 2]
