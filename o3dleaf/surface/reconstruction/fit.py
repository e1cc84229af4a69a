"""An oriented cloud to a field: noise averaged, constraints off the surface, splines blended over balls."""

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.parallel import Progress, finish, share_out
from o3dleaf.fitting.local.fitter import Fitter
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.smoothing import SmoothingValue
from o3dleaf.surface.cloud.constraints import OffSurface, off_surface_constraints
from o3dleaf.surface.cloud.downsample import Merged, leave_out_tails, merge_points
from o3dleaf.surface.cloud.noise import estimate_noise
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.point_spacing import cloud_spacing
from o3dleaf.surface.creases.creased_splines import CreasedSplines

PER_NOISE = 1.8
"""Side of the voxels that points are averaged in, in standard deviations of the noise: wider ones take rims and
corners off, narrower ones leave the fit with more points than tell it anything."""
SHARE = 2
"""One point in so many has constraints off the surface: they only tell inside from outside."""
ROUNDING = 1e-9
"""Share of a distance that is no shortening of it."""
OFF = 0.7
"""Distance of the constraints in spacings: nearer, normals count for more, and farther they cut corners."""
OFF_MEANS = 1.0
"""The same where points are means of several: their noise was as thick as the spacing."""
CLEAN = 0.1
"""Noise in spacings up to which a cloud is clean. Of others creases are not looked for: of normals that turn, some
only seem to."""
SMALL_BALLS = (100, 200)
"""Constraints of a ball of a clean cloud, for which larger ones only cost more; noise wants more to be told from."""

Constrain = Callable[..., OffSurface]
"""``(points, normals, spacing)`` to constraints off the surface."""


def merge_noise(cloud: OrientedCloud, *, progress: Progress | None = None) -> Merged:
    """Return the cloud with its points averaged where noise is thicker than the spacing, each with its weight.

    Voxels of 1.8 standard deviations of the noise hold too few points to lose any shape that the noise has left,
    and make the fit of a dense noisy scan a small one. Where they are narrower than a spacing nothing is merged.

    Parameters
    ----------
    cloud : OrientedCloud
    progress : callable, optional
        ``progress(done, total)``, in shares of the work.
    """
    measuring, merging, trimming = share_out(progress, 1, 3, 1)
    voxel = PER_NOISE * estimate_noise(cloud.points, cloud.near.tree if cloud.near else None)
    finish(measuring)
    if voxel <= cloud.spacing:
        return Merged(cloud.points, cloud.normals, np.ones(len(cloud.points)))
    merged = merge_points(cloud.points, cloud.normals, voxel)
    finish(merging)
    merged = leave_out_tails(merged)
    finish(trimming)
    return merged


def constrain(points: FloatArray, normals: FloatArray, spacing: float, *, off: float = OFF) -> OffSurface:
    """Return constraints `off` spacings off the surface on both sides of every second point, the same each time.

    Points that another sheet leaves less room have theirs all the same, nearer: each of close sheets is held.

    Parameters
    ----------
    points, normals : (n, 3) ndarray
        On the surface; outward unit normals there.
    spacing : float
        1/√(points per unit area), in the unit of the points.
    off : float
        0.7; `fit_surface` takes 1 where points are means of several.
    """
    found = off_surface_constraints(points, normals, off * spacing)
    chosen = np.zeros(len(points), dtype=bool)
    chosen[np.random.default_rng(0).permutation(len(points))[: max(len(points) // SHARE, 1)]] = True
    chosen[found.base[np.abs(found.values) < (1 - ROUNDING) * off * spacing]] = True
    kept = chosen[found.base]
    return OffSurface(found.sites[kept], found.values[kept], found.base[kept])


def fit_surface(  # noqa: PLR0913 - the parts of a fit, each of which can be replaced
    cloud: Merged,
    *,
    rho: SmoothingValue | None = "gcv",
    smoothing: SmoothingValue | None = None,
    local: str | Fitter = "rbf",
    constraints: Constrain = constrain,
    creases: Literal["auto", False] | float = "auto",
    points_per_ball: int | tuple[int, int] | None = None,
    margin: float = 0.0,
    spacing: float | None = None,
    tree: cKDTree | None = None,
    unit: str | None = None,
    progress: Progress | None = None,
) -> PUInterpolant:
    """Return the field of an oriented cloud: about the signed distance, larger inside, zero on the surface.

    Parameters
    ----------
    cloud : Merged
        Points, outward normals, and how many measured points each stands for.
    rho, smoothing
        As in `PUInterpolant.fit`. "gcv" is what a sample of balls agrees on and, where there is noise, each ball's own
        choice around that, points being left out with all constraints made from them.
    local : {"rbf", "hermite", "curl-free", "mls", "auto"} or object with a fit
        What lives in the balls: splines of the values 0 and ±d at and off the surface, or a fit to points and
        normals, see `PUInterpolant.fit_oriented`, which chooses its own smoothing.
    constraints : callable
        ``constraints(points, normals, spacing) -> OffSurface``, for "rbf".
    creases : "auto", False or float
        Sharp creases, for "rbf": see `CreasedSplines`. "auto" looks for them where the noise is below a tenth of
        the spacing.
    points_per_ball, unit
        As in `PUInterpolant.fit`.
    margin : float
        How far beyond the cloud's box the field is to reach, in the unit of the points.
    spacing : float, optional
        Median of 1/√(points per unit area); left out, that of `cloud_spacing`.
    tree : scipy.spatial.cKDTree, optional
        Of the points, where there is one.
    progress : callable, optional
        ``progress(done, total)``, in shares of the work.
    """
    spacing = cloud_spacing(cloud.points).median if spacing is None else spacing
    measuring, constraining, _ = share_out(progress, 1, 1, 40)
    reach = max(margin, spacing) * np.array([[-1.0], [1.0]])
    options: dict[str, Any] = {
        "bounds": np.array([cloud.points.min(axis=0), cloud.points.max(axis=0)]) + reach,
        "unit": unit,
    }
    if points_per_ball is not None:
        options["points_per_ball"] = points_per_ball
    if local != "rbf":
        return PUInterpolant.fit_oriented(cloud.points, cloud.normals, local=local, **options)
    clean = estimate_noise(cloud.points, tree) <= CLEAN * spacing
    finish(measuring)
    if clean:
        options.setdefault("points_per_ball", SMALL_BALLS)
    # Our own step is told of means.
    means = {"off": OFF_MEANS} if constraints is constrain and (cloud.weights > 1).any() else {}
    off = constraints(cloud.points, cloud.normals, spacing, **means)
    finish(constraining)
    groups = np.concatenate([np.arange(len(cloud.points)), off.base])
    gcv: SmoothingValue = "gcv" if clean else "gcv-per-ball"
    options["rho"] = gcv if rho == "gcv" else rho
    options["smoothing"] = gcv if smoothing == "gcv" else smoothing
    if creases is not False and (clean or creases != "auto"):
        options["local"] = CreasedSplines(creases, rho=options["rho"], smoothing=options["smoothing"])
    return PUInterpolant.fit(
        np.concatenate([cloud.points, off.sites]),
        np.concatenate([np.zeros(len(cloud.points)), off.values]),
        groups=groups,
        weights=cloud.weights[groups],
        normals=cloud.normals[groups],
        **options,
    )
