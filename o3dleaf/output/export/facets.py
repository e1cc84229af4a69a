"""The triangles of a leaf as facets, for models of spray retention: place, area, inclination, curvature, side."""

from dataclasses import dataclass, replace
from os import PathLike
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.atomic_files import claim, require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_direction, as_place
from o3dleaf.core.parallel import blocks
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.io.labelled_mesh import AnyMesh
from o3dleaf.io.mesh_data import MeshData, face_vectors, unit_rows
from o3dleaf.io.vtk import write_vtp
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.export.consumers import vertex_normals

SUFFIXES = (".csv", ".vtp")
COLUMNS = ("x", "y", "z", "area", "nx", "ny", "nz", "inclination", "curvature", "side")
"""Of the CSV file, in this order."""
UNKNOWN = "unknown"
"""The side of facets without labels."""
ROWS, ROW = 1 << 14, 200
"""Rows that are written together; bytes of one, at most."""


@checked
@dataclass(frozen=True, eq=False, repr=False)
class Facets:
    """The triangles of a surface, each with what a droplet that meets it has to know.

    Attributes
    ----------
    mesh : MeshData
        The surface, with its labels and its unit.
    centroids, normals : (m, 3) ndarrays
        Middles in the mesh's unit, and outward unit normals; (0, 0, 1) of a triangle without area.
    areas : (m,) ndarray
    inclinations : (m,) ndarray
        Angle in degrees between the normal and the vertical: 0 faces up, 90 stands upright, 180 faces down.
    curvatures : (m,) ndarray
        Mean curvature in 1/unit, positive where the leaf bulges.
    vertical : (3,) ndarray
        What inclinations are measured to.
    """

    mesh: MeshData
    centroids: FloatArray
    normals: FloatArray
    areas: FloatArray
    inclinations: FloatArray
    curvatures: FloatArray
    vertical: FloatArray

    def __repr__(self) -> str:
        unit = "" if self.mesh.unit is None else f", unit {self.mesh.unit}"
        return f"Facets({len(self.areas):,}{unit})"

    def moved(self, origin: npt.ArrayLike) -> "Facets":
        """Return the facets with the point `origin` at 0 0 0."""
        shift = as_place(origin, "origin")
        mesh = replace(self.mesh, vertices=self.mesh.vertices - shift)
        return replace(self, mesh=mesh, centroids=self.centroids - shift)

    @property
    def sides(self) -> npt.NDArray[np.str_]:
        """(m,) adaxial, abaxial, rim, or what the mesh calls its labels; unknown where it has none."""
        if self.mesh.labels is None:
            return np.full(len(self.areas), UNKNOWN)
        return np.array(self.mesh.names)[self.mesh.labels]


@checked
def facets_of(
    mesh: AnyMesh,
    *,
    field: MultiscaleLeaf | None = None,
    vertical: npt.ArrayLike = (0.0, 0.0, 1.0),
    labels: npt.ArrayLike | None = None,
    unit: Unit | None = None,
) -> Facets:
    r"""Return the triangles of a mesh as facets.

    The curvature is that of the leaf's field at the centroid, ½ ∇·(−∇G/\|∇G\|); of a mesh alone that of the normals n
    at a triangle's corners, between which they are linear (Rusinkiewicz, 2004):

    .. math:: κ = \tfrac{1}{2} \sum_{i=1}^3 ∇φ_i · n_i

    with φ the barycentric coordinates; it is exact on a sphere. At the edge of a rim it says how sharp the mesh is
    there, and no more.

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
    field : MultiscaleLeaf, optional
        The leaf that the mesh is of.
    vertical : (3,) array_like
        Direction that inclinations are measured to: the world's z, unless the leaf's own or another is given.
    labels : (m,) array_like of int, optional
        Of the triangles; by default those that the mesh brings.
    unit : str, optional
        Unit of the mesh.

    Raises
    ------
    InputError
        If the vertical has no length.
    """
    surface, axis = MeshData.of(mesh, labels, unit), as_direction(vertical, "vertical")
    corners = surface.vertices[surface.triangles]
    vectors, centroids = face_vectors(corners), corners.mean(axis=1)
    normals = unit_rows(vectors)
    across = np.linalg.norm(np.cross(normals, axis), axis=1)
    inclinations = np.degrees(np.arctan2(across, normals @ axis))
    curvatures = _normal_divergence(surface, corners, vectors) if field is None else field.mean_curvature(centroids)
    areas = np.linalg.norm(vectors, axis=1) / 2
    return Facets(surface, centroids, normals, areas, inclinations, curvatures, axis)


def _normal_divergence(mesh: MeshData, corners: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return half the divergence (m,) of the corners' normals, linear in each triangle; 0 where it has no area."""
    normals = vertex_normals(mesh.vertices, mesh.triangles)[mesh.triangles]
    squared = np.einsum("ij,ij->i", vectors, vectors)
    total = np.zeros(len(corners))
    for i in range(3):
        # The gradient of a corner's coordinate: the normal turned across the opposite edge.
        opposite = corners[:, i - 1] - corners[:, i - 2]
        total += np.einsum("ij,ij->i", np.cross(vectors, opposite), normals[:, i])
    return np.asarray(total / np.where(squared > 0, squared, np.inf) / 2)


@checked
def export_facets(facets: Facets, path: str | PathLike[str], *, to_unit: Unit | None = None) -> None:
    """Write facets as CSV, one a row, or as VTP, the mesh with values of its cells; whole or not at all.

    Columns of CSV: x, y, z of the centroid, area, nx, ny, nz, inclination in degrees, curvature, and the side as a
    word, after a line that states unit and vertical. VTP has the same as cell data, and the side as `label`.

    Parameters
    ----------
    facets : Facets
    path : path-like
    to_unit : str, optional
        Unit of the file; that of the mesh by default.

    Raises
    ------
    InputError
        If the suffix is unknown or the folder cannot be written to.
    UnitError
        If lengths must be converted and the mesh's unit is not known.
    """
    target = require_writable(path, SUFFIXES)
    unit = facets.mesh.unit if to_unit is None else check_unit(to_unit)
    scale = unit_scale(facets.mesh.unit, unit)
    x, y, z = " ".join(f"{each:.6g}" for each in facets.vertical).split()
    note = f"o3dleaf facets, unit {unit or 'not stated'}, inclination in degrees to {x} {y} {z}"
    with whole_file(target) as temporary, temporary.open("r+b") as out:
        if target.suffix.lower() == ".csv":
            _write_csv(out, facets, scale, note)
            return
        cells = {
            "area": facets.areas * scale**2,
            "Normals": facets.normals,
            "inclination": facets.inclinations,
            "curvature": facets.curvatures / scale,
        }
        write_vtp(out, facets.mesh.in_unit(unit), note, cells)


def _write_csv(out: IO[bytes], facets: Facets, scale: float, note: str) -> None:
    """Write the rows block by block, every digit of every number."""
    claim(out, ROW * len(facets.areas))
    out.write(f"# {note}\n{','.join(COLUMNS)}\n".encode())
    sides = facets.sides
    columns: list[npt.NDArray[Any]] = [
        *(facets.centroids * scale).T,
        facets.areas * scale**2,
        *facets.normals.T,
        facets.inclinations,
        facets.curvatures / scale,
    ]
    for start, stop in blocks(len(sides), ROWS):
        rows = zip(*(column[start:stop].tolist() for column in columns), sides[start:stop].tolist(), strict=True)
        out.write("".join(f"{','.join(map(repr, row[:-1]))},{row[-1]}\n" for row in rows).encode())
