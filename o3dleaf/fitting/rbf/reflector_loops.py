"""Compiled Householder reflectors: what makes a tail a triangle, applied to vectors and to both sides of matrices."""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot, put

RANK_TOLERANCE = 1e-8
"""Singular values of the tail below this share of the largest count as zero: data that lie on a plane
(or a quadric) to within rounding at coordinates 10⁶ times the ball's size."""

SURE = 1e6
"""Bound on the condition of a tail below which its rank is full without a look at its singular values."""

TILE = 4
"""Rows and columns of a matrix that are transposed at once, in registers."""


@njit(nogil=True, cache=True)
def mirror(matrix):
    """Write what is below the diagonal above it, by tiles whose columns are fetched before they are written as rows."""
    count = len(matrix)
    whole = count - count % TILE
    for i in range(0, whole, TILE):
        a, b, c, d = matrix[i], matrix[i + 1], matrix[i + 2], matrix[i + 3]
        for j in range(0, i, TILE):
            a0, a1, a2, a3 = a[j], a[j + 1], a[j + 2], a[j + 3]
            b0, b1, b2, b3 = b[j], b[j + 1], b[j + 2], b[j + 3]
            c0, c1, c2, c3 = c[j], c[j + 1], c[j + 2], c[j + 3]
            d0, d1, d2, d3 = d[j], d[j + 1], d[j + 2], d[j + 3]
            first, second, third, fourth = matrix[j], matrix[j + 1], matrix[j + 2], matrix[j + 3]
            first[i], first[i + 1], first[i + 2], first[i + 3] = a0, b0, c0, d0
            second[i], second[i + 1], second[i + 2], second[i + 3] = a1, b1, c1, d1
            third[i], third[i + 1], third[i + 2], third[i + 3] = a2, b2, c2, d2
            fourth[i], fourth[i + 1], fourth[i + 2], fourth[i + 3] = a3, b3, c3, d3
        for k in range(i, i + TILE):
            for j in range(i, k):
                matrix[j, k] = matrix[k, j]
    for k in range(whole, count):
        for j in range(k):
            matrix[j, k] = matrix[k, j]


@njit(nogil=True, cache=True)
def householder(matrix):
    """Factor `matrix` (n, q) = Q R: its first rows become R above; return the reflectors I − β v vᵀ, (v rows, β)."""
    count, columns = matrix.shape
    steps = min(count, columns)
    vectors = np.zeros((steps, count))
    betas = np.zeros(steps)
    rest = matrix.T.copy()  # columns as rows: what is summed lies side by side
    for k in range(steps):
        vector = vectors[k]
        put(rest[k, k:], vector[k:])
        norm = math.sqrt(dot(vector, vector, count))
        if norm == 0.0:
            continue
        betas[k] = 1.0 / (norm * (norm + abs(vector[k])))
        vector[k] += norm if vector[k] > 0.0 else -norm
        for m in range(k, columns):
            subtract(vector, betas[k] * dot(vector, rest[m], count), rest[m])
    for i in range(steps):
        put(rest[:, i], matrix[i])
    return vectors, betas


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def subtract(vector, factor, other):
    """Take a multiple of `vector` off the other one."""
    for i in range(vector.size):
        other[i] -= factor * vector[i]


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
    for i in range(0, count - 1, 2):
        # Two rows and two reflectors at a time: fewer loads and stores.
        row, following, end = matrix[i], matrix[i + 1], i + 2
        for k in range(0, steps - 1, 2):
            v, w, other, image = vectors[k], images[k], vectors[k + 1], images[k + 1]
            a, b, c, d = v[i], w[i], other[i], image[i]
            e, f, g, h = v[i + 1], w[i + 1], other[i + 1], image[i + 1]
            for j in range(end):
                vj, wj, other_j, image_j = v[j], w[j], other[j], image[j]
                row[j] -= a * wj + b * vj + c * image_j + d * other_j
                following[j] -= e * wj + f * vj + g * image_j + h * other_j
        if steps % 2:
            v, w = vectors[steps - 1], images[steps - 1]
            for j in range(end):
                row[j] -= v[i] * w[j] + w[i] * v[j]
                following[j] -= v[i + 1] * w[j] + w[i + 1] * v[j]
    if count % 2:
        row = matrix[count - 1]
        for k in range(steps):
            v, w = vectors[k], images[k]
            for j in range(count):
                row[j] -= v[count - 1] * w[j] + w[count - 1] * v[j]
    mirror(matrix)


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def reflect(vector, vectors, betas, forward):
    """Replace `vector` by Qᵀ x (forward) or by Q x (backward)."""
    steps, count = vectors.shape
    for step in range(steps):
        k = step if forward else steps - 1 - step
        subtract(vectors[k], betas[k] * dot(vectors[k], vector, count), vector)
