"""Normals turned to where their points were seen from."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud.neighbors import BLOCK, IndexArray
from o3dleaf.surface.cloud.orientation import viewpoint_loops
from o3dleaf.surface.cloud.orientation.orientation import Orientation

STEEP = 0.5
"""Square of the cosine between a normal and the line of sight up to which neighbors are asked: at 45° a point's own
sight weighs as much as all of them, so that of more inclined planes none is turned."""
ONE_PLACE = 0.995
"""Cosine between the directions to two viewpoints up to which they are one, 6°, as on the way of a scanner that moves:
what is seen from one place shows one side, while thin sheets that are seen from several show both."""
SETTLED, ROUNDS = 1e-4, 1000
"""Least move that counts, of a share from −1 to 1, and sweeps at most: patches of a hundred points take some fifty."""


def face_viewpoint(points: FloatArray, normals: FloatArray, viewpoint: FloatArray, rows: IndexArray) -> FloatArray:
    r"""Return normals (n, 3) turned so that none faces away from its viewpoint: a scanner sees outer sides only.

    Where a plane is seen at an angle γ below what its estimated normal is off, the side that it shows by itself is
    chance. So a point faces its viewpoint to a share of x, and below 0 its normal is turned,

    .. math:: x_i (1 + \tan^2 γ_i) = \sum_j a_{ij} x_j / \sum_j |a_{ij}| + \tan^2 γ_i

    with a the agreement of neighbors' normals, where each faces the viewpoint by itself: they follow one another
    from where their sides are seen. At 45° and more x is above 0 whatever the neighbors, which is not asked.

    Parameters
    ----------
    points, normals, viewpoint : (n, 3) ndarray
    rows : (n, k) ndarray
        Each point's neighbors, itself first.
    """
    sight = viewpoint - points
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), np.finfo(float).tiny)
    cosine = np.einsum("ij,ij->i", normals, sight)
    facing = np.where(cosine < 0, -1.0, 1.0)[:, np.newaxis] * normals
    square = cosine * cosine
    grazed = np.flatnonzero(square < STEEP)
    agreement, share = np.empty((len(grazed), rows.shape[1] - 1), dtype=np.float32), np.ones(len(points))
    args = points, facing, np.ascontiguousarray(viewpoint), rows, grazed, ONE_PLACE
    run_blocks(lambda i, j: viewpoint_loops.compare_seen(*args, i, j, agreement), len(grazed), BLOCK)
    steepness = square[grazed] / (1 - square[grazed])
    viewpoint_loops.weigh_sides(rows, grazed, agreement, steepness, SETTLED, ROUNDS, share)
    return np.where(share < 0, -1.0, 1.0)[:, np.newaxis] * facing


def face_given(points: FloatArray, given: Orientation, viewpoint: FloatArray, rows: IndexArray) -> Orientation:
    """Return normals that came with a cloud turned to its viewpoint, and say how many had to be.

    Parameters
    ----------
    points, viewpoint : (n, 3) ndarray
    given : Orientation
    rows : (n, k) ndarray
        Each point's neighbors, itself first.
    """
    turned = face_viewpoint(points, given.normals, viewpoint, rows)
    count = int(np.sum(np.einsum("ij,ij->i", turned, given.normals) < 0))
    note = f"{count:,} of {len(points):,} normals faced away from where the cloud was scanned from and were flipped"
    return Orientation(turned, (*given.notes, note) if count else given.notes)
