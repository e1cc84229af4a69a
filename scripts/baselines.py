"""The published algorithm as printed, in plain NumPy and SciPy: what the benchmarks call the baseline.

Dense saddle-point systems solved by LAPACK on all cores, large subdomains, vectorised where a
careful reader of the paper would vectorise. Nothing here comes from o3dleaf.
"""

import math
from itertools import product

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist

RHO_MICRO = 3e-5
"""In cubic micrometres."""
RHO_HEIGHT = 4e-4
"""The paper's 400 square micrometres, in square millimetres."""
OVERLAP = 1.1
BLOCK = 2000


def cubic(r):
    return r**3


def thin_plate(r):
    return r**2 * np.log(np.where(r > 0, r, 1.0))


def monomials(points, degree):
    powers = [p for p in product(range(degree + 1), repeat=points.shape[1]) if sum(p) <= degree]
    return np.stack([np.prod(points ** np.array(p), axis=1) for p in powers], axis=1)


class Subdomain:
    """One ball's smoothed spline: equation (2) of the paper, in coordinates about the ball's centre."""

    def __init__(self, points, values, ball, phi, degree, diagonal_per_point):
        (centre, radius), self.phi, self.degree, self.points = ball, phi, degree, points
        self.centre, self.radius = centre, radius
        count = len(points)
        A = phi(cdist(points, points)) + diagonal_per_point * count * np.eye(count)
        P = monomials((points - centre) / radius, degree)
        terms = P.shape[1]
        system = np.block([[A, P], [P.T, np.zeros((terms, terms))]])
        solution = np.linalg.solve(system, np.concatenate([values, np.zeros(terms)]))
        self.weights, self.tail = solution[:count], solution[count:]

    def __call__(self, queries):
        radial = self.phi(cdist(queries, self.points)) @ self.weights
        return radial + monomials((queries - self.centre) / self.radius, self.degree) @ self.tail


class PartitionOfUnity:
    """Boxes halved until there are enough of them, a ball around each, Wendland's weight and Shepard's sum."""

    def __init__(self, points, values, halvings, phi, degree, diagonal_per_point):
        boxes = [np.array([points.min(axis=0), points.max(axis=0)])]
        for _ in range(halvings):
            boxes = [half for box in boxes for half in halve(box)]
        tree = cKDTree(points)
        self.parts = []
        for low, high in boxes:
            centre, radius = (low + high) / 2, OVERLAP * np.linalg.norm(high - low) / 2
            rows = tree.query_ball_point(centre, radius)
            ball = centre, radius
            self.parts.append(Subdomain(points[rows], values[rows], ball, phi, degree, diagonal_per_point))

    def __call__(self, queries):
        tree = cKDTree(queries)
        top, bottom = np.zeros(len(queries)), np.zeros(len(queries))
        for part in self.parts:
            rows = np.array(tree.query_ball_point(part.centre, part.radius), dtype=int)
            for start in range(0, len(rows), BLOCK):
                some = rows[start : start + BLOCK]
                tau = np.minimum(np.linalg.norm(queries[some] - part.centre, axis=1) / part.radius, 1.0)
                weight = (1 - tau) ** 4 * (4 * tau + 1)
                top[some] += weight * part(queries[some])
                bottom[some] += weight
        return top / bottom


def halve(box):
    axis = int(np.argmax(box[1] - box[0]))
    middle = box.mean(axis=0)[axis]
    lower, upper = box.copy(), box.copy()
    lower[1, axis] = upper[0, axis] = middle
    return lower, upper


def fit_micro(points, values, halvings=7):
    """128 subdomains of r³ with a tail of degree 2, ρ = 3e-5."""
    return PartitionOfUnity(points, values, halvings, cubic, 2, RHO_MICRO * 96 * math.pi)


def fit_height(plane, heights):
    """4 subdomains of r² log r with a tail of degree 1, ρ = 400 square micrometres."""
    return PartitionOfUnity(plane, heights, 2, thin_plate, 1, RHO_HEIGHT * 8 * math.pi)


class Frame:
    """The leaf coordinates of appendix A, past its ends clamped: axis and normals are cubic splines in arc length."""

    def __init__(self, scan, control, radius):
        rough = CubicSpline(np.arange(len(control)), control)
        fine = np.linspace(0, len(control) - 1, 100 * len(control))
        lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(rough(fine), axis=0), axis=1))])
        t = np.interp(np.arange(len(control)), fine, lengths)
        normals = []
        tree = cKDTree(scan)
        for point in control:
            near = tree.query_ball_point(point, radius)
            if len(near) < 10:  # a hole in the scan, of which the paper says nothing
                near = tree.query(point, 30)[1]
            _, directions = np.linalg.eigh(np.cov(scan[near].T))
            normal = directions[:, 0]
            normals.append(normal if not normals or normal @ normals[-1] > 0 else -normal)
        self.axis, self.normal, self.end = CubicSpline(t, control), CubicSpline(t, np.array(normals)), t[-1]

    def frames(self, t):
        along = self.axis(t, 1)
        along /= np.linalg.norm(along, axis=1)[:, None]
        up = self.normal(t)
        up -= np.sum(up * along, axis=1)[:, None] * along
        up /= np.linalg.norm(up, axis=1)[:, None]
        return along, np.cross(up, along), up

    def to_leaf(self, x):
        """Algorithm 2: the closest point of the axis, seeded by samples and refined by Newton's method."""
        samples = np.linspace(0, self.end, 2000)
        t = samples[cKDTree(self.axis(samples)).query(x)[1]]
        for _ in range(20):
            off, slope, bend = self.axis(t) - x, self.axis(t, 1), self.axis(t, 2)
            t -= np.sum(off * slope, axis=1) / (np.sum(slope**2, axis=1) + np.sum(off * bend, axis=1))
            t = np.clip(t, 0, self.end)
        _, across, up = self.frames(t)
        off = x - self.axis(t)
        return np.column_stack([t, np.sum(off * across, axis=1), np.sum(off * up, axis=1)])

    def to_world(self, y):
        _, across, up = self.frames(y[:, 0])
        return self.axis(y[:, 0]) + y[:, 1:2] * across + y[:, 2:] * up


class AlphaShape:
    """Delaunay triangles with a circumradius of at most α."""

    def __init__(self, plane, alpha):
        self.delaunay = Delaunay(plane)
        a, b, c = np.moveaxis(plane[self.delaunay.simplices], 1, 0)
        sides = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]
        area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        self.kept = np.append(np.prod(sides, axis=0) / (4 * area) <= alpha, False)

    def contains(self, plane):
        return self.kept[self.delaunay.find_simplex(plane)]


CORNERS = np.array(list(product((0, 1), repeat=3)))
TETRAHEDRA = [(0, a, a | b, 7) for a, b in ((4, 2), (4, 1), (2, 4), (2, 1), (1, 4), (1, 2))]


def marching_tetrahedra(samples):
    """Return the (n, 3, 3) triangles of the zero set over six tetrahedra a cell, in lattice coordinates."""
    found = []
    size = np.array(samples.shape) - 1
    for i in range(size[0]):
        cells = np.stack(np.meshgrid([i], np.arange(size[1]), np.arange(size[2]), indexing="ij"), -1).reshape(-1, 3)
        corners = cells[:, None] + CORNERS
        values = samples[tuple(np.moveaxis(corners, -1, 0))]
        for tetrahedron in TETRAHEDRA:
            f, x = values[:, tetrahedron], corners[:, tetrahedron].astype(float)
            inside = f > 0
            for case in range(1, 15):
                flags = np.array([(case >> k) & 1 for k in range(4)], dtype=bool)
                rows = np.all(inside == flags, axis=1)
                if rows.any():
                    found.append(cut(f[rows], x[rows], np.flatnonzero(flags), np.flatnonzero(~flags)))
    return np.concatenate(found)


def cut(f, x, ins, outs):
    """Return the one or two triangles of tetrahedra with these corners inside and outside."""

    def crossing(a, b):
        share = f[:, a] / (f[:, a] - f[:, b])
        return x[:, a] + share[:, None] * (x[:, b] - x[:, a])

    if len(ins) == 2:
        p, q, r, s = (crossing(a, b) for a, b in product(ins, outs))
        return np.concatenate([np.stack([p, q, s], 1), np.stack([p, s, r], 1)])
    return np.stack([crossing(a, b) for a, b in product(ins, outs)], 1)
