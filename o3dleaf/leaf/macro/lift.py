"""The lift X(z) from flat coordinates to the world, heights along up, with its Jacobian, and where lifts fold."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.blade.distortion import radii_of
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.macro import lift_loops
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.offset import NormalOffsets

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


def focal_along_normal(frame: LeafFrame, height_map: HeightMap, plane: FloatArray) -> FloatArray:
    """Return the least radius of curvature of the blade (n,) at (n, 2) places."""
    flat = np.column_stack([plane, np.zeros(len(plane))])
    curvature = np.abs(NormalOffsets.at(frame, height_map, flat).curvatures).max(axis=1, initial=0.0)
    return radii_of(curvature, frame.length)


def focal_up(frame: LeafFrame, height_map: HeightMap, plane: FloatArray) -> FloatArray:
    """Return the height (n,) at (n, 2) places at which det ∂x/∂y, linear in y₃, vanishes."""
    leaf = np.column_stack([plane, height_map(plane)])
    determinant = np.linalg.det(frame.jacobian(leaf))
    higher = np.linalg.det(frame.jacobian(leaf + np.array([0.0, 0.0, frame.length])))
    fall = np.abs(higher - determinant) / frame.length
    return np.asarray(np.abs(determinant) * radii_of(fall, frame.length))
