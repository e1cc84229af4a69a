"""A mesh cut into blocks that are edited side by side, each with its border locked, and put together again."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import run_blocks

Labels = npt.NDArray[np.uint8]

MAX_TRIANGLES = 1 << 14
"""Triangles of a block at most: they stay in a core's cache."""


@dataclass(frozen=True, eq=False)
class Charted:
    """A mesh whose vertices have charts, and whose triangles have labels.

    Attributes
    ----------
    places, charts : (n, 3) ndarrays
    triangles : (m, 3) ndarray of int64
    labels : (m,) ndarray of uint8
    on_surface : (n,) ndarray of bool
        Which vertices are known to lie on the surface.
    """

    places: FloatArray
    charts: FloatArray
    triangles: IntArray
    labels: Labels
    on_surface: BoolArray

    @classmethod
    def of(cls, places: FloatArray, charts: FloatArray, triangles: IntArray, labels: Labels) -> "Charted":
        """Return a mesh of which nothing is known to lie on the surface."""
        return cls(places, charts, triangles, labels, np.zeros(len(places), dtype=bool))


Task = Callable[[Charted, BoolArray], Charted]
"""Takes a block and which vertices must stay, and returns it edited: vertices keep their rows, new ones follow."""


def edit_in_blocks(mesh: Charted, task: Task, share: float) -> Charted:
    """Cut a mesh into blocks at `share` of their triangles, edit each, and put the mesh together.

    The result does not depend on the number of threads. Vertices that no triangle names are dropped.

    Parameters
    ----------
    mesh : Charted
    task : callable
    share : float
        Between 0 and 1: where a part is cut in two. Blocks of another share have their borders elsewhere.
    """
    order, starts = _cut(mesh.places[mesh.triangles].mean(axis=1), share)
    block = np.empty(len(order), dtype=np.int32)
    block[order] = np.repeat(np.arange(len(starts) - 1, dtype=np.int32), np.diff(starts))
    owner = np.full(len(mesh.places), -1, dtype=np.int32)
    owner[mesh.triangles] = block[:, np.newaxis]
    shared = np.zeros(len(mesh.places), dtype=bool)
    shared[mesh.triangles[owner[mesh.triangles] != block[:, np.newaxis]]] = True
    parts: list[tuple[IntArray, Charted]] = [(np.empty(0, dtype=np.int64), mesh)] * (len(starts) - 1)

    def edit(first: int, _: int) -> None:
        parts[first] = _edit_rows(mesh, np.sort(order[starts[first] : starts[first + 1]]), shared, task)

    run_blocks(edit, len(parts), 1, reports=True)
    return _join(mesh, parts)


def edit_part(mesh: Charted, chosen: BoolArray, task: Task) -> Charted:
    """Edit the `chosen` (m,) triangles of a mesh, the vertices that they share with others locked."""
    shared = np.zeros(len(mesh.places), dtype=bool)
    shared[mesh.triangles[~chosen]] = True
    part = _edit_rows(mesh, np.flatnonzero(chosen), shared, task)
    rest = _edit_rows(mesh, np.flatnonzero(~chosen), shared, lambda block, _: block)
    return _join(mesh, [rest, part])


def _edit_rows(mesh: Charted, rows: IntArray, shared: BoolArray, task: Task) -> tuple[IntArray, Charted]:
    """Return the vertices of some triangles, and what an edit makes of these."""
    used, local = np.unique(mesh.triangles[rows], return_inverse=True)
    block = Charted(
        mesh.places[used], mesh.charts[used], local.reshape(-1, 3), mesh.labels[rows], mesh.on_surface[used]
    )
    return used, task(block, shared[used])


def _cut(points: FloatArray, share: float) -> tuple[IntArray, IntArray]:
    """Return an order of points and the starts of blocks in it, parts that were cut across their longest sides."""
    order, starts, todo = np.arange(len(points)), [], [(0, len(points))]
    while todo:
        start, stop = todo.pop()
        if stop - start <= MAX_TRIANGLES:
            starts.append(start)
            continue
        rows = order[start:stop]
        axis = np.ptp(points[rows], axis=0).argmax()
        middle = start + int(share * (stop - start))
        order[start:stop] = rows[np.argpartition(points[rows, axis], middle - start)]
        todo += [(middle, stop), (start, middle)]
    return order, np.array([*starts, len(points)])


def _join(mesh: Charted, parts: list[tuple[IntArray, Charted]]) -> Charted:
    """Return one mesh of blocks: vertices that it had before them in their order, then the new ones, block by block."""
    places, charts, on_surface = mesh.places.copy(), mesh.charts.copy(), mesh.on_surface.copy()
    triangles, more, count = [], [], len(places)
    for used, part in parts:
        fresh = len(part.places) - len(used)
        name = np.concatenate([used, count + np.arange(fresh)])
        places[used], charts[used] = part.places[: len(used)], part.charts[: len(used)]
        on_surface[used] = part.on_surface[: len(used)]
        more.append((part.places[len(used) :], part.charts[len(used) :], part.on_surface[len(used) :]))
        triangles.append(name[part.triangles])
        count += fresh
    corners = np.concatenate(triangles)
    places, charts, on_surface = (
        np.concatenate([old, *new]) for old, *new in zip((places, charts, on_surface), *more, strict=True)
    )
    kept = np.zeros(count, dtype=bool)
    kept[corners] = True
    labels = np.concatenate([part.labels for _, part in parts])
    return Charted(places[kept], charts[kept], (np.cumsum(kept) - 1)[corners], labels, on_surface[kept])
