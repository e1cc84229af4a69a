"""Any field a ball: the method does not depend on how a local fit was made."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.blend_loops import FAR, hold
from o3dleaf.fitting.local.fitter import POINTS_PER_BALL, ScatteredData
from o3dleaf.fitting.local.jet_loops import add_product, divide, scale_jets
from o3dleaf.fitting.local.weight_loops import weight_jets
from o3dleaf.fitting.rbf.evaluation_loops import jet_size

FitBall = Callable[[FloatArray, FloatArray], Field]
"""Fits one ball: (n, d) points and (n,) values in, a Field out."""


@dataclass(frozen=True)
class FieldPerBall:
    """Fields that a function of one ball's points and values makes."""

    fit_ball: FitBall
    points_per_ball: int | tuple[int, int] = POINTS_PER_BALL

    def fit(self, cover: Cover, data: ScatteredData) -> "LocalFields":
        """Fit every ball of the cover, one after another."""
        fields = []
        for rows in np.split(cover.members, cover.offsets[1:-1]):
            fields.append(self.fit_ball(data.points[rows], data.values[rows]))
            progress.report(len(fields), len(cover.radii))
        return LocalFields(fields)


@dataclass(frozen=True, eq=False)
class LocalFields:
    """One field a ball, whatever it is.

    Attributes
    ----------
    fields : sequence of Field
        Local fits, in the data's own coordinates.
    """

    fields: Sequence[Field]

    def __repr__(self) -> str:
        return f"LocalFields({len(self.fields):,} balls)"

    def blend(
        self,
        index: BallIndex,
        queries: FloatArray,
        *,
        level: int,
        dtype: np.dtype[Any],  # noqa: ARG002 - what a field computes in is its own affair
    ) -> FloatArray:
        """Return the jets, a column each, of the blend at (n, d) queries, outside the index's box too."""
        folded, _ = index.fold(queries)
        # How far each lies outside the box, where nothing is along axes that repeat.
        with np.errstate(over="ignore"):
            away = np.ascontiguousarray(np.where(index.period > 0, 0.0, queries - folded).T)
        outside = bool(away.any())
        count, dimension = folded.shape
        sums, totals = (np.zeros((jet_size(dimension, level), count)) for _ in range(2))
        tree = cKDTree(folded)
        for image, ball in enumerate(index.balls):
            rows = np.array(sorted(tree.query_ball_point(index.centers[image], index.radii[image])), dtype=np.int64)
            if not len(rows):
                continue
            radius = index.radii[image]
            z = np.ascontiguousarray((folded[rows] - index.centers[image]).T / radius)
            weight = np.empty((len(sums), len(rows)))
            weight_jets(z, len(rows), level, weight)
            scale_jets(weight, len(rows), 1 / radius, dimension)
            places = folded[rows] - index.shifts[image]
            if outside:
                places += np.clip(away.T[rows], -FAR * radius, FAR * radius)
            local = _jets_of(self.fields[ball], places, level)
            if outside and level > 0:
                hold(away, rows, len(rows), radius, FAR, weight, local)
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
    return np.ascontiguousarray(np.concatenate(parts))
