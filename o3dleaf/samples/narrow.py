"""Solids with what is hard to reconstruct, as thin, narrow or small as is asked: fins, a gap, a fold, bumps."""

from collections.abc import Callable

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import NotNegative, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.samples.mesh_solid import MeshSolid
from o3dleaf.samples.meshed import level_mesh

STEPS = 6
"""Steps of the mesh across what is narrow; its triangles are the truth, so that they need not be finer."""


@checked
def fins(thickness: Positive = 0.04) -> MeshSolid:
    """Return three round-edged plates through a ball, like the fins of a radiator.

    Parameters
    ----------
    thickness : float
        Of the plates, 1 long and 0.7 wide.
    """
    require_positive(thickness, "thickness")
    box = np.array([[-0.6, -0.6, -0.45], [0.6, 0.6, 0.45]])
    turns = np.deg2rad([0.0, 60.0, 120.0])

    def level(points: FloatArray) -> FloatArray:
        parts = [0.2 - np.linalg.norm(points, axis=1)]
        for along, across in ((np.array([np.cos(t), np.sin(t)]), np.array([-np.sin(t), np.cos(t)])) for t in turns):
            u, v, w = points[:, :2] @ along, points[:, :2] @ across, points[:, 2]
            parts.append(thickness / 2 - _length(np.maximum(np.abs(u) - 0.5, 0), v, np.maximum(np.abs(w) - 0.35, 0)))
        return _joined(np.stack(parts), thickness / 4)

    return _solid(level, box, thickness)


@checked
def gap(width: Positive = 0.04) -> MeshSolid:
    """Return a block with a slot down to below its middle, like two fingers that nearly touch.

    Parameters
    ----------
    width : float
        Of the slot, whose foot is round.
    """
    require_positive(width, "width")
    box = np.array([[-0.55, -0.4, -0.35], [0.55, 0.4, 0.35]])
    half, radius = np.array([0.5, 0.35, 0.3]), 0.05

    def level(points: FloatArray) -> FloatArray:
        beyond = np.abs(points) - (half - radius)
        block = radius - np.linalg.norm(np.maximum(beyond, 0), axis=1) - np.minimum(beyond.max(axis=1), 0)
        slot = _length(points[:, 0], np.minimum(points[:, 2] + 0.1, 0)) - width / 2
        return -_joined(np.stack([-block, -slot]), width / 8)

    return _solid(level, box, width)


@checked
def fold(distance: Positive = 0.04) -> MeshSolid:
    """Return a plate folded onto itself, like a leaf that is rolled in.

    Parameters
    ----------
    distance : float
        Between its two halves, and its thickness.
    """
    require_positive(distance, "distance")
    box = np.array([[-0.6, -0.45, -2 * distance], [0.5 + 2 * distance, 0.45, 2 * distance]])

    def level(points: FloatArray) -> FloatArray:
        x, y, z = points.T
        bend = np.abs(_length(np.maximum(x - 0.4, 0), z) - distance)
        halves = _length(np.maximum(-0.5 - x, 0), np.where(x > 0.4, bend, np.abs(z) - distance))
        return distance / 2 - _length(halves, np.maximum(np.abs(y) - 0.35, 0))

    return _solid(level, box, distance)


@checked
def bumps(height: NotNegative = 0.01, wave: Positive = 0.15) -> MeshSolid:
    """Return a ball of radius 0.5 with bumps all over.

    Parameters
    ----------
    height : float
        Of the bumps over the ball, and depth of the dents between them.
    wave : float
        Length from bump to bump along the axes.
    """
    require_positive(height, "height")
    require_positive(wave, "wave")
    box = (0.55 + height) * np.array([[-1.0] * 3, [1.0] * 3])

    def level(points: FloatArray) -> FloatArray:
        waves = np.cos(2 * np.pi / wave * points).prod(axis=1)
        return np.asarray(0.5 + height * waves - np.linalg.norm(points, axis=1))

    return _solid(level, box, wave / 4, steepness=1 + 2 * np.pi * height / wave)


def _solid(
    level: Callable[[FloatArray], FloatArray], box: FloatArray, narrow: float, *, steepness: float = 1.0
) -> MeshSolid:
    return MeshSolid.of(level_mesh(level, box, narrow / STEPS, steepness))


def _length(*parts: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.sum(np.square(parts), axis=0)))


def _joined(levels: FloatArray, blend: float) -> FloatArray:
    """Return the union (n,) of levels (k, n), larger inside, with creases rounded with a radius of about `blend`."""
    most = levels.max(axis=0)
    return np.asarray(most + blend * np.log(np.exp((levels - most) / blend).sum(axis=0)))
