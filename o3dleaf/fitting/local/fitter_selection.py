"""Choice of the local fit for oriented points and of its balls, as large as noise requires and the shape allows.

And what a fit says of points that are left out, by which its data are judged.
"""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.even_sample import even_rows
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.core.trees import query
from o3dleaf.fitting.cover.cover import Cover
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.fields import FieldPerBall, FitBall
from o3dleaf.fitting.local.fitter import Fitter, ScatteredData
from o3dleaf.fitting.local.oriented_loops import OrientedPoints, polynomial_residual
from o3dleaf.fitting.local.polynomials import MovingLeastSquares
from o3dleaf.fitting.local.potentials import CurlFree, Hermite
from o3dleaf.fitting.local.smoothing_selection import each_ball
from o3dleaf.fitting.rbf.tail import IntArray, tail_exponents

NAMED_FITTERS: dict[str, type[Hermite | CurlFree | MovingLeastSquares]] = {
    "hermite": Hermite,
    "curl-free": CurlFree,
    "mls": MovingLeastSquares,
}

SIZES = tuple(50 * 2**step for step in range(8))
"""Points of the trial balls."""

MAX_BALLS, MAX_POINTS = 128, 100_000
"""Most balls of a size, and points of all of them: their mean square residual is known to half a per cent."""

FILLED = 0.7
"""Share of its most points that a ball of a cover contains on average."""

FLAT, STEEP = 1.07, 2.0
"""Growth of the mean square residual, from one size to the next, of noise at most and of a shape's bias at least."""

LARGE = 200
"""Points of a ball from which a cubic has less noise than `Hermite` with its smoothing."""

EXACT = 1e-20
"""Mean square residual, in squares of a ball's radius, of points that lie on a cubic but for rounding."""


def as_fitter(local: str | Fitter | FitBall, data: ScatteredData) -> Fitter:
    """Return the fitter of a name, the one that `choose_fitter` takes for "auto", of a callable, or itself."""
    if isinstance(local, str):
        if require_choice(local, ("auto", *NAMED_FITTERS), "local") == "auto":
            return choose_fitter(data.oriented)
        return NAMED_FITTERS[local]()
    return local if isinstance(local, Fitter) else FieldPerBall(local)


def choose_fitter(data: OrientedPoints) -> Hermite | MovingLeastSquares:
    """Return `Hermite` with smoothing by GCV, or `MovingLeastSquares` with balls as large as the noise requires.

    Cubics are fitted to balls of growing size around a sample of the points. Where noise exceeds what the shape bends
    away from a cubic, their residuals stay at its level from one size to the next: small balls follow it, large ones
    add their bias. The balls take the size at the end of the flattest step; where no step is flat, or the flattest is
    among small balls, the spline is better.

    Residuals of points held out would not do: where noise exceeds the spacing, the points of a small ball are those
    that are off alike, and find each other.

    Parameters
    ----------
    data : OrientedPoints
    """
    spline = Hermite(smoothing="gcv")
    tree, before, flattest, chosen = cKDTree(data.points), 0.0, FLAT, 0
    for size in SIZES:
        if size > len(data.points) // 4:
            break
        square = mean_square_residual(size, data, tree)
        if before > 0:
            growth = square / before
            if growth > STEEP:
                break
            if growth < flattest:
                flattest, chosen = growth, size
        before = square
    return MovingLeastSquares(points_per_ball=round(chosen / FILLED)) if chosen >= LARGE else spline


def mean_square_residual(size: int, data: OrientedPoints, tree: cKDTree) -> float:
    """Return the mean square distance of points to the cubics of balls of their `size` nearest, 0 but for rounding."""
    fitter, points = MovingLeastSquares(), data.points
    exponents = tail_exponents(points.shape[1], fitter.degree)
    places = min(MAX_BALLS, MAX_POINTS // size)
    seeds = even_rows(len(points), places)
    distances, near = query(tree, points[seeds], k=size)

    def residual(k: int) -> float:
        center, radius = points[seeds[k]], distances[k, -1]
        return float(polynomial_residual(data, near[k], center, radius, exponents, fitter.step))

    with single_threaded_blas():
        squares = np.array(each_ball(residual, np.arange(len(seeds))))
    return float(np.mean(np.where(squares > EXACT * distances[:, -1] ** 2, squares, 0.0)))


def left_out_values(data: ScatteredData, fitter: Fitter, rows: IntArray) -> FloatArray:
    """Return the values (k,) at the points of some rows (k,), in balls around them fitted to the nearest other points.

    None of the rows is among those, so that the values are predictions.
    """
    points, places = data.points, data.points[rows]
    kept = np.delete(np.arange(len(points)), rows)
    count = min(int(np.max(fitter.points_per_ball)), len(kept))
    distances, near = query(cKDTree(points[kept]), places, k=[*range(1, count + 1)])
    radii = np.where(distances[:, -1] > 0, distances[:, -1], 1.0)
    box, offsets = np.array([places.min(axis=0), places.max(axis=0)]), count * np.arange(len(rows) + 1)
    cover = Cover(places, radii, box, offsets, np.sort(kept[near], axis=1).ravel())
    index, local = BallIndex.build(places, radii, box), fitter.fit(cover, data)
    return np.asarray(local.blend(index, places, level=0, dtype=np.dtype(np.float64))[0])
