"""Splines of three components: in each ball one smoothed polyharmonic spline a coordinate, at common sites."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.columns.column_splines import LocalColumns
from o3dleaf.fitting.rbf.kernels import Polyharmonic
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.parametric.spline_loops import VectorBalls

CUBIC = Polyharmonic(3, 2)
"""φ = r³ in the plane: C² at its data and fast."""
LINEAR = np.array([[0, 0], [1, 0], [0, 1]])
"""Exponents of the tail's monomials 1, u, v."""


@dataclass(frozen=True, eq=False)
class VectorSplines:
    """One spline r³ with a linear tail a ball and component, in unit coordinates, end to end for the compiled loops.

    Attributes
    ----------
    smoothing : Smoothing
    offsets : (M + 1,) int64 ndarray
        Ball i has the weights ``offsets[i]:offsets[i + 1]``.
    sites : (2 total,) ndarray
        Points as (2, N_i) blocks.
    weights : (3, total) ndarray
        λ of each component.
    tails : (M, 3, 3) ndarray
        Component, then the coefficients of 1, u, v.
    """

    smoothing: Smoothing
    offsets: IntArray
    sites: FloatArray
    weights: FloatArray
    tails: FloatArray

    @classmethod
    def of(cls, columns: LocalColumns) -> "VectorSplines":
        """Return splines of three columns, one a component, or raise `InputError`."""
        if columns.columns != 3 or columns.kernel != CUBIC or len(columns.exponents) != 3:
            raise InputError("columns: give three, by splines of the kernel r³ with a linear tail in the plane")
        order = [int(np.flatnonzero((columns.exponents == monomial).all(axis=1))[0]) for monomial in LINEAR]
        # In the layout that loops are compiled for, as those that are read from a file have.
        tails = np.ascontiguousarray(columns.tails[:, :, order])
        return cls(columns.smoothing, columns.offsets, columns.sites, columns.weights, tails)

    def __repr__(self) -> str:
        return f"VectorSplines({len(self.tails):,} balls)"

    def balls(self, index: BallIndex) -> VectorBalls:
        """Return what the compiled loops read."""
        return VectorBalls(self.offsets, self.sites, self.weights, self.tails, index.bounds, index.images, index.tree)
