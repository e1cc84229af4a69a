"""Pieces of a planar sample, joined over gaps: large ones where they are near, and points apart to the nearest."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation, components_of

BRIDGE = 8.0
"""Pieces of a sample are joined over gaps of so many spacings; beyond that nothing says that they belong together."""
PIECE = 10
"""Fewer points than this are no piece of their own."""


def joined_pieces(
    mesh: Triangulation, kept: BoolArray, bays: BoolArray, spacing: FloatArray, longest: float
) -> tuple[BoolArray, int, float]:
    """Return the triangles with those that bridge pieces, how many pieces of `PIECE` points these join, and how far.

    Points apart are bridged over triangles up to `longest` spacings long, but those in bays (`with_points_of`).
    """
    kept = with_points_of(mesh, kept, bays)
    labels = components_of(mesh.neighbors, kept)
    piece = np.arange(len(mesh.points)) + labels.max() + 1  # a point alone is a piece by itself
    for corner in range(3):
        piece[mesh.triangles[kept, corner]] = labels[kept]
    piece = np.unique(piece, return_inverse=True)[1]
    large = np.bincount(piece) >= PIECE
    of = piece[mesh.triangles]
    reach = mesh.reach / spacing[mesh.triangles].mean(axis=1)
    several = (of != of[:, :1]).any(axis=1)
    limit = np.where(large[of].all(axis=1), BRIDGE, longest)
    bridge = ~kept & several & (reach <= limit) & ~(bays & ~large[of].all(axis=1))
    joined = kept | bridge
    pieces = np.flatnonzero(np.bincount(labels[kept]) >= PIECE)
    after = components_of(mesh.neighbors, joined)[kept & np.isin(labels, pieces)]
    bridged = len(pieces) - len(np.unique(after))
    return joined, bridged, float(mesh.reach[bridge & large[of].all(axis=1)].max(initial=0.0)) if bridged else 0.0


def with_points_of(mesh: Triangulation, kept: BoolArray, bays: BoolArray) -> BoolArray:
    """Return the triangles kept, and those of bays by which points of the leaf beside them are in it.

    One by one a point is joined to the bank that it is nearest to, by a triangle with a side there: a bay stays open
    that each of these narrows. All triangles around a point would reach over to the other bank.
    """
    labels = components_of(mesh.neighbors, kept)
    cut_off = kept & (np.bincount(labels[kept], minlength=1) < PIECE)[labels]
    cut_off &= np.isin(labels, labels[np.append(bays, False)[mesh.neighbors].any(axis=1)])
    kept, bays = kept & ~cut_off, bays | cut_off
    while True:
        used = np.zeros(len(mesh.points), dtype=bool)
        used[mesh.triangles[kept]] = True
        row, side = np.nonzero(np.append(kept, False)[mesh.neighbors] & (bays & ~kept)[:, None])
        apex = mesh.triangles[row, side]
        row, apex = row[~used[apex]], apex[~used[apex]]
        if not len(row):
            return kept
        order = np.argsort(mesh.reach[row], kind="stable")
        kept[row[order[np.unique(apex[order], return_index=True)[1]]]] = True
