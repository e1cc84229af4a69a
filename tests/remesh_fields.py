"""Meshes for the tests of remeshing, and fields with gradients: a sphere, a torus, an ellipsoid, turned anyhow."""

from dataclasses import dataclass

import numpy as np
import open3d as o3d
from scipy.spatial.transform import Rotation

from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.surface.remeshing.blocks import Charted


@dataclass(frozen=True)
class Turned:
    """A Field out of a function and its gradient at (n, 3) points, turned about the origin."""

    function: object
    slope: object
    turn: np.ndarray
    unit: str | None = None
    bounds = np.array([[-1.4] * 3, [1.4] * 3])

    def __call__(self, points):
        return self.function(np.atleast_2d(points) @ self.turn)

    def gradient(self, points):
        return self.slope(np.atleast_2d(points) @ self.turn) @ self.turn.T


RING, TUBE = 0.8, 0.3
AXES = np.array([1.2, 0.8, 0.5])
VOLUMES = {"sphere": 4 / 3 * np.pi, "torus": 2 * np.pi**2 * RING * TUBE**2, "ellipsoid": 4 / 3 * np.pi * AXES.prod()}


def turned(name, seed=0):
    """Return the field of a sphere of radius 1, a torus or an ellipsoid, turned at random."""

    def tube(x):
        around = np.hypot(x[:, 0], x[:, 1])
        return around, np.hypot(around - RING, x[:, 2])

    def slope_of_tube(x):
        around, far = tube(x)
        out = (around - RING) / far
        return -np.column_stack([out * x[:, 0] / around, out * x[:, 1] / around, x[:, 2] / far])

    function, slope = {
        "sphere": (lambda x: 1 - np.linalg.norm(x, axis=1), lambda x: -x / np.linalg.norm(x, axis=1)[:, None]),
        "torus": (lambda x: TUBE - tube(x)[1], slope_of_tube),
        "ellipsoid": (lambda x: 1 - np.sum((x / AXES) ** 2, axis=1), lambda x: -2 * x / AXES**2),
    }[name]
    return Turned(function, slope, Rotation.random(random_state=seed).as_matrix())


def sheet(n=6):
    """Return an open square of triangles, bent a little."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    at = np.arange(n * n).reshape(n, n)
    low = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:]], axis=-1).reshape(-1, 3)
    high = np.stack([at[:-1, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 3)
    return np.column_stack([x, y, x * y / (4 * n)]) / n, np.concatenate([low, high])


NAMES = ["sphere", "torus", "sheet", "sphere, two labels", "torus, two labels", "sheet, four labels"]


def charted(name, size, noise=0.0, seed=0):
    """Return a small mesh, larger with `size`; vertices may be moved at random. Four labels meet in a corner."""
    shapes = o3d.geometry.TriangleMesh
    vertices, triangles = {
        "sphere": lambda: mesh_arrays(shapes.create_icosahedron().subdivide_midpoint(size)),
        "torus": lambda: mesh_arrays(shapes.create_torus(1, 0.4, 4 + 3 * size, 4 + 2 * size)),
        "sheet": lambda: sheet(4 + 3 * size),
        "tetrahedron": lambda: mesh_arrays(shapes.create_tetrahedron()),
    }[name.split(",")[0]]()
    if name.startswith("sphere"):
        vertices /= np.linalg.norm(vertices, axis=1)[:, np.newaxis]
    middle = vertices[triangles].mean(axis=1) - vertices.mean(axis=0)
    labels = np.zeros(len(triangles), dtype=np.uint8)
    if "labels" in name:
        labels += middle[:, 0] > 0
    if "four" in name:
        labels += 2 * (middle[:, 1] > 0).astype(np.uint8)
    rng = np.random.default_rng(seed)
    edge = np.linalg.norm(vertices[triangles[:, 0]] - vertices[triangles[:, 1]], axis=1).mean()
    vertices += noise * edge * rng.normal(size=vertices.shape)
    return Charted.of(vertices, vertices, triangles, labels)


def angles(vertices, triangles):
    """Return the smallest angle of each triangle in degrees."""
    corners = vertices[triangles]
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.linalg.norm(sides, axis=2)
    cosines = [-np.einsum("ij,ij->i", sides[:, i], sides[:, i - 1]) / length[:, i] / length[:, i - 1] for i in range(3)]
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))).min(axis=0)


def edge_lengths(vertices, triangles):
    """Return the lengths of the edges of a mesh."""
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    ends = np.unique(ends, axis=0)
    return np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
