"""Fields with a known surface, for the tests of mesh and view: nothing here is fitted."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Analytic:
    """A Field out of a function of (x, y, z), larger inside; outside its bounds it falls with the distance."""

    function: object
    bounds: np.ndarray = field(default_factory=lambda: np.array([[-1.2] * 3, [1.2] * 3]))
    unit: str | None = None

    def __call__(self, points):
        points = np.atleast_2d(np.asarray(points, dtype=np.float64))
        nearest = np.clip(points, *self.bounds)
        return self.function(*nearest.T) - np.linalg.norm(points - nearest, axis=1)

    def gradient(self, points):
        points, step = np.atleast_2d(np.asarray(points, dtype=np.float64)), 1e-6
        offsets = step * np.eye(3)
        return np.stack([self(points + offset) - self(points - offset) for offset in offsets], axis=1) / (2 * step)


# A little off the lattice's own symmetry, so that no sample lies on the surface by accident.
CENTRE = (0.013, -0.021, 0.007)


def sphere(radius=1.0, centre=CENTRE):
    a, b, c = centre
    return Analytic(lambda x, y, z: radius - np.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2))


def torus(ring=0.8, tube=0.3):
    a, b, c = CENTRE
    return Analytic(lambda x, y, z: tube - np.hypot(np.hypot(x - a, y - b) - ring, z - c))


BLOCK_HALF = np.array([0.7, 0.5, 0.4])
BLOCK_TURN = np.array([[0.7686, -0.5406, 0.3420], [0.6337, 0.7353, -0.2403], [-0.1215, 0.4014, 0.9078]])


def block():
    """A turned block with sharp edges: the least distance to its six planes."""
    turn = np.linalg.qr(BLOCK_TURN)[0]

    def inside(x, y, z):
        return (BLOCK_HALF - np.abs((np.stack([x, y, z], axis=1) - CENTRE) @ turn)).min(axis=1)

    return Analytic(inside), turn


def wavy_sheets(thickness=0.15):
    """A slab between two wavy sheets that leaves the bounds on four sides."""
    return Analytic(lambda x, y, z: thickness - np.abs(z - 0.2 * np.sin(3 * x + 0.1) * np.cos(2 * y)))


def hashed_noise(seed, shape=(12, 13, 11), *, levels=None):
    """Return random samples, padded with outside: whole numbers below `levels`, or normal deviates."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=shape) if levels is None else rng.integers(0, levels, size=shape).astype(np.float64)
    return np.pad(noise, 1, constant_values=-5.0)


def joined(*parts):
    """Return several (vertices, triangles) as one mesh."""
    start = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    triangles = [np.asarray(part[1]) + first for part, first in zip(parts, start, strict=True)]
    return np.concatenate([part[0] for part in parts]), np.concatenate(triangles)


def planted(defect, ball):
    """Return the sphere with one defect, and what a report must then say."""
    vertices, triangles = ball
    count = len(vertices)
    fin = np.append(triangles, [[*triangles[0, :2], count]], axis=0)
    mirrored = joined(ball, (2 * vertices[0] - vertices, triangles[:, ::-1]))
    touching = mirrored[0], np.where(mirrored[1] == count, 0, mirrored[1])
    thin, null = (np.array([[3.0, 0, 0], [4, 0, 0], [3.5, height, 0]]) for height in (1e-3, 0.0))
    return {
        "missing face": (
            (vertices, triangles[1:]),
            {"boundary_edges": 3, "holes": 1, "watertight": False, "manifold": True},
        ),
        "flipped face": (
            (vertices, np.concatenate([triangles[:1, ::-1], triangles[1:]])),
            {"oriented": False, "inconsistent_edges": 3, "manifold": True, "genus": None},
        ),
        "duplicated face": (
            (vertices, np.concatenate([triangles, triangles[:1]])),
            {"duplicate_triangles": 1, "nonmanifold_edges": 3, "manifold": False},
        ),
        "non-manifold edge": (
            (np.append(vertices, [[3.0, 0, 0]], axis=0), fin),
            {"nonmanifold_edges": 1, "manifold": False, "boundary_edges": 2},
        ),
        "non-manifold vertex": (touching, {"nonmanifold_vertices": 1, "components": 2, "manifold": False}),
        "intersecting sheets": (
            joined(ball, (vertices + 0.5, triangles)),
            {"watertight": False, "components": 2, "manifold": True, "nonmanifold_edges": 0},
        ),
        "sliver": (joined(ball, (thin, [[0, 1, 2]])), {"degenerate_triangles": 0, "components": 2}),
        "null face": (joined(ball, (null, [[0, 1, 2]])), {"degenerate_triangles": 1, "min_angle_deg": 0.0}),
        "stray component": (
            joined(ball, (0.05 * vertices + 2, triangles)),
            {"components": 2, "watertight": True, "genus": 0},
        ),
    }[defect]


DEFECTS = [
    "missing face",
    "flipped face",
    "duplicated face",
    "non-manifold edge",
    "non-manifold vertex",
    "intersecting sheets",
    "sliver",
    "null face",
    "stray component",
]


def prism(rng):
    """A turned prism over a rectangle or a wedge of 60° to 90°, all drawn: the least distance to its planes; its edges.

    Edges are (k, 2, 3); those of the solid are all there.
    """
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    wide, high = rng.uniform(0.4, 0.6, 2)
    if rng.random() < 0.5:
        base = np.array([[-0.5, -wide], [0.5, -wide], [0.5, wide], [-0.5, wide]])
    else:
        wide = np.tan(np.radians(rng.uniform(30, 45)))
        base = 0.9 * np.array([[-0.6, 0.0], [0.4, -wide], [0.4, wide]])
    along = np.roll(base, -1, axis=0) - base
    across = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, np.newaxis]
    reach = (across * base).sum(axis=1)

    def inside(x, y, z):
        places = (np.stack([x, y, z], axis=1) - CENTRE) @ turn
        return np.minimum((reach - places[:, :2] @ across.T).min(axis=1), high - np.abs(places[:, 2]))

    low, top = (np.column_stack([base, np.full(len(base), level)]) for level in (-high, high))
    pairs = [(low, np.roll(low, -1, axis=0)), (top, np.roll(top, -1, axis=0)), (low, top)]
    edges = np.concatenate([np.stack(pair, axis=1) for pair in pairs])
    return Analytic(inside), edges @ turn.T + CENTRE


def rod(rng, radius):
    """A turned rod with round ends, the signed distance in it: it bends everywhere and has no crease."""
    way = rng.normal(size=3)
    way /= np.linalg.norm(way)

    def inside(x, y, z):
        places = np.stack([x, y, z], axis=1) - CENTRE
        along = np.clip(places @ way, -0.6, 0.6)
        return radius - np.linalg.norm(places - along[:, np.newaxis] * way, axis=1)

    return Analytic(inside)
