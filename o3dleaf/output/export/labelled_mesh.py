"""What every writer is given: a mesh with all that a file can say about it, in the unit of the file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks import FloatArray, as_labels, as_values
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, build_mesh, mesh_arrays
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.io.labelled_mesh import LABELS, LabelArray, LabelledMesh

AnyMesh = MeshLike | LabelledMesh
"""What can be exported: a mesh, with labels or without."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Arrays of a mesh: vertices (n, 3), triangles (m, 3), labels (m,), normals (n, 3), scalars (n,) by name."""

    vertices: FloatArray
    triangles: IntArray
    labels: LabelArray | None
    names: tuple[str, ...]
    unit: str | None
    scalars: Mapping[str, FloatArray]
    normals: FloatArray | None = None

    @classmethod
    def of(
        cls,
        mesh: AnyMesh,
        labels: npt.ArrayLike | None = None,
        unit: str | None = None,
        scalars: Mapping[str, npt.ArrayLike] | None = None,
    ) -> "Surface":
        """Return the arrays of a mesh; labels and unit that it brings itself are used unless others are given.

        Raises
        ------
        InputError
            If it has no triangles, or labels or scalars do not fit it.
        """
        bare = mesh.mesh if isinstance(mesh, LabelledMesh) else mesh
        held: Any = mesh.labels if labels is None and isinstance(mesh, LabelledMesh) else labels
        vertices, triangles = mesh_arrays(bare)
        if not len(triangles):
            raise InputError("mesh: has no triangles; there is nothing to export")
        names = mesh.names if isinstance(mesh, LabelledMesh) else LABELS
        known = mesh.unit if unit is None and isinstance(mesh, LabelledMesh) else check_unit(unit)
        found = None if held is None else as_labels(held, len(triangles), len(names))
        values = {name: as_values(each, len(vertices), name) for name, each in (scalars or {}).items()}
        return cls(vertices, triangles, found, names, known, values)

    def in_unit(self, unit: str | None) -> "Surface":
        """Return the surface in another unit of length (None: in its own); scalars stay as they are."""
        if unit is None or unit == self.unit:
            return self
        return replace(self, vertices=self.vertices * unit_scale(self.unit, unit), unit=check_unit(unit))

    def with_normals(self) -> "Surface":
        """Return the surface with outward unit normals at its vertices: the mean of their triangles', by area."""
        return replace(self, normals=vertex_normals(self.vertices, self.triangles))

    def parts(self, whole: str) -> list[tuple[str, IntArray]]:
        """Return the triangles of each label that occurs, by name; without labels all of them, called `whole`."""
        if self.labels is None:
            return [(whole, self.triangles)]
        found = [(name, self.triangles[self.labels == number]) for number, name in enumerate(self.names)]
        return [(name, triangles) for name, triangles in found if len(triangles)]

    @property
    def mesh(self) -> o3d.geometry.TriangleMesh:
        """The mesh for Open3D."""
        return build_mesh(self.vertices, self.triangles)


def face_vectors(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m, 3) outward normals of triangles, as long as twice their areas."""
    first, second, third = (vertices[triangles[:, corner]] for corner in range(3))
    return np.asarray(np.cross(second - first, third - first))


def unit_rows(vectors: FloatArray) -> FloatArray:
    """Return rows of length 1; (0, 0, 1) for those that have no direction, as file formats want one."""
    # Squares of the smallest sides in metres would underflow: scale before a row is given up.
    largest = np.abs(vectors).max(axis=1, initial=0.0, keepdims=True)
    scaled = vectors / np.where(largest > 0, largest, 1.0)
    size = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.where(size > 0, scaled / np.where(size > 0, size, 1.0), [0.0, 0.0, 1.0])


def vertex_normals(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of vertices: the sum of their triangles' vectors, made one long."""
    vectors = face_vectors(vertices, triangles)
    sums = np.empty_like(vertices)
    for axis in range(3):
        weights = np.repeat(vectors[:, axis], 3)
        sums[:, axis] = np.bincount(triangles.ravel(), weights=weights, minlength=len(vertices))
    return unit_rows(sums)


def enclosed_volume(vertices: FloatArray, triangles: IntArray) -> float:
    """Return the volume inside a closed mesh, negative where its faces look inwards: tetrahedra to its middle."""
    corners = (vertices - vertices.mean(axis=0))[triangles]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)
