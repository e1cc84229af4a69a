"""Remeshing: any manifold mesh into triangles that a solver accepts, every vertex on the surface."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_answers
from o3dleaf.core.checks.scalars import as_number, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, build_mesh, require_triangles, triangle_areas
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import in_words, require_resources
from o3dleaf.io.labelled_mesh import LabelledMesh, with_or_without_labels
from o3dleaf.surface.mesh.topology import EdgeTable, fans_per_vertex, label_fans
from o3dleaf.surface.remeshing.apart import crossing_of, remesh_apart, wider
from o3dleaf.surface.remeshing.blocks import Charted, Task, edit_in_blocks, edit_part
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.projection_target import FieldTarget, MeshTarget, ProjectionTarget
from o3dleaf.surface.remeshing.submesh import NOT_MANIFOLD, Submesh

SWEEPS = ((0.5, 5), (0.38, 2), (0.62, 1))
"""Cuts of blocks, as a share of their triangles, and rounds of edits; borders of one are within others."""
SHORTEST, LONGEST = 0.7, 1.33
"""Edges shorter than these, of the target, are collapsed, and longer ones split (Botsch & Kobbelt 2004: 4/5, 4/3)."""
DEVIATION = 0.1
"""The deviation that an edit may make by default, of the target edge."""
MIN_GROWTH = 1.1
"""Times as many triangles as before that splitting has to bring to go on."""
LAST_ROUNDS = 2
"""Times that what is left is improved, beyond the sweeps."""
SLIVER = 0.1
"""Sine of the angle below which a triangle is improved then."""
FLOOR = 1e-4
"""Least score of what vertices leave behind that come to the surface then."""
UNTANGLING_ROUNDS = 8
"""Times that the neighborhood of crossing triangles is smoothed, wider each time."""
COARSENING = 1.1
"""By how much longer its edges become, each time."""


@with_or_without_labels
@checked
def remesh(
    mesh: LabelledMesh,
    target_edge: Positive,
    field: Field | None = None,
    *,
    isovalue: Finite = 0.0,
    deviation: Positive | None = None,
) -> LabelledMesh:
    r"""Return a mesh of nearly equilateral triangles, every vertex of it on the surface.

    Rounds of splitting, collapsing, swapping edges and moving vertices (Botsch & Kobbelt 2004, A remeshing
    approach to multiresolution modeling), then edits that make the worst triangles better, one by one. With
    a field, vertices that move are put back onto it by Newton's method, x ← x − (F − isovalue) ∇F/\|∇F\|²;
    without one, onto the nearest point of the mesh as it was. Each edit takes the surface no further than
    `deviation`, all of them a few times as far; sharp edges without labels are rounded. The border stays bit for
    bit, and no edit changes the topology. Where triangles cross whatever is done, as where two sheets lie much
    closer together than the edges are long, those of the mesh as it was stay. The same input gives the same mesh,
    whatever the number of threads.

    Parameters
    ----------
    mesh : LabelledMesh, open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Manifold, its triangles turned alike; not modified. Labels are whole numbers from 0 to 7; the edges between
        two of them are creases: they keep their course.
    target_edge : float
        Edge length to reach, in the mesh's unit; where the surface is finer than that, edges are shorter.
    field : Field, optional
        In the mesh's unit; the mesh lies near its surface. What its bounds cut is flat there, and stays so.
    isovalue : float
        The field is larger than this inside.
    deviation : float, optional
        In the mesh's unit; a tenth of the edge by default.

    Returns
    -------
    LabelledMesh if one was given, else open3d.geometry.TriangleMesh

    Raises
    ------
    InputError
        If a length is not above zero, the labels do not fit, or the mesh has no triangle or is not manifold.
    MemoryBudgetError
        If the edges are so short that the mesh does not fit into memory.
    """
    vertices, triangles = require_triangles(mesh.mesh)
    edge = require_positive(target_edge, "target_edge")
    far = None if deviation is None else require_positive(deviation, "deviation")
    level = as_number(isovalue, "isovalue")
    require_room(vertices, triangles, edge)
    edges = EdgeTable.of(triangles)
    fans = fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices))
    if edges.inconsistent.any() or edges.count.max() > 2 or fans.max() > 1:
        raise InputError(NOT_MANIFOLD)
    target: ProjectionTarget = (
        MeshTarget(vertices, triangles)
        if field is None
        else FieldTarget(
            lambda points: (as_answers(field(points), len(points)) - level, field.gradient(points)),
            edge / 2,
            field.bounds,
        )
    )
    charted = Charted.of(vertices, vertices, triangles, _as_labels(mesh.labels, len(triangles)))
    remeshed = remesh_charted(charted, target, edge, far)
    labels = None if mesh.labels is None else remeshed.labels
    return replace(mesh, mesh=build_mesh(remeshed.places, remeshed.triangles), labels=labels)


def require_room(vertices: FloatArray, triangles: IntArray, edge: float) -> None:
    """Raise `MemoryBudgetError` if a mesh, remeshed to a length of edges, does not fit into memory.

    It is as many equilateral triangles as its area has room for, or those that it has.
    """
    with np.errstate(over="ignore", divide="ignore"):
        count = float(triangle_areas(vertices, triangles).sum() / (3**0.5 / 4) / edge / edge)
    what = f"target_edge: about {in_words(count)} triangles"
    require_resources(measured.REMESHED_TRIANGLE * count, what, "give a longer one", step=edge)
    held = measured.REMESHED_TRIANGLE * len(triangles)
    require_resources(held, f"mesh: {len(triangles):,} triangles", "simplify it first")


def remesh_charted(
    mesh: Charted, target: ProjectionTarget, target_edge: float, deviation: float | None = None
) -> Charted:
    """Return a mesh remeshed on its surface: see `remesh`. Where triangles then cross, the mesh is made coarser there.

    What crosses all the same stays as it was: see `remesh_apart`.

    Raises
    ------
    InputError
        If the mesh is not manifold, or its triangles are not turned alike.
    """
    limits = Limits(
        SHORTEST * target_edge, LONGEST * target_edge, DEVIATION * target_edge if deviation is None else deviation
    )
    improved = _improve(mesh, target, limits)
    untangled, crossing = _untangle(improved, target, limits)
    if not crossing.any():
        return untangled
    with progress.silent():
        apart = remesh_apart(mesh, improved, lambda part: _improve(part, target, limits))
    return apart if crossing_of(apart).sum() < crossing.sum() else untangled


def _improve(mesh: Charted, target: ProjectionTarget, limits: Limits) -> Charted:
    """Return a mesh remeshed in all sweeps, whether triangles cross or not."""
    with progress.silent():
        mesh = _refine(mesh, target, limits)
    for part, (share, rounds) in zip(progress.split(*(1,) * len(SWEEPS)), SWEEPS, strict=True):
        with part:
            mesh = edit_in_blocks(mesh, _improving(target, limits, rounds), share)
    return _finish(mesh, target, limits)


def _refine(mesh: Charted, target: ProjectionTarget, limits: Limits) -> Charted:
    """Split a mesh that is much too coarse, block by block, as a block has room for so many triangles only."""
    wanted = triangle_areas(mesh.places, mesh.triangles).sum() / (np.sqrt(3) / 4 * limits.longest**2)
    while wanted > len(mesh.triangles):
        finer = edit_in_blocks(mesh, _improving(target, limits, 1), SWEEPS[0][0])
        if len(finer.triangles) < MIN_GROWTH * len(mesh.triangles):
            break
        mesh = finer
    return mesh


def _finish(mesh: Charted, target: ProjectionTarget, limits: Limits) -> Charted:
    """Improve once more around slivers and vertices off the surface, which were on borders of blocks in every sweep."""
    for _ in range(LAST_ROUNDS):
        near = ~mesh.on_surface[mesh.triangles].all(axis=1) | (_smallest_sines(mesh) < SLIVER)
        if not near.any():
            break
        mesh = edit_part(mesh, wider(mesh, wider(mesh, near)), _improving(target, limits._replace(floor=FLOOR), 1))
    return mesh


def _smallest_sines(mesh: Charted) -> FloatArray:
    """Return the sine of the smallest angle of each triangle: twice the area over the two longer sides."""
    corners = [mesh.places[mesh.triangles[:, k]] for k in range(3)]
    sides = np.sort([np.linalg.norm(corners[k] - corners[k - 1], axis=1) for k in range(3)], axis=0)
    return np.asarray(2 * triangle_areas(mesh.places, mesh.triangles) / np.maximum(sides[1] * sides[2], 1e-300))


def _improving(target: ProjectionTarget, limits: Limits, rounds: int, smooth: int = 0) -> Task:
    """Return the task of a block: rounds of smoothing without regard, then of improving."""

    def task(block: Charted, locked: BoolArray) -> Charted:
        submesh = Submesh(block, locked)
        submesh.smooth(target, limits, smooth)
        submesh.improve(target, limits, rounds)
        return submesh.result()

    return task


def _untangle(mesh: Charted, target: ProjectionTarget, limits: Limits) -> tuple[Charted, BoolArray]:
    """Smooth the mesh around triangles that cross, and make it coarser, until none do or all rounds have passed.

    Return it and which of its triangles (m,) cross.
    """
    crossing = crossing_of(mesh)
    for number in range(1, UNTANGLING_ROUNDS + 1):
        if not crossing.any():
            break
        near: BoolArray = crossing
        for _ in range(1 + number):
            near = wider(mesh, near)
        mesh = edit_part(mesh, near, _improving(target, limits.coarser(COARSENING**number), 3, smooth=number))
        crossing = crossing_of(mesh)
    return mesh, crossing


def _as_labels(labels: npt.ArrayLike | None, count: int) -> npt.NDArray[np.uint8]:
    """Return one label a triangle, 0 for all by default."""
    whole = np.zeros(count, dtype=np.int64) if labels is None else np.asarray(labels)
    if whole.shape != (count,) or not np.issubdtype(whole.dtype, np.integer) or whole.min() < 0 or whole.max() > 7:
        raise InputError(f"labels: give one whole number from 0 to 7 per triangle, ({count},)")
    return whole.astype(np.uint8)
