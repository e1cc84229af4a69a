"""Third differences around a ring: what they are of a cubic, and systems as a dense solver has them."""

import numpy as np
import pytest

from o3dleaf.leaf.margin.edge.third_differences import SHIFTS, ThirdDifferences
from tolerances import BANDED_SOLUTION


def dense(differences):
    """The matrix (n, n) of differences, entry by entry."""
    count = differences.factors.shape[1]
    matrix = np.zeros((count, count))
    for row in range(count):
        for factor, shift in zip(differences.factors[:, row], SHIFTS, strict=True):
            matrix[row, (row + shift) % count] += factor
    return matrix


def test_of_a_cubic_they_are_six_and_of_a_quadratic_none():
    nodes, plain = np.arange(20.0), ThirdDifferences(np.repeat([[-1.0], [3.0], [-3.0], [1.0]], 20, axis=1))
    inside = slice(1, 18)  # elsewhere the ring closes
    assert np.array_equal(plain.of(nodes**3)[inside], np.full(17, 6.0))
    assert np.array_equal(plain.of(nodes**2)[inside], np.zeros(17))


@pytest.mark.parametrize("count", [12, 13, 40, 41])
def test_what_they_make_is_what_the_dense_matrix_makes(count):
    rng = np.random.default_rng(count)
    some = ThirdDifferences(rng.normal(size=(4, count)))
    weights, diagonal, right = rng.uniform(0.5, 2.0, count), rng.uniform(0.5, 2.0, count), rng.normal(size=count)
    matrix = dense(some)
    assert np.allclose(some.of(right), matrix @ right, rtol=0, atol=BANDED_SOLUTION)
    assert np.allclose(some.transposed(right), matrix.T @ right, rtol=0, atol=BANDED_SOLUTION)
    whole = matrix.T @ np.diag(weights) @ matrix + np.diag(diagonal)
    solved = some.squared(weights).solve(diagonal, right)
    assert np.allclose(solved, np.linalg.solve(whole, right), rtol=0, atol=BANDED_SOLUTION)
