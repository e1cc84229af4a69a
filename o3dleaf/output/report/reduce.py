"""A mesh with fewer triangles to look at: vertices in one cell of a grid become one."""

from dataclasses import dataclass, replace

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas

MAX_TRIALS = 6
"""Steps of the grid that are tried at most."""

MIN_SHARE = 0.7
"""Part of the budget that a trial has to reach to be the last."""


@dataclass(frozen=True, eq=False)
class ReducedMesh:
    """A mesh to look at, and where each vertex of the full one went.

    Attributes
    ----------
    vertices, triangles : (k, 3), (l, 3) ndarrays
    cluster : (n,) ndarray of int64
        The vertex here of each vertex of the full mesh, -1 for one that no triangle uses.
    step : float
        Edge of the grid's cells in the mesh's unit; 0 where nothing was put together.
    full : int
        Triangles of the full mesh.
    """

    vertices: FloatArray
    triangles: IntArray
    cluster: IntArray
    step: float
    full: int

    @property
    def is_less(self) -> bool:
        """Return whether it has fewer triangles than the mesh."""
        return len(self.triangles) < self.full

    def mean(self, values: FloatArray) -> FloatArray:
        """Return the (k, c) means of the (n, c) values that each vertex here stands for."""
        used = np.flatnonzero(self.cluster >= 0)
        of_row, size = self.cluster[used], len(self.vertices)
        sums = [np.bincount(of_row, weights=column[used], minlength=size) for column in values.T]
        return np.stack(sums, axis=1) / np.maximum(np.bincount(of_row, minlength=size), 1)[:, np.newaxis]

    def worst(self, values: FloatArray, *, least: bool = False) -> FloatArray:
        """Return the largest (or `least`) of the (n,) values that each vertex here stands for; NaN where unknown."""
        chosen = np.flatnonzero((self.cluster >= 0) & ~np.isnan(values))
        # Sorted by value, the last to be written stays.
        order = chosen[np.argsort(-values[chosen] if least else values[chosen], kind="stable")]
        worst = np.full(len(self.vertices), np.nan)
        worst[self.cluster[order]] = values[order]
        return worst


def reduce_mesh(vertices: FloatArray, triangles: IntArray, budget: int) -> ReducedMesh:
    """Return a mesh of at most `budget` triangles that looks alike, or the mesh itself if it has no more.

    Vertices in one cell of a cubic grid become one, at their mean; triangles that lost a corner go,
    and so do those that others cover. The cells' edge is found by a few trials, from the one at
    which an even surface of this area has `budget` triangles. Where nothing is left, because the
    mesh is fragments smaller than a cell, some of its triangles stay as they are.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    budget : int
    """
    if len(triangles) <= budget:
        used = np.zeros(len(vertices), dtype=bool)
        used[triangles] = True
        cluster = np.where(used, np.cumsum(used) - 1, -1)
        return ReducedMesh(vertices[used], cluster[triangles].reshape(-1, 3), cluster, 0.0, len(triangles))
    step = float(np.sqrt(3 * triangle_areas(vertices, triangles).sum() / budget))
    step = max(step, 1e-6 * float(np.ptp(vertices, axis=0).max()))
    best: ReducedMesh | None = None
    for _ in range(MAX_TRIALS):
        trial = _cluster(vertices, triangles, step)
        count = len(trial.triangles)
        if count <= budget and (best is None or count > len(best.triangles)):
            best = trial
        if MIN_SHARE * budget <= count <= budget:
            break
        step *= float(np.clip(np.sqrt(count / (0.85 * budget)), 0.25, 4.0))
    if best is None or not len(best.triangles):
        # Fragments, each smaller than a cell: some of them, as they are.
        chosen = triangles[np.linspace(0, len(triangles) - 1, budget).astype(np.int64)]
        return replace(reduce_mesh(vertices, chosen, budget), full=len(triangles))
    return best


def _cluster(vertices: FloatArray, triangles: IntArray, step: float) -> ReducedMesh:
    """Return the mesh whose vertices are the cells of a grid of this step."""
    used = np.zeros(len(vertices), dtype=bool)
    used[triangles] = True
    rows = np.flatnonzero(used)
    cell = np.floor((vertices[rows] - vertices[rows].min(axis=0)) / step).astype(np.int64)
    size = cell.max(axis=0) + 1
    _, of_row, count = np.unique(
        (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2], return_inverse=True, return_counts=True
    )
    cluster = np.full(len(vertices), -1, dtype=np.int64)
    cluster[rows] = of_row
    mean = np.stack([np.bincount(of_row, weights=vertices[rows, axis]) / count for axis in range(3)], axis=1)
    moved = cluster[triangles]
    apart = (moved[:, 0] != moved[:, 1]) & (moved[:, 1] != moved[:, 2]) & (moved[:, 2] != moved[:, 0])
    moved = moved[apart]
    first = np.argmin(moved, axis=1)[:, np.newaxis]
    turned = np.take_along_axis(moved, (first + np.arange(3)) % 3, axis=1)
    order = np.lexsort(turned.T)
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(turned[order], axis=0) != 0).any(axis=1)
    return ReducedMesh(mean, moved[np.sort(order[fresh])], cluster, step, len(triangles))
