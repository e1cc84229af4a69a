"""The polynomial tail: monomials of total degree up to a bound, in shifted and scaled coordinates."""

from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt

from o3dleaf.core.errors import InputError

IntArray = npt.NDArray[np.int64]

MAX_DEGREE = 20
"""Monomials of higher degree cannot be told apart in double precision, and there are thousands of them."""


def tail_exponents(dimension: int, degree: int) -> IntArray:
    """Return the (q, d) exponents of all monomials of total degree <= `degree`, lowest degree first.

    q = C(degree + d, d): 10 for degree 2 in 3-D. Degree −1 is the empty tail.

    Raises
    ------
    InputError
        If the degree is below −1, or above `MAX_DEGREE`.
    """
    if not -1 <= degree <= MAX_DEGREE:
        raise InputError(f"degree: is {degree}; give -1 (no tail), 0, 1, 2, ..., at most {MAX_DEGREE}")
    rows = [
        [axes.count(axis) for axis in range(dimension)]
        for total in range(degree + 1)
        for axes in combinations_with_replacement(range(dimension), total)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, dimension)
