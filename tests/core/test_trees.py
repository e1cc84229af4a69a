"""Queries of k-d trees: the same answers on as many threads as they are worth."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from o3dleaf import get_num_threads, set_num_threads
from o3dleaf.core.trees import WORTH, query, threads_for


@pytest.fixture
def threads():
    before = get_num_threads()
    yield set_num_threads
    set_num_threads(before)


def test_threads_are_started_for_no_less_than_they_are_worth_and_no_more_than_loops_run_on(threads):
    threads(3)
    assert [threads_for(count) for count in (0, WORTH, 2 * WORTH - 1, 2 * WORTH, 9 * WORTH)] == [1, 1, 1, 2, 3]
    threads(1)
    assert threads_for(9 * WORTH) == 1


@pytest.mark.parametrize("k", [1, 3, [2], np.arange(1, 5)], ids=str)
def test_a_query_finds_what_the_tree_does(k, threads):
    threads(2)
    points = np.random.default_rng(0).random((4 * WORTH, 3))
    tree, places = cKDTree(points), points[::-1] + 0.01
    for found, expected in zip(query(tree, places, k), tree.query(places, k), strict=True):
        np.testing.assert_array_equal(found, expected)
    found = query(tree, places[:5], k, distance_upper_bound=0.02)[0]
    np.testing.assert_array_equal(found, tree.query(places[:5], k, distance_upper_bound=0.02)[0])
