"""The compiled solution of one local system, on the null space of the tail's transpose.

Householder reflectors turn the tail P into a triangle; what they make of A + D on the rest of the
space is positive definite, and Cholesky does the rest. Unit coordinates as in `loops.py`.
"""

import math

import numpy as np
from numba import njit

from o3dleaf.rbf.loops import REASSOCIATE, dot, monomial, put, radial_values, squared_distances

RANK_TOLERANCE = 1e-8
"""Singular values of the tail below this share of the largest count as zero: data that lie on a plane
(or a quadric) to within rounding at coordinates 10⁶ times the ball's size."""

SURE = 1e6
"""Bound on the condition of a tail below which its rank is full without a look at its singular values."""

ROWS = 64
"""Rows of a tall system that are reduced at once: with the triangle they stay in the nearest cache."""

TILE = 16
"""Rows and columns of a matrix that are transposed at once."""

SINGULAR = 3e-14
"""Share of the trace below which an eigenvalue is rounding: coinciding points leave at most half of this,
points 10⁻⁶ of the ball apart leave five times as much."""


@njit(nogil=True, cache=True)
def radial_matrix(points, power):
    """Return A with A_ij = φ(|z_i − z_j|), symmetric, zero on the diagonal."""
    count = points.shape[1]
    matrix = np.zeros((count, count))
    z, squared = np.empty(points.shape[0]), np.empty(count)
    for i in range(count):
        for axis in range(z.size):
            z[axis] = points[axis, i]
        # Not in place: the compiler cannot tell that one entry needs no other, and takes them one by one.
        squared_distances(z, points, i, squared)
        radial_values(power, squared, i, matrix[i])
    mirror(matrix)
    return matrix


@njit(nogil=True, cache=True)
def mirror(matrix):
    """Write what is below the diagonal above it, in tiles that stay in the nearest cache."""
    count = len(matrix)
    for top in range(0, count, TILE):
        for left in range(0, top + 1, TILE):
            for i in range(top, min(top + TILE, count)):
                for j in range(left, min(left + TILE, i)):
                    matrix[j, i] = matrix[i, j]


@njit(nogil=True, cache=True)
def tail_matrix(points, exponents):
    """Return P with P_ik = p_k(z_i)."""
    count = points.shape[1]
    matrix = np.empty((count, len(exponents)))
    z = np.empty(points.shape[0])
    for i in range(count):
        for axis in range(z.size):
            z[axis] = points[axis, i]
        for k in range(len(exponents)):
            matrix[i, k] = monomial(z, exponents[k])
    return matrix


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def householder(matrix):
    """Factor `matrix` (n, q) = Q R in place: R above, reflectors I − β v vᵀ below; return (v rows, β)."""
    count, columns = matrix.shape
    steps = min(count, columns)
    vectors = np.zeros((steps, count))
    betas = np.zeros(steps)
    for k in range(steps):
        norm = 0.0
        for i in range(k, count):
            norm += matrix[i, k] * matrix[i, k]
        norm = math.sqrt(norm)
        if norm == 0.0:
            continue
        pivot = -norm if matrix[k, k] > 0.0 else norm
        for i in range(k, count):
            vectors[k, i] = matrix[i, k]
        vectors[k, k] -= pivot
        length = 0.0
        for i in range(k, count):
            length += vectors[k, i] * vectors[k, i]
        betas[k] = 2.0 / length
        for column in range(k, columns):
            product = 0.0
            for i in range(k, count):
                product += vectors[k, i] * matrix[i, column]
            product *= betas[k]
            for i in range(k, count):
                matrix[i, column] -= product * vectors[k, i]
    return vectors, betas


@njit(nogil=True, cache=True)
def natural_monomials(points, exponents):
    """Return the (q, q) coefficients of √(|α|!/α!) (z − z̄)^α in the monomials z^α, one column each, z̄ the points' mean.

    Turning the points about their mean turns these monomials of a degree orthogonally among
    themselves, and where the centre of the ball lies has no part in them.
    """
    count, dimension = exponents.shape
    frame = np.empty((count, count))
    mean = np.empty(dimension)
    for axis in range(dimension):
        mean[axis] = np.mean(points[axis])
    for k in range(count):
        scale, total = 1.0, 0
        for exponent in exponents[k]:
            for step in range(1, exponent + 1):
                total += 1
                scale *= math.sqrt(total / step)
        for row in range(count):
            value = scale
            for axis in range(dimension):
                high, low = exponents[k, axis], exponents[row, axis]
                for step in range(low):
                    value *= (high - step) / (step + 1)
                for _ in range(high - low):
                    value *= -mean[axis]
            frame[row, k] = value
    return frame


@njit(nogil=True, cache=True)
def restrict_tail(tail, frame):
    """Return (reflectors, β, R, basis): the tail reduced to a rank-revealing basis on its points.

    `basis` (q, r) turns coefficients of the reduced tail into coefficients of the monomials. It is
    the identity for a tail of full rank; else it is spanned by the right singular vectors of P in
    the `natural_monomials` (the columns of `frame`) with singular values above `RANK_TOLERANCE`.
    Then the fit does not depend on how the plane that holds the points is turned, and what they do
    not tell is zero: across the plane the tail is constant.
    """
    columns = tail.shape[1]
    factored = tail.copy()
    vectors, betas = householder(factored)
    rank, basis = columns, np.eye(columns)
    steps = min(tail.shape[0], columns)
    if columns > steps or not norm(factored) * inverse_norm(factored) * norm(frame) * inverse_norm(frame) < SURE:
        _, singular, rows = np.linalg.svd(upper(factored[:steps]) @ frame, False)
        rank = 0
        for value in singular:
            if value > RANK_TOLERANCE * singular[0]:
                rank += 1
        if rank < columns:
            basis = frame @ np.ascontiguousarray(rows[:rank].T)
            factored = tail @ basis
            vectors, betas = householder(factored)
    return vectors, betas, upper(factored[:rank, :rank]), basis


@njit(nogil=True, cache=True)
def upper(matrix):
    """Return `np.triu` of a matrix, which Numba compiles for seconds."""
    found = np.zeros(matrix.shape)
    for i in range(matrix.shape[0]):
        for j in range(i, matrix.shape[1]):
            found[i, j] = matrix[i, j]
    return found


@njit(nogil=True, cache=True)
def norm(triangle):
    """Return the Frobenius norm of the square upper triangle R at the top of an array."""
    return math.sqrt(np.sum(upper(triangle[: triangle.shape[1]]) ** 2))


@njit(nogil=True, cache=True, error_model="numpy")
def inverse_norm(triangle):
    """Return the Frobenius norm of R⁻¹, the square upper triangle R at the top of an array; infinite or NaN for none.

    |R| |R⁻¹| is no less than the quotient of the extreme singular values: a full rank is told without them.
    """
    size = triangle.shape[1]
    column, total = np.empty(size), 0.0
    for at in range(size):
        for k in range(at, -1, -1):
            column[k] = 1.0 if k == at else 0.0
            for j in range(k + 1, at + 1):
                column[k] -= triangle[k, j] * column[j]
            column[k] /= triangle[k, k]
            total += column[k] * column[k]
    return math.sqrt(total)


@njit(nogil=True, cache=True)
def block_reflector(vectors, betas):
    """Return the (q, q) upper triangle T of the product I − Yᵀ T Y of the reflectors, the first one leftmost.

    Y are the rows `vectors` (Schreiber and Van Loan 1989).
    """
    triangle, products = np.diag(betas), vectors @ vectors.T
    for k in range(len(betas)):
        for i in range(k):
            triangle[i, k] = -betas[k] * dot(triangle[i, i:k], products[i:k, k], k - i)
    return triangle


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def reflect_both_sides(matrix, vectors, betas, forward):
    """Replace the symmetric `matrix` by Qᵀ A Q (forward) or Q A Qᵀ, all reflectors at once.

    With S = T (forward) or Tᵀ, see `block_reflector`, it is A − Yᵀ W − Wᵀ Y, W = Z − ½ Sᵀ (Y Zᵀ) Y, Z = Sᵀ Y A.
    """
    steps, count = vectors.shape
    if steps == 0:
        return
    triangle = block_reflector(vectors, betas)
    turned = np.ascontiguousarray(triangle.T) if forward else triangle
    images = turned @ (vectors @ matrix)
    images -= 0.5 * (turned @ (vectors @ images.T)) @ vectors
    for i in range(count):
        row = matrix[i]
        for k in range(0, steps - 1, 2):
            # Two at a time: half of the loads and stores.
            v, w, other, image = vectors[k], images[k], vectors[k + 1], images[k + 1]
            vi, wi, other_i, image_i = v[i], w[i], other[i], image[i]
            for j in range(i + 1):
                row[j] -= vi * w[j] + wi * v[j] + other_i * image[j] + image_i * other[j]
        if steps % 2:
            v, w = vectors[steps - 1], images[steps - 1]
            for j in range(i + 1):
                row[j] -= v[i] * w[j] + w[i] * v[j]
    mirror(matrix)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def reflect(vector, vectors, betas, forward):
    """Replace `vector` by Qᵀ x (forward) or by Q x (backward)."""
    steps, count = vectors.shape
    for step in range(steps):
        k = step if forward else steps - 1 - step
        scale = betas[k] * dot(vectors[k], vector, count)
        for i in range(count):
            vector[i] -= scale * vectors[k, i]


@njit(nogil=True, cache=True)
def cholesky(matrix):
    """Return the lower factor, and whether the matrix was fit for it."""
    lower = matrix
    try:
        lower = np.linalg.cholesky(matrix)
    except Exception:  # noqa: BLE001 - Numba knows this one class only; it is LinAlgError
        return lower, False
    least = SINGULAR * np.trace(matrix)
    for i in range(len(matrix)):
        if lower[i, i] * lower[i, i] <= least:
            return lower, False
    return lower, True


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def cholesky_solve(matrix, right):
    """Solve the positive definite system in place of `right`; return whether it was fit for it."""
    count = len(matrix)
    lower, fit = cholesky(matrix)
    if not fit:
        return False
    for i in range(count):
        right[i] = (right[i] - dot(lower[i], right, i)) / lower[i, i]
    for i in range(count - 1, -1, -1):
        right[i] /= lower[i, i]
        for j in range(i):
            right[j] -= lower[i, j] * right[i]
    return True


@njit(nogil=True, cache=True)
def solve_positive(matrix, right):
    """Solve the positive semi-definite system in place of `right`; return how many directions it left out.

    Coinciding points make the matrix singular, each in the direction of their difference. Without
    it their weights come out equal, and the fit goes through their mean: the limit of a vanishing
    smoothing.
    """
    if len(matrix) == 0 or cholesky_solve(matrix, right):
        return 0
    eigenvalues, vectors = np.linalg.eigh(matrix)
    coefficients = np.ascontiguousarray(vectors.T) @ right
    least, dropped = SINGULAR * np.trace(matrix), 0
    for i in range(len(matrix)):
        if eigenvalues[i] > least:
            coefficients[i] /= eigenvalues[i]
        else:
            coefficients[i] = 0.0
            dropped += 1
    put(vectors @ coefficients, right)
    return dropped


@njit(nogil=True, cache=True)
def solve_few(matrix, right):
    """Do what `solve_positive` does for a few unknowns, for which calling LAPACK takes longer than solving."""
    count, least, lower = len(matrix), SINGULAR * np.trace(matrix), matrix.copy()
    for i in range(count):
        for j in range(i + 1):
            for k in range(j):
                lower[i, j] -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] /= lower[j, j]
            elif lower[i, i] > least:
                lower[i, i] = math.sqrt(lower[i, i])
            else:
                return solve_positive(matrix, right)
    for i in range(count):
        for k in range(i):
            right[i] -= lower[i, k] * right[k]
        right[i] /= lower[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= lower[k, i] * right[k]
        right[i] /= lower[i, i]
    return 0


@njit(nogil=True, cache=True)
def project(points, exponents, power, diagonal):
    """Return `project_system` of the local system of values at (d, n) points, its matrix radial."""
    matrix = radial_matrix(points, power)
    for i in range(len(matrix)):
        matrix[i, i] += diagonal[i]
    return project_system(matrix, tail_matrix(points, exponents), natural_monomials(points, exponents))


@njit(nogil=True, cache=True)
def project_system(matrix, tail, frame):
    """Return (Qᵀ A Q, reflectors, β, R, basis) of the saddle point of A, overwritten, and P; see `restrict_tail`."""
    vectors, betas, triangle, basis = restrict_tail(tail, frame)
    reflect_both_sides(matrix, vectors, betas, True)
    return matrix, vectors, betas, triangle, basis


@njit(nogil=True, cache=True)
def solve_local(points, values, exponents, power, diagonal):
    """Solve (A + D) λ + P a = f, Pᵀ λ = 0, equation (2) of the paper, on the null space of Pᵀ.

    Parameters
    ----------
    points : (d, n) unit coordinates
    values : (n,)
    exponents : (q, d)
    power : int
    diagonal : (n,)
        D, in unit coordinates: the smoothing, divided by each point's weight.

    Returns
    -------
    weights (n,), tail (q,), rank of P, directions left out
    """
    return solve_projected(values, project(points, exponents, power, diagonal))


@njit(nogil=True, cache=True)
def solve_system(matrix, tail, frame, values):
    """Solve A λ + P a = f, Pᵀ λ = 0 for any A, overwritten, that is positive on the null space of Pᵀ.

    Returns
    -------
    weights (n,), coefficients (q,), rank of P, directions left out
    """
    return solve_projected(values, project_system(matrix, tail, frame))


@njit(nogil=True, cache=True)
def solve_projected(values, projected):
    """Solve what `project_system` made."""
    matrix, vectors, betas, triangle, basis = projected
    count, rank = len(values), len(triangle)
    rotated = values.copy()
    reflect(rotated, vectors, betas, True)
    weights = np.zeros(count)
    put(rotated[rank:], weights[rank:])
    dropped = solve_positive(matrix[rank:, rank:].copy(), weights[rank:])
    reduced = np.empty(rank)
    for k in range(rank):
        reduced[k] = rotated[k] - dot(matrix[k, rank:], weights[rank:], count - rank)
    solve_triangle(triangle, reduced)
    reflect(weights, vectors, betas, False)
    return weights, basis @ reduced, rank, dropped


@njit(nogil=True, cache=True)
def solve_triangle(triangle, right):
    """Solve R x = b, R above the diagonal, in place of `right`."""
    for k in range(len(triangle) - 1, -1, -1):
        for j in range(k + 1, len(triangle)):
            right[k] -= triangle[k, j] * right[j]
        right[k] /= triangle[k, k]


@njit(nogil=True, cache=True)
def reduce_rows(rows, right):
    """Return (q, q) rows and their right-hand side of the same least-squares problem, from a few rows at a time."""
    count, columns = rows.shape
    stack, side = np.zeros((columns + ROWS, columns)), np.zeros(columns + ROWS)
    for start in range(0, count, ROWS):
        filled = columns + min(ROWS, count - start)
        for i in range(columns, filled):
            put(rows[start + i - columns], stack[i])
        put(right[start : start + ROWS], side[columns:filled])
        vectors, betas = householder(stack[:filled])
        reflect(side[:filled], vectors, betas, True)
        for i in range(columns):
            stack[i, :i] = 0.0
    return stack[:columns].copy(), side[:columns].copy()


@njit(nogil=True, cache=True)
def least_squares(rows, frame, right):
    """Return the coefficients with least |P a − b|, of them the least in the norm of `frame`, and the rank of P."""
    rows, right = reduce_rows(rows, right)
    vectors, betas, triangle, basis = restrict_tail(rows, frame)
    reflect(right, vectors, betas, True)
    reduced = right[: len(triangle)].copy()
    solve_triangle(triangle, reduced)
    return basis @ reduced, len(triangle)
