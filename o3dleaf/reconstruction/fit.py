"""An oriented cloud to a field: noise averaged, constraints off the surface, splines blended over balls."""

from collections.abc import Callable
from typing import Literal

import numpy as np

from o3dleaf.checks import FloatArray
from o3dleaf.cloud.constraints import OffSurface, off_surface_constraints
from o3dleaf.cloud.noise import Merged, estimate_noise, merge_points
from o3dleaf.cloud.oriented import OrientedCloud
from o3dleaf.cloud.spacing import cloud_spacing
from o3dleaf.parallel import Progress
from o3dleaf.pu.interpolant import PUInterpolant
from o3dleaf.pu.oriented import OrientedFitter
from o3dleaf.rbf.smoothing import Amount

PER_NOISE = 2.5
"""Side of the voxels that points are averaged in, in standard deviations of the noise: what is left beside the
smoothing of the fit is least between 2 and 3."""
SHARE = 4
"""One point in so many has constraints off the surface: they only tell inside from outside."""

Constrain = Callable[[FloatArray, FloatArray, float], OffSurface]
"""``(points, normals, spacing)`` to constraints off the surface."""


def merge_noise(cloud: OrientedCloud) -> Merged:
    """Return the cloud with its points averaged where noise is thicker than the spacing, each with its weight.

    Voxels of 2.5 standard deviations of the noise hold too few points to lose any shape that the noise has left,
    and make the fit of a dense noisy scan a small one. Where they are narrower than a spacing nothing is merged.
    """
    voxel = PER_NOISE * estimate_noise(cloud.points)
    if voxel <= cloud.spacing:
        return Merged(cloud.points, cloud.normals, np.ones(len(cloud.points)))
    return merge_points(cloud.points, cloud.normals, voxel)


def constrain(points: FloatArray, normals: FloatArray, spacing: float) -> OffSurface:
    """Return constraints off the surface, a spacing away on both sides, for every fourth point, the same each time."""
    rows = np.sort(np.random.default_rng(0).permutation(len(points))[: max(len(points) // SHARE, 1)])
    found = off_surface_constraints(points, normals, spacing)
    chosen = np.isin(found.base, rows)
    return OffSurface(found.sites[chosen], found.values[chosen], found.base[chosen])


def fit_surface(
    cloud: Merged,
    *,
    rho: Amount | None = None,
    smoothing: Amount | None = None,
    local: Literal["rbf", "curl-free", "mls"] | OrientedFitter = "rbf",
    constraints: Constrain = constrain,
    creases: Literal["auto", False] | float = "auto",
    points_per_ball: int | tuple[int, int] | None = None,
    margin: float = 0.0,
    unit: str | None = None,
    progress: Progress | None = None,
) -> PUInterpolant:
    spacing = cloud_spacing(cloud.points).median
    box = np.array([cloud.points.min(axis=0), cloud.points.max(axis=0)])
    size = {} if points_per_ball is None else {"points_per_ball": points_per_ball}
    if local != "rbf":
        box += margin * np.array([[-1.0], [1.0]])
        return PUInterpolant.fit_oriented(
            cloud.points, cloud.normals, local=local, unit=unit, bounds=box, progress=progress, **size
        )
    off = constraints(cloud.points, cloud.normals, spacing)
    count = len(cloud.points)
    owners = np.concatenate([np.arange(count), off.base])
    sites = np.concatenate([cloud.points, off.sites])
    box += max(margin, spacing) * np.array([[-1.0], [1.0]])
    return PUInterpolant.fit(
        sites,
        np.concatenate([np.zeros(count), off.values]),
        rho=rho,
        smoothing=smoothing,
        owners=owners,
        weights=cloud.weights[owners],
        normals=cloud.normals[owners],
        creases=creases,
        unit=unit,
        bounds=box,
        progress=progress,
        **size,
    )
