"""How balls measure distances: longer along directions in which the normals of their points differ."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.fitting.cover.ball_loops import Balls
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.local import fit_loops
from o3dleaf.fitting.local.fitter import ScatteredData

BATCH_SIZE = 256
"""Balls whose normals are summed up in one compiled call."""


@dataclass(frozen=True, eq=False)
class StretchedCover(Cover):
    """A cover whose balls measure distances in ways of their own.

    Attributes
    ----------
    stretches : (M, d, d) ndarray
        Symmetric matrices that their unit coordinates are multiplied with.
    """

    stretches: FloatArray

    @classmethod
    def of(cls, cover: Cover, stretches: FloatArray) -> "StretchedCover":
        """Return a cover with the stretches of its balls."""
        return cls(cover.centers, cover.radii, cover.bounds, cover.offsets, cover.members, stretches)

    @property
    def balls(self) -> Balls:
        """The balls, as the compiled loops take them."""
        return super().balls._replace(stretches=self.stretches)


def stretched(cover: Cover, data: ScatteredData) -> Cover:
    r"""Return a cover whose balls measure distances by the metric I + d C, C the covariance of their normals.

    Normals are slopes of the function that is sought, and where they differ it bends: between the two sheets of a thin
    part across them, and hardly along them. A spline bends alike in all directions, so that smoothing which averages
    noise along the sheets wears off the ridge between them. By that metric slopes change at rates that are closer to
    alike: where a ball has normals to two sides distances across the sheets are doubled (d = 3), where it has them to
    all sides all distances are longer alike, and where one sheet is flat they are Euclid's.

    Data without normals, or whose points share no error, are left as they are.
    """
    if data.normals is None or not data.share:
        return cover
    dimension = data.points.shape[1]
    spreads = np.empty((len(cover.radii), dimension, dimension))
    args = data.normals, data.weighted.weights, cover.balls
    run_blocks(lambda i, j: fit_loops.spread_normals(i, j, *args, spreads), len(spreads), BATCH_SIZE)
    squares, axes = np.linalg.eigh(spreads)
    lengths = np.sqrt(1.0 + dimension * np.maximum(squares, 0.0))
    return StretchedCover.of(cover, (axes * lengths[:, np.newaxis]) @ axes.transpose(0, 2, 1))
