"""Clouds on surfaces that are known: points and their outward normals."""

import numpy as np


def sphere(count, seed=0):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, np.newaxis]
    return points, points.copy()


def torus(count, seed=0, tube=0.35):
    rng = np.random.default_rng(seed)
    u, v, chance = rng.uniform(0, 1, (3, 4 * count))
    u, v = 2 * np.pi * u, 2 * np.pi * v
    even = np.flatnonzero(chance < (1 + tube * np.cos(v)) / (1 + tube))[:count]
    u, v = u[even], v[even]
    normals = np.column_stack([np.cos(u) * np.cos(v), np.sin(u) * np.cos(v), np.sin(v)])
    return np.column_stack([np.cos(u), np.sin(u), 0 * u]) + tube * normals, normals


def block(count, size=(1.0, 0.7, 0.5), seed=0):
    rng = np.random.default_rng(seed)
    edges = np.array(size)
    areas = edges.prod() / edges
    face, side = rng.choice(3, count, p=areas / areas.sum()), rng.choice([-1.0, 1.0], count)
    points, normals = rng.uniform(-0.5, 0.5, (count, 3)) * edges, np.zeros((count, 3))
    points[np.arange(count), face] = side * edges[face] / 2
    normals[np.arange(count), face] = side
    return points, normals


def slab(count, spacings=3.0, seed=0):
    """Return a unit square that is so many spacings thick, with its rim."""
    thickness = 0.0
    for _ in range(5):
        thickness = spacings * np.sqrt((2 + 4 * thickness) / count)
    return block(count, (1.0, 1.0, thickness), seed)
