"""Formats and units of other programs, and the one function that writes for them all."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_values
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError, UnitError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.units import check_unit
from o3dleaf.io.glb import write_glb
from o3dleaf.io.labelled_mesh import AnyMesh
from o3dleaf.io.mesh_data import MeshData, face_vectors, unit_comment, unit_rows
from o3dleaf.io.obj import write_obj
from o3dleaf.io.ply import write_ply
from o3dleaf.io.stl import write_stl
from o3dleaf.io.stl_text import write_stl_text
from o3dleaf.io.vtk import write_vtp
from o3dleaf.surface.mesh.topology import EdgeTable

SUFFIXES = (".stl", ".ply", ".obj", ".glb", ".vtp")
"""What a mesh can be exported as."""


@dataclass(frozen=True)
class Consumer:
    """Requirements of a program on its input.

    Attributes
    ----------
    suffixes : tuple of str
    unit : str, optional
        None: any.
    solids : bool
        STL as text with named solids.
    closed : bool
        Closed surfaces only.
    single : bool
        STL is read in single precision: corners that fall together there make illegal triangles.
    solver : bool
        Solves equations around or in the mesh, or meshes the space for one: of a model it gets a remeshed mesh.
    """

    suffixes: tuple[str, ...]
    unit: str | None = None
    solids: bool = False
    closed: bool = False
    single: bool = False
    solver: bool = False


CONSUMERS = {
    "openfoam": Consumer((".obj", ".stl"), unit="m", solids=True, single=True, solver=True),
    "dualsphysics": Consumer((".stl",), unit="m", closed=True, single=True, solver=True),
    "paraview": Consumer((".vtp", ".ply", ".stl", ".obj")),
    "web": Consumer((".glb",), unit="m"),
    "blender": Consumer((".glb", ".ply", ".obj", ".stl"), unit="m"),
    "gmsh": Consumer((".stl",), solids=True, closed=True, solver=True),
}
"""The programs that are known by name; docs/consumers has a page on each."""
OTHERS = {"sph": (".csv", ".vtp", ".ply", ".bgeo"), "retention": (".csv", ".vtp"), "evolver": (".fe",)}
"""What takes something else than a mesh, and the suffixes of that: `boundary`, `facets`, a static drop."""
FOLDERS = ("droplet",)
"""What is no file but a folder: a case of a droplet, `o3dleaf.output.droplet`."""
PROGRAMS = (*CONSUMERS, *OTHERS, *FOLDERS)
"""All that the command line knows by name."""
NO_UNIT = "no stated unit"
RESERVED = frozenset(("x", "y", "z", "nx", "ny", "nz", "normals", "colors"))
"""What scalars cannot be called."""


@checked
def export_mesh(
    mesh: AnyMesh,
    path: str | PathLike[str],
    *,
    labels: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    to_unit: Unit | None = None,
    consumer: str | None = None,
    scalars: Mapping[str, npt.ArrayLike] | None = None,
) -> None:
    """Write a mesh for another program, by the suffix of the file's name; the file appears whole or not at all.

    ======  =============================================================================================
    suffix  what is written
    ======  =============================================================================================
    .stl    for openfoam and gmsh ASCII, one named solid a label, 17 digits; else binary, float32
    .ply    binary, float64: normals, scalars, labels of the faces; unit and names of labels as comments
    .obj    text, every digit of float64: normals, one group a label; the unit as a comment
    .glb    glTF 2.0, float32 around the middle of the mesh: meters and y up, as the format wants
    .vtp    VTK PolyData, float64: normals, scalars, labels; the unit as a comment
    ======  =============================================================================================

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Not modified.
    path : path-like
    labels : (m,) array_like of int, optional
        Of each triangle: 0 adaxial, 1 abaxial, 2 rim; by default those that the mesh brings.
    unit : str, optional
        Unit of length of the mesh.
    to_unit : str, optional
        Unit of the file: converted to it. By default the consumer's (meters for openfoam, dualsphysics, web and
        blender, and for .glb always), or the mesh's own.
    consumer : {"openfoam", "dualsphysics", "paraview", "web", "blender", "gmsh"}, optional
        The program that the file is for.
    scalars : dict of str to (n,) array_like, optional
        Values at the vertices, kept by .ply and .vtp.

    Raises
    ------
    InputError
        If the suffix is not one that the consumer takes, the folder cannot be written to, a mesh must be closed and is
        not, or triangles collapse in the single precision in which the consumer reads STL.
    UnitError
        If lengths must be converted and the mesh's unit is not known.
    """
    wanted = Consumer(SUFFIXES) if consumer is None else CONSUMERS[require_choice(consumer, CONSUMERS, "consumer")]
    target = require_writable(path, wanted.suffixes)
    suffix = target.suffix.lower()
    goal = check_unit(to_unit) or wanted.unit or ("m" if suffix == ".glb" else None)
    if suffix == ".glb" and goal != "m":
        raise UnitError(f"{target}: glTF is in meters by its definition; leave to_unit out")
    given = MeshData.of(mesh, labels, unit)
    values = _as_scalars(scalars or {}, given.vertex_count)
    if goal is not None and given.unit is None:
        raise UnitError(f"{target}: is to be in {goal}, but the unit of the mesh is not known; name it (unit='mm')")
    if wanted.closed:
        _require_closed(given, target)
    ready = given.in_unit(goal)
    if wanted.single and suffix == ".stl":
        _require_single(ready, target)
    with whole_file(target) as temporary, temporary.open("r+b") as out:
        if suffix == ".stl":
            _write_stl(out, ready, target.stem, solids=wanted.solids)
        else:
            normals = vertex_normals(ready.vertices, ready.triangles)
            _write(out, replace(ready, attributes={"normals": normals, **values}), target)


def _as_scalars(scalars: Mapping[str, npt.ArrayLike], count: int) -> dict[str, FloatArray]:
    """Return scalars as (count,) arrays, or raise `InputError` where one is called as a column of the file's own."""
    taken = sorted(RESERVED & scalars.keys())
    if taken:
        raise InputError(f"scalars: {', '.join(taken)} would be a second column of that name; choose another name")
    return {name: as_values(each, count, name) for name, each in scalars.items()}


def _write_stl(out: IO[bytes], mesh: MeshData, name: str, *, solids: bool) -> None:
    """Write STL: as text with named solids, or binary."""
    if solids:
        write_stl_text(out, mesh, name)
    else:
        write_stl(out, mesh, f"o3dleaf {name}, lengths in {mesh.unit or NO_UNIT}".encode("ascii", "replace"))


def _write(out: IO[bytes], mesh: MeshData, target: Path) -> None:
    """Write any other file by its suffix; what it is called and its unit stand in it."""
    name, suffix = target.stem, target.suffix.lower()
    if suffix == ".ply":
        write_ply(out, mesh, (f"o3dleaf {name}", *unit_comment(mesh.unit)))
    elif suffix == ".obj":
        write_obj(out, mesh, (f"o3dleaf {name}, lengths in {mesh.unit or NO_UNIT}",), group=name)
    elif suffix == ".glb":
        write_glb(out, mesh, name)
    else:
        write_vtp(out, mesh, name)


def _require_closed(mesh: MeshData, target: Path) -> None:
    """Raise `InputError` unless every edge has two triangles, run along once each way, around a positive volume."""
    edges = EdgeTable.of(mesh.triangles)
    wrong = int((edges.count != 2).sum()) + int(edges.inconsistent.sum())
    if wrong:
        raise InputError(
            f"{target}: needs a closed mesh, and {wrong:,} edges of this one are open, non-manifold or inconsistent; "
            "mesh the leaf with closed=True, or clean the mesh"
        )
    if enclosed_volume(mesh.vertices, mesh.triangles) <= 0:
        raise InputError(f"{target}: needs triangles whose normals point outward, and these point inward; flip them")


def _require_single(mesh: MeshData, target: Path) -> None:
    """Raise `InputError` if corners of a triangle fall together in single precision."""
    corners = mesh.vertices.astype(np.float32)[mesh.triangles]
    lost = int((corners == np.roll(corners, 1, axis=1)).all(axis=2).any(axis=1).sum())
    if lost:
        raise InputError(
            f"{target}: {lost:,} triangles collapse in single precision, in which STL is read; write .obj where the "
            "program takes it, clean or remesh the mesh, or move the origin to it"
        )


def vertex_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 3) outward unit normals at vertices: the mean of their triangles', by area."""
    vectors = face_vectors(vertices[triangles])
    sums = np.empty_like(vertices)
    for axis in range(3):
        weights = np.repeat(vectors[:, axis], 3)
        sums[:, axis] = np.bincount(triangles.ravel(), weights=weights, minlength=len(vertices))
    return unit_rows(sums)


def enclosed_volume(vertices: FloatArray, triangles: IntArray) -> float:
    """Return the volume inside a closed mesh, negative where its faces look inwards: tetrahedra to its middle."""
    corners = (vertices - vertices.mean(axis=0))[triangles]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)
