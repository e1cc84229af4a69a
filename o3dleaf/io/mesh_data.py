"""A mesh as its file is to hold it: arrays of vertices and triangles and of all that they carry, block by block."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.attributes import as_labels
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, mesh_arrays
from o3dleaf.core.units import check_unit, unit_scale
from o3dleaf.io.labelled_mesh import LABELS, AnyMesh, LabelArray, LabelledMesh

IndexArray = npt.NDArray[np.integer[Any]]


class MeshBlocks(Protocol):
    """A mesh that is read block by block: from memory, or from the file that it was streamed to."""

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        ...

    @property
    def triangle_count(self) -> int:
        """Number of triangles."""
        ...

    @property
    def label_names(self) -> tuple[str, ...]:
        """Names of the labels; none where triangles have none."""
        ...

    @property
    def normals(self) -> FloatArray | None:
        """Normals (n, 3) of the vertices, if there are any."""
        ...

    def vertex_block(self, start: int, stop: int) -> FloatArray:
        """Return the positions of the vertices from start to stop."""
        ...

    def triangle_block(self, start: int, stop: int) -> tuple[IndexArray, LabelArray | None]:
        """Return the triangles from start to stop, and their labels, if they have any."""
        ...

    def corners(self, triangles: IndexArray) -> FloatArray:
        """Return the (m, 3, 3) positions of the corners of triangles that are near one another in the file."""
        ...


@dataclass(frozen=True, eq=False)
class MeshData:
    """The arrays of a mesh in memory.

    Attributes
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
    labels : (m,) ndarray of uint8, or None
    names : tuple of str
        Of the labels.
    unit : str, optional
    attributes : mapping of str to (n,) or (n, c) ndarray
        What else vertices carry, by Open3D's names: "normals", "colors", and any other.
    """

    vertices: FloatArray
    triangles: IntArray
    labels: LabelArray | None = None
    names: tuple[str, ...] = LABELS
    unit: str | None = None
    attributes: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, mesh: AnyMesh, labels: npt.ArrayLike | None = None, unit: str | None = None) -> "MeshData":
        """Return the arrays of a mesh; labels and unit that it brings itself are used unless others are given.

        Raises
        ------
        InputError
            If it has no triangles, or labels do not fit it.
        """
        bare, names = (mesh.mesh, mesh.names) if isinstance(mesh, LabelledMesh) else (mesh, LABELS)
        if isinstance(mesh, LabelledMesh):
            labels = mesh.labels if labels is None else labels
            unit = mesh.unit if unit is None else unit
        vertices, triangles = mesh_arrays(bare)
        if not len(triangles):
            raise InputError("mesh: has no triangles; there is nothing to write")
        checked = None if labels is None else as_labels(labels, len(triangles), len(names))
        return cls(vertices, triangles, checked, names, check_unit(unit), vertex_attributes(bare))

    def in_unit(self, unit: str | None) -> "MeshData":
        """Return the mesh in another unit of length (None: in its own); attributes stay as they are."""
        if unit is None or unit == self.unit:
            return self
        return replace(self, vertices=self.vertices * unit_scale(self.unit, unit), unit=check_unit(unit))

    def parts(self, whole: str) -> list[tuple[str, IntArray]]:
        """Return the triangles of each label that occurs, by name; without labels all of them, called `whole`."""
        if self.labels is None:
            return [(whole, self.triangles)]
        parts = [(name, self.triangles[self.labels == number]) for number, name in enumerate(self.names)]
        return [(name, triangles) for name, triangles in parts if len(triangles)]

    @property
    def label_names(self) -> tuple[str, ...]:
        """Names of the labels; none where triangles have none."""
        return () if self.labels is None else self.names

    @property
    def normals(self) -> FloatArray | None:
        """Normals (n, 3) of the vertices, if there are any."""
        return self.attributes.get("normals")

    @property
    def vertex_count(self) -> int:
        """Number of vertices."""
        return len(self.vertices)

    @property
    def triangle_count(self) -> int:
        """Number of triangles."""
        return len(self.triangles)

    def vertex_block(self, start: int, stop: int) -> FloatArray:
        """Return the positions of the vertices from start to stop."""
        return self.vertices[start:stop]

    def triangle_block(self, start: int, stop: int) -> tuple[IndexArray, LabelArray | None]:
        """Return the triangles from start to stop, and their labels, if they have any."""
        return self.triangles[start:stop], None if self.labels is None else self.labels[start:stop]

    def corners(self, triangles: IndexArray) -> FloatArray:
        """Return the (m, 3, 3) positions of the corners of triangles."""
        return self.vertices[triangles]


def vertex_attributes(mesh: object) -> dict[str, npt.NDArray[Any]]:
    """Return what the vertices of an Open3D mesh carry beside their positions, by Open3D's names."""
    if isinstance(mesh, o3d.t.geometry.TriangleMesh):
        return {name: tensor.cpu().numpy() for name, tensor in mesh.vertex.items() if name != "positions"}
    if not isinstance(mesh, o3d.geometry.TriangleMesh):
        return {}
    normals = {"normals": np.asarray(mesh.vertex_normals)} if mesh.has_vertex_normals() else {}
    return normals | ({"colors": np.asarray(mesh.vertex_colors)} if mesh.has_vertex_colors() else {})


def unit_comment(unit: str | None) -> tuple[str, ...]:
    """Return the line by which a file says its unit, if there is one."""
    return () if unit is None else (f"unit {unit}",)


def face_vectors(corners: FloatArray) -> FloatArray:
    """Return the (m, 3) outward normals of triangles with (m, 3, 3) corners, as long as twice their areas."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def unit_rows(vectors: FloatArray) -> FloatArray:
    """Return rows of length 1; (0, 0, 1) for those that have no direction, as file formats want one."""
    # Squares of the smallest sides in meters would underflow: scale before a row is given up.
    largest = np.abs(vectors).max(axis=1, initial=0.0, keepdims=True)
    scaled = vectors / np.where(largest > 0, largest, 1.0)
    size = np.linalg.norm(scaled, axis=1, keepdims=True)
    return np.where(size > 0, scaled / np.where(size > 0, size, 1.0), [0.0, 0.0, 1.0])
