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


def pipe(count, spacings=1.5, seed=0):
    """Return a pipe of mean radius 1/2 and length 3, open at both ends, whose wall is so many spacings thick."""
    rng, half = np.random.default_rng(seed), spacings * np.sqrt(6 * np.pi / count) / 2
    radii = 0.5 - half, 0.5 + half
    part = rng.choice(3, count, p=np.array([3 * radii[0], 3 * radii[1], 2 * half]) / (3 + 2 * half))
    angle, chance, end = rng.uniform(0, 2 * np.pi, count), rng.uniform(size=count), rng.choice([-1.0, 1.0], count)
    ring = np.sqrt(radii[0] ** 2 + chance * (radii[1] ** 2 - radii[0] ** 2))
    radius = np.choose(part, [radii[0], radii[1], ring])
    height, facing = np.where(part == 2, 1.5 * end, 3 * chance - 1.5), np.choose(part, [-1.0, 1.0, 0.0])
    outward = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    normals = facing[:, np.newaxis] * outward
    normals[part == 2, 2] = end[part == 2]
    return radius[:, np.newaxis] * outward + np.outer(height, [0, 0, 1]), normals


def ellipsoid(count, semiaxes, seed=0):
    """Points uniform by area, and outward unit normals."""
    rng, semiaxes = np.random.default_rng(seed), np.asarray(semiaxes)
    places = rng.normal(size=(100 * count, 3))
    places /= np.linalg.norm(places, axis=1)[:, np.newaxis]
    area = np.linalg.norm(places / semiaxes, axis=1)
    kept = places[rng.random(len(places)) < area / area.max()][:count]
    normals = kept / semiaxes
    return kept * semiaxes, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis]


def moebius(count, half_width, start=0.0, seed=4):
    """A strip with one side: its normals are opposite on both sides of the angle `start`."""
    u, v = np.random.default_rng(seed).uniform([start, -half_width], [start + 2 * np.pi, half_width], (count, 2)).T
    radius = 1 + v * np.cos(u / 2)
    points = np.column_stack([radius * np.cos(u), radius * np.sin(u), v * np.sin(u / 2)])
    along = np.column_stack(
        [
            -v / 2 * np.sin(u / 2) * np.cos(u) - radius * np.sin(u),
            -v / 2 * np.sin(u / 2) * np.sin(u) + radius * np.cos(u),
            v / 2 * np.cos(u / 2),
        ]
    )
    across = np.column_stack([np.cos(u / 2) * np.cos(u), np.cos(u / 2) * np.sin(u), np.sin(u / 2)])
    normals = np.cross(along, across)
    return points, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis]


def ground(x, y):
    """Return heights of waves 9 to 44 long, and their slopes along x and y."""
    height = 0.5 * np.sin(x / 6) * np.cos(y / 7) + 0.12 * np.sin(x / 1.5) * np.cos(y / 1.7)
    along_x = 0.5 / 6 * np.cos(x / 6) * np.cos(y / 7) + 0.12 / 1.5 * np.cos(x / 1.5) * np.cos(y / 1.7)
    along_y = -0.5 / 7 * np.sin(x / 6) * np.sin(y / 7) - 0.12 / 1.7 * np.sin(x / 1.5) * np.sin(y / 1.7)
    return height, along_x, along_y


def scanned_ground(step=2.0, eye=1.6):
    """Return what a scanner above waves sees, a ray every so many degrees, the upward normals, and where it stands."""
    azimuth, elevation = np.radians(np.arange(0, 360, step)), np.radians(np.arange(-40, 2, step))
    a, e = (each.ravel() for each in np.meshgrid(azimuth, elevation, indexing="ij"))
    rays = np.column_stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    place, reach = np.array([0.0, 0.0, eye]), np.geomspace(2.0, 60.0, 250)
    along = place + reach[:, np.newaxis, np.newaxis] * rays
    above = along[..., 2] - ground(along[..., 0], along[..., 1])[0]
    first = (above <= 0).argmax(axis=0)
    hit = np.flatnonzero(first)
    before, behind = above[first[hit] - 1, hit], above[first[hit], hit]
    length = reach[first[hit] - 1] + before / (before - behind) * (reach[first[hit]] - reach[first[hit] - 1])
    points = place + length[:, np.newaxis] * rays[hit]
    normals = np.column_stack([*(-slope for slope in ground(points[:, 0], points[:, 1])[1:]), np.ones(len(points))])
    return points, normals / np.linalg.norm(normals, axis=1)[:, np.newaxis], place
