"""The lift X(z) from flat coordinates to the world, heights along up, with its Jacobian."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.macro import lift_loops
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap

BLOCK = 1 << 12


def lift_up(frame: LeafFrame, height_map: HeightMap, flat: FloatArray) -> Lifted:
    """Return the world points of (n, 3) flat coordinates with heights along up, and the Jacobian there."""
    jet = height_map.jet(flat[:, :2], 1)
    heights, gradients = np.ascontiguousarray(jet[:, 0]), np.ascontiguousarray(jet[:, 1:])
    lifted, splines = Lifted(np.empty_like(flat), np.empty((len(flat), 3, 3))), frame.splines

    def task(start: int, stop: int) -> None:
        lift_loops.fill_lift(start, stop, flat, heights, gradients, splines, lifted.world, lifted.columns)

    run_blocks(task, len(flat), BLOCK)
    return lifted
