"""Remeshing of all but what came to cross: that stays as it was, wider each time, until none cross."""

from collections.abc import Callable

import numpy as np

from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.deviation import nearest_triangles
from o3dleaf.surface.remeshing.blocks import Charted

MAX_ROUNDS = 8
"""Times that more stays around triangles that cross, wider each time."""

Remesher = Callable[[Charted], Charted]
"""Takes a mesh whose border stays bit for bit."""


def remesh_apart(mesh: Charted, remeshed: Charted, again: Remesher) -> Charted:
    """Return a mesh that is remeshed where none of its triangles come to cross others, and stays as it was elsewhere.

    Where two sheets lie closer together than the edges are long, as at a tapered rim or on both sides of a slit, no
    triangles of that length tell them apart; those that the mesh came with do. If triangles still cross in the end it
    is the mesh with the fewest of them; those that cross as they came do not count.

    Parameters
    ----------
    mesh : Charted
    remeshed : Charted
        What remeshing made of all of it.
    again : callable
        Remeshes a part of it.
    """
    unavoidable = int(crossing_of(mesh).sum())
    stays, best = np.zeros(len(mesh.triangles), dtype=bool), (len(remeshed.triangles) + 1, remeshed)
    for number in range(MAX_ROUNDS):
        crossing = crossing_of(remeshed)
        best = min(best, (int(crossing.sum()), remeshed), key=lambda found: found[0])
        if best[0] <= unavoidable:
            break
        for _ in range(number):
            crossing = wider(remeshed, crossing)
        # What lies nearest to them is what they were made of.
        middles = mesh.places[mesh.triangles].mean(axis=1)
        stays |= crossing[nearest_triangles(remeshed.places, remeshed.triangles, middles)]
        stays = wider(mesh, stays) if number == 0 else stays
        remeshed = _remesh_rest(mesh, stays, again)
    return best[1]


def crossing_of(mesh: Charted) -> BoolArray:
    """Return the (m,) triangles that cross others."""
    return find_crossings(mesh.places, mesh.triangles)


def wider(mesh: Charted, chosen: BoolArray) -> BoolArray:
    """Return the triangles that share a vertex with chosen ones, and these."""
    touched = np.zeros(len(mesh.places), dtype=bool)
    touched[mesh.triangles[chosen]] = True
    return np.asarray(touched[mesh.triangles].any(axis=1))


def _remesh_rest(mesh: Charted, stays: BoolArray, again: Remesher) -> Charted:
    """Return a mesh remeshed but for triangles that stay, joined to them along the border that they share."""
    if stays.all():
        return mesh
    kept, rest = _part(mesh, stays), again(_part(mesh, ~stays))
    return _joined(kept, rest)


def _part(mesh: Charted, chosen: BoolArray) -> Charted:
    """Return the chosen triangles (m,) of a mesh."""
    used, corners = np.unique(mesh.triangles[chosen], return_inverse=True)
    return Charted(
        mesh.places[used], mesh.charts[used], corners.reshape(-1, 3), mesh.labels[chosen], mesh.on_surface[used]
    )


def _joined(one: Charted, other: Charted) -> Charted:
    """Return two meshes as one, vertices on a border of both being those of the same place and chart."""
    keys = [np.hstack([each.places, each.charts]).view(np.dtype((np.void, 48))).ravel() for each in (one, other)]
    numbers = [dict(zip(key.tolist(), range(len(key)), strict=True)) for key in keys]
    name: IntArray = np.array([numbers[0].get(key, -1) for key in keys[1].tolist()], dtype=np.int64)
    fresh = name < 0
    name[fresh] = len(one.places) + np.arange(fresh.sum())
    places, charts, on_surface = (
        np.concatenate([first, second[fresh]])
        for first, second in (
            (one.places, other.places),
            (one.charts, other.charts),
            (one.on_surface, other.on_surface),
        )
    )
    triangles = np.concatenate([one.triangles, name[other.triangles]])
    return Charted(places, charts, triangles, np.concatenate([one.labels, other.labels]), on_surface)
