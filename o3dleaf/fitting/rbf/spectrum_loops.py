"""One symmetric eigen-decomposition of a local system: the fit, its score and its held-out errors for every smoothing.

With weights W, D = s W⁻¹ and λ = W^½ μ, equation (2) is (W^½ A W^½ + s I) μ + W^½ P a = W^½ f, Pᵀ W^½ μ = 0:
symmetric, with s alone on the diagonal. On the null space of the tail U E Uᵀ takes the place of W^½ A W^½.
"""

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import SINGULAR, solve_few
from o3dleaf.fitting.rbf.radial_loops import dot, put
from o3dleaf.fitting.rbf.reflector_loops import reflect
from o3dleaf.fitting.rbf.shared_noise_loops import (
    add_errors,
    count_group,
    held_out,
    inverse,
    judged,
    shared_noise,
    whiten,
    whiten_both_sides,
    whiten_rows,
)
from o3dleaf.fitting.rbf.solve_loops import natural_monomials, project_system, radial_matrix, tail_matrix

ROUNDING = 2e-15
"""Share of the data's norm below which a coefficient is rounding: constants and polynomials leave up to 3e-16."""

LEVERAGE = 1e-12
"""A point whose unit vector keeps less of its square than this beside the tail is needed by the tail."""


@njit(nogil=True, cache=True)
def decompose(points, roots, exponents, power, noise):
    """Return (eigenvalues, eigenvectors, reflectors, β) of W^½ S A S W^½ on the null space of (W^½ S P)ᵀ.

    `roots` are the √w of the points, S is that of their noise, see `shared_noise_loops`. Eigenvalues of rounding size,
    one for each coinciding point, are zero.
    """
    matrix, tail = radial_matrix(points, power), tail_matrix(points, exponents)
    whiten_both_sides(noise, matrix)
    whiten_rows(noise, tail)
    return decompose_system(matrix, tail, natural_monomials(points, exponents), roots)


@njit(nogil=True, cache=True)
def decompose_system(matrix, tail, frame, roots):
    """Return what `decompose` does, of any A and P, which are overwritten."""
    matrix, vectors, betas, triangle, _ = project_weighted(matrix, tail, frame, roots)
    rank = len(triangle)
    eigenvalues, eigenvectors = np.linalg.eigh(matrix[rank:, rank:].copy())
    least = SINGULAR * np.sum(eigenvalues)
    for k in range(eigenvalues.size):
        if eigenvalues[k] <= least:
            eigenvalues[k] = 0.0
    return eigenvalues, eigenvectors, vectors, betas


@njit(nogil=True, cache=True)
def project_weighted(matrix, tail, frame, roots):
    """Return `project_system` of W^½ A W^½ and W^½ P; A and P are overwritten."""
    for i in range(len(roots)):
        row = tail[i]
        row *= roots[i]
        for j in range(len(roots)):
            matrix[i, j] *= roots[i] * roots[j]
    return project_system(matrix, tail, frame)


@njit(nogil=True, cache=True)
def spectra(points, values, roots, exponents, power):
    """Return (eigenvalues e, coefficients c (m, ·) of W^½ f) of a local system with m rows of values (m, n).

    They live on the null space of the tail. With them the residual of smoothing s is Σ (s c/(e + s))², in the
    weighted norm, for every s at once. Coefficients of rounding size are zero.
    """
    noise = shared_noise(np.empty(0, np.int64), 0.0)
    return coefficients_of(values, roots, decompose(points, roots, exponents, power, noise))


@njit(nogil=True, cache=True)
def coefficients_of(values, roots, decomposed):
    """Return (eigenvalues, coefficients) of rows of values (m, n), as `spectra` does, of a decomposed system."""
    eigenvalues, eigenvectors, vectors, betas = decomposed
    transposed, rank = np.ascontiguousarray(eigenvectors.T), len(roots) - len(eigenvalues)
    coefficients = np.empty((len(values), len(eigenvalues)))
    for row in range(len(values)):
        rotated = values[row] * roots
        least = ROUNDING * np.sqrt(np.sum(rotated * rotated))
        reflect(rotated, vectors, betas, True)
        projected = transposed @ rotated[rank:]
        for k in range(projected.size):
            coefficients[row, k] = projected[k] if abs(projected[k]) > least else 0.0
    return eigenvalues, coefficients


@njit(nogil=True, cache=True)
def held_out_squares(decomposed, values, weighted, roots, groups, share, trials, blocks, counts):
    r"""Return Σ w_j e_j² over groups of points left out together, for each trial value of the smoothing, and Σ w_j.

    Row j is of the group that is named by row groups[j] of the ball (−1: by one that is not in it), and only groups
    whose naming row is in the ball count. With B as in `diagnose`, e_I = W_I^{−½} (B_II)⁻¹ (B W^½ f)_I for the rows I
    of a group.

    Parameters
    ----------
    decomposed
        What `decompose` returns.
    values, weighted, roots : (n,)
        f, W^½ S f (see `shared_noise_loops`) and √w.
    groups : (n,) int64
    share : float
        β, the part of the variance that a group has in common: where it is not 0, see `judged`.
    trials : (m,) smoothing in unit coordinates, above 0
    blocks, counts : (g, m, g, g), (g,)
        The s B_II of groups of 1, ..., g rows are added here, and their number.
    """
    eigenvalues, eigenvectors, vectors, betas = decomposed
    count, free = len(values), len(eigenvalues)
    rank = count - free
    basis = np.zeros((free, count))
    for k in range(free):
        put(eigenvectors[:, k], basis[k, rank:])
        reflect(basis[k], vectors, betas, False)
    coefficients = basis @ weighted
    basis = np.ascontiguousarray(basis.T)
    inverses = 1.0 / (eigenvalues.reshape(-1, 1) + trials)
    pulled = (basis * coefficients) @ inverses
    sums = held_out(trials.size)
    for name in range(count):
        rows = np.flatnonzero(groups == name)
        if groups[name] != name or count - rows.size < 2 * rank:
            continue
        readings, weight = count_group(rows, name, values, roots, share, sums), roots[name] ** 2
        block = group_blocks(basis[rows], inverses)
        if rows.size <= counts.size:
            counts[rows.size - 1] += 1
            for k in range(trials.size):
                blocks[rows.size - 1, k, : rows.size, : rows.size] += trials[k] * block[k]
        for k in range(trials.size):
            right = pulled[rows, k]
            solve_few(block[k], right)
            add_errors(right, rows.size, weight, readings, share, sums, k)
    return judged(sums)


@njit(nogil=True, cache=True)
def group_blocks(basis, inverses):
    """Return the (m, g, g) blocks Σ_k u_ik u_jk / (e_k + s) of the rows (g, n) of the basis, for each of m columns."""
    size, free = basis.shape
    products, row = np.empty((size * (size + 1) // 2, free)), 0
    for i in range(size):
        for j in range(i + 1):
            for k in range(free):
                products[row, k] = basis[i, k] * basis[j, k]
            row += 1
    entries, row = products @ inverses, 0
    block = np.empty((inverses.shape[1], size, size))
    for i in range(size):
        for j in range(i + 1):
            block[:, i, j] = block[:, j, i] = entries[row]
            row += 1
    return block


@njit(nogil=True, cache=True)
def diagnose(points, weights, roots, exponents, power, smoothing, noise):
    r"""Diagnose the fit with the weights λ and s = `smoothing`, unit coordinates, from its own numbers alone.

    With B = S W^½ Q₂ U (E + s)⁻¹ Uᵀ Q₂ᵀ W^½ S the point j is missed by e_j = λ_j/B_jj when it is left out; S is that of
    the noise, see `shared_noise_loops`, and I where points share none.

    Returns
    -------
    score : N |μ|²/(Σ 1/(e + s))², the score of `gcv_score` also where s = 0
    degrees of freedom : tr A_s, the rank of the tail included
    condition : (e_max + s)/(e_min + s)
    errors : (n,) the e_j; NaN at points that the tail cannot do without

    Where the solution left out directions, its numbers do not say what they contained: score and errors are NaN.
    """
    eigenvalues, eigenvectors, vectors, betas = decompose(points, roots, exponents, power, noise)
    count, free = len(weights), len(eigenvalues)
    rank = count - free
    errors = np.full(count, np.nan)
    if free == 0:
        return np.nan, float(rank), np.nan, errors
    shifted = eigenvalues + smoothing
    kept = np.flatnonzero(shifted > SINGULAR * np.sum(shifted))
    if kept.size == 0:
        return np.nan, float(rank), np.nan, errors
    degrees = rank + np.sum(eigenvalues[kept] / shifted[kept])
    condition = shifted[kept[-1]] / shifted[kept[0]]
    if kept.size < free:
        return np.nan, degrees, condition, errors
    diagonal, apart = np.zeros(count), np.zeros(count)
    column = np.empty(count)
    for k in range(free):
        column[:rank] = 0.0
        put(eigenvectors[:, k], column[rank:])
        reflect(column, vectors, betas, False)
        apart += column * column
        column *= roots
        whiten(noise, column)
        diagonal += column * column / shifted[k]
    mu = weights.copy()
    whiten(inverse(noise), mu)
    mu /= roots
    for j in range(count):
        if apart[j] > LEVERAGE:
            errors[j] = weights[j] / diagonal[j]
    return count * dot(mu, mu, count) / np.sum(1 / shifted) ** 2, degrees, condition, errors
