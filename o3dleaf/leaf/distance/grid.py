"""The leaf on a regular grid of the world, sampled slab by slab: its field, its distance, or a mask."""

from collections.abc import Callable, Iterator
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, require_choice
from o3dleaf.core.parallel import Progress, run_blocks
from o3dleaf.io.grid import GridFile
from o3dleaf.leaf.distance.around import Around
from o3dleaf.leaf.distance.distance import signed_distance
from o3dleaf.leaf.distance.solid import Solid

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

SUFFIXES = (".vti", ".nrrd")
KINDS: dict[str, type[Any]] = {"field": np.float32, "distance": np.float32, "mask": np.uint8}
"""What can be written, and the numbers that it is kept in."""
SLAB = 1 << 18
"""Points asked for at once."""
BLOCK = 1 << 13
"""Points of a mask that a thread looks at together: empty air costs it nothing but telling that it is."""


def write_grid(
    leaf: "MultiscaleLeaf",
    path: str | PathLike[str],
    spacing: float | npt.ArrayLike,
    bounds: npt.ArrayLike | None = None,
    *,
    what: str = "field",
    closed: bool = False,
    progress: Progress | None = None,
) -> None:
    """Sample the leaf on a regular grid and write it as one file; see `MultiscaleLeaf.write_grid`."""
    require_choice(what, KINDS, "what")
    box = leaf.bounds if bounds is None else bounds
    file = GridFile.plan(path, spacing, box, what, leaf.unit, KINDS[what], suffixes=SUFFIXES)
    sampler = _sampler(leaf, what, closed=closed)

    def values() -> Iterator[npt.NDArray[Any]]:
        done = 0
        for points in file.points(SLAB):
            yield sampler(points)
            done += len(points)
            if progress:
                progress(done, file.size)

    file.write(values())


def _sampler(leaf: "MultiscaleLeaf", what: str, *, closed: bool) -> Callable[[FloatArray], npt.NDArray[Any]]:
    if what == "field":
        return leaf
    if what == "distance":
        leaf.index_of(closed=closed)  # refused here where it cannot be, not in the middle of a file
        return lambda points: signed_distance(leaf, points, closed=closed)
    solid = leaf.index_of(closed=True).solid if closed else Solid(leaf.blade.outline.polygon, None)
    around = Around.of(leaf)

    def mask(points: FloatArray) -> npt.NDArray[np.bool_]:
        held = np.zeros(len(points), dtype=bool)

        def task(start: int, stop: int) -> None:
            rows = start + around.rows(points[start:stop])
            held[rows] = solid.holds(leaf, points[rows])

        run_blocks(task, len(points), BLOCK)
        return held

    return mask
