"""A mesh under repair, with the origin of its vertices and triangles."""

from dataclasses import dataclass, replace

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.mesh.measurements import FLAT

NEW = -1
"""Origin of a triangle that closes a hole."""


@dataclass(frozen=True, eq=False)
class EditableMesh:
    """Vertices and triangles, and the rows of the input that they were.

    Attributes
    ----------
    vertices : (n, 3) ndarray of float64
    triangles : (m, 3) ndarray of int64
    vertex_origin : (n,) ndarray of int64
        Every vertex is one of the input's: none is made, none is moved.
    triangle_origin : (m,) ndarray of int64
        `NEW` for those that the input did not have.
    """

    vertices: FloatArray
    triangles: IntArray
    vertex_origin: IntArray
    triangle_origin: IntArray

    @classmethod
    def of(cls, vertices: FloatArray, triangles: IntArray) -> "EditableMesh":
        """Return a mesh as it came."""
        return cls(vertices, triangles, np.arange(len(vertices)), np.arange(len(triangles)))

    def only(self, keep: BoolArray) -> "EditableMesh":
        """Return the mesh with some of its triangles; all vertices stay."""
        if keep.all():
            return self
        return replace(self, triangles=self.triangles[keep], triangle_origin=self.triangle_origin[keep])

    def joined(self, target: IntArray) -> "EditableMesh":
        """Return the mesh with each vertex replaced by `target` of it; all vertices stay."""
        return replace(self, triangles=target[self.triangles])

    def compact(self) -> "EditableMesh":
        """Return the mesh without vertices that no triangle names, the others in their old order."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.triangles] = True
        renumber = np.cumsum(used) - 1
        return replace(
            self,
            vertices=self.vertices[used],
            triangles=renumber[self.triangles],
            vertex_origin=self.vertex_origin[used],
        )

    def same(self, other: "EditableMesh") -> bool:
        """Return whether two meshes are equal to the bit."""
        return np.array_equal(self.triangles, other.triangles) and np.array_equal(self.vertices, other.vertices)

    def heights(self) -> tuple[FloatArray, IntArray, BoolArray]:
        """Return the (m,) heights over the longest edges, the corners where these begin, and which are degenerate."""
        sides = self.vertices[np.roll(self.triangles, -1, axis=1)] - self.vertices[self.triangles]
        squared = np.einsum("ijk,ijk->ij", sides, sides)
        corner = squared.argmax(axis=1)
        longest = np.take_along_axis(squared, corner[:, np.newaxis], axis=1)[:, 0]
        double_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        height = np.divide(double_area, np.sqrt(longest), out=np.zeros(len(longest)), where=longest > 0)
        return height, corner, double_area / 2 <= FLAT * longest
