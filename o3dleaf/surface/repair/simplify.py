"""`simplify_mesh`: as few triangles as a target or a deviation allows."""

from dataclasses import replace

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, NotNegative, Positive, Share
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, require_triangles, triangle_areas
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.io.labelled_mesh import LabelledMesh, with_or_without_labels
from o3dleaf.surface.mesh.surface_distance import surface_distance_of
from o3dleaf.surface.repair.collapse import collapse_apart
from o3dleaf.surface.repair.meshlab import Parts

FIRST_STEP, LAST_STEP = float(np.log(4.0)), 0.1
"""Logarithms of numbers of triangles: the first step down, and the one at which the search for the fewest ends."""


@with_or_without_labels
@checked
def simplify_mesh(
    mesh: LabelledMesh,
    *,
    target_triangles: Count | None = None,
    target_edge: Positive | None = None,
    deviation: NotNegative | None = None,
    quality: Share = 0.3,
) -> LabelledMesh:
    """Return a mesh of fewer triangles by quadric edge collapse; border, lines between labels and topology stay.

    Garland & Heckbert 1997 (Proc. SIGGRAPH), as MeshLab does it: vertices inside move to where the
    squared distance to the planes of the triangles collapsed so far is least, vertices on the border
    stay bit for bit, and no collapse changes the genus or joins two sheets. A mesh without triangles that
    cross others gets none: where some would, more triangles are left.

    Parameters
    ----------
    mesh : LabelledMesh, open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Edge-manifold; not modified. The lines between labels are locked as its border is.
    target_triangles : int, optional
        Triangles to come down to; where border, topology, crossings or `deviation` forbid it, more are left.
    target_edge : float, optional
        The same as a mean edge length in the mesh's unit: area / (sqrt(3)/4 edge^2) triangles.
    deviation : float, optional
        How far the surfaces may be apart (`surface_distance`), in the mesh's unit. Without a target
        the mesh comes down as far as that allows, to a tenth of its triangles; some ten times the work.
    quality : float
        From 0 (any shape of triangle) to 1 (equilateral ones are preferred).

    Returns
    -------
    LabelledMesh if one was given, else open3d.geometry.TriangleMesh
        float64 vertices, without colors or normals.

    Raises
    ------
    InputError
        If there is no target and no deviation, or both targets, or one is not above zero, or the
        mesh has no triangle, or not one label a triangle.
    """
    given = require_triangles(mesh.mesh)
    count = len(given[1])
    require_resources(
        measured.SIMPLIFIED_TRIANGLE * count, f"simplify: {count:,} triangles", "coarsen the spacing of it"
    )
    labels = mesh.labels_of(count)
    fewest = _fewest_triangles(given, target_triangles, target_edge, deviation)
    names, kind = np.unique(np.zeros(len(given[1])) if labels is None else labels, return_inverse=True)
    vertices, triangles, left = _simplify((*given, kind), fewest, deviation, quality)
    return replace(mesh, mesh=build_mesh(vertices, triangles), labels=None if labels is None else names[left])


def _fewest_triangles(
    mesh: tuple[FloatArray, IntArray], target_triangles: int | None, target_edge: float | None, deviation: float | None
) -> int:
    """Return the number of triangles to come down to; 1 where only the deviation limits it."""
    if (target_triangles is not None) + (target_edge is not None) + (deviation is not None) == 0:
        raise InputError("target_triangles, target_edge, deviation: none is given; give one of them")
    if target_triangles is not None and target_edge is not None:
        raise InputError("target_triangles, target_edge: are two targets; give one")
    if deviation is not None:
        require_positive(deviation, "deviation")
    if target_edge is not None:
        edge = require_positive(target_edge, "target_edge")
        return max(4, round(float(triangle_areas(*mesh).sum()) / (3**0.5 / 4 * edge**2)))
    return int(require_positive(1 if target_triangles is None else target_triangles, "target_triangles"))


def _simplify(whole: Parts, fewest: int, deviation: float | None, quality: float) -> Parts:
    """Return a mesh of no fewer triangles than `fewest`, within the deviation."""
    count = len(whole[1])
    if fewest >= count:
        return whole
    if deviation is None:
        return collapse_apart(whole, fewest, quality)
    best, share, step = whole, 0.0, FIRST_STEP
    # Down in large steps to the first that is too far away, then up and down by ever smaller ones.
    while step > LAST_STEP:
        tried = collapse_apart(whole, max(fewest, round(count * np.exp(share - step))), quality)
        allowed = surface_distance_of(whole[:2], tried[:2]) <= deviation
        if allowed and len(tried[1]) < len(best[1]):
            best, share = tried, share - step
            if len(best[1]) <= fewest:
                break
        else:
            step /= 2
    return best
