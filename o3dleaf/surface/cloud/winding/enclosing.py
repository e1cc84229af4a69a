"""Signs of the pieces of a cloud with which they enclose a volume, by the winding number."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import parity_loops
from o3dleaf.surface.cloud.neighbors import IndexArray

SAMPLE = 4096
"""Points at which the winding number is found, and as many that make it."""
MAX_PIECES = 64
"""Largest pieces whose signs are found; smaller ones follow their neighbors."""
ROUNDS = 20
BLOCK = 64


class Enclosure(NamedTuple):
    """Of each piece (m,): its sign, the mean winding number on it, and by how much another sign would be worse."""

    sign: FloatArray
    winding: FloatArray
    gain: FloatArray


def enclosing_signs(points: FloatArray, normals: FloatArray, area: FloatArray, piece: IndexArray) -> Enclosure:
    """Find the sign of each piece with which the pieces enclose a volume.

    Half way between inside and outside, the winding number w of a rightly oriented closed surface is 1/2 on it;
    of two sheets that face one another each sees 1/2 of the other. The signs are those that bring the mean of w on
    every piece nearest to 1/2, the sum of squares weighed with the pieces' areas.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
        Normals that agree within each piece.
    area : (n,) ndarray
        The area that each point stands for.
    piece : (n,) ndarray
        Numbered from the largest.
    """
    count = int(piece.max()) + 1
    number = _winding_between(points, normals, area, piece)
    large = len(number)
    weight = np.asarray(np.bincount(piece, area, count)[:large], dtype=np.float64)
    sign = np.ones(large)
    for _ in range(ROUNDS):
        turned = [c for c in range(large) if _turn_if_better(number, weight, sign, c)]
        if not turned:
            break
    gain = np.array([_gain(number, weight, sign, c) for c in range(large)])
    rest = count - large
    return Enclosure(
        np.append(sign, np.ones(rest)), np.append(number @ sign, np.zeros(rest)), np.append(gain, np.zeros(rest))
    )


def _turn_if_better(number: FloatArray, weight: FloatArray, sign: FloatArray, c: int) -> bool:
    """Turn piece c if the winding numbers are better then; return whether it was turned."""
    better = _gain(number, weight, sign, c) < 0
    if better:
        sign[c] = -sign[c]
    return better


def _gain(number: FloatArray, weight: FloatArray, sign: FloatArray, c: int) -> float:
    """Return how much worse the winding numbers would be if piece c were turned, a unit of its area.

    A piece without any, all of whose neighborhoods are lines, changes nothing.
    """
    mean = number @ sign
    turned = mean - 2 * sign[c] * number[:, c]
    worse = float(weight @ ((turned - 0.5) ** 2 - (mean - 0.5) ** 2))
    return worse / weight[c] if weight[c] else 0.0


def _winding_between(points: FloatArray, normals: FloatArray, area: FloatArray, piece: IndexArray) -> FloatArray:
    """Return the (m, m) mean winding numbers that each of the largest pieces (column) makes on each (row)."""
    count = min(int(piece.max()) + 1, MAX_PIECES)
    order = np.random.default_rng(0).permutation(np.flatnonzero(piece < count))
    sources, targets = order[:SAMPLE], order[-SAMPLE:]
    whole, sampled = (np.bincount(piece[rows], area[rows], count) for rows in (order, sources))
    share = whole / np.where(sampled > 0, sampled, 1.0)
    sources = sources[np.argsort(piece[sources], kind="stable")]
    source_piece = piece[sources]
    flux = normals[sources] * (area[sources] * share[source_piece])[:, np.newaxis]
    number = np.empty((len(targets), count))
    soft, first = np.linalg.norm(flux, axis=1) / (2 * np.pi), np.searchsorted(source_piece, np.arange(count + 1))
    x, y, f = points[targets], np.ascontiguousarray(points[sources].T), np.ascontiguousarray(flux.T)
    run_blocks(lambda i, j: parity_loops.winding(x, y, f, first, soft, i, j, number), len(targets), BLOCK)
    total = np.zeros((count, count))
    np.add.at(total, piece[targets], number)
    return total / np.maximum(np.bincount(piece[targets], minlength=count), 1)[:, np.newaxis]
