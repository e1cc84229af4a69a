"""An oriented cloud to a field: constraints off the surface, and splines blended over balls."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, NotNegative, Positive, SmoothingValue, Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.even_sample import even_rows
from o3dleaf.fitting.local.fitter import Fitter, ScatteredData
from o3dleaf.fitting.local.fitter_selection import NAMED_FITTERS, as_fitter, left_out_values
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.surface.cloud.constraints import EVEN, OffsetConstraints, offset_constraints
from o3dleaf.surface.cloud.noise import CLEAN
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.creases.creased_splines import CreasedSplines
from o3dleaf.surface.reconstruction.finish import field_normals

MARGIN = 4.0
"""Spacings that the field reaches beyond its data, one more than the widest gap that is closed."""
SMALL_BALLS = (100, 200)
"""Constraints of a ball of a clean cloud, for which larger ones only cost more; under noise larger ones do better."""
SHARE = 0.5
"""Part of the variance of the rows of a noisy point that they have in common, the rest being that of its normal."""
LEFT_OUT, ONE_IN = 128, 16
"""Points left out to see which normals predict them better, and of how many at least one is. Of normals that do alike
the share known of a sample is off by 0.04; a first fit without one point in sixteen is hardly another."""

Constrain = Callable[[OrientedCloud], OffsetConstraints]
"""An oriented cloud to constraints off the surface."""


@checked
def fit_surface(
    cloud: CloudLike,
    *,
    rho: SmoothingValue | None = "gcv",
    smoothing: SmoothingValue | None = None,
    local: str | Fitter = "rbf",
    constraints: Constrain = offset_constraints,
    creases: Literal["auto", False] | Positive = "auto",
    points_per_ball: Count | tuple[Count, Count] | None = None,
    margin: NotNegative | None = None,
    unit: Unit | None = None,
) -> PUInterpolant:
    """Return the field of an oriented cloud: about the signed distance, larger inside, zero on the surface.

    Parameters
    ----------
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        With normals; what `preprocess_point_cloud` or `adaptive_down_sample` returns.
    rho, smoothing
        As in `PUInterpolant.fit`; where there is a smoothing, "gcv" for rho means none. "gcv" is what a sample of balls
        agrees on and, where there is noise, each ball's own choice around that, points being left out with all
        constraints made from them.
    local : {"rbf", "hermite", "curl-free", "mls", "auto"} or object with a fit
        What is fitted in the balls: splines of the values 0 and ±d at and off the surface, or a fit to points and
        normals, see `PUInterpolant.fit_oriented`, which chooses its own smoothing; "hermite" and "curl-free" go through
        the points, noise included. Its normals are the cloud's, if exact, else the slopes of a first fit of "rbf",
        whichever predict most of a sample of left-out points more closely; with that fit it takes about twice the time.
    constraints : callable
        ``constraints(cloud) -> OffsetConstraints``, for "rbf".
    creases : "auto", False or float
        Sharp creases, for "rbf": see `CreasedSplines`. "auto" finds them where the noise is below a tenth of the
        spacing.
    points_per_ball, unit
        As in `PUInterpolant.fit`.
    margin : float, optional
        How far beyond the cloud's box the field is to reach, in the unit of the points; left out, four of its widest
        spacings, which `trim_to_data` needs.

    Raises
    ------
    InputError
        If the cloud has no normals, or an option makes no sense.
    """
    data = OrientedCloud.of(cloud)
    data.require_normals()
    margin = MARGIN * float(data.point_spacing.max()) if margin is None else margin
    reach = max(margin, data.spacing) * np.array([[-1.0], [1.0]])
    options: dict[str, Any] = {
        "bounds": np.array([data.points.min(axis=0), data.points.max(axis=0)]) + reach,
        "unit": unit,
    }
    if points_per_ball is not None:
        options["points_per_ball"] = points_per_ball
    if local != "rbf":
        if isinstance(local, str):
            require_choice(local, ("rbf", "auto", *NAMED_FITTERS), "local")
        choosing, fitting = progress.split(2, 3)
        with choosing:
            normals = normal_data(data, constraints, local)
        with fitting:
            return PUInterpolant.fit_oriented(data.points, normals, local=local, **options)
    measuring, constraining, fitting = progress.split(1, 1, 40)
    with measuring:
        clean, noiseless = data.is_clean, data.noise <= CLEAN * data.spacing
    if clean:
        options.setdefault("points_per_ball", SMALL_BALLS)
    with constraining:
        surface = surface_data(data, constraints)
    gcv: SmoothingValue = "gcv" if clean else "gcv-per-ball"
    rho = None if smoothing is not None and rho == "gcv" else rho
    options["rho"] = gcv if rho == "gcv" else rho
    options["smoothing"] = gcv if smoothing == "gcv" else smoothing
    if creases is not False and (noiseless or creases != "auto"):
        options["local"] = CreasedSplines(creases, rho=options["rho"], smoothing=options["smoothing"])
    with fitting:
        return PUInterpolant.fit(
            surface.points,
            surface.values,
            groups=surface.groups,
            share=surface.share,
            weights=surface.weights,
            normals=surface.normals,
            **options,
        )


def surface_data(
    cloud: OrientedCloud, constraints: Constrain = offset_constraints, *, local: str | Fitter = "rbf"
) -> ScatteredData:
    """Return what `fit_surface` fits a surface to: 0 at the points, and behind them the constraints off the surface.

    Local fits other than "rbf" take points and normals, and no constraints.
    """
    if local != "rbf":
        return ScatteredData.on_surface(cloud.points, normal_data(cloud, constraints, local))
    normals = cloud.require_normals()
    off = _offset(cloud, constraints)
    groups = np.concatenate([np.arange(len(cloud)), off.base])
    return ScatteredData(
        np.concatenate([cloud.points, off.sites]),
        np.concatenate([np.zeros(len(cloud)), off.values]),
        cloud.weights[groups],
        groups,
        normals[groups],
        0.0 if cloud.is_clean else SHARE,
    )


def normal_data(cloud: OrientedCloud, constraints: Constrain, local: str | Fitter) -> FloatArray:
    """Return the normals (n, 3) that a local fit takes for data: the cloud's, or the slopes of a first fit of values.

    Values take from normals little but the side, while a fit to normals is off by their angle times the spacing: planes
    through neighbors, whoever computed them, are off by the spacing over the radius of curvature. Some of the points
    are left out; slopes are taken where most of those are predicted more closely by them than by the normals. The cloud
    remembers them: a field that is corrected needs them.
    """
    normals = cloud.require_normals()
    known: tuple[Constrain, str | Fitter, FloatArray, FloatArray] | None = vars(cloud).get("_normal_data")
    if known is None or known[0] is not constraints or known[1] != local or known[2] is not normals:
        chosen = _better_normals(cloud, constraints, local)
        known = vars(cloud)["_normal_data"] = constraints, local, normals, chosen
    return known[3]


def _better_normals(cloud: OrientedCloud, constraints: Constrain, local: str | Fitter) -> FloatArray:
    """Return the cloud's normals, or a first fit's slopes where these predict most of the points left out better.

    What normals do falls with the spacing, what slopes do with a power of it: dense and sparse parts are judged apart.
    """
    normals, relative = cloud.require_normals(), cloud.point_spacing / np.median(cloud.point_spacing)
    group = np.digitize(relative, (1 / EVEN, EVEN))
    parts = (np.flatnonzero(group == number) for number in range(3))
    rows = np.concatenate([part[even_rows(len(part), min(LEFT_OUT, len(part) // ONE_IN))] for part in parts])
    others = cloud.take(np.delete(np.arange(len(cloud)), rows))
    measuring, fitting, sloping = progress.split(1, 20, 2)
    with measuring:
        if not len(rows) or not others.is_measurable:
            return normals
        _ = others.point_spacing  # found before the fit tells how far it is
    with fitting:
        first = fit_surface(others, constraints=constraints)
    with sloping:
        slopes = field_normals(first, cloud.points)
    facing = np.einsum("ij,ij->i", slopes, normals) > 0
    slopes = np.where(facing[:, np.newaxis], slopes, normals)
    given, tried = (ScatteredData.on_surface(cloud.points, each) for each in (normals, slopes))
    fitter = as_fitter(local, given)
    with progress.silent():
        by_normals, by_slopes = (np.abs(left_out_values(data, fitter, rows)) for data in (given, tried))
    nearer, counts = (np.bincount(group[rows], kind, 3) for kind in (by_slopes < by_normals, None))
    return np.where((2 * nearer > counts)[group][:, np.newaxis], slopes, normals)


def _offset(cloud: OrientedCloud, constraints: Constrain) -> OffsetConstraints:
    """Return the constraints off the surface of a cloud, which remembers them: a field that is corrected needs them."""
    known: tuple[Constrain, FloatArray | None, OffsetConstraints] | None = vars(cloud).get("_offset")
    if known is None or known[0] is not constraints or known[1] is not cloud.normals:
        known = vars(cloud)["_offset"] = constraints, cloud.normals, constraints(cloud)
    return known[2]
