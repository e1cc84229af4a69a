"""A tree of boxes that lie as what they contain does: a heap over items in a row, for `search_loops`."""

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.leaf.distance.search_loops import GROUP

BLOCK = 64
"""Leaves of the tree that are made together: half a megabyte."""
SLACK = 1e-6
"""Share of a box's distance from the origin and size that is added to its half sides: the roundings to float32."""


Hulls = Callable[[int, int], tuple[FloatArray, FloatArray]]
"""Of the items start:stop, points (n, q, 3) whose convex hull contains each, and directions (n, 3, 3), one a row, of
which the first two span what boxes lie along."""


def grow_tree(count: int, hulls: Hulls) -> npt.NDArray[np.float32]:
    """Return the (2k, 15) float32 boxes of a heap: center, three unit vectors along the sides, half the sides.

    Parameters
    ----------
    count : int
        Number of items; neighbors in the row should be neighbors in space.
    hulls : callable
        Asked for some of them at a time.
    """
    groups = -(-count // GROUP)
    leaves = max(1 << max(groups - 1, 0).bit_length(), 2)
    boxes = np.zeros((2 * leaves, 15), dtype=np.float32)
    boxes[:, 12:] = -np.inf

    def task(start: int, stop: int) -> None:
        points, directions = hulls(GROUP * start, min(GROUP * stop, count))
        # The last group is filled up with its last item.
        rows = np.minimum(np.arange(GROUP * (stop - start)), len(points) - 1)
        axes = _orthonormal(directions[rows].reshape(-1, GROUP, 3, 3).mean(axis=1))
        boxes[leaves + start : leaves + stop] = _boxes(points[rows].reshape(stop - start, -1, 3), axes)

    run_blocks(task, groups, BLOCK)
    while leaves > 1:
        leaves, groups = leaves // 2, -(-groups // 2)
        run_blocks(partial(_join, boxes, leaves), groups, BLOCK)
    return boxes


def _join(boxes: npt.NDArray[np.float32], first: int, start: int, stop: int) -> None:
    """Write the boxes first + start:stop of the heap about their children, of which the last one may be empty."""
    rows = 2 * first + np.arange(2 * start, 2 * stop)
    if np.isinf(boxes[rows[-1], 12]):
        rows[-1] -= 1
    children = boxes[rows].astype(np.float64)
    axes = _orthonormal(children[:, 3:12].reshape(-1, 2, 3, 3).mean(axis=1))
    boxes[first + start : first + stop] = _boxes(_corners(children).reshape(stop - start, -1, 3), axes)


def _orthonormal(directions: FloatArray) -> FloatArray:
    """Return (n, 3, 3) right-handed unit vectors, one a row, that span what the given rows do (Gram and Schmidt).

    Where they do not span anything, the world's axes: any box will do.
    """
    first = directions[:, 0] / np.maximum(np.linalg.norm(directions[:, 0], axis=1, keepdims=True), 1e-300)
    second = directions[:, 1] - np.sum(directions[:, 1] * first, axis=1, keepdims=True) * first
    second /= np.maximum(np.linalg.norm(second, axis=1, keepdims=True), 1e-300)
    axes = np.stack([first, second, np.cross(first, second)], axis=1)
    skew = np.abs(axes @ axes.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) > SLACK
    axes[skew] = np.eye(3)
    return axes


def _boxes(points: FloatArray, axes: FloatArray) -> FloatArray:
    """Return the (n, 15) least boxes along `axes` (n, 3, 3) about the points (n, q, 3)."""
    along = np.einsum("nqk,nak->nqa", points, axes)
    low, high = along.min(axis=1), along.max(axis=1)
    center = np.einsum("na,nak->nk", (low + high) / 2, axes)
    half = (high - low) / 2
    half += SLACK * (np.abs(center).max(axis=1, keepdims=True) + half.max(axis=1, keepdims=True))
    return np.concatenate([center, axes.reshape(-1, 9), half], axis=1)


def _corners(boxes: FloatArray) -> FloatArray:
    """Return the corners (n, 8, 3) of boxes."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    sides = boxes[:, 12:, np.newaxis] * boxes[:, 3:12].reshape(-1, 3, 3)
    return np.asarray(boxes[:, np.newaxis, :3] + np.einsum("ca,nak->nck", signs, sides), dtype=np.float64)
