"""Selection before export: one part of a mesh, another origin."""

from dataclasses import replace

import numpy.typing as npt

from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh, drop_unused_vertices, mesh_arrays
from o3dleaf.io.labelled_mesh import LabelledMesh


def part_of(mesh: LabelledMesh, name: str) -> LabelledMesh:
    """Return the triangles of one label, and their vertices.

    Raises
    ------
    InputError
        If the mesh has no labels, or none of that name.
    """
    if mesh.labels is None:
        raise InputError("part: the mesh has no labels; give one that o3dleaf wrote as PLY, OBJ or STL")
    number = mesh.names.index(require_choice(name, mesh.names, "part"))
    vertices, triangles = mesh_arrays(mesh.mesh)
    kept = mesh.labels == number
    if not kept.any():
        raise InputError(f"part: no triangle has the label {name}; choose another part")
    return replace(mesh, mesh=build_mesh(*drop_unused_vertices(vertices, triangles[kept])), labels=mesh.labels[kept])


def moved(mesh: LabelledMesh, origin: npt.ArrayLike) -> LabelledMesh:
    """Return the mesh with the point `origin` at 0 0 0."""
    vertices, triangles = mesh_arrays(mesh.mesh)
    return replace(mesh, mesh=build_mesh(vertices - as_points(origin, "origin", dim=3), triangles))
