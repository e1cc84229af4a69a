"""Literal, slow twins of the fast code: the paper's equations as they are printed, in plain NumPy.

Nothing here is shared with the package. Systems are dense saddle points, sums are loops over balls,
membership is a comparison of all distances. A twin is to be read beside the paper, not to be fast.
"""

import itertools
import math
from dataclasses import dataclass

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


def solve_spline(points, values, power, degree, diagonal=0.0):
    """Solve (A + s I) λ + P a = f, Pᵀ λ = 0 as one dense saddle-point system."""
    origin = points.mean(axis=0)
    length = np.abs(points - origin).max() or 1.0
    A = PHI[power](distances(points, points)) + diagonal * np.eye(len(points))
    P = polynomials((points - origin) / length, degree)
    zero = np.zeros((P.shape[1], P.shape[1]))
    right = np.concatenate([values, np.zeros(P.shape[1])])
    solution = np.linalg.solve(np.block([[A, P], [P.T, zero]]), right)
    return Spline(points, power, degree, origin, length, solution[: len(points)], solution[len(points) :])


def influence_matrix(points, power, degree, diagonal):
    """Return H with F(x_i) = Σ_j H_ij f_j, one fit for each unit vector."""
    columns = [solve_spline(points, unit, power, degree, diagonal)(points) for unit in np.eye(len(points))]
    return np.array(columns).T


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
