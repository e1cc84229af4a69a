"""Edges collapsed until triangles would cross others: by halves, what came to cross locked as it was before."""

import numpy as np

from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.deviation import nearest_triangles
from o3dleaf.surface.repair.meshlab import Parts, collapse_edges

MAX_ROUNDS = 8
"""Times that more is locked around triangles that cross, wider each time, until they are left as they were."""

FIRST_STEP, LAST_STEP = float(np.log(2.0)), 0.05
"""Logarithms of numbers of triangles: the first step down, and the one below which no smaller one is tried."""


def collapse_apart(mesh: Parts, target: int, quality: float) -> Parts:
    """Return the mesh of about `target` triangles, or as many more as it takes that none come to cross others.

    MeshLab's collapses see the triangles around an edge alone, and the later ones take what is left: a few vertices
    that are joined to all of a long rim, across its bends, or two sheets that lie closer together than the triangles
    are long. A mesh that crosses itself as it comes is simplified without regard to that.
    """
    simplified = collapse_edges(mesh, target, quality)
    if not _crossing(simplified).any() or _crossing(mesh).any():
        return simplified
    step, least = FIRST_STEP, mesh
    while len(mesh[1]) > target and step > LAST_STEP:
        aim = max(target, int(len(mesh[1]) * np.exp(-step)))
        fewer = _collapse_once(mesh, aim, quality)
        if fewer is not None and len(fewer[1]) < len(least[1]):
            least = fewer
        if fewer is not None and 2 * len(fewer[1]) <= len(mesh[1]) + aim:
            mesh = fewer
        else:
            # Where much had to be locked, shorter steps lock less.
            step /= 2
    return least


def _collapse_once(mesh: Parts, target: int, quality: float) -> Parts | None:
    """Return a mesh of as few triangles as `target`, or more, of which none cross; None if none was found."""
    vertices, triangles, _ = mesh
    share, locked = target / len(triangles), np.zeros(len(triangles), dtype=bool)
    for number in range(MAX_ROUNDS):
        kept = int(locked.sum())
        # What others keep is not made up for beyond what was asked of each.
        fewer = collapse_edges(mesh, kept + int(share * (len(triangles) - kept)), quality, locked)
        crossing = _crossing(fewer)
        if not crossing.any():
            return fewer
        for _ in range(number):
            crossing = _wider(fewer, crossing)
        # What lies nearest to them is what they were made of.
        locked |= crossing[nearest_triangles(*fewer[:2], vertices[triangles].mean(axis=1))]
        if number == 0:
            locked = _wider(mesh, locked)
    return None


def _crossing(mesh: Parts) -> BoolArray:
    """Return the (m,) triangles that cross others."""
    return find_crossings(mesh[0], mesh[1])


def _wider(mesh: Parts, chosen: BoolArray) -> BoolArray:
    """Return the triangles that share a vertex with chosen ones, and these."""
    touched = np.zeros(len(mesh[0]), dtype=bool)
    touched[mesh[1][chosen]] = True
    return np.asarray(touched[mesh[1]].any(axis=1))
