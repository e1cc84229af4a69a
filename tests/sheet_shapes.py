"""Flat leaves of known midrib as meshes, and isometric ways to bend them in space."""

import numpy as np
import shapely
from scipy.spatial import Delaunay


def triangulated(outline, step):
    """Vertices (n, 2) and counter-clockwise triangles of a polygon: a hexagonal lattice, and its border."""
    low, high = np.reshape(outline.bounds, (2, 2))
    rows = [
        np.stack([xs := np.arange(low[0], high[0], step) + (row % 2) * step / 2, np.full_like(xs, y)], axis=1)
        for row, y in enumerate(np.arange(low[1], high[1], step * np.sqrt(3) / 2))
    ]
    inner = np.concatenate(rows)
    inner = inner[shapely.contains_xy(outline.buffer(-0.45 * step), *inner.T)]
    border = [_along(ring, step) for ring in (outline.exterior, *outline.interiors)]
    points = np.concatenate([*border, inner])
    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[twice < 0] = triangles[twice < 0][:, ::-1]
    inside = shapely.contains_xy(outline, *points[triangles].mean(axis=1).T) & (np.abs(twice) > 1e-3 * step**2)
    used, corner = np.unique(triangles[inside], return_inverse=True)
    return points[used], corner.reshape(-1, 3)


def _along(ring, step):
    count = max(8, round(ring.length / step))
    return np.array([ring.interpolate(k / count, normalized=True).coords[0] for k in range(count)])


def rolled(flat, radius=60.0, turned=0.5):
    """Places (n, 3) of plane points (n, 2) rolled onto a cylinder: no length on the sheet changes."""
    cos, sin = np.cos(turned), np.sin(turned)
    along, across = flat[:, 0] * cos + flat[:, 1] * sin, flat[:, 1] * cos - flat[:, 0] * sin
    return np.stack([radius * np.sin(along / radius), across, radius * np.cos(along / radius)], axis=1)


def spiral(turns, step=1.0):
    """A flat strip that winds around itself in its own plane, rising: it overlaps when laid flat."""
    flat, triangles = triangulated(shapely.box(0, -4, 2 * np.pi * 10 * turns, 4), step)
    return staircase(flat), triangles


def staircase(flat):
    """Places (n, 3) of those of a strip (n, 2) that winds around an axis 10 off its middle, rising by 4 pi a turn."""
    angle, radius = flat[:, 0] / 10, 10 + flat[:, 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 2.0 * angle], axis=1)


def blade(length=120.0, width=12.0, *, oblique=0.0):
    """A long blade along x, symmetric about y = 0, its base cut at x = 0, square or `oblique` (rise over run)."""
    x = np.linspace(0, length, 200)
    half = width / 2 * np.minimum(1, (length - x) / (length / 3)) ** 0.7
    upper, lower = np.stack([x, half], axis=1), np.stack([x, -half], axis=1)
    upper[0, 0], lower[0, 0] = oblique * width / 2, -oblique * width / 2
    return shapely.Polygon(np.concatenate([lower, upper[-2::-1]]))


def ellipse(length, width, notch=0.0):
    """An ellipse from x = 0 to `length` about y = 0, with a wedge as deep as `notch` cut out at x = 0."""
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    whole = shapely.Polygon(np.stack([length / 2 * (1 + np.cos(angle)), width / 2 * np.sin(angle)], axis=1))
    return whole.difference(shapely.Polygon([(-1, -notch / 2), (notch, 0), (-1, notch / 2)])) if notch else whole


def lobed(length=100.0, width=56.0):
    """A leaf with three lobes a side and one at the tip, symmetric about y = 0."""
    angle = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    radius = 1 - 0.22 * np.cos(7 * angle) * np.abs(np.sin(angle)) ** 0.5
    xy = np.stack([length / 2 * (1 + radius * np.cos(angle)), width / 2 * radius * np.sin(angle)], axis=1)
    return shapely.Polygon(xy)


def sickle(radius=60.0, width=12.0, angle=2.0):
    """A blade that bends in its own plane, and its midrib (k, 2): an arc."""
    turn = np.linspace(0, angle, 200)
    half = width / 2 * np.minimum(1, (angle - turn) * radius / 30) ** 0.7

    def arc(r):
        return np.stack([r * np.sin(turn), radius - r * np.cos(turn)], axis=1)

    return shapely.Polygon(np.concatenate([arc(radius + half), arc(radius - half)[-2::-1]])), arc(radius)


def stalked(length=60.0, width=25.0, stalk=40.0, thickness=2.0, stub=0.0):
    """An elliptic blade on a petiole along y = 0 that ends at x = 0, on a stub of the stem `stub` thick."""
    whole = shapely.transform(ellipse(length, width), lambda xy: xy + np.array([stalk, 0.0]))
    whole = whole.union(shapely.box(0, -thickness / 2, stalk + 3, thickness / 2))
    return whole.union(shapely.box(-5, -stub / 2, 0.1, stub / 2)) if stub else whole
