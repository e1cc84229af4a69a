"""A synthetic laser scan of a wheat leaf: two passes, uneven, noisy, with holes."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, NotNegative, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.samples.sheet import WheatBlade

CONTROL_POINTS = 20
PICK_ERROR = 0.2
"""Standard deviation of a hand-picked control point, in millimeters."""
SURPLUS = 2.5
"""So many candidates are scanned for every point that is kept."""
OUTLIER_REACH = 6.0
"""Outliers lie up to so far from the leaf, in millimeters."""


class ScanSample(NamedTuple):
    """A synthetic scan: the cloud, (k, 3) control points of the midrib in order from the base, and the truth."""

    cloud: o3d.geometry.PointCloud
    midrib: FloatArray
    truth: WheatBlade

    def __repr__(self) -> str:
        points = f"{len(self.cloud.points):,} points"
        return f"ScanSample({points}, {len(self.midrib)} control points of the midrib, truth {self.truth!r})"


@checked
def wheat_scan(
    *,
    seed: Whole = 0,
    count: Count = 6300,
    noise: NotNegative = 0.1,
    misregistration: NotNegative = 0.15,
    holes: Whole = 6,
    outliers: Whole = 0,
) -> ScanSample:
    """Return a synthetic laser scan of a wheat leaf about 200 mm long and 11 mm wide, in millimeters.

    Parameters
    ----------
    seed : int
        Of the leaf, the scan and the picking of the midrib.
    count : int
        Number of points, outliers included.
    noise : float
        Standard deviation of the scanner's noise along each axis, in millimeters.
    misregistration : float
        How far the second of the two passes is displaced, in millimeters.
    holes : int
        Number of gaps where something hid the leaf.
    outliers : int
        Number of points that are not on the leaf, up to 6 mm from it.

    Returns
    -------
    ScanSample
        Cloud, midrib control points, and the blade without noise as a Field.

    Raises
    ------
    InputError
        If fewer than 100 points are requested, or a number is negative.
    """
    if count < 100 or min(noise, misregistration, holes, outliers) < 0 or outliers > count // 2:
        raise InputError(f"scan: count is {count} with {outliers} outliers; give 100 points, most on the leaf")
    shape_rng, scan_rng, pick_rng = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    truth = _grow(shape_rng)
    points = _scan(scan_rng, truth, count - outliers, misregistration, holes)
    points += scan_rng.normal(0.0, noise, points.shape)
    stray = points[scan_rng.integers(0, len(points), outliers)]
    stray = stray + scan_rng.uniform(-OUTLIER_REACH, OUTLIER_REACH, stray.shape)
    along = np.linspace(0.002, 0.998, CONTROL_POINTS) * truth.length
    midrib = truth.axis(along) + pick_rng.normal(0.0, PICK_ERROR, (CONTROL_POINTS, 3))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.concatenate([points, stray])))
    return ScanSample(cloud, midrib, truth)


def _grow(rng: np.random.Generator) -> WheatBlade:
    """Make a blade that differs a little from seed to seed."""
    near = rng.uniform(0.95, 1.05, 6)
    usual = WheatBlade()
    names = ("length", "width", "rise", "droop", "swing", "twist")
    return WheatBlade(**{name: getattr(usual, name) * f for name, f in zip(names, near, strict=True)})


def _scan(rng: np.random.Generator, truth: WheatBlade, count: int, shift: float, holes: int) -> FloatArray:
    """Points (count, 3) of two passes over the blade, denser in the middle, without those that are hidden."""
    pitch = np.sqrt(2 * truth.area / (SURPLUS * count))
    passes: list[tuple[FloatArray, FloatArray]] = []
    for angle in rng.uniform(-0.6, 0.6, 2):
        sites = _lattice(rng, truth, pitch, angle)
        world = truth.surface(sites[:, 0], sites[:, 1])
        direction = rng.normal(size=3)
        passes.append((sites, world + len(passes) * shift * direction / np.linalg.norm(direction)))
    sites, world = (np.concatenate(parts) for parts in zip(*passes, strict=True))
    seen = _seen(rng, truth, sites, holes)
    share = sites[:, 0] / truth.length
    # Sparse at the base and thinner at the tip, as a sensor above the plant sees it.
    density = np.where(seen, 0.12 + np.exp(-(((share - 0.55) / 0.32) ** 2)), 0.0)
    chosen = rng.choice(len(sites), count, replace=False, p=density / density.sum())
    return world[np.sort(chosen)]


def _lattice(rng: np.random.Generator, truth: WheatBlade, pitch: float, angle: float) -> FloatArray:
    """Leaf coordinates (n, 2) of scan lines at an angle across the blade, each point jittered."""
    reach = truth.length + truth.width
    line, place = np.meshgrid(np.arange(-truth.width, reach, pitch), np.arange(-truth.width, truth.width, pitch))
    sites = np.column_stack([line.ravel(), place.ravel()]) + rng.normal(0.0, 0.15 * pitch, (line.size, 2))
    sites[:, 0] += np.tan(angle) * sites[:, 1]
    inside = (sites[:, 0] > 0) & (sites[:, 0] < truth.length)
    return sites[inside & (abs(sites[:, 1]) < truth.half_width(sites[:, 0]))]


def _seen(rng: np.random.Generator, truth: WheatBlade, sites: FloatArray, holes: int) -> npt.NDArray[np.bool_]:
    """Return which sites lie in none of the elliptical gaps; gaps gather near the base."""
    seen = np.ones(len(sites), dtype=bool)
    for _ in range(holes):
        along = truth.length * (0.05 + 0.9 * rng.beta(1.2, 2.0))
        half_width = truth.half_width(along)[0]
        center = np.array([along, rng.uniform(-0.8, 0.8) * half_width])
        # Never so wide that the leaf falls in two.
        half = np.array([rng.uniform(1.5, 4.0), rng.uniform(0.2, 0.45) * half_width])
        seen &= (((sites - center) / half) ** 2).sum(axis=1) > 1.0
    return seen
