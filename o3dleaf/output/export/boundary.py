"""The boundary of a solid in layers of particles, for SPH: on the surface, and at whole spacings below it."""

import numpy as np
import numpy.typing as npt
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive, Unit, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, ray_scene
from o3dleaf.core.trees import query
from o3dleaf.io.labelled_mesh import LABELS, RIM, AnyMesh
from o3dleaf.io.mesh_data import MeshData, face_vectors, unit_rows
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.export.particle_loops import thin_samples
from o3dleaf.output.export.particles import Particles, cover_surface, require_closed
from o3dleaf.output.export.thinning import sort_into_cubes

MIN_DISTANCE = 0.75
"""Least distance r of two particles, of the spacing: one has about 1.75 r² to itself, hence spacing²."""
CANDIDATES = 3
"""Particles are chosen among samples that are as much nearer together: nine to one."""
SHALLOWER = 0.25
"""Of the spacing, by which another part of the surface may be nearer to a particle of a layer than its own."""


@checked
def sample_boundary(
    mesh: AnyMesh,
    spacing: Positive,
    *,
    layers: Count = 3,
    field: MultiscaleLeaf | None = None,
    labels: npt.ArrayLike | None = None,
    unit: Unit | None = None,
    seed: Whole = 0,
) -> Particles:
    r"""Return the boundary of a solid as particles with outward normals, in layers below its surface.

    Layer 0 lies on the surface, of a leaf on G = 0 itself to rounding; layer k where

    .. math:: x = p - k\,d\,n(p), \qquad \mathrm{dist}(x) \ge (k - 1/4)\,d

    for points p of the surface with outward normal n, d the spacing: what is nearer to another part of the surface is
    left out. So a part thinner than 2 k d has no layer k: the middle of a blade is not filled twice, and a hair as
    thick as a spacing is layer 0 alone. No two particles, of whatever layer or face, are nearer than 0.75 d, and
    none is missing where one has room; each has about d² of its layer to itself, d³ of the volume. Its `size` is the
    area of that part of the surface which it lies on or below: those of layer 0 add up to the mesh's, and those of a
    layer below to the part of it that has this layer.

    Parameters
    ----------
    mesh : Open3D mesh, (vertices, triangles) or LabelledMesh
        Closed; a single layer may be of an open one.
    spacing : float
        d, in the mesh's unit.
    layers : int
        A kernel whose support reaches s beyond the surface wants s/d of them and one more.
    field : MultiscaleLeaf, optional
        The leaf that the mesh is of: particles are moved onto it, all but those of the rim, which is where the solid
        is cut. What would have to move by more than a spacing, the mesh being too coarse, is left out.
    labels : (m,) array_like of int, optional
        Of the triangles; by default those that the mesh brings.
    unit : str, optional
        Unit of the mesh.
    seed : int
        Of the order in which particles are chosen.

    Raises
    ------
    InputError
        If the mesh is open and there is more than one layer, or without area.
    MemoryBudgetError
        If the spacing is so small that the samples, among which particles are chosen, do not fit into memory.
    """
    step, surface = require_positive(spacing, "spacing"), MeshData.of(mesh, labels, unit)
    if layers > 1:
        require_closed(surface)
    points, triangle, shares = cover_surface(surface, step * MIN_DISTANCE / CANDIDATES, step, seed, layers)
    normals = unit_rows(face_vectors(surface.vertices[surface.triangles[triangle]]))
    sample = np.arange(len(points))
    if field is not None:
        points, normals, there = _on_field(field, surface, points, normals, triangle, step)
        sample = sample[there]
    depth = _depths(surface, step)
    places, of, layer = [points[sample]], [sample], [np.zeros(len(sample), dtype=np.int64)]
    for k in range(1, layers):
        below = points[sample] - k * step * normals[sample]
        deep = depth(below) >= (k - SHALLOWER) * step
        if not deep.any():
            break
        places, of = [*places, below[deep]], [*of, sample[deep]]
        layer.append(np.full(int(deep.sum()), k))
    found, sampled, layer_of = np.concatenate(places), np.concatenate(of), np.concatenate(layer)
    kept = _thinned(found, [len(each) for each in places], step * MIN_DISTANCE, seed)
    sizes = _areas_below(found, layer_of, shares[sampled], kept)
    own = None if surface.labels is None else surface.labels[triangle[sampled[kept]]]
    return Particles(found[kept], normals[sampled[kept]], sizes, own, surface.unit, layer_of[kept])


def _on_field(
    field: MultiscaleLeaf, mesh: MeshData, points: FloatArray, normals: FloatArray, triangle: IntArray, step: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return samples on G = 0 with its normals, those of the rim as they are, and which of them are there."""
    cut = np.zeros(len(points), dtype=bool)
    if mesh.labels is not None and LABELS[RIM] in mesh.names:
        cut = mesh.labels[triangle] == mesh.names.index(LABELS[RIM])
    moved, turned = points.copy(), normals.copy()
    moved[~cut] = field.project(points[~cut])
    turned[~cut] = field.normals(moved[~cut])
    return moved, turned, np.linalg.norm(moved - points, axis=1) <= step


def layer_counts(particles: Particles) -> list[int]:
    """Return how many particles there are of each layer."""
    return [] if particles.layers is None else np.bincount(particles.layers).tolist()


class _depths:  # noqa: N801 - a function that holds its tree
    """Depths (n,) of points in a closed mesh: their distances to it, and −1 outside."""

    def __init__(self, mesh: MeshData, step: float) -> None:
        self.middle, self.step = mesh.vertices.mean(axis=0), step
        self.scene = ray_scene((mesh.vertices - self.middle) / step, mesh.triangles)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the depths of (n, 3) points."""
        query = o3d.core.Tensor.from_numpy(((points - self.middle) / self.step).astype(np.float32))
        inside = self.scene.compute_occupancy(query, nsamples=3).numpy() > 0
        return np.where(inside, self.scene.compute_distance(query).numpy() * self.step, -1.0)


def _thinned(points: FloatArray, sizes: list[int], radius: float, seed: int) -> IntArray:
    """Return the rows that are kept of layers of so many points: in random order, the outer layers first."""
    by_cube, cube, starts, neighbors = sort_into_cubes(points, radius)
    random, place = np.random.default_rng(seed), np.empty(len(points), dtype=np.int64)
    place[by_cube] = np.arange(len(points))
    ends = np.cumsum(sizes)
    order = np.concatenate([end - size + random.permutation(size) for end, size in zip(ends, sizes, strict=True)])
    members, counts = np.empty(len(points), dtype=np.int64), np.zeros(len(starts), dtype=np.int64)
    # One normal for all: particles keep apart whatever side they are of.
    one, all_of_it = np.array([[0.0, 0.0, 1.0]]), np.zeros(len(points), dtype=np.int64)
    thin_samples(points[by_cube], one, all_of_it, cube, starts, neighbors, place[order], radius, members, counts)
    # The members of a cube stand from its start on, counts of them.
    rank = np.arange(len(points)) - starts[cube]
    return np.sort(by_cube[members[rank < counts[cube]]])


def _areas_below(points: FloatArray, layer: IntArray, shares: FloatArray, kept: IntArray) -> FloatArray:
    """Return the areas (k,) of the samples to which a kept particle is the nearest of their layer."""
    sizes = np.zeros(len(kept))
    for k in np.unique(layer[kept]):
        rows, own = np.flatnonzero(layer == k), np.flatnonzero(layer[kept] == k)
        nearest = query(cKDTree(points[kept[own]]), points[rows])[1]
        sizes[own] = np.bincount(nearest, weights=shares[rows], minlength=len(own))
    return sizes
