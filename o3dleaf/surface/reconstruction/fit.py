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
from o3dleaf.fitting.local.fitter import Fitter, ScatteredData
from o3dleaf.fitting.local.fitter_selection import NAMED_FITTERS
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.surface.cloud.constraints import OffsetConstraints, offset_constraints
from o3dleaf.surface.cloud.noise import CLEAN
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.creases.creased_splines import CreasedSplines

MARGIN = 4.0
"""Spacings that the field reaches beyond its data, one more than the widest gap that is closed."""
SMALL_BALLS = (100, 200)
"""Constraints of a ball of a clean cloud, for which larger ones only cost more; under noise larger ones do better."""
SHARE = 0.5
"""Part of the variance of the rows of a noisy point that they have in common, the rest being that of its normal."""

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
        normals, see `PUInterpolant.fit_oriented`, which chooses its own smoothing. "hermite" and "curl-free" want exact
        normals: with estimated ones "rbf", which takes from them the side alone, is nearer to the truth, or give them
        its own slopes, ``OrientedCloud.of(cloud, -field.gradient(cloud.points))``.
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
        return PUInterpolant.fit_oriented(data.points, data.require_normals(), local=local, **options)
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
    normals = cloud.require_normals()
    if local != "rbf":
        return ScatteredData.on_surface(cloud.points, normals)
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


def _offset(cloud: OrientedCloud, constraints: Constrain) -> OffsetConstraints:
    """Return the constraints off the surface of a cloud, which remembers them: a field that is corrected needs them."""
    known: tuple[Constrain, FloatArray | None, OffsetConstraints] | None = vars(cloud).get("_offset")
    if known is None or known[0] is not constraints or known[1] is not cloud.normals:
        known = vars(cloud)["_offset"] = constraints, cloud.normals, constraints(cloud)
    return known[2]
