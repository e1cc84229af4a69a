"""Groups of points that share their error, left out together: of every smoothing at once, without eigenvectors.

On the null space of the tail (B f)_I = B_II e_I holds for a group I of rows, e its errors when it is left out; see
`spectrum_loops`. One Krylov space contains B f for all values of the smoothing, and the solution for the one that is
chosen, at less than the cost of a Cholesky factorization; and for B_II stands its mean over groups of as many rows in
some other balls, as in generalized cross-validation 1 − tr A/N stands for 1 − A_jj.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from o3dleaf.core.compiled.decorator import njit
from o3dleaf.fitting.rbf.cholesky_loops import multiply_symmetric, solve_triangle
from o3dleaf.fitting.rbf.radial_loops import REASSOCIATE, dot
from o3dleaf.fitting.rbf.reflector_loops import mirror, reflect, restrict_tail, subtract
from o3dleaf.fitting.rbf.shared_noise_loops import (
    add_errors,
    count_group,
    held_out,
    judged,
    whiten,
    whiten_both_sides,
    whiten_rows,
    whitened,
)
from o3dleaf.fitting.rbf.solve_loops import (
    lower_radial_matrix,
    natural_monomials,
    radial_matrix,
    solve_projected,
    solve_system,
    tail_matrix,
)
from o3dleaf.fitting.rbf.spectrum_loops import project_weighted

RESIDUAL = 1e-2
"""Share of s |x| that the residual of the smallest smoothing may keep: squares of errors are off by its square."""

EXACT = 1e-6
"""The same of the smoothing that is chosen: s |x| is what smoothing leaves of the data, so that the fit is off by a
millionth of their noise. To 1e-10 it takes half as many steps again, and under little noise a factor for a quarter of
the balls."""


class TailFreeSystem(NamedTuple):
    """W^½ S A S W^½ on the null space of (W^½ S P)ᵀ, as it is multiplied with; see `shared_noise_loops`.

    Attributes
    ----------
    matrix, roots, noise
        A (n, n) up to its diagonal, √w (n,) and S.
    tail : (r, n)
        A basis of W^½ S P.
    """

    matrix: Any
    roots: Any
    noise: Any
    tail: Any


@njit(nogil=True, cache=True)
def weight_rows(system, vector):
    """Return S W^½ x of a vector (n,), which multiplies A."""
    weighted = system.roots * vector
    whiten(system.noise, weighted)
    return weighted


class Krylov(NamedTuple):
    """How far the solutions for m shifts are: conjugate gradients, their recurrences from one product a step.

    Attributes
    ----------
    vector, before : (n,)
        The last two Lanczos vectors.
    pivots, heights : (m,)
        Of the tridiagonal matrix, shifted and eliminated.
    directions, solutions : (m, n)
    """

    vector: Any
    before: Any
    pivots: Any
    heights: Any
    directions: Any
    solutions: Any


@njit(nogil=True, cache=True)
def drop_tail(tail, vector):
    """Take off a vector (n,) what lies along orthonormal rows (r, n)."""
    for k in range(len(tail)):
        subtract(tail[k], dot(tail[k], vector, vector.size), vector)


@njit(nogil=True, cache=True)
def begin(system, right, count):
    """Return the Krylov space of b = `right` (n,) without its tail, for so many shifts, and |b|."""
    size = right.size
    vector = right.copy()
    drop_tail(system.tail, vector)
    length = math.sqrt(dot(vector, vector, size)) if size > len(system.tail) else 0.0
    for j in range(size):
        vector[j] = vector[j] / length if length > 0.0 else 0.0
    many = (count, size)
    krylov = Krylov(vector, np.zeros(size), np.ones(count), np.full(count, -length), np.zeros(many), np.zeros(many))
    return krylov, length


@njit(nogil=True, cache=True, fastmath=REASSOCIATE)
def advance(system, krylov, shifts, first, most, link, residual):
    r"""Solve (M + s_i) x = b, M symmetric and semi-definite, for rising s_i > 0, from the step `first` to `most`.

    The tridiagonal matrix of the Lanczos vectors of M and b, shifted by each s_i, is eliminated as it grows: conjugate
    gradients, with one product by M a step for all shifts (Saad 2003, Iterative Methods, 6.7.1). The smallest
    converges last, and ends it: where its residual is below that share of s |x|, x is right to that share.

    Returns
    -------
    step, link, whether it has converged
    """
    vector, before, pivots, heights, directions, solutions = krylov
    roots, size, image = system.roots, vector.size, np.empty(vector.size)
    for step in range(first, most):
        multiply_symmetric(system.matrix, weight_rows(system, vector), image)
        whiten(system.noise, image)
        for j in range(size):
            image[j] *= roots[j]
        middle = dot(image, vector, size)
        for i in range(shifts.size):
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
        drop_tail(system.tail, image)
        link = math.sqrt(dot(image, image, size))
        for j in range(size):
            before[j] = vector[j]
            vector[j] = image[j] / link if link > 0.0 else 0.0
        reached = residual * shifts[0] * math.sqrt(dot(solutions[0], solutions[0], size))
        if link * abs(heights[0] / pivots[0]) <= reached:
            return step + 1, link, True
    return most, link, False


@njit(nogil=True, cache=True)
def solve_chosen(points, values, roots, exponents, power, groups, noise, trials, inverses, usual):
    """Choose a trial value and solve `solve_local`'s equation with it, in the Krylov space that both are found in.

    Of values that two points in the weight could not tell apart, the largest, as `Smoothing.chosen_from` does; the one
    in place `usual` where no group counts.

    Parameters
    ----------
    points, values, roots, exponents, power, groups, noise, trials, inverses
        As in `shared_squares`.
    usual : int

    Returns
    -------
    what `solve_local` does : (weights (n,), tail (q,), rank of P, directions left out)
    best : int
        The place of the value among the trials.
    """
    count = len(values)
    system, triangle, basis = tail_free(points, exponents, power, roots, noise)
    weighted, best = whitened(values, roots, noise), usual
    krylov, length = begin(system, weighted, trials.size)
    step, link = 0, 0.0
    if trials.size > 1 and length > 0.0:
        step, link, _ = advance(system, krylov, trials, 0, 2 * count, 0.0, RESIDUAL)
        squares, weight = group_squares(
            krylov.solutions, len(triangle), values, roots, groups, noise.share, trials, inverses
        )
        if weight > 0.0:
            limit = np.min(squares) * (1.0 + 2.0 / weight)
            for k in range(trials.size):
                best = k if squares[k] <= limit else best
    own, shift = of_shift(krylov, best), trials[best : best + 1]
    # A factor takes n³/6 products and 2 n² for each reflector of the tail, a step n².
    most = max(count // 6 + 2 * len(triangle), step + 1)
    if length > 0.0 and not advance(system, own, shift, step, most, link, EXACT)[2]:
        return factor_solution(points, exponents, system, weighted, trials[best]), best
    weights, reduced = weight_rows(system, own.solutions[0]), np.empty(len(triangle))
    image = np.empty(count)
    multiply_symmetric(system.matrix, weights, image)
    whiten(noise, image)
    rest = weighted - roots * image
    for k in range(reduced.size):
        reduced[k] = dot(system.tail[k], rest, count)
    solve_triangle(triangle, reduced)
    return (weights, basis @ reduced, reduced.size, 0), best


@njit(nogil=True, cache=True)
def solve_shared(points, values, exponents, power, diagonal, noise):
    """Return what `solve_local` does where s is that on the `diagonal` (n,) of the whitened system."""
    matrix, tail, right = radial_matrix(points, power), tail_matrix(points, exponents), values.copy()
    whiten_both_sides(noise, matrix)
    whiten_rows(noise, tail)
    whiten(noise, right)
    for i in range(len(matrix)):
        matrix[i, i] += diagonal[i]
    weights, coefficients, rank, lost = solve_system(matrix, tail, natural_monomials(points, exponents), right)
    whiten(noise, weights)
    return weights, coefficients, rank, lost


@njit(nogil=True, cache=True)
def factor_solution(points, exponents, system, weighted, smoothing):
    """Return what `solve_local` does, by a Cholesky factor; the matrix A of the system is overwritten."""
    tail, frame = tail_matrix(points, exponents), natural_monomials(points, exponents)
    whiten_rows(system.noise, tail)
    mirror(system.matrix)
    whiten_both_sides(system.noise, system.matrix)
    projected = project_weighted(system.matrix, tail, frame, system.roots)
    matrix = projected[0]
    for i in range(len(system.tail), len(matrix)):
        matrix[i, i] += smoothing
    scaled, coefficients, rank, lost = solve_projected(weighted, projected)
    return weight_rows(system, scaled), coefficients, rank, lost


@njit(nogil=True, cache=True)
def tail_free(points, exponents, power, roots, noise):
    """Return the system of some points without its tail, the tail's triangle R, and its basis; see `restrict_tail`."""
    tail = tail_matrix(points, exponents)
    whiten_rows(noise, tail)
    for i in range(len(roots)):
        tail[i] *= roots[i]
    vectors, betas, triangle, basis = restrict_tail(tail, natural_monomials(points, exponents))
    span = np.zeros((len(triangle), len(roots)))
    for k in range(len(span)):
        span[k, k] = 1.0
        reflect(span[k], vectors, betas, False)
    return TailFreeSystem(lower_radial_matrix(points, power), roots, noise, span), triangle, basis


@njit(nogil=True, cache=True)
def of_shift(krylov, k):
    """Return the part of a Krylov space that belongs to one shift."""
    vector, before, pivots, heights, directions, solutions = krylov
    one = slice(k, k + 1)
    return Krylov(vector, before, pivots[one], heights[one], directions[one], solutions[one])


@njit(nogil=True, cache=True)
def shared_squares(points, values, roots, exponents, power, groups, noise, trials, inverses):
    """Return, for each trial value, Σ e² over groups of points left out together, and Σ w of those rows; see `judged`.

    Parameters
    ----------
    points, values, roots, exponents, power, groups, trials
        As in `o3dleaf.fitting.rbf.spectrum_loops.held_out_squares`, the trials rising.
    noise : SharedNoise
    inverses : (g, m, g, g)
        Inverses of the mean s B_II of groups of 1, ..., g rows; groups of more do not count.
    """
    system, triangle, _ = tail_free(points, exponents, power, roots, noise)
    krylov, length = begin(system, whitened(values, roots, noise), trials.size)
    if length > 0.0:
        advance(system, krylov, trials, 0, 2 * len(values), 0.0, RESIDUAL)
    return group_squares(krylov.solutions, len(triangle), values, roots, groups, noise.share, trials, inverses)


@njit(nogil=True, cache=True)
def group_squares(pulled, rank, values, roots, groups, share, trials, inverses):
    """Return `shared_squares` of the solutions (m, n) for all trials, of points that a tail takes `rank` of."""
    count = roots.size
    order = np.argsort(groups, kind="mergesort")
    sums, first = held_out(trials.size), 0
    missed = np.empty(len(inverses))
    while first < count:
        last, name = first + 1, groups[order[first]]
        while last < count and groups[order[last]] == name:
            last += 1
        rows, first = order[first:last], last
        if name < 0 or groups[name] != name or rows.size > len(inverses) or count - rows.size < 2 * rank:
            continue
        readings, weight = count_group(rows, name, values, roots, share, sums), roots[name] ** 2
        for k in range(trials.size):
            for i in range(rows.size):
                missed[i] = 0.0
                for j in range(rows.size):
                    missed[i] += inverses[rows.size - 1, k, i, j] * pulled[k, rows[j]]
                missed[i] *= trials[k]
            add_errors(missed, rows.size, weight, readings, share, sums, k)
    return judged(sums)
