"""The leaf on a regular grid of the world, sampled slab by slab: its field, its distance, or a mask."""

from collections.abc import Callable
from os import PathLike
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.parallel import run_blocks
from o3dleaf.io.grid import GridFile
from o3dleaf.leaf.distance.around import BoundingBalls
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.textured_blade import TexturedBlade

SUFFIXES = (".vti", ".nrrd")
KINDS: dict[str, type[Any]] = {"field": np.float32, "distance": np.float32, "mask": np.uint8}
"""The values that can be written, and the numbers that they are kept in."""
SLAB = 1 << 18
"""Points evaluated at once."""
BLOCK = 1 << 13
"""Points of a mask that a thread looks at together: empty air costs it nothing but the look."""

Sampler: TypeAlias = Callable[[FloatArray], npt.NDArray[Any]]
"""The values (n,) at (n, 3) points."""


def plan_grid(
    path: str | PathLike[str], spacing: float | npt.ArrayLike, bounds: npt.ArrayLike, what: str, unit: str | None
) -> GridFile:
    """Lay the whole multiples of `spacing` over a box (2, 3), or refuse what cannot be written."""
    require_choice(what, KINDS, "what")
    return GridFile.plan(path, spacing, bounds, what, unit, KINDS[what], suffixes=SUFFIXES)


def write_grid(grid: GridFile, sampler: Sampler) -> None:
    """Write the values of a sampler at the points of a grid, slab by slab."""
    grid.write(sampler(points) for points in grid.points(SLAB))


def mask_sampler(leaf: TexturedBlade, solid: LeafSolid) -> Sampler:
    """Return the function that tests whether (n, 3) points lie in a solid."""
    balls = BoundingBalls.of(leaf)

    def mask(points: FloatArray) -> npt.NDArray[np.bool_]:
        inside = np.zeros(len(points), dtype=bool)

        def task(start: int, stop: int) -> None:
            rows = start + balls.rows(points[start:stop])
            inside[rows] = solid.contains_points(leaf, points[rows])

        run_blocks(task, len(points), BLOCK)
        return inside

    return mask
