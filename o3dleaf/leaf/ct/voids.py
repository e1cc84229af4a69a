"""Voids and loose pieces at a range of levels, from which a level is chosen by hand.

The paper lowered its own from 0.11, the valley of its histogram, to 0.03, until the holes were gone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import generate_binary_structure, label

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.ct.volume import Volume

FACES, CORNERS = generate_binary_structure(3, 1), generate_binary_structure(3, 3)
"""Leaf hangs together by corners, air by faces: then neither runs through the other."""


@dataclass(frozen=True)
class PiecesAtLevel:
    """Voids and loose pieces of a volume at a level.

    Attributes
    ----------
    level : float
        In intensity.
    share : float
        Share of the voxels above it.
    voids, pieces : int
        Number of voids, which are air that no way leads out of, and of pieces of leaf beside the largest.
    void_volume, piece_volume : float
        Theirs, in the volume's unit cubed.
    """

    level: float
    share: float
    voids: int
    void_volume: float
    pieces: int
    piece_volume: float


def pieces_at_levels(volume: Volume, levels: FloatArray) -> list[PiecesAtLevel]:
    """Return what each level makes of the voxels; pockets that a face of the volume cuts are open, and no voids."""
    voxel = float(np.prod(volume.spacing))
    found = []
    for level in levels:
        leaf = np.asarray(volume.data > level)
        voids = _enclosed(~leaf)
        pieces = np.bincount(label(leaf, CORNERS)[0].ravel())[1:]
        loose = np.sort(pieces)[:-1]
        found.append(
            PiecesAtLevel(
                float(level), float(leaf.mean()), len(voids), float(voids.sum() * voxel), len(loose),
                float(loose.sum() * voxel),
            )
        )  # fmt: skip
    return found


def levels_around(air: float, leaf: float) -> FloatArray:
    """Return nine levels between air and leaf, the middle among them."""
    levels: FloatArray = air + (leaf - air) * np.linspace(0.1, 0.9, 9)
    return levels


def _enclosed(air: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """Return the voxels of each piece of air that touches no face of the box."""
    pieces, count = label(air, FACES)
    sizes = np.bincount(pieces.ravel(), minlength=count + 1)
    for axis in range(3):
        sizes[np.take(pieces, [0, -1], axis)] = 0
    sizes[0] = 0
    enclosed: npt.NDArray[Any] = sizes[sizes > 0]
    return enclosed
