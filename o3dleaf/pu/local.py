"""What lives in the balls: polyharmonic splines, stored end to end, or any Fields at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.checks import FloatArray
from o3dleaf.errors import InputError
from o3dleaf.field import Field
from o3dleaf.parallel import Progress, run_blocks, single_threaded_blas
from o3dleaf.pu import loops
from o3dleaf.pu.cover import Cover
from o3dleaf.pu.index import BallIndex
from o3dleaf.pu.jets import add_product, divide, scale_jets
from o3dleaf.pu.weights import weight_jets
from o3dleaf.rbf.kernels import Polyharmonic, require_twice_differentiable
from o3dleaf.rbf.loops import jet_size
from o3dleaf.rbf.smoothing import Smoothing, choose_by_gcv
from o3dleaf.rbf.tail import IntArray, tail_exponents

BLEND_BLOCK = 4096
GCV_BALLS = 32
"""Balls whose pooled score chooses the smoothing; an eigen-decomposition costs ten factorisations."""


class LocalFits(Protocol):
    """The local fits of a cover: all that the partition of unity needs to know of them."""

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets (see `o3dleaf.rbf.loops`), to derivatives of `level`, of the blend at the folded queries."""
        ...


@dataclass(frozen=True, eq=False)
class LocalSplines:
    """One smoothed polyharmonic spline a ball, in unit coordinates, stored end to end for the compiled blend.

    Attributes
    ----------
    kernel : Polyharmonic
    smoothing : Smoothing
        With its amount chosen, where it was "gcv".
    offsets, places : (M + 1,), (M,) int64 ndarrays
        Ball i has the weights ``offsets[i]:offsets[i + 1]``, and its points from ``places[i]`` on.
    sites, weights, tails : (·,), (total,), (M, q) ndarrays
        Points as (d, N_i) blocks, λ, and the tail's coefficients. Balls on a lattice share blocks.
    exponents : (q, d) int64 ndarray
    ranks, dropped : (M,) int64 ndarrays
        Rank of each ball's tail on its points; directions of its system that coinciding points left out.
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
        trust = np.ones(len(points)) if trust is None else trust
        with single_threaded_blas():
            if smoothing.amount == "gcv":
                smoothing = _pooled_gcv(cover, points, values, kernel, exponents, smoothing)
            diagonal = smoothing.diagonals(cover.counts)

            def task(start: int, stop: int) -> None:
                loops.fit_balls(
                    start, stop, points, values, trust, balls, exponents, kernel.power, diagonal, model, ranks, dropped
                )

            run_blocks(task, count, 1, progress)
        places = points.shape[1] * cover.offsets[:-1]
        return cls(kernel, smoothing, cover.offsets, places, *model, exponents, ranks, dropped)

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets, a column each, of the blend at the (n, d) queries folded into the index's box.

        Raises
        ------
        InputError
            If second derivatives are asked for of a kernel that has none.
        """
        if level == 2:
            require_twice_differentiable(self.kernel)
        folded, leaves = index.fold(queries)
        order = loops.group(leaves, len(index.tree[0]))
        images = (index.balls, index.centres, index.radii)
        sites, weights = self._as_type(dtype)
        widest = int(np.diff(self.offsets).max())
        model = (self.offsets, self.places, sites, weights, self.tails, self.exponents, self.kernel.power, widest)
        jets = np.empty((jet_size(queries.shape[1], level), len(queries)))

        def task(start: int, stop: int) -> None:
            loops.blend(start, stop, order, folded, leaves, index.tree, images, model, level, jets)

        run_blocks(task, len(queries), BLEND_BLOCK)
        return jets

    def _as_type(self, dtype: np.dtype[Any]) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return sites and weights in float64, or in a float32 copy that is kept."""
        return (self.sites, self.weights) if dtype == np.float64 else self._single

    @cached_property
    def _single(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        return self.sites.astype(np.float32), self.weights.astype(np.float32)


def _pooled_gcv(
    cover: Cover, points: FloatArray, values: FloatArray, kernel: Polyharmonic, exponents: IntArray, rule: Smoothing
) -> Smoothing:
    """Return the rule with the amount that a fixed sample of balls agrees on."""
    sample = np.unique(np.linspace(0, len(cover.radii) - 1, GCV_BALLS).round().astype(np.int64))
    balls = (cover.centres, cover.radii, cover.offsets, cover.members)
    spectra: list[tuple[FloatArray, FloatArray]] = [(np.empty(0), np.empty(0))] * len(sample)

    def task(start: int, stop: int) -> None:
        for at in range(start, stop):
            spectra[at] = loops.ball_spectrum(sample[at], points, values, balls, exponents, kernel.power)

    run_blocks(task, len(sample), 1)
    scales = [rule.scale(int(cover.counts[ball])) / cover.radii[ball] ** kernel.power for ball in sample]
    return Smoothing(choose_by_gcv(spectra, np.array(scales)), rule.per_point)


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
        dtype: np.dtype[Any],  # noqa: ARG002 - a Field computes in float64
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
