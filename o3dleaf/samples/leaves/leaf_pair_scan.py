"""A scan of two leaves, one of which may hide what is under it, that says which points are whose."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry import Polygon

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.samples.leaves.leaf_scan import draw_places
from o3dleaf.samples.leaves.leaf_shape import LeafShape

MESH_STEP = 0.5
"""Step in millimeters of the meshes and margins that tell how far one leaf is above the other, and what it hides."""


class Pose(NamedTuple):
    """A motion that carries a place of a leaf to the origin, its tangent plane to the horizontal, and turns it then."""

    origin: FloatArray
    turn: FloatArray

    @classmethod
    def of(cls, leaf: LeafShape, place: tuple[float, float], turn: FloatArray) -> "Pose":
        """Return the motion for a place (u, v) of a leaf and a rotation (3, 3)."""
        at = np.array([place])
        along, normal = leaf.jacobian(at)[0, :, 0], leaf.normals(at)[0]
        along = along / np.linalg.norm(along)
        frame = np.stack([along, np.cross(normal, along), normal])
        return cls(leaf.lift(at)[0], turn @ frame)

    def moved(self, points: FloatArray) -> FloatArray:
        """Return points (n, 3) moved."""
        return np.asarray((points - self.origin) @ self.turn.T)


class LeafPairScan(NamedTuple):
    """Points (n, 3) of two leaves, which leaf each is of (n,), 0 the lower and 1 the upper, and the areas seen (2,)."""

    points: FloatArray
    leaf: IntArray
    areas: FloatArray


def scan_leaf_pair(
    leaves: Sequence[LeafShape],
    poses: Sequence[Pose],
    lift: float,
    spacings: FloatArray,
    *,
    hidden: bool,
    noise: float,
    rng: np.random.Generator,
) -> LeafPairScan:
    """Return random points of a lower and an upper leaf in some poses, the upper one raised by `lift`.

    Parameters
    ----------
    leaves, poses : of two
    lift, noise : float
        In millimeters; noise along all axes.
    spacings : (2,) ndarray
        Of the points of either, in millimeters.
    hidden : bool
        Whether nothing is seen of the lower leaf under the upper one.
    rng : numpy.random.Generator
    """
    lower, upper = (
        pose.moved(leaf.lift(draw_places(leaf, float(spacing), "random", rng)))
        for leaf, pose, spacing in zip(leaves, poses, spacings, strict=True)
    )
    upper += [0.0, 0.0, lift]
    if hidden:
        cover = Polygon(poses[1].moved(leaves[1].margin(MESH_STEP)[0])[:, :2])
        lower = lower[~shapely.contains_xy(cover, *lower[:, :2].T)]
    points, counts = np.concatenate([lower, upper]), np.array([len(lower), len(upper)])
    points += rng.normal(0.0, noise, points.shape)
    return LeafPairScan(points, np.repeat([0, 1], counts), counts * spacings**2)
