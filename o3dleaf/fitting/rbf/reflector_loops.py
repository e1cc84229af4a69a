"""Compiled Householder reflectors: what makes a tail a triangle, applied to vectors and to both sides of matrices."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot

RANK_TOLERANCE = 1e-8
"""Singular values of the tail below this share of the largest count as zero: data that lie on a plane
(or a quadric) to within rounding at coordinates 10⁶ times the ball's size."""

SURE = 1e6
"""Bound on the condition of a tail below which its rank is full without a look at its singular values."""

TILE = 16
"""Rows and columns of a matrix that are transposed at once."""


@njit(nogil=True, cache=True)
def mirror(matrix):
    """Write what is below the diagonal above it, in tiles that stay in the nearest cache."""
    count = len(matrix)
    for top in range(0, count, TILE):
        for left in range(0, top + 1, TILE):
            for i in range(top, min(top + TILE, count)):
                for j in range(left, min(left + TILE, i)):
                    matrix[j, i] = matrix[i, j]


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
def restrict_tail(tail, frame):
    """Return (reflectors, β, R, basis): the tail reduced to a rank-revealing basis on its points.

    `basis` (q, r) turns coefficients of the reduced tail into coefficients of the monomials. It is
    the identity for a tail of full rank; else it is spanned by the right singular vectors of P in
    the `natural_monomials` (the columns of `frame`) with singular values above `RANK_TOLERANCE`.
    Then the fit does not depend on how the plane of the points is turned, and what they do
    not determine is zero: across the plane the tail is constant.
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
    triangle = np.zeros(matrix.shape)
    for i in range(matrix.shape[0]):
        for j in range(i, matrix.shape[1]):
            triangle[i, j] = matrix[i, j]
    return triangle


@njit(nogil=True, cache=True)
def norm(triangle):
    """Return the Frobenius norm of the square upper triangle R at the top of an array."""
    return math.sqrt(np.sum(upper(triangle[: triangle.shape[1]]) ** 2))


@njit(nogil=True, cache=True, error_model="numpy")
def inverse_norm(triangle):
    """Return the Frobenius norm of R⁻¹, the square upper triangle R at the top of an array; infinite or NaN for none.

    |R| |R⁻¹| is no less than the quotient of the extreme singular values: a full rank is known without them.
    """
    size = triangle.shape[1]
    column, total = np.empty(size), 0.0
    for last in range(size):
        for k in range(last, -1, -1):
            column[k] = 1.0 if k == last else 0.0
            for j in range(k + 1, last + 1):
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
