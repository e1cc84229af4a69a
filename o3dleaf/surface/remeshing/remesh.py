"""Remeshing: any manifold mesh into triangles that a solver accepts, every vertex on the surface."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks import FloatArray, as_number, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, MeshLike, build_mesh, mesh_arrays, triangle_areas
from o3dleaf.core.parallel import Progress
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, label_fans
from o3dleaf.surface.remeshing.blocks import Charted, Work, work_in_blocks, work_on
from o3dleaf.surface.remeshing.projection_target import FieldGround, Ground, MeshGround
from o3dleaf.surface.remeshing.submesh import KNOT, Limits, Piece

SWEEPS = ((0.5, 5), (0.38, 2), (0.62, 1))
"""Where blocks are cut, as a share of their triangles, and rounds of work on each; borders of one are within others."""
SHORTEST, LONGEST = 0.7, 1.33
"""Edges shorter than these, of the target, are collapsed, and longer ones split (Botsch & Kobbelt 2004: 4/5, 4/3)."""
DEVIATION = 0.1
"""How far an edit may take the surface by default, of the target edge."""
MORE = 1.1
"""Times as many triangles as before that splitting has to bring to go on."""
LAST = 2
"""Times that what is left is worked on, beyond the sweeps."""
SLIVER = 0.1
"""Sine of the angle below which a triangle is worked on then."""
FLOOR = 1e-4
"""Least score of what vertices leave behind that come to the surface then."""
KNOTS = 8
"""Times that the neighbourhood of crossing triangles is smoothed, wider each time."""
COARSER = 1.1
"""By how much longer its edges become, each time."""


def remesh(
    mesh: MeshLike,
    target_edge: float,
    field: Field | None = None,
    *,
    isovalue: float = 0.0,
    deviation: float | None = None,
    labels: npt.ArrayLike | None = None,
    progress: Progress | None = None,
) -> o3d.geometry.TriangleMesh:
    r"""Return a mesh of nearly equilateral triangles, every vertex of it on the surface.

    Rounds of splitting, collapsing, swapping edges and moving vertices (Botsch & Kobbelt 2004, A remeshing
    approach to multiresolution modeling), then edits that make the worst triangles better, one by one. With
    a field, vertices that move are put back onto it by Newton's method, x ← x − (F − isovalue) ∇F/\|∇F\|²;
    without one, onto the nearest point of the mesh as it was. Each edit takes the surface no further than
    `deviation`, all of them a few times as far; sharp edges without labels are rounded. The border stays bit for
    bit, and no edit changes the topology. The same input gives the same
    mesh, whatever the number of threads.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Manifold, its triangles turned alike; not modified.
    target_edge : float
        Edge length to reach, in the mesh's unit; where the surface is finer than that, edges are shorter.
    field : Field, optional
        In the mesh's unit; the mesh lies near its surface.
    isovalue : float
        The field is larger than this inside.
    deviation : float, optional
        In the mesh's unit; a tenth of the edge by default.
    labels : (m,) array_like of int, optional
        Labels of triangles, from 0 to 7. The edges between two labels are creases: they keep their course.
    progress : callable, optional
        ``progress(done, total)`` in blocks.

    Raises
    ------
    InputError
        If a length is not above zero, the labels do not fit, or the mesh has no triangle or is not manifold.
    """
    vertices, triangles = mesh_arrays(mesh)
    edge = require_positive(target_edge, "target_edge")
    far = None if deviation is None else require_positive(deviation, "deviation")
    level = as_number(isovalue, "isovalue")
    if not len(triangles):
        raise InputError("mesh: has no triangles; nothing to work on")
    edges = EdgeTable.of(triangles)
    fans = fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices))
    if edges.against.any() or edges.count.max() > 2 or fans.max() > 1:
        raise InputError(KNOT)
    ground: Ground = (
        MeshGround(vertices, triangles)
        if field is None
        else FieldGround(lambda points: (field(points) - level, field.gradient(points)), edge / 2)
    )
    charted = Charted.of(vertices, vertices, triangles, _as_labels(labels, len(triangles)))
    found = remesh_charted(charted, ground, edge, far, progress)
    return build_mesh(found.places, found.triangles)


def remesh_charted(
    mesh: Charted, ground: Ground, target_edge: float, deviation: float | None = None, progress: Progress | None = None
) -> Charted:
    """Return a mesh remeshed on its ground: see `remesh`. Where triangles then cross, the mesh is made coarser there.

    Raises
    ------
    InputError
        If the mesh is not manifold, or its triangles are not turned alike.
    """
    limits = Limits(
        SHORTEST * target_edge, LONGEST * target_edge, DEVIATION * target_edge if deviation is None else deviation
    )
    mesh = _refine(mesh, ground, limits)
    for number, (share, rounds) in enumerate(SWEEPS):

        def report(done: int, total: int, number: int = number) -> None:
            if progress:
                progress(number * total + done, len(SWEEPS) * total)

        mesh = work_in_blocks(mesh, _worker(ground, limits, rounds), share, report)
    return _untangle(_finish(mesh, ground, limits), ground, limits)


def _refine(mesh: Charted, ground: Ground, limits: Limits) -> Charted:
    """Split a mesh that is much too coarse, block by block, as a block has room for so many triangles only."""
    wanted = triangle_areas(mesh.places, mesh.triangles).sum() / (np.sqrt(3) / 4 * limits.longest**2)
    while wanted > len(mesh.triangles):
        finer = work_in_blocks(mesh, _worker(ground, limits, 1), SWEEPS[0][0])
        if len(finer.triangles) < MORE * len(mesh.triangles):
            break
        mesh = finer
    return mesh


def _finish(mesh: Charted, ground: Ground, limits: Limits) -> Charted:
    """Work once more around slivers and vertices off the surface: they lay on the border of a block in every sweep."""
    for _ in range(LAST):
        near = ~mesh.grounded[mesh.triangles].all(axis=1) | (_smallest_sines(mesh) < SLIVER)
        if not near.any():
            break
        mesh = work_on(mesh, _wider(mesh, _wider(mesh, near)), _worker(ground, replace(limits, floor=FLOOR), 1))
    return mesh


def _smallest_sines(mesh: Charted) -> FloatArray:
    """Return the sine of the smallest angle of each triangle: twice the area over the two longer sides."""
    corners = [mesh.places[mesh.triangles[:, k]] for k in range(3)]
    sides = np.sort([np.linalg.norm(corners[k] - corners[k - 1], axis=1) for k in range(3)], axis=0)
    return np.asarray(2 * triangle_areas(mesh.places, mesh.triangles) / np.maximum(sides[1] * sides[2], 1e-300))


def _wider(mesh: Charted, chosen: BoolArray) -> BoolArray:
    """Return the triangles that share a vertex with chosen ones, and these."""
    touched = np.zeros(len(mesh.places), dtype=bool)
    touched[mesh.triangles[chosen]] = True
    return np.asarray(touched[mesh.triangles].any(axis=1))


def _worker(ground: Ground, limits: Limits, rounds: int, smooth: int = 0) -> Work:
    """Return the work on a block: rounds of smoothing without regard, then of improving."""

    def work(own: Charted, locked: BoolArray) -> Charted:
        piece = Piece(own, locked)
        piece.smooth(ground, limits, smooth)
        piece.improve(ground, limits, rounds)
        return piece.result()

    return work


def _untangle(mesh: Charted, ground: Ground, limits: Limits) -> Charted:
    """Smooth the mesh around triangles that cross, and make it coarser, until none do or `KNOTS` rounds have passed."""
    for number in range(1, KNOTS + 1):
        crossing = find_crossings(mesh.places, mesh.triangles)
        if not crossing.any():
            break
        near: BoolArray = crossing
        for _ in range(1 + number):
            near = _wider(mesh, near)
        mesh = work_on(mesh, near, _worker(ground, limits.coarser(COARSER**number), 3, smooth=number))
    return mesh


def _as_labels(labels: npt.ArrayLike | None, count: int) -> npt.NDArray[np.uint8]:
    """Return one label a triangle, 0 for all by default."""
    found = np.zeros(count, dtype=np.int64) if labels is None else np.asarray(labels)
    if found.shape != (count,) or not np.issubdtype(found.dtype, np.integer) or found.min() < 0 or found.max() > 7:
        raise InputError(f"labels: give one whole number from 0 to 7 a triangle, ({count},)")
    return found.astype(np.uint8)
