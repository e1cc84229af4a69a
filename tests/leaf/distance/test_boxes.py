"""Boxes of a heap contain what is in them, however many items there are."""

import numpy as np
import pytest

from o3dleaf.leaf.distance.boxes import grow_tree
from o3dleaf.leaf.distance.search_loops import GROUP


@pytest.mark.parametrize("groups", [1, 2, 3, 4, 5, 8, 9, 17])
@pytest.mark.parametrize("short", [0, 1])
def test_each_box_contains_its_items_and_no_other_is_there(groups, short):
    count = groups * GROUP - short
    rng = np.random.default_rng(groups)
    items = rng.normal(size=(count, 4, 3)) * 0.1 + np.arange(count)[:, None, None]
    directions = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    boxes = grow_tree(count, lambda start, stop: (items[start:stop], directions[start:stop])).astype(float)
    leaves = len(boxes) // 2
    assert leaves >= groups
    assert np.isinf(boxes[leaves + groups :, 12:]).all()
    for number in range(1, leaves + groups):
        # Of a heap: the leaves below box n.
        first = last = number
        while first < leaves:
            first, last = 2 * first, 2 * last + 1
        held = items[GROUP * (first - leaves) : GROUP * (last + 1 - leaves)].reshape(-1, 3)
        if len(held):
            center, axes, half = boxes[number, :3], boxes[number, 3:12].reshape(3, 3), boxes[number, 12:]
            assert (np.abs((held - center) @ axes.T) <= half).all()
