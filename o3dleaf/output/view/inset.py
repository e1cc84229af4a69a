"""Where the inset of a leaf's picture lies, and how fine its mesh is: known without all that draws it."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import unit_scale

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

WINDOW_MM = 2.4
"""Side of the inset's window on the leaf."""
STEPS = 200
"""Mesh steps along that side: half a voxel of a 24 µm CT in 2.4 mm, so that hairs are round."""
SHARE = 0.5
"""Of the shorter side of a part that is drawn alone, the most that the window takes: it is a detail."""


def inset_window(leaf: "MultiscaleLeaf", region: npt.ArrayLike | None = None) -> FloatArray:
    """Return the (2, 2) window of the inset: 2.4 mm in the middle of what the picture shows of the outline."""
    side, shown = _inset_side(leaf.unit, region), leaf.blade.outline.polygon
    if region is not None:
        shown &= shapely.box(*np.asarray(region, dtype=np.float64).ravel())
    middle = shown.representative_point()
    center = np.array([middle.x, middle.y])
    return np.array([center - side / 2, center + side / 2])


def inset_step(unit: str | None, region: npt.ArrayLike | None = None) -> float:
    """Return the step of the inset's mesh, in the leaf's unit, which does not depend on the blade."""
    return _inset_side(unit, region) / STEPS


def _inset_side(unit: str | None, region: npt.ArrayLike | None) -> float:
    side = WINDOW_MM * unit_scale("mm", unit)
    return side if region is None else min(side, SHARE * float(np.ptp(np.asarray(region), axis=0).min()))
