"""Groups of points that share their error, left out together: of every smoothing at once, without eigenvectors.

On the null space of the tail (B f)_I = B_II e_I holds for a group I of rows, e its errors when it is left out; see
`spectrum_loops`. One Krylov space contains B f for all values of the smoothing, at the cost of about one Cholesky
factorization; and for B_II stands its mean over groups of as many rows in some other balls, as in generalized
cross-validation 1 − tr A/N stands for 1 − A_jj.
"""

import math

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot, put
from o3dleaf.fitting.rbf.reflector_loops import reflect
from o3dleaf.fitting.rbf.solve_loops import natural_monomials, radial_matrix, solve_projected, tail_matrix
from o3dleaf.fitting.rbf.spectrum_loops import project_weighted

RESIDUAL = 1e-2
"""Share of s |x| that the residual of the smallest smoothing may keep: squares of errors are off by its square."""


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def shifted_solutions(matrix, right, shifts):
    r"""Return the (m, n) solutions of (M + s_i) x = b, M symmetric and semi-definite, for rising s_i > 0.

    The tridiagonal matrix of the Lanczos vectors of M and b, shifted by each s_i, is eliminated as it grows: conjugate
    gradients, with one product by M a step for all shifts (Saad 2003, Iterative Methods, 6.7.1). The smallest
    converges last, and ends it.
    """
    size, count = right.size, shifts.size
    solutions, directions = np.zeros((count, size)), np.zeros((count, size))
    pivots, heights = np.ones(count), np.full(count, -math.sqrt(dot(right, right, size)))
    if size == 0 or heights[0] == 0.0:
        return solutions
    vector, before, link = right / -heights[0], np.zeros(size), 0.0
    for step in range(2 * size):
        image = matrix @ vector
        middle = dot(image, vector, size)
        for i in range(count):
            share = link / pivots[i] if step > 0 else 1.0
            pivots[i] = middle + shifts[i] - (share * link if step > 0 else 0.0)
            heights[i] *= -share
            direction, solution, height = directions[i], solutions[i], heights[i]
            scale, rest = 1.0 / pivots[i], link / pivots[i]  # divisions take as long as all else
            for j in range(size):
                moved = scale * vector[j] - rest * direction[j]
                direction[j] = moved
                solution[j] += height * moved
        for j in range(size):
            image[j] -= middle * vector[j] + link * before[j]
        link = math.sqrt(dot(image, image, size))
        reached = RESIDUAL * shifts[0] * math.sqrt(dot(solutions[0], solutions[0], size))
        if link * abs(heights[0] / pivots[0]) <= reached:
            break
        before, vector = vector, image / link
    return solutions


@njit(nogil=True, cache=True)
def solve_chosen(points, values, roots, exponents, power, groups, trials, inverses, usual):
    """Choose a trial value and solve `solve_local`'s equation with it, on the system that both are projected from.

    Of values that two points in the weight could not tell apart, the largest, as `Smoothing.chosen_from` does; the one
    in place `usual` where no group counts.

    Parameters
    ----------
    points, values, roots, exponents, power, groups, trials, inverses
        As in `shared_squares`.
    usual : int

    Returns
    -------
    what `solve_local` does : (weights (n,), tail (q,), rank of P, directions left out)
    best : int
        The place of the value among the trials.
    """
    frame = natural_monomials(points, exponents)
    projected = project_weighted(radial_matrix(points, power), tail_matrix(points, exponents), frame, roots)
    best = usual
    if trials.size > 1:
        squares, weight = projected_squares(projected, values, roots, groups, trials, inverses)
        if weight > 0.0:
            limit = np.min(squares) * (1.0 + 2.0 / weight)
            for k in range(trials.size):
                best = k if squares[k] <= limit else best
    matrix, rank = projected[0], len(projected[3])
    for i in range(rank, len(matrix)):
        matrix[i, i] += trials[best]
    scaled, tail, rank, lost = solve_projected(values * roots, projected)
    return (scaled * roots, tail, rank, lost), best


@njit(nogil=True, cache=True)
def shared_squares(points, values, roots, exponents, power, groups, trials, inverses):
    """Return, for each trial value, Σ e² over groups of points left out together, and Σ w of those rows.

    Parameters
    ----------
    points, values, roots, exponents, power, groups, trials
        As in `o3dleaf.fitting.rbf.spectrum_loops.held_out_squares`, the trials rising.
    inverses : (g, m, g, g)
        Inverses of the mean s B_II of groups of 1, ..., g rows; groups of more do not count.
    """
    frame = natural_monomials(points, exponents)
    projected = project_weighted(radial_matrix(points, power), tail_matrix(points, exponents), frame, roots)
    return projected_squares(projected, values, roots, groups, trials, inverses)


@njit(nogil=True, cache=True)
def projected_squares(projected, values, roots, groups, trials, inverses):
    """Return `shared_squares` of what `project_weighted` made."""
    matrix, vectors, betas, triangle, _ = projected
    count, rank = len(values), len(triangle)
    rotated = values * roots
    reflect(rotated, vectors, betas, True)
    pulled = np.zeros((trials.size, count))
    free = shifted_solutions(matrix[rank:, rank:].copy(), rotated[rank:], trials)
    for k in range(trials.size):
        put(free[k], pulled[k, rank:])
        reflect(pulled[k], vectors, betas, False)
    order = np.argsort(groups, kind="mergesort")
    squares, weight, first = np.zeros(trials.size), 0.0, 0
    while first < count:
        last, name = first + 1, groups[order[first]]
        while last < count and groups[order[last]] == name:
            last += 1
        rows, first = order[first:last], last
        if name < 0 or groups[name] != name or rows.size > len(inverses) or count - rows.size < 2 * rank:
            continue
        for row in rows:
            weight += roots[row] ** 2
        for k in range(trials.size):
            for i in range(rows.size):
                missed = 0.0
                for j in range(rows.size):
                    missed += inverses[rows.size - 1, k, i, j] * pulled[k, rows[j]]
                squares[k] += (trials[k] * missed) ** 2
    return squares, weight
