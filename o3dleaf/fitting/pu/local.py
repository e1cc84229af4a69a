"""What lives in the balls: polyharmonic splines, stored end to end, or any Fields at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.parallel import Progress, run_blocks, share_out, single_threaded_blas
from o3dleaf.fitting.pu import ball_loops
from o3dleaf.fitting.pu.cover import Cover
from o3dleaf.fitting.pu.index import BallIndex
from o3dleaf.fitting.pu.jet_loops import add_product, divide, scale_jets
from o3dleaf.fitting.pu.smoothing_selection import choose_amounts
from o3dleaf.fitting.pu.weight_loops import weight_jets
from o3dleaf.fitting.rbf.evaluation_loops import jet_size
from o3dleaf.fitting.rbf.kernels import Polyharmonic, require_twice_differentiable
from o3dleaf.fitting.rbf.smoothing import Smoothing
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

BLEND_BLOCK = 4096

AT_ONCE = 4
"""Balls that are fitted in one compiled call: between calls threads wait for one another."""


class LocalFits(Protocol):
    """The local fits of a cover: all that the partition of unity needs to know of them."""

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets (see `evaluation_loops`), to derivatives of `level`, of the blend at the folded queries."""
        ...


@dataclass(frozen=True, eq=False)
class LocalSplines:
    """One smoothed polyharmonic spline a ball, in unit coordinates, stored end to end for the compiled blend.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : Smoothing
        With its amount chosen, where it was "gcv"; the word is left where it was "gcv-per-ball".
    offsets, places : (M + 1,), (M,) int64 ndarrays
        Ball i has the weights ``offsets[i]:offsets[i + 1]``, and its points from ``places[i]`` on.
    sites, weights, tails : (·,), (total,), (M, q) ndarrays
        Points as (d, N_i) blocks, λ, and the tail's coefficients. Balls on a lattice share blocks.
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
    offsets: IntArray
    places: IntArray
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
        owners: IntArray | None = None,
        terms: IntArray | None = None,
        progress: Progress | None = None,
    ) -> "LocalSplines":
        """Fit every ball of the cover to its points; see `PUInterpolant.fit`, whose `weights` are here `trust`.

        Of the tail's monomials, lowest degree first, ball i has ``terms[i]``, or all of them.
        """
        exponents = tail_exponents(points.shape[1], degree)
        balls = (cover.centres, cover.radii, cover.offsets, cover.members)
        count, total = len(cover.radii), int(cover.offsets[-1])
        model = (np.empty(points.shape[1] * total), np.empty(total), np.zeros((count, len(exponents))))
        ranks, dropped = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
        weights = np.ones(len(points)) if trust is None else trust
        filled = (model, ranks, dropped)
        # Balls that choose for themselves take about as long for it as for their fit, a sample of them nothing.
        choosing, solving = share_out(progress, smoothing.amount == "gcv-per-ball", 1)
        terms = np.full(count, len(exponents)) if terms is None else terms
        with single_threaded_blas():
            rule, amounts = choose_amounts(
                cover,
                points,
                values,
                weights,
                kernel=kernel,
                exponents=exponents,
                terms=terms,
                rule=smoothing,
                owners=owners,
                progress=choosing,
            )
            diagonal, tail = rule.diagonals(cover.counts, amounts), (exponents, terms)

            def task(start: int, stop: int) -> None:
                ball_loops.fit_balls(start, stop, points, values, weights, balls, tail, kernel.power, diagonal, *filled)

            run_blocks(task, count, AT_ONCE, solving)
        kept = None if trust is None else trust[cover.members]
        places = points.shape[1] * cover.offsets[:-1]
        return cls(kernel, rule, cover.offsets, places, *model, exponents, ranks, dropped, amounts, kept)

    @property
    def diagonals(self) -> FloatArray:
        """(M,) the number s on the diagonal of each ball, in the data's unit."""
        return self.smoothing.diagonals(np.diff(self.offsets), self.amounts)

    def ball(self, ball: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the (d, N) points of a ball in its unit coordinates, their (N,) λ and their (N,) weights."""
        first, last = self.offsets[ball], self.offsets[ball + 1]
        dimension, place = self.kernel.dimension, self.places[ball]
        points = self.sites[place : place + dimension * (last - first)].reshape(dimension, last - first)
        trust = np.ones(last - first) if self.trust is None else self.trust[first:last]
        return points, self.weights[first:last], trust

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box.

        Raises
        ------
        InputError
            If second derivatives are asked for of a kernel that has none.
        """
        return blend_balls(self.balls(level, dtype), index, queries, level)

    def balls(self, level: int, dtype: np.dtype[Any]) -> ball_loops.SplineBalls:
        """Return what the compiled blend reads, or raise `InputError` where the kernel lacks the derivatives."""
        if level == 2:
            require_twice_differentiable(self.kernel)
        sites, weights = self._as_type(dtype)
        widest = int(np.diff(self.offsets).max())
        power, exponents = self.kernel.power, self.exponents
        return ball_loops.SplineBalls(self.offsets, self.places, sites, weights, self.tails, exponents, power, widest)

    def _as_type(self, dtype: np.dtype[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return sites and weights in float64, or in a float32 copy that is kept."""
        return (self.sites, self.weights) if dtype == np.float64 else self._single

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        return self.sites.astype(np.float32), self.weights.astype(np.float32)


def blend_balls(
    balls: ball_loops.SplineBalls | ball_loops.PotentialBalls | ball_loops.CreasedBalls,
    index: BallIndex,
    queries: FloatArray,
    level: int,
) -> FloatArray:
    """Return the jets, a column each, of the compiled blend at the (n, d) queries folded into the index's box."""
    folded, leaves = index.fold(queries)
    order = ball_loops.group(leaves, len(index.tree[0]))
    images = (index.balls, index.centres, index.radii)
    jets = np.empty((jet_size(queries.shape[1], level), len(queries)))

    def task(start: int, stop: int) -> None:
        ball_loops.blend(start, stop, order, folded, leaves, index.tree, images, balls, level, jets)

    run_blocks(task, len(queries), BLEND_BLOCK)
    return jets


@dataclass(frozen=True, eq=False)
class LocalFields:
    """One Field a ball, whatever it is: the method does not depend on how a local fit was made.

    Attributes
    ----------
    fields : sequence of Field
        Local fits, in the data's own coordinates.
    """

    fields: Sequence[Field]

    def blend(
        self,
        index: BallIndex,
        queries: FloatArray,
        *,
        level: int,
        dtype: np.dtype[Any],  # noqa: ARG002 - what a field computes in is its own affair
    ) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box."""
        folded, _ = index.fold(queries)
        count, dimension = folded.shape
        sums, totals = (np.zeros((jet_size(dimension, level), count)) for _ in range(2))
        tree = cKDTree(folded)
        for image, ball in enumerate(index.balls):
            rows = np.array(sorted(tree.query_ball_point(index.centres[image], index.radii[image])), dtype=np.int64)
            if not len(rows):
                continue
            z = np.ascontiguousarray((folded[rows] - index.centres[image]).T / index.radii[image])
            weight = np.empty((len(sums), len(rows)))
            weight_jets(z, len(rows), level, weight)
            scale_jets(weight, len(rows), 1 / index.radii[image], dimension)
            local = _jets_of(self.fields[ball], folded[rows] - index.shifts[image], level)
            add_product(weight, local, rows, len(rows), dimension, level, sums, totals)
        divide(sums, totals, count, dimension, level)
        return sums


def _jets_of(field: Field, points: FloatArray, level: int) -> FloatArray:
    """Return the jets of any field at (n, d) points."""
    parts = [field(points)[np.newaxis]]
    if level > 0:
        parts.append(field.gradient(points).T)
    if level > 1:
        if not hasattr(field, "hessian"):
            raise InputError(f"hessian: the local fits, of type {type(field).__name__}, have none; add the method")
        upper = np.triu_indices(points.shape[1])
        parts.append(field.hessian(points)[:, *upper].T)
    return np.concatenate(parts)
