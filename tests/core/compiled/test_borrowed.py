"""Functions that take views alone count no references; those that make arrays do, and all leave counts as they were."""

import sys
import weakref
from typing import Any, NamedTuple

import numpy as np
import pytest

from o3dleaf.core.compiled.decorator import njit


class Pair(NamedTuple):
    """Arrays of one argument."""

    rows: Any
    names: Any


@njit(nogil=True)
def row_sums(table, sums):
    for i in range(len(table)):
        row = table[i]
        for each in row[1:]:
            sums[i] += each


@njit(nogil=True)
def block_sums(pair, sums):
    rows = pair.rows.reshape(2, pair.rows.size // 2)
    for name in pair.names:
        part = rows[:, name]
        sums[name] = part[0] + part[1]


@njit(nogil=True)
def first_row(table):
    return table[0]


@njit(nogil=True)
def calls_one_that_returns_a_view(table, sums):
    for _ in range(5):
        sums[0] += first_row(table)[0]


@njit(nogil=True)
def makes_an_array(table, sums):
    squares = table * table
    sums[0] += squares[0, 0]


@njit(nogil=True)
def selects_rows(table, sums):
    chosen = table[sums]
    sums[0] += len(chosen)


@njit(nogil=True)
def copies_what_overlaps(table, sums):
    table[1:] = table[:-1]
    sums[0] += table[1, 0]


@njit(nogil=True)
def makes_an_array_and_hands_on_what_it_was_given(table, sums):
    squares = table * table
    for _ in range(5):
        calls_one_that_returns_a_view(table, sums)
        row_sums(squares, sums)


@njit(nogil=True)
def row_sums_of_blocks(table, sums):
    for _ in range(3):
        row_sums(table[1:], sums[1:])


TAKE = [row_sums, block_sums, row_sums_of_blocks]
MAKE = [
    calls_one_that_returns_a_view,
    makes_an_array,
    selects_rows,
    copies_what_overlaps,
    makes_an_array_and_hands_on_what_it_was_given,
]


def arguments(function):
    """Return arrays that a function takes."""
    if function is block_sums:
        return Pair(np.arange(8.0), np.arange(4)), np.zeros(4)
    return np.arange(12.0).reshape(4, 3), np.arange(4, dtype=np.int64 if function is selects_rows else np.float64)


@pytest.mark.parametrize("function", TAKE + MAKE, ids=lambda each: each.__name__)
def test_references_are_counted_where_arrays_are_made_and_arrays_are_freed_after_the_last_call(function):
    """One test, since each worker would compile the function anew."""
    given, meant = arguments(function), arguments(function)
    function(*given)
    function.py_func(*meant)
    np.testing.assert_array_equal(given[1], meant[1])
    (compiled,) = function.overloads.values()
    assert compiled.target_context.enable_nrt == (function in MAKE)
    given = arguments(function)
    arrays = [array for each in given for array in (each if isinstance(each, Pair) else (each,))]
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(10):
        function(*given)
    assert [sys.getrefcount(array) for array in arrays] == before
    held = [weakref.ref(array) for array in arrays]
    del given, arrays
    assert not any(each() is not None for each in held)


def test_what_is_returned_is_held():
    table = np.arange(6.0).reshape(2, 3)
    row = first_row(table)
    held = weakref.ref(table)
    del table
    assert held() is not None
    np.testing.assert_array_equal(row, [0.0, 1.0, 2.0])
    del row
    assert held() is None
