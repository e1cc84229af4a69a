"""Samples of a surface over its chart, from which the closest points of the surface are found."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.parametric import feet_loops, surface_loops
from o3dleaf.leaf.parametric.feet_loops import Samples
from o3dleaf.leaf.parametric.spline_loops import JET, VectorBalls

SAMPLE_COUNT = 20_000
"""Samples of a surface, about: on a leaf 200 mm long and 12 mm wide one every third of a millimeter."""
SIDE = 4
"""Samples along a side of a block, and blocks along one of a group."""
MARGIN = 1.5
"""Added to a block's ball, in steps of samples: the surface about its samples, where it is stretched."""
BLOCK = 1 << 12
LONGEST_STEP = 32.0
"""Of Newton's method, in steps of samples: of points whose start is given it may lie far off."""


@dataclass(frozen=True, eq=False)
class SurfaceFeet:
    """Closest points of a surface.

    Attributes
    ----------
    plane : (n, 2) ndarray
        (u, v).
    heights : (n,) ndarray
        Signed distances along the unit normal.
    converged : (n,) bool ndarray
    """

    plane: FloatArray
    heights: FloatArray
    converged: npt.NDArray[np.bool_]


def sample_surface(
    balls: VectorBalls,
    bounds: FloatArray,
    step: float,
    contains: Callable[[FloatArray], npt.NDArray[np.bool_]],
    beyond: Callable[[FloatArray], FloatArray] | None = None,
) -> Samples:
    """Return samples of a surface on a square grid over a box (2, 2) of the plane, where a predicate holds.

    `beyond` returns the distances from a margin and their derivatives, as in `Samples`; without it there is none.

    Raises
    ------
    ReconstructionError
        If it holds nowhere.
    """
    places, numbers = _grid(bounds, step)
    inside = contains(places)
    if not inside.any():
        raise ReconstructionError("surface: has no place inside the outline; enlarge the outline")
    places, numbers = places[inside], numbers[inside]
    order = np.lexsort(numbers.T[::-1])
    plane = np.ascontiguousarray(places[order])
    off = np.zeros((len(plane), 3)) if beyond is None else beyond(plane)
    return _samples_at(balls, plane, numbers[order], off, step)


def _grid(bounds: FloatArray, step: float) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return places (m, 2) on a square grid over a box, and the group and block of each (m, 2)."""
    counts = np.maximum(np.ceil(np.ptp(bounds, axis=0) / step), 1).astype(np.int64) + 1
    rows = np.stack(np.meshgrid(np.arange(counts[0]), np.arange(counts[1]), indexing="ij"), axis=-1).reshape(-1, 2)
    start = bounds.mean(axis=0) - step * (counts - 1) / 2
    numbers = [rows[:, 0] // side * (counts[1] // side + 1) + rows[:, 1] // side for side in (SIDE**2, SIDE)]
    return start + step * rows, np.stack(numbers, axis=1)


def _samples_at(
    balls: VectorBalls, plane: FloatArray, numbers: npt.NDArray[np.int64], beyond: FloatArray, step: float
) -> Samples:
    """Return the samples at places (m, 2), a `step` apart, in the order of the groups and blocks of each (m, 2)."""
    jets = jets_of(balls, plane, 2)
    space = np.ascontiguousarray(jets[:, 0])
    stretch = np.sqrt(np.maximum((jets[:, 1] ** 2).sum(axis=1), (jets[:, 2] ** 2).sum(axis=1)))
    groups, blocks = (_first_rows(numbers[:, :columns]) for columns in (1, 2))
    surround = partial(_surround, space, MARGIN * step * stretch)
    ends = np.append(np.searchsorted(blocks, groups), len(blocks)), np.append(blocks, len(plane))
    within = np.vstack([space.T, np.maximum(beyond[:, 0], 0.0)])
    return Samples(surround(groups), surround(blocks), *ends, within, plane, jets, beyond, step)


def _first_rows(numbers: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Return where a row differs from the one before."""
    return np.flatnonzero(np.append(True, np.any(numbers[1:] != numbers[:-1], axis=1))).astype(np.int64)


def _surround(space: FloatArray, slack: FloatArray, first: npt.NDArray[np.int64]) -> FloatArray:
    """Return centers and radii (4, k) of balls about runs of points (n, 3) with slack, from the first row of each."""
    counts = np.diff(np.append(first, len(space)))
    centers = np.add.reduceat(space, first, axis=0) / counts[:, np.newaxis]
    away = np.linalg.norm(space - np.repeat(centers, counts, axis=0), axis=1)
    return np.vstack([centers.T, np.maximum.reduceat(away + slack, first)])


def jets_of(balls: VectorBalls, plane: FloatArray, order: int) -> FloatArray:
    """Return the jets (n, rows, 3) of a surface at (n, 2) places."""
    jets = np.empty((len(plane), (1, 3, JET)[order], 3))

    def task(start: int, stop: int) -> None:
        surface_loops.jets_at(plane[start:stop], balls, order, jets[start:stop])

    run_blocks(task, len(plane), BLOCK)
    return jets


def feet_from(balls: VectorBalls, points: FloatArray, starts: FloatArray, step: float) -> SurfaceFeet:
    """Return the feet of points (n, 3) that Newton's method finds from `starts` (n, 2)."""
    found = _empty(len(points))

    def task(i: int, j: int) -> None:
        _newton(balls, points[i:j], starts[i:j], step, LONGEST_STEP * step, found, i)

    run_blocks(task, len(points), BLOCK)
    return found


def closest_feet(balls: VectorBalls, points: FloatArray, samples: Samples) -> SurfaceFeet:
    """Return the closest feet of points (n, 3), from those samples of the surface that may lead to them.

    Beyond a margin there is no surface: the closest foot is that of the sheet whose part inside the margin is closest.
    """
    found = _empty(len(points))

    def task(i: int, j: int) -> None:
        block, starts, others = points[i:j], np.empty((j - i, 3)), np.empty((j - i, 3))
        feet_loops.find_starts(block, samples, starts, others)
        _newton(balls, block, starts, samples.step, 2 * samples.step, found, i)
        rows = np.flatnonzero(~np.isnan(others[:, 0]))
        if len(rows):
            rival = _empty(len(rows))
            _newton(balls, block[rows], others[rows], samples.step, 2 * samples.step, rival, 0)
            squares = rival.heights**2 + others[rows, 2] ** 2, found.heights[i + rows] ** 2 + starts[rows, 2] ** 2
            better = squares[0] < squares[1]
            rows = i + rows[better]
            found.plane[rows], found.heights[rows] = rival.plane[better], rival.heights[better]
            found.converged[rows] = rival.converged[better]

    run_blocks(task, len(points), BLOCK)
    return found


def _empty(count: int) -> SurfaceFeet:
    return SurfaceFeet(np.empty((count, 2)), np.empty(count), np.empty(count, dtype=bool))


def _newton(  # noqa: PLR0917 - a surface, points and where to write
    balls: VectorBalls,
    points: FloatArray,
    starts: FloatArray,
    step: float,
    max_step: float,
    found: SurfaceFeet,
    first: int,
) -> None:
    """Write the feet of a block into `found` from row `first` on."""
    rows = slice(first, first + len(points))
    feet_loops.find_feet(
        points, starts, balls, step, max_step, found.plane[rows], found.heights[rows], found.converged[rows]
    )
