"""What lives in the balls: polyharmonic splines, stored end to end, or any Fields at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.field import Field
from o3dleaf.parallel import Progress, run_blocks, single_threaded_blas
from o3dleaf.pu import loops
from o3dleaf.pu.choice import choose_amounts
from o3dleaf.pu.cover import Cover
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.weights import wendland, wendland_slope_over_tau
from o3dleaf.rbf.kernels import Polyharmonic
from o3dleaf.rbf.loops import tail_steps
from o3dleaf.rbf.smoothing import Smoothing
from o3dleaf.rbf.tail import IntArray, tail_exponents

BLEND_BLOCK = 4096


class LocalFits(Protocol):
    """The local fits of a cover: all that the partition of unity needs to know of them."""

    def blend(self, index: BallIndex, queries: FloatArray, *, gradient: bool) -> tuple[FloatArray, FloatArray]:
        """Return the (n,) blended values at (n, d) queries and, if asked for, their (n, d) gradients (else no rows)."""
        ...


@dataclass(frozen=True, eq=False)
class LocalSplines:
    """One smoothed polyharmonic spline a ball, in unit coordinates, stored end to end for the compiled blend.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : Smoothing
        With its amount chosen, where it was "gcv"; the word is left where it was "gcv-per-ball".
    centres : (M, d) ndarray
    offsets : (M + 1,) int64 ndarray
    sites, weights, tails : (d·total,), (total,), (M, q) ndarrays
        Points of each ball as a (d, N_i) block, λ, and the tail's coefficients.
    exponents : (q, d) int64 ndarray
    ranks, dropped : (M,) int64 ndarrays
        Rank of each ball's tail on its points; directions of its system that coinciding points left out.
    amounts : (M,) ndarray or None
        Each ball's own amount of smoothing, where it was "gcv-per-ball".
    trust : (total,) ndarray or None
        The weights of the points of each ball, where there were any.
    """

    kernel: Polyharmonic
    smoothing: Smoothing
    centres: FloatArray
    offsets: IntArray
    sites: FloatArray
    weights: FloatArray
    tails: FloatArray
    exponents: IntArray
    ranks: IntArray
    dropped: IntArray
    amounts: FloatArray | None = None
    trust: FloatArray | None = None

    @classmethod
    def fit(
        cls,
        cover: Cover,
        points: FloatArray,
        values: FloatArray,
        kernel: Polyharmonic,
        degree: int,
        smoothing: Smoothing,
        *,
        trust: FloatArray | None = None,
        progress: Progress | None = None,
    ) -> "LocalSplines":
        """Fit every ball of the cover to its points; see `PUInterpolant.fit`, whose `weights` are here `trust`."""
        exponents = tail_exponents(points.shape[1], degree)
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        count, total = len(cover.radii), int(cover.offsets[-1])
        model = (np.empty(points.shape[1] * total), np.empty(total), np.empty((count, len(exponents))))
        ranks, dropped = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
        weights = np.ones(len(points)) if trust is None else trust
        filled = (model, ranks, dropped)
        with single_threaded_blas():
            rule, amounts = choose_amounts(
                cover, points, values, weights, kernel=kernel, exponents=exponents, rule=smoothing, progress=progress
            )
            diagonal = rule.diagonals(cover.counts, amounts)

            def task(start: int, stop: int) -> None:
                loops.fit_balls(start, stop, points, values, weights, balls, exponents, kernel.power, diagonal, *filled)

            run_blocks(task, count, 1, progress if amounts is None else None)
        kept = None if trust is None else trust[cover.members]
        return cls(kernel, rule, cover.centres, cover.offsets, *model, exponents, ranks, dropped, amounts, kept)

    @property
    def diagonals(self) -> FloatArray:
        """(M,) the number s on the diagonal of each ball, in the data's unit."""
        return self.smoothing.diagonals(np.diff(self.offsets), self.amounts)

    def ball(self, ball: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the (d, N) points of a ball in its unit coordinates, their (N,) λ and their (N,) weights."""
        first, last = self.offsets[ball], self.offsets[ball + 1]
        dimension = self.kernel.dimension
        points = self.sites[dimension * first : dimension * last].reshape(dimension, last - first)
        trust = np.ones(last - first) if self.trust is None else self.trust[first:last]
        return points, self.weights[first:last], trust

    def blend(self, index: BallIndex, queries: FloatArray, *, gradient: bool) -> tuple[FloatArray, FloatArray]:
        """Return the (n,) blended values at the (n, d) queries and, if asked for, their (n, d) gradients."""
        leaves = index.locate(queries)
        order = np.argsort(leaves, kind="stable")
        images = (index.balls, index.shifts, index.radii, self.centres)
        steps = tail_steps(self.exponents)
        model = (self.offsets, self.sites, self.weights, self.tails, steps, self.kernel.power)
        values = np.empty(len(queries))
        gradients = np.empty((len(queries) if gradient else 0, queries.shape[1]))

        def task(start: int, stop: int) -> None:
            loops.blend(start, stop, order, queries, leaves, index.tree, images, model, values, gradients)

        run_blocks(task, len(queries), BLEND_BLOCK)
        return values, gradients


@dataclass(frozen=True, eq=False)
class LocalFields:
    """One Field a ball, whatever it is: the method does not depend on how a local fit was made.

    Attributes
    ----------
    fields : sequence of Field
        Local fits, in the data's own coordinates.
    """

    fields: Sequence[Field]

    def blend(self, index: BallIndex, queries: FloatArray, *, gradient: bool) -> tuple[FloatArray, FloatArray]:
        """Return the (n,) blended values at the (n, d) queries and, if asked for, their (n, d) gradients."""
        count, dimension = queries.shape
        sums, totals = np.zeros(count), np.zeros(count)
        slopes, falls = np.zeros((count, dimension)), np.zeros((count, dimension))
        tree = cKDTree(queries)
        for image, ball in enumerate(index.balls):
            rows = np.array(sorted(tree.query_ball_point(index.centres[image], index.radii[image])), dtype=np.int64)
            if not len(rows):
                continue
            z = (queries[rows] - index.centres[image]) / index.radii[image]
            tau = np.linalg.norm(z, axis=1)
            weight = np.array([wendland(t) for t in tau])
            local = queries[rows] - index.shifts[image]
            value = self.fields[ball](local)
            sums[rows] += weight * value
            totals[rows] += weight
            if gradient:
                fall = np.array([wendland_slope_over_tau(t) for t in tau])[:, None] * z / index.radii[image]
                slopes[rows] += fall * value[:, None] + weight[:, None] * self.fields[ball].gradient(local)
                falls[rows] += fall
        values = sums / totals
        gradients = (slopes - values[:, None] * falls) / totals[:, None]
        return values, gradients if gradient else gradients[:0]
