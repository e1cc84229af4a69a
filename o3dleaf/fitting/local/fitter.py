"""The protocol of local fits: scattered data and a cover in, what is blended of its balls out."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FARTHEST, FloatArray
from o3dleaf.core.checks.attributes import as_normals, as_rows, as_values, as_weights
from o3dleaf.core.checks.coordinates import as_sites
from o3dleaf.core.errors import InputError
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fit_loops import WeightedValues
from o3dleaf.fitting.local.oriented_loops import OrientedPoints
from o3dleaf.fitting.rbf.tail import IntArray

POINTS_PER_BALL = (200, 400)
"""Of splines of values, and of fits that do not say."""


@dataclass(frozen=True, eq=False)
class ScatteredData:
    """Values at points and, as far as there are any, weights, groups and normals: the data of a fit.

    Attributes
    ----------
    points, values : (n, d), (n,) or (n, c) ndarrays
    weights : (n,) ndarray or None
        Above 0: the smoothing at a point is divided by its weight.
    groups : (n,) int64 ndarray or None
        Points of one group share their error, and are left out together. The number of a group is the row of one of
        its points: the measured one, which the others were made from.
    normals : (n, d) ndarray or None
        Outward unit normals of a surface on which the value is zero, and where it is not, of the level set there; 0 at
        points of which the value alone is known.
    share : float
        The part β, below 1, of the variance of their errors that the points of a group have in common: the covariance
        is that of (1 − β) I + β 11ᵀ over their weights, where there is smoothing. Where it is not 0 errors of points
        left out are those of the measured ones, over the slope that the fit leaves, see `shared_noise_loops`.
    """

    points: FloatArray
    values: FloatArray
    weights: FloatArray | None = None
    groups: IntArray | None = None
    normals: FloatArray | None = None
    share: float = 0.0

    @classmethod
    def of(
        cls,
        points: npt.ArrayLike,
        values: npt.ArrayLike,
        *,
        weights: npt.ArrayLike | None = None,
        groups: npt.ArrayLike | None = None,
        normals: npt.ArrayLike | None = None,
        share: float = 0.0,
    ) -> "ScatteredData":
        """Return data of any arrays, or raise `InputError`; normals may have any length above 0."""
        sites = as_sites(points, "points", least=1, largest=FARTHEST)
        known = as_values(values, len(sites), columns=True)
        if share and (groups is None or known.ndim > 1):
            raise InputError("share: is of the points of a group, and of one column of values; give those, or no share")
        return cls(
            sites,
            known,
            None if weights is None else as_weights(weights, len(sites)),
            None if groups is None else as_rows(groups, len(sites)),
            None if normals is None else as_normals(normals, sites),
            share,
        )

    @classmethod
    def on_surface(cls, points: npt.ArrayLike, normals: npt.ArrayLike) -> "ScatteredData":
        """Return oriented points of a surface, where the value is zero."""
        sites = as_sites(points, "points", least=1, largest=FARTHEST)
        return cls(sites, np.zeros(len(sites)), normals=as_normals(normals, sites))

    @cached_property
    def named(self) -> IntArray:
        """The groups, each point's own where none are given."""
        return np.arange(len(self.points)) if self.groups is None else self.groups

    @cached_property
    def weighted(self) -> WeightedValues:
        """Points, values and weights, 1 where there are none, as the compiled loops take them."""
        return WeightedValues(
            self.points, self.values, np.ones(len(self.points)) if self.weights is None else self.weights
        )

    @property
    def oriented(self) -> OrientedPoints:
        """Points, normals and values, as the compiled loops take them, or `InputError` where there are no normals."""
        if self.normals is None:
            raise InputError("normals: are missing, and this fit needs them; give one for each point")
        return OrientedPoints(self.points, self.normals, self.values)


class LocalFits(Protocol):
    """The local fits of a cover: all that the partition of unity needs of them."""

    def blend(self, index: BallIndex, queries: FloatArray, *, level: int, dtype: np.dtype[Any]) -> FloatArray:
        """Return the jets (see `evaluation_loops`), to derivatives of `level`, of the blend at (n, d) queries.

        They are (jet, n); of fits to c columns of values, whose number is their `columns`, (c, jet, n). Outside the
        index's box the weights are those of its nearest point, and the fits go on.
        """
        ...


@runtime_checkable
class RefittableFits(LocalFits, Protocol):
    """Local fits of which some balls can be fitted again, to more points."""

    def with_points(self, cover: Cover, data: ScatteredData, balls: IntArray) -> LocalFits:
        """Return the fits with those of some balls (k,) made again, from their points in a cover."""
        ...


@runtime_checkable
class Fitter(Protocol):
    """A way to fit the balls of a cover: `Hermite`, `CurlFree`, `MovingLeastSquares`, `CreasedSplines` or your own."""

    @property
    def points_per_ball(self) -> int | tuple[int, int]:
        """The points of a ball, where the caller does not say, as in `PUInterpolant.fit`."""
        ...

    def fit(self, cover: Cover, data: ScatteredData) -> LocalFits:
        """Fit every ball of the cover to its points."""
        ...
