"""A periodic layer, an outline over it, and the two put together."""

import numpy as np

from o3dleaf.io.mesh_stream import Arrays
from o3dleaf.leaf.instancing.assembly import BATCH_SIZE, MAX_VERTICES, Assembly
from o3dleaf.leaf.instancing.block import FlatBlock
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.tile import TileLattice

PERIOD = 1.2
WIDE = 5.1, 2.5
"""Reach of an outline over some nine tiles by five, for what takes whole tiles, or many."""
LATTICE = TileLattice((0.1, -0.2, -0.4), (PERIOD / 24, PERIOD / 20, 0.8 / 30), (24, 20, 31))


def ball(points, centre, radius):
    """Radius less the distance to the nearest copy of a ball."""
    x, y, z = (points - centre).T
    x, y = x - PERIOD * np.round(x / PERIOD), y - PERIOD * np.round(y / PERIOD)
    return radius - np.sqrt(x * x + y * y + z * z)


def layer(points):
    """A wavy layer 0.2 thick with a void in its middle, one across the sides of the period, and a speck over it."""
    x, y, z = points.T
    wave = 2 * np.pi / PERIOD
    blade = 0.1037 + 0.03 * np.sin(wave * y) + 0.02 * np.sin(2 * wave * x) - np.abs(z - 0.01 * np.cos(wave * x))
    for centre in ([0.5, 0.6, 0.0], [0.1, -0.2, 0.003]):
        blade = np.minimum(blade, -ball(points, centre, 0.052))
    return np.maximum(blade, ball(points, [0.5, 0.6, 0.25], 0.06))


def solid_layer(points):
    """The wavy layer alone."""
    x, y, z = points.T
    wave = 2 * np.pi / PERIOD
    return 0.1037 + 0.03 * np.sin(wave * y) + 0.02 * np.sin(2 * wave * x) - np.abs(z - 0.01 * np.cos(wave * x))


def outline(points=90, reach=(3.1, 1.7)):
    """An outline with notches; unless it is said otherwise, some five tiles by three."""
    angle = np.linspace(0, 2 * np.pi, points, endpoint=False) + 0.01
    x, y = reach[0] * np.cos(angle) + 2, reach[1] * np.sin(angle) * (1 + 0.2 * np.sin(5 * angle))
    return ring(np.column_stack([x, y]))


def ring(points):
    """The sides (n, 4) of a closed polygon through points (n, 2)."""
    return np.hstack([points, np.roll(points, -1, axis=0)])


def area(sides):
    return abs(np.sum(sides[:, 0] * sides[:, 3] - sides[:, 2] * sides[:, 1])) / 2


def assemble(tile, sides, region=None, *, closed=False, max_vertices=MAX_VERTICES, batch_size=BATCH_SIZE):
    plane = np.array(tile.lattice.origin[:2]), np.array(tile.lattice.spacing[:2])
    assembly = Assembly(tile, footprint(sides, *plane, region), closed=closed, max_vertices=max_vertices)
    arrays = Arrays(assembly)
    assembly.emit(arrays, lambda flat: flat, batch_size)
    return assembly, arrays


def made_block(tile):
    """Vertices, triangles and labels of a tile's block."""
    block = FlatBlock(tile)
    arrays = Arrays(block)
    block.emit(arrays)
    return arrays.vertices, arrays.triangles, arrays.labels
