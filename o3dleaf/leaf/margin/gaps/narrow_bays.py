"""Bays of a margin, slits and holes that are no wider than gaps by chance, but too long to be chance's.

Each triangle between the banks of a bay two or three spacings wide is no larger than others inside. But they follow one
another across their long sides along all of the bay, and inside large triangles seldom do.
"""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.gaps.sample_gaps import CHANCE, open_gaps
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation, components_of, side_lengths

USUAL_AREA, LARGE_AREA = 0.5, 0.8
"""Shares of the areas of linked triangles below which lie two that tell how these fall off: bays are fewer than the
rest."""
MAX_CHANCE = 1e-3
"""Number of areas that large that a leaf has by chance."""


def narrow_bays(mesh: Triangulation, size: FloatArray, usual: float, short: float, longest: float) -> BoolArray:
    """Return the triangles (m,) between whose long sides a larger area is empty than chance leaves.

    They are linked where they share a side longer than `usual`. Those that are open to the outside across triangles
    longer than `longest` are none of a bay.

    Parameters
    ----------
    mesh : Triangulation
    size : (m,) ndarray
        The spacing that each triangle is judged by.
    usual : float
        The longest side, in spacings, that nine of ten triangles inside do not exceed.
    short, longest : float
        The sides, in spacings, up to which triangles are covered, and beyond which they are not.
    """
    reach, sides = mesh.reach / size, side_lengths(mesh) / size[:, np.newaxis]
    large = (reach > usual) & ~open_gaps(mesh, reach > longest)
    labels = components_of(np.where(sides > usual, mesh.neighbors, -1), large)
    if not large.any():
        return large
    cells = np.asarray(np.bincount(labels[large], (mesh.areas / size**2)[large]), dtype=np.float64)
    return np.asarray(large & (cells > max(_largest_by_chance(cells), CHANCE * short**2))[labels])


def _largest_by_chance(cells: FloatArray) -> float:
    """Return the area that `MAX_CHANCE` of areas (k,) exceed by chance: of large ones exponentially fewer are there."""
    middle, large = np.quantile(cells, (USUAL_AREA, LARGE_AREA))
    scale = (large - middle) / np.log((1 - USUAL_AREA) / (1 - LARGE_AREA))
    return float(middle + scale * np.log((1 - USUAL_AREA) * len(cells) / MAX_CHANCE))
