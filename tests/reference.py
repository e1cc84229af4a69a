"""Literal, slow twins of the fast code: the paper's equations as they are printed, in plain NumPy.

Nothing here is shared with the package. Systems are dense saddle points, sums are loops over balls,
membership is a comparison of all distances. A twin is to be read beside the paper, not to be fast.
"""

import itertools
import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np

# φ by its power of r, with the sign of SciPy and of the conditionally positive definite side.
PHI = {
    1: lambda r: -r,
    2: lambda r: _times_log(r, r**2),
    3: lambda r: r**3,
    4: lambda r: -_times_log(r, r**4),
    5: lambda r: -(r**5),
    6: lambda r: _times_log(r, r**6),
    7: lambda r: r**7,
}


def _times_log(r, factor):
    return np.where(r > 0, factor * np.log(np.where(r > 0, r, 1)), 0)


def theta(m, d):
    """Return the signed θ of the polyharmonic spline, as the paper prints it below its equation (1)."""
    if (2 * m - d) % 2 == 0:
        return (-1) ** (d // 2 + 1 + m) / (
            2 ** (2 * m - 1) * math.pi ** (d / 2) * math.factorial(m - 1) * math.factorial(m - d // 2)
        )
    return math.gamma(d / 2 - m) / (2 ** (2 * m) * math.pi ** (d / 2) * math.factorial(m - 1))


def powers(d, degree):
    """Return the exponents of all monomials in d variables of total degree up to `degree`."""
    return [p for p in itertools.product(range(degree + 1), repeat=d) if sum(p) <= degree]


def polynomials(points, degree):
    """Return P_ik = p_k(x_i)."""
    columns = [np.prod(points ** np.array(p), axis=1) for p in powers(points.shape[1], degree)]
    return np.array(columns).reshape(len(columns), len(points)).T


def distances(a, b):
    """Return |a_i − b_j| for all pairs."""
    return np.sqrt(((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2))


@dataclass
class Spline:
    """The solution of the paper's equation (2), with the polynomials about `origin` in units of `length`."""

    points: np.ndarray
    power: int
    degree: int
    origin: np.ndarray
    length: float
    lam: np.ndarray
    a: np.ndarray

    def __call__(self, x):
        """Return Σ λ_j φ(|x − x_j|) + Σ a_k p_k(x)."""
        tail = polynomials((x - self.origin) / self.length, self.degree)
        return PHI[self.power](distances(x, self.points)) @ self.lam + tail @ self.a


def radial_derivatives(power, r):
    """Return φ′(r) and φ″(r) for r > 0, φ as in `PHI`."""
    sign = (-1) ** (power // 2 + 1)
    first, second = power * r ** (power - 1), power * (power - 1) * r ** (power - 2)
    if power % 2 == 0:
        first, second = first * np.log(r) + r ** (power - 1), second * np.log(r) + (2 * power - 1) * r ** (power - 2)
    return sign * first, sign * second


def radial_jet(offsets, first, second):
    """Return gradient and Hessian of a function f(|y|), f′(0) = 0, at the vectors y (n, d), from f′ and f″ of a length.

    Hess f = f″ y yᵀ/r² + (f′/r)(I − y yᵀ/r²), and f″(0) I at y = 0.
    """
    d = offsets.shape[1]
    gradients, hessians = np.zeros((len(offsets), d)), np.zeros((len(offsets), d, d))
    for row, y in enumerate(offsets):
        r = math.sqrt(y @ y)
        if r > 0:
            along = np.outer(y, y) / r**2
            gradients[row] = first(r) * y / r
            hessians[row] = second(r) * along + first(r) / r * (np.eye(d) - along)
        else:
            hessians[row] = second(0.0) * np.eye(d)
    return gradients, hessians


def spline_jet(spline, x):
    """Return value, gradient and Hessian of a `Spline` of r³ or smoother at one point x (d,)."""

    def slope(r):
        return radial_derivatives(spline.power, r)[0]

    def bend(r):
        return radial_derivatives(spline.power, r)[1] if r > 0 else 0.0

    gradients, hessians = radial_jet(x - spline.points, slope, bend)
    gradient, hessian = spline.lam @ gradients, np.tensordot(spline.lam, hessians, 1)
    z = (x - spline.origin) / spline.length
    for factor, power in zip(spline.a, np.array(powers(len(x), spline.degree), dtype=float), strict=True):
        for a, one in enumerate(np.eye(len(x))):
            gradient[a] += factor * power[a] * np.prod(z ** np.maximum(power - one, 0)) / spline.length
            for b, other in enumerate(np.eye(len(x))):
                twice = power[a] * (power - one)[b] * np.prod(z ** np.maximum(power - one - other, 0))
                hessian[a, b] += factor * twice / spline.length**2
    return spline(x[None])[0], gradient, hessian


def weight_jet(y, radius):
    """Return value, gradient and Hessian of Wendland's weight of a ball at the vector y from its centre."""

    def slope(r):
        return -20 * r / radius**2 * max(1 - r / radius, 0) ** 3

    def bend(r):
        return (80 * r / radius - 20) / radius**2 * max(1 - r / radius, 0) ** 2

    gradients, hessians = radial_jet(y[None], slope, bend)
    return wendland(math.sqrt(y @ y) / radius), gradients[0], hessians[0]


def blended_jets(queries, centres, radii, local):
    """Return values, gradients and Hessians of Σ w_i F_i / Σ w_i = N/W by Leibniz's rule, a query at a time."""
    values, gradients, hessians = [], [], []
    for x in queries:
        d = len(x)
        N, gN, hN, W, gW, hW = 0.0, np.zeros(d), np.zeros((d, d)), 0.0, np.zeros(d), np.zeros((d, d))
        for centre, radius, fit in zip(centres, radii, local, strict=True):
            if math.dist(x, centre) < radius:
                w, gw, hw = weight_jet(x - centre, radius)
                f, gf, hf = spline_jet(fit, x)
                N, W = N + w * f, W + w
                gN, gW = gN + gw * f + w * gf, gW + gw
                hN, hW = hN + hw * f + np.outer(gw, gf) + np.outer(gf, gw) + w * hf, hW + hw
        g = gN / W - N / W**2 * gW
        values.append(N / W)
        gradients.append(g)
        hessians.append(hN / W - (np.outer(g, gW) + np.outer(gW, g)) / W - N / W**2 * hW)
    return np.array(values), np.array(gradients), np.array(hessians)


def solve_spline(points, values, power, degree, diagonal=0.0):
    """Solve (A + s I) λ + P a = f, Pᵀ λ = 0 as one dense saddle-point system."""
    origin = points.mean(axis=0)
    length = np.abs(points - origin).max() or 1.0
    A = PHI[power](distances(points, points)) + diagonal * np.eye(len(points))
    P = polynomials((points - origin) / length, degree)
    zero = np.zeros((P.shape[1], P.shape[1]))
    right = np.concatenate([values, np.zeros((P.shape[1], *np.shape(values)[1:]))])
    solution = np.linalg.solve(np.block([[A, P], [P.T, zero]]), right)
    return Spline(points, power, degree, origin, length, solution[: len(points)], solution[len(points) :])


def influence_matrix(points, power, degree, diagonal):
    """Return H with F(x_i) = Σ_j H_ij f_j, one fit for each unit vector."""
    return solve_spline(points, np.eye(len(points)), power, degree, diagonal)(points)


def gcv(points, values, power, degree, diagonal, weights=1.0):
    """Return Wahba's score (1/N) |W^½ (I − H) f|² / ((1/N) tr(I − H))², with D = W⁻¹ `diagonal`."""
    rest = np.eye(len(points)) - influence_matrix(points, power, degree, diagonal / weights)
    return np.mean(weights * (rest @ values) ** 2) / (np.trace(rest) / len(points)) ** 2


def left_out(points, values, power, degree, diagonal):
    """Return the error at each point of the spline through all the others, `diagonal` a number or one a point."""
    diagonal, errors = np.broadcast_to(diagonal, len(points)), np.empty(len(points))
    for j in range(len(points)):
        rest = np.arange(len(points)) != j
        errors[j] = values[j] - solve_spline(points[rest], values[rest], power, degree, diagonal[rest])(points[[j]])[0]
    return errors


def wendland(tau):
    """Return (1 − τ)⁴ (4τ + 1), 0 beyond τ = 1."""
    return (1 - tau) ** 4 * (4 * tau + 1) if tau <= 1 else 0.0


def members(points, centre, radius, least):
    """Return the points in a ball, or its `least` nearest ones where it holds fewer."""
    distance = np.sqrt(((points - centre) ** 2).sum(axis=1))
    inside = np.flatnonzero(distance <= radius)
    return inside if len(inside) >= least else np.sort(np.argsort(distance, kind="stable")[:least])


def partition_of_unity(queries, centres, radii, local, shifts=None):
    """Return Σ w_i F_i / Σ w_i, one query and one (shifted) ball at a time.

    With `shifts`, the balls and their local fits are copied and displaced: the paper's Algorithm 1,
    with F_i(z − s) as in the equation above it.
    """
    shifts = np.zeros((1, queries.shape[1])) if shifts is None else shifts
    result = np.empty(len(queries))
    for row, z in enumerate(queries):
        top = bottom = 0.0
        for s in shifts:
            for centre, radius, fit in zip(centres, radii, local, strict=True):
                w = wendland(math.dist(z - s, centre) / radius)
                if w > 0:
                    top += w * fit((z - s)[None])[0]
                    bottom += w
        result[row] = top / bottom
    return result


def difference(function, x, step=1e-4):
    """Return the central differences of fourth order of `function` at the rows of x, (n, d)."""

    def along(e):
        return (8 * (function(x + e) - function(x - e)) - (function(x + 2 * e) - function(x - 2 * e))) / (12 * step)

    return np.array([along(e) for e in step * np.eye(x.shape[1])]).T


# --- mesh: triangles that meet ---


def meet(first, second):
    """Say whether two triangles, (3, 3) corners, share a point outside the corner or edge that they have in common.

    The first is cut, in exact fractions, by the plane of the second and then by its three edges; the corners of what
    is left are common corners, or the triangles meet elsewhere. Two triangles on the same places meet.
    """
    a, b = ([tuple(map(Fraction, corner)) for corner in triangle.tolist()] for triangle in (first, second))
    normal = _cross(_minus(b[1], b[0]), _minus(b[2], b[0]))
    left = _cut(_cut(a, normal, b[0]), _minus((0, 0, 0), normal), b[0])
    for i in range(3):
        left = _cut(left, _cross(normal, _minus(b[(i + 1) % 3], b[i])), b[i])
    common = set(a) & set(b)
    return len(common) == 3 or not set(left) <= common


def _cut(polygon, normal, origin):
    """Return the part of a convex polygon with normal · (x − origin) >= 0 (Sutherland & Hodgman 1974)."""
    heights, kept = [_dot(normal, _minus(point, origin)) for point in polygon], []
    for i, point in enumerate(polygon):
        before, height = heights[i - 1], heights[i]
        if before * height < 0:
            share = before / (before - height)
            kept.append(tuple(p + share * (q - p) for p, q in zip(polygon[i - 1], point, strict=True)))
        if height >= 0:
            kept.append(point)
    return kept


def _minus(a, b):
    return tuple(p - q for p, q in zip(a, b, strict=True))


def _dot(a, b):
    return sum(p * q for p, q in zip(a, b, strict=True))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def is_line(triangle):
    """Say whether the (3, 3) corners of a triangle are in one line, exactly."""
    a, b, c = (tuple(map(Fraction, corner)) for corner in triangle.tolist())
    return not any(_cross(_minus(b, a), _minus(c, a)))


def plane_side(a, b, c, d):
    """Return the sign of det(a − d, b − d, c − d) in fractions."""
    a, b, c, d = (tuple(map(Fraction, point)) for point in (a, b, c, d))
    return int(np.sign(_dot(_minus(a, d), _cross(_minus(b, d), _minus(c, d)))))


# --- mesh: what is beside what ---


def edge_triangles(triangles):
    """Return for each edge, a set of vertices, the triangles on it, once for each side that they have there."""
    found = {}
    for row, corners in enumerate(triangles.tolist()):
        for i in range(3):
            found.setdefault(frozenset((corners[i], corners[(i + 1) % 3])), []).append(row)
    return found


def fans(triangles, vertex):
    """Return the number of pieces of a vertex's link: its neighbours, joined where a triangle has both."""
    pieces = []
    for corners in triangles.tolist():
        if vertex in corners:
            link = set(corners) - {vertex}
            touching = [piece for piece in pieces if piece & link]
            pieces = [piece for piece in pieces if not piece & link] + [link.union(*touching)]
    return len(pieces)


def smallest_angle(a, b, c):
    """Return the smallest angle of a triangle in degrees, by the law of cosines in 40 digits."""
    with localcontext() as context:
        context.prec = 40
        a, b, c = (tuple(map(Decimal, corner.tolist())) for corner in (a, b, c))
        squares = sorted(_dot(_minus(p, q), _minus(p, q)) for p, q in ((a, b), (b, c), (c, a)))
        cosine = (squares[1] + squares[2] - squares[0]) / (2 * (squares[1] * squares[2]).sqrt())
        # The sine keeps what the cosine of a small angle has lost in float64.
        return math.degrees(math.asin(float((1 - cosine**2).sqrt())))


# --- remeshing: edits of triangles by name ---


def collapsed(triangles, v, w):
    """Return the triangles (m, 3) with vertex v drawn to w: those that had both are gone."""
    moved = np.where(triangles == v, w, triangles)
    return moved[[len(set(corners)) == 3 for corners in moved.tolist()]]


def flipped(triangles, a, b, c, d):
    """Return the triangles with abc and bad swapped for adc and dbc."""
    gone = [frozenset((a, b, c)), frozenset((b, a, d))]
    kept = [corners for corners in triangles.tolist() if frozenset(corners) not in gone]
    return np.array([*kept, [a, d, c], [d, b, c]])


def halved(triangles, a, b, v):
    """Return the triangles with a vertex v put onto the edge ab."""
    found = []
    for corners in triangles.tolist():
        if {a, b} <= set(corners):
            found += [[v if x == b else x for x in corners], [v if x == a else x for x in corners]]
        else:
            found.append(corners)
    return np.array(found)


def is_same_kind(before, after, vertices):
    """Say whether triangles are a manifold with the border, and Euler's number, of those before, and so many vertices.

    Manifold: no two triangles have the same corners, no two run along an edge in one direction, and the triangles
    around each vertex are one fan.
    """
    if len({frozenset(corners) for corners in after.tolist()}) < len(after) or border(after) != border(before):
        return False
    numbers = [len(np.unique(part)) - len(edge_triangles(part)) + len(part) for part in (before, after)]
    runs = {(corners[i - 1], corners[i]) for corners in after.tolist() for i in range(3)}
    names = np.unique(after)
    return (
        numbers[0] == numbers[1]
        and len(names) == vertices
        and len(runs) == 3 * len(after)
        and all(fans(after, v) == 1 for v in names)
    )


def border(triangles):
    """Return the edges of one triangle."""
    return {edge for edge, rows in edge_triangles(triangles).items() if len(rows) == 1}


def score(corners, normals):
    """Return the least of the sines of triangles' angles, (m, 3, 3), and of half of 1 + cos of turns (k, 2, 3)."""
    sides = np.roll(corners, -1, axis=1) - corners
    double = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    lengths = np.linalg.norm(sides, axis=2)
    sines = [double / (lengths[:, i] * lengths[:, i - 1]) for i in range(3)]
    u, v = np.moveaxis(np.reshape(normals, (-1, 2, 3)), 1, 0)
    turns = (1 + np.sum(u * v, axis=1) / (np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1))) / 2
    return min(np.min(sines), *turns, 1.0)


def hermite_functions(points, normals, power, degree, ridge, origin, length):
    """Return F and the matrix of the saddle point: λ_i F = 0 and ∂_a F = −n at the points, one unknown each.

    The functionals are L = δ_x and ∂_a δ_x in turn; entry (i, j) is L_i L_j φ(x − y), each derivative by y turning the
    sign. `ridge` (2,) stands on the diagonal of values and of slopes.
    """
    n, d = points.shape

    def columns(x):
        """φ(x − x_j), then −∂_a φ(x − x_j), at one x; and the same differentiated by x."""
        offsets = x - points
        slope, bend = (lambda r: radial_derivatives(power, r)[0]), (lambda r: radial_derivatives(power, r)[1])
        gradients, hessians = radial_jet(offsets, slope, lambda r: bend(r) if r > 0 else 0.0)
        values = np.r_[PHI[power](np.linalg.norm(offsets, axis=1)), -gradients.T.ravel()]
        slopes = [np.r_[gradients[:, a], -hessians[:, a].T.ravel()] for a in range(d)]
        return values, np.array(slopes)

    def tail(x):
        z = (x - origin) / length
        down = [
            [p[a] * np.prod(z ** np.maximum(np.array(p) - np.eye(d, dtype=int)[a], 0)) / length for a in range(d)]
            for p in powers(d, degree)
        ]
        return polynomials(z[None], degree)[0], np.array(down).T

    at = [columns(x) for x in points]
    A = np.concatenate([[a[0] for a in at], *[[a[1][axis] for a in at] for axis in range(d)]])
    tails = [tail(x) for x in points]
    P = np.concatenate([[t[0] for t in tails], *[[t[1][axis] for t in tails] for axis in range(d)]])
    A = A + np.diag(np.r_[np.full(n, ridge[0]), np.full(d * n, ridge[1])])
    q = P.shape[1]
    right = np.r_[np.zeros(n), -normals.T.ravel(), np.zeros(q)]
    solution = np.linalg.solve(np.block([[A, P], [P.T, np.zeros((q, q))]]), right)
    return lambda x: columns(x)[0] @ solution[: (1 + d) * n] + tail(x)[0] @ solution[(1 + d) * n :]


def blended_functions(queries, centres, radii, functions):
    """Return Σ w_i F_i / Σ w_i at the queries, for any functions of one point."""
    found = []
    for x in queries:
        weights = [wendland(math.dist(x, c) / r) for c, r in zip(centres, radii, strict=True)]
        held = [(w, f(x)) for w, f in zip(weights, functions, strict=True) if w > 0]
        found.append(sum(w * value for w, value in held) / sum(w for w, _ in held))
    return np.array(found)
