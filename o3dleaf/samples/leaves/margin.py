"""The lifted margin of a leaf, and its closest points."""

from dataclasses import dataclass, field

import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely.geometry import Polygon

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.samples.leaves.sweep import Sweep

STEPS = 4
"""Of Gauss and Newton along an edge of the polygon, which is short and almost straight in space."""


def rings_of(outline: Polygon, step: float) -> list[FloatArray]:
    """Return the rings of an outline, exterior first, each (k, 2), open, no edge longer than `step`."""
    edges = shapely.segmentize(outline, step)
    return [shapely.get_coordinates(ring)[:-1] for ring in (edges.exterior, *edges.interiors)]


@dataclass(frozen=True, eq=False)
class LiftedMargin:
    """The margin S(∂outline), as edges of the polygon, each curved as the surface is.

    Attributes
    ----------
    sweep : Sweep
    corners : (k, 2) ndarray
        In the plane, ring after ring.
    before, after : (k,) ndarrays
        Rows of a corner's neighbors in its ring.
    """

    sweep: Sweep
    corners: FloatArray
    before: IntArray
    after: IntArray
    _tree: KDTree = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_tree", KDTree(self.sweep.jet(self.corners).points))

    @classmethod
    def of(cls, sweep: Sweep, outline: Polygon, step: float) -> "LiftedMargin":
        """Return the margin of an outline, its edges no longer than `step`."""
        rings = rings_of(outline, step)
        starts = np.cumsum([0, *(len(ring) for ring in rings[:-1])])
        rows = [start + np.arange(len(ring)) for start, ring in zip(starts, rings, strict=True)]
        before = np.concatenate([np.roll(row, 1) for row in rows])
        return cls(sweep, np.concatenate(rings), before, np.concatenate([np.roll(row, -1) for row in rows]))

    def closest(self, points: FloatArray) -> FloatArray:
        """Return the places (n, 2) on the margin that are closest in space to (n, 3) points."""
        nearest = self._tree.query(points)[1]
        best, least = self.corners[nearest], np.full(len(points), np.inf)
        for neighbor in (self.before, self.after):
            start, way = self.corners[nearest], self.corners[neighbor[nearest]] - self.corners[nearest]
            share = np.zeros(len(points))
            for _ in range(STEPS):
                jet = self.sweep.jet(start + share[:, np.newaxis] * way)
                slope = way[:, :1] * jet.along + way[:, 1:] * jet.across
                step = ((points - jet.points) * slope).sum(axis=1) / (slope**2).sum(axis=1)
                share = np.clip(share + step, 0.0, 1.0)
            place = start + share[:, np.newaxis] * way
            miss = ((points - self.sweep.jet(place).points) ** 2).sum(axis=1)
            best, least = np.where((miss < least)[:, np.newaxis], place, best), np.minimum(miss, least)
        return np.asarray(best)
