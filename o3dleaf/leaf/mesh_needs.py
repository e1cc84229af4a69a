"""Memory and time that the mesh of a leaf takes at least, from scan and volume alone: before the blade is fitted.

What it takes is asked again where its surface is known. This here is a lower bound, so that nothing is refused that
would have room; what is too fine by far is refused at once, and not after minutes of fitting.
"""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import Need, in_words, need_of
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.instancing.extraction.tile_cost import cost_of_tile
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.corners import KINDS
from o3dleaf.leaf.texture.wang.quilting import SIZES
from o3dleaf.leaf.texture.wang.wang_field import WangField

ASKED = 1000
"""Points whose distance to the next one is asked for."""
CELL = 6.0
"""Side of the cells that points are counted in, in spacings: few of those that the surface crosses have none."""
CLUTTER = 2.0
"""Times the blade's cells that noise, stalks and second sheets may add."""
SHARE = 0.25
"""Of a volume's face that a tile takes at least: half of it along either axis."""


def least_area(points: FloatArray) -> float:
    """Return an area that the surface through (n, 3) points has at least, but for clutter of more than its own.

    A plane crosses at most √3 cells to each square of a cell's side, and the points lie in some of those.
    """
    some = points[:: max(1, len(points) // ASKED)]
    spacing = float(np.median(cKDTree(points).query(some, k=2)[0][:, 1])) if len(points) > 1 else 0.0
    if spacing == 0:
        return 0.0
    cells = UniqueRows.of(np.floor((points - points.min(axis=0)) / (CELL * spacing))).rows
    return float(len(cells) * (CELL * spacing) ** 2 / (np.sqrt(3.0) * CLUTTER))


def need_for_sheet(points: FloatArray, spacing: float, region: npt.ArrayLike | None = None) -> Need:
    """Return what the mesh of a blade takes at least, of the points of its scan; of a part of it, (2, 2), no more."""
    area = least_area(points)
    if region is not None:
        low, high = np.asarray(region, dtype=np.float64)
        area = min(area, float(np.prod(np.maximum(high - low, 0.0))))
    with np.errstate(over="ignore"):
        count = float(area / (np.sqrt(3.0) / 4) / np.square(np.float64(require_positive(spacing, "spacing"))))
    what = f"spacing: over {in_words(count)} triangles"
    return need_of(measured.SHEET_TRIANGLE * count, what, "give a larger one", step=spacing)


def need_for_tile(
    patch: Volume | TiledField | PatchBlend | WangField, spacing: float, unit: str, *, wang: bool = False
) -> Need:
    """Return what one tile of a volume, or all its Wang tiles, or those of a texture, take at least at a spacing."""
    if isinstance(patch, Volume):
        share = KINDS * SIZES[0] ** 2 if wang else SHARE
        height, *face = np.sort(np.array(patch.shape) * patch.spacing)
        area = share * float(np.prod(face))
    else:
        height = np.ptp(patch.cell[:, 2])
        area = float(np.prod(patch.period)) * (KINDS if isinstance(patch, WangField) else 1)
    scale = unit_scale(patch.unit, unit) if patch.unit else 1.0
    with np.errstate(over="ignore"):
        per_length = np.float64(scale) / require_positive(spacing, "spacing")
        count, layers = float(area * np.square(per_length)), float(height * per_length)
    what = f"spacing: over {in_words(count)} columns of the lattice in one tile"
    return need_of(cost_of_tile(count, layers), what, "give a larger one", step=spacing)
