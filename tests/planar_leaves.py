"""Outlines of leaves in the plane, whose area and margin are known, and ways in which a scanner samples them."""

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

TURN = np.linspace(0, 2 * np.pi, 2000, endpoint=False)


def ellipse():
    return shapely.Polygon(np.stack([50 * np.cos(TURN), 20 * np.sin(TURN)], axis=1))


def strip(angle, width=10.0, length=150.0):
    """A strip with a square cut base and a tip of so many degrees."""
    begin = length - width / 2 / np.tan(np.radians(angle / 2))
    side = width / 2
    return shapely.Polygon([(0, -side), (begin, -side), (length, 0), (begin, side), (0, side)])


def lobed():
    radius = 30 * (1 + 0.35 * np.cos(5 * TURN))
    return shapely.Polygon(np.stack([radius * np.cos(TURN), radius * np.sin(TURN)], axis=1))


def toothed(pitch, depth, length=100.0, half=14.0):
    """A strip with triangular teeth along both sides."""
    count = int(length / pitch)
    up = [(pitch * (i + part), half + 2 * part * depth) for i in range(count) for part in (0.0, 0.5)]
    up.append((count * pitch, half))
    return shapely.Polygon(up + [(x, -y) for x, y in up][::-1])


def eaten(notch):
    """The ellipse with a hole of 10 and a notch of a given width."""
    bite = shapely.Point(10, 2).buffer(5, quad_segs=64)
    return ellipse().difference(bite).difference(shapely.box(-20, 6, -20 + notch, 40))


def true_spacing(leaf, points):
    return np.sqrt(leaf.area / len(points))


def uniform(leaf, count, rng):
    low, high = leaf.bounds[:2], leaf.bounds[2:]
    box = np.prod(np.subtract(high, low))
    points = rng.uniform(low, high, (int(1.3 * count * box / leaf.area) + 100, 2))
    return points[shapely.contains_xy(leaf, *points.T)][:count]


def graded(leaf, count, rng):
    """Four times as dense at the far end as at the near one."""
    points = uniform(leaf, 2 * count, rng)
    along = (points[:, 0] - leaf.bounds[0]) / (leaf.bounds[2] - leaf.bounds[0])
    return points[rng.uniform(size=len(points)) < 0.25 + 0.75 * along]


def crossings(leaf, step, rng):
    """Where the edges of a cubic lattice, turned and shifted at random, cross the plane of a leaf."""
    turn, shift = Rotation.random(random_state=rng).as_matrix(), rng.uniform(0, step, 3)
    low, high = np.reshape(leaf.bounds, (2, 2))
    reach = int(np.linalg.norm(high - low) / step) + 1
    lines = step * np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2), axis=-1).reshape(-1, 2)
    found = []
    for axis in range(3):
        places = np.insert(lines, axis, 0.0, axis=1) + shift
        places[:, axis] = 0.0
        places[:, axis] = -places @ turn[:, 2] / turn[axis, 2]
        found.append(places @ turn[:, :2] + (low + high) / 2)
    points = np.concatenate(found)
    return points[shapely.contains_xy(leaf, *points.T)]


def lattice(leaf, count, rng, *, across=1.0, jitter=0.0):
    """A turned lattice of the given aspect; rows of an uneven one begin anywhere, as scan lines do."""
    step = np.sqrt(leaf.area / count / across)
    reach = int(np.hypot(leaf.bounds[2] - leaf.bounds[0], leaf.bounds[3] - leaf.bounds[1]) / step) + 2
    i, j = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach), indexing="ij")
    begin = rng.uniform(0, 1, 2 * reach) if across != 1 else np.full(2 * reach, rng.uniform())
    points = np.stack([i + begin[j], across * (j + rng.uniform())], axis=2).reshape(-1, 2) * step
    points += rng.normal(0, jitter * step, points.shape)
    angle = rng.uniform(0, np.pi)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    points = points @ turn + shapely.get_coordinates(leaf.centroid)[0]
    return points[shapely.contains_xy(leaf, *points.T)]


def triangles(leaf, count, rng, *, stretch=1.0, bend=0.0):
    """The corners of a turned lattice of triangles, stretched along its rows; by so much more from end to end."""
    step = np.sqrt(leaf.area / count * 2 / np.sqrt(3) / stretch)
    length = np.hypot(leaf.bounds[2] - leaf.bounds[0], leaf.bounds[3] - leaf.bounds[1])
    reach = int(length / step) + 2
    i, j = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach), indexing="ij")
    x, y = stretch * step * (i + j % 2 / 2).ravel() + rng.uniform(), step * (np.sqrt(3) / 2 * j).ravel() + rng.uniform()
    angle = rng.uniform(0, np.pi)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    points = np.stack([x + bend * x**2 / (2 * length), y], axis=1) @ turn + shapely.get_coordinates(leaf.centroid)[0]
    return points[shapely.contains_xy(leaf, *points.T)]


def lines(leaf, spacing, ratio, angle, rng):
    """Lines `ratio` times as far apart as the points along them, which begin anywhere."""
    step, apart = spacing / np.sqrt(ratio), spacing * np.sqrt(ratio)
    reach = np.hypot(leaf.bounds[2] - leaf.bounds[0], leaf.bounds[3] - leaf.bounds[1])
    along, across = (np.arange(-reach, reach, each) for each in (step, apart))
    points = np.stack(np.meshgrid(along, across, indexing="ij"), axis=-1)
    points[..., 0] += rng.uniform(0, step, len(across))
    points[..., 1] += rng.uniform(0, apart)
    points += rng.normal(0, 0.1 * step, points.shape)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    points = points.reshape(-1, 2) @ turn + shapely.get_coordinates(leaf.centroid)[0]
    return points[shapely.contains_xy(leaf, *points.T)]


def jittered(leaf, count, rng):
    return lattice(leaf, count, rng, jitter=0.2)


def scan_lines(leaf, count, rng):
    return lattice(leaf, count, rng, across=3.0, jitter=0.05)


SAMPLERS = {"uniform": uniform, "graded": graded, "lattice": lattice, "jittered": jittered, "lines": scan_lines}


def margin_distances(leaf, polygon, step):
    """Distances of the true margin from the polygon's, and of the polygon's from the true one."""

    def along(area):
        rings = (area.exterior, *area.interiors)
        return np.concatenate([ring.interpolate(np.arange(0, ring.length, step)) for ring in rings])

    return shapely.distance(along(leaf), polygon.boundary), shapely.distance(along(polygon), leaf.boundary)
