"""Vertices where the field itself is zero along their edges, not its linear interpolant."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.lattice import BLOCK
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import blocks
from o3dleaf.core.processes.spread import each_block
from o3dleaf.core.resources.scratch import GrowingArray
from o3dleaf.leaf.instancing.extraction.samples import Alike
from o3dleaf.leaf.instancing.tile import TileLattice
from o3dleaf.surface.isosurface.cell_loops import MIN_FRACTION
from o3dleaf.surface.isosurface.polygonize import lattice_positions

MAX_STEPS = 12
"""Steps towards a field's zero along an edge: a smooth field takes three."""
TOLERANCE = 1e-4
"""Share of an edge by which the last of them moves a vertex."""


def sharpened_fractions(  # noqa: PLR0917 - the vertices, the field, and which edges are alike
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    edges: IntArray,
    fractions: FloatArray,
    upward: npt.NDArray[np.bool_],
    period: tuple[int, int],
    alike: Alike | None,
) -> FloatArray:
    """Return where the field is zero along each edge, asked once of edges that are alike."""
    if alike is None and period == lattice.shape[:2]:
        return _sharpened(field, lattice, edges, fractions, upward)
    folded = _folded(edges, lattice.shape, period) if alike is None else alike.edges(edges)
    first, rows, copies = np.unique(folded, return_index=True, return_inverse=True)
    return _sharpened(field, lattice, first, fractions[rows], upward[rows])[copies]


def _folded(edges: IntArray, shape: tuple[int, int, int], period: tuple[int, int]) -> IntArray:
    """Return the edges like these that start in the first `period` of steps."""
    _, ny, nz = shape
    column, rest = edges // (8 * nz), edges % (8 * nz)
    return np.asarray((column // ny % period[0] * ny + column % ny % period[1]) * 8 * nz + rest)


def _sharpened(
    field: Callable[[FloatArray], FloatArray],
    lattice: TileLattice,
    edges: IntArray,
    fractions: FloatArray,
    upward: npt.NDArray[np.bool_],
) -> FloatArray:
    """Return where the field is zero along each edge, by the Illinois variant of regula falsi.

    Where its sign at an end is not what is inside there, a void having been filled, the fraction stays as it is.
    """
    sharpened = GrowingArray(np.float64)
    parts = (_Edges(edges[i:j], fractions[i:j], upward[i:j]) for i, j in blocks(len(edges), BLOCK))
    for (part,) in each_block(partial(_sharpen, field, lattice), parts):
        sharpened.append(part)
    return sharpened.whole()


class _Edges(NamedTuple):
    """Edges (n,), where a vertex lies along each, and whether its lower end is the one inside."""

    edges: IntArray
    fractions: FloatArray
    upward: npt.NDArray[np.bool_]


def _sharpen(field: Callable[[FloatArray], FloatArray], lattice: TileLattice, part: _Edges) -> tuple[FloatArray]:
    """Return where the field is zero along some edges."""
    sharpened, low = part.fractions.copy(), part.upward

    def values_at(rows: IntArray, share: FloatArray) -> FloatArray:
        return field(lattice.positions(lattice_positions(part.edges[rows], share, lattice.shape)))

    every = np.arange(len(sharpened))
    ends = [np.zeros(len(sharpened)), np.ones(len(sharpened))]
    values = [values_at(every, share) for share in ends]
    rows = np.flatnonzero(((values[0] > 0) == low) & ((values[1] > 0) != low))
    a, b, fa, fb = (each[rows] for each in (*ends, *values))
    for _ in range(MAX_STEPS):
        share = (a * fb - b * fa) / (fb - fa)
        sharpened[rows] = np.clip(share, MIN_FRACTION, 1 - MIN_FRACTION)
        f = values_at(rows, share)
        crossed = (f > 0) != (fb > 0)
        a, fa = np.where(crossed, b, a), np.where(crossed, fb, fa / 2)
        b, fb = share, f
        # The secant's next step, which says how far the zero still is.
        going = np.abs(fb * (b - a)) > TOLERANCE * np.abs(fb - fa)
        rows = rows[going]
        a, b, fa, fb = (each[going] for each in (a, b, fa, fb))
        if not len(rows):
            break
    return (sharpened,)
