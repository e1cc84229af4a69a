"""A solid that is bounded by a mesh: any closed mesh as a truth to sample and to measure against."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, UniqueRows, mesh_arrays, ray_scene, triangle_areas
from o3dleaf.samples.meshed import draw_on_triangles
from o3dleaf.samples.solids import Feet, Solid
from o3dleaf.surface.mesh.topology import EdgeTable

RAYS = 3
"""Rays whose majority says what is inside: one may graze an edge."""


@dataclass(frozen=True, eq=False, repr=False)
class MeshSolid(Solid):
    """The solid inside a closed mesh, which is its surface exactly; normals are those of the triangles.

    The nearest triangle and what is inside are found by Open3D in single precision, the closest point of that
    triangle in double.

    Attributes
    ----------
    vertices : (k, 3) ndarray
    triangles : (m, 3) ndarray
        Counter-clockwise seen from outside.
    """

    vertices: FloatArray
    triangles: IntArray

    @classmethod
    def of(cls, mesh: MeshLike) -> "MeshSolid":
        """Return the solid inside a mesh, whichever side its triangles face, with coinciding vertices merged.

        Parameters
        ----------
        mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)

        Raises
        ------
        InputError
            If an edge is not one of two triangles, so that the mesh does not bound a solid.
        """
        vertices, triangles = mesh_arrays(mesh)
        vertices, _, place = UniqueRows.of(vertices)
        triangles = place[triangles]
        distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
        triangles = triangles[distinct]
        odd = int((EdgeTable.of(triangles).count != 2).sum())
        if odd or not len(triangles):
            raise InputError(f"mesh: {odd} edges are not of two triangles, so that it bounds no solid; close it first")
        if _volume(vertices, triangles) < 0:
            triangles = triangles[:, ::-1]
        return cls(vertices, np.ascontiguousarray(triangles))

    def __repr__(self) -> str:
        return f"MeshSolid({len(self.triangles):,} triangles)"

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of its box."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @property
    def area(self) -> float:
        """Area of the mesh."""
        return float(triangle_areas(self.vertices, self.triangles).sum())

    @cached_property
    def _normals(self) -> FloatArray:
        a, b, c = self.vertices[self.triangles].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, np.newaxis])

    @cached_property
    def _scene(self) -> tuple[o3d.t.geometry.RaycastingScene, FloatArray]:
        middle = self.box.mean(axis=0)
        scene = ray_scene(self.vertices - middle, self.triangles, threads=1)
        scene.compute_distance(
            o3d.core.Tensor.from_numpy(np.zeros((1, 3), dtype=np.float32))
        )  # makes its tree, before threads ask
        return scene, middle

    def _feet(self, points: FloatArray) -> Feet:
        scene, middle = self._scene
        query = o3d.core.Tensor.from_numpy((points - middle).astype(np.float32))
        nearest = scene.compute_closest_points(query, nthreads=1)["primitive_ids"].numpy()
        inside = scene.compute_occupancy(query, nthreads=1, nsamples=RAYS).numpy() > 0
        feet = _closest_of_triangles(points, *self.vertices[self.triangles[nearest]].transpose(1, 0, 2))
        distance = np.linalg.norm(points - feet, axis=1)
        return Feet(feet, self._normals[nearest], np.where(inside, -distance, distance))

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        return draw_on_triangles(self.vertices, self.triangles, count, rng)[0]


def _volume(vertices: FloatArray, triangles: IntArray) -> float:
    a, b, c = (vertices - vertices.mean(axis=0))[triangles].transpose(1, 0, 2)
    return float((np.cross(a, b) * c).sum() / 6)


def _closest_of_triangles(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the points (n, 3) of n triangles that are closest to n points."""
    normals = np.cross(b - a, c - a)
    square = np.maximum((normals**2).sum(axis=1), np.finfo(float).tiny)
    plumb = points - (((points - a) * normals).sum(axis=1) / square)[:, np.newaxis] * normals
    ends = ((a, b), (b, c), (c, a))
    within = np.all([(np.cross(q - p, plumb - p) * normals).sum(axis=1) >= 0 for p, q in ends], axis=0)
    candidates = np.stack([_closest_of_segments(points, p, q) for p, q in ends])
    best = ((candidates - points) ** 2).sum(axis=2).argmin(axis=0)
    return np.asarray(np.where(within[:, np.newaxis], plumb, candidates[best, np.arange(len(points))]))


def _closest_of_segments(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    length = np.maximum(((b - a) ** 2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(((points - a) * (b - a)).sum(axis=1) / length, 0.0, 1.0)
    return np.asarray(a + share[:, np.newaxis] * (b - a))
