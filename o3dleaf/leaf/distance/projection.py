"""The surface of the multi-scale leaf at points: projection onto it, its normals and its mean curvature.

All of it works in flat coordinates z, where the surface is F(z) = 0, and in the metric of the world,
which the lift X(z) brings in by its Jacobian: nothing has to find its way from the world to the leaf
but the queries themselves, once.
"""

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks import FloatArray, as_points
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.leaf.distance import projection_loops
from o3dleaf.leaf.macro.offset import NormalOffsets

if TYPE_CHECKING:
    from o3dleaf.leaf.macro.blade import Blade
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

CHUNK = 1 << 15
"""Points looked at together: what is kept of them beside arguments and results, 600 bytes each, is 20 MB."""
BLOCK = 1 << 12
MOST_STEPS = 40
SETTLED = 1e-11
"""Length of Newton's step, of the patch's thickness, at which a point is on the surface."""
ROUNDED = 1e-8
"""The same, where rounding hides whether the last step brought |F| down."""
LONGEST = 0.05
"""The same: no step is longer, so that it does not leap over the face that it goes to."""
LEAST_SHARE = 1 / 64
"""Share of a step that must bring |F| down; where none does, there is no surface to go to."""
DIFFERENCE = 1e-4
"""Step of the differences of the lift's Jacobian, of the blade's width: blades bend over their width."""


class Texture(Protocol):
    """A field over the plane that repeats, in its own unit of length."""

    @property
    def period(self) -> FloatArray:
        """(2,) size of a tile along and across."""
        ...

    @property
    def cell(self) -> FloatArray:
        """(2, 3) box of one tile."""
        ...

    def tile_key(self, p: int) -> Hashable:
        """Return what tile number p along looks like: tiles of equal keys are translates of one another."""
        ...

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the values at (n, 3) points."""
        ...

    def jets(self, points: npt.ArrayLike, level: int) -> tuple[FloatArray, ...]:
        """Return the values and derivatives to order `level` at (n, 3) points."""
        ...


class OnBlade(Protocol):
    """A texture on a blade: a leaf, or the realisation of one."""

    @property
    def texture(self) -> Texture:
        """The micro-structure, in its own unit."""
        ...

    @property
    def blade(self) -> "Blade":
        """What it lies on."""
        ...

    @property
    def scale(self) -> float:
        """Factor from the blade's unit to the texture's."""
        ...


@dataclass(frozen=True)
class Lifted:
    """Points of the blade's neighbourhood: where they are, and how the world stretches around them.

    Attributes
    ----------
    world : (n, 3) ndarray
        X(z).
    columns : (n, 3, 3) ndarray
        ``columns[:, k]`` is ∂X/∂z_k.
    """

    world: FloatArray
    columns: FloatArray


def lift(blade: "Blade", flat: FloatArray) -> Lifted:
    """Return the world points of (n, 3) flat coordinates, and the lift's Jacobian there."""
    if blade.offset == "up":
        return lift_up(blade, flat)
    offsets = NormalOffsets.at(blade.frame, blade.height_map, flat)
    return Lifted(offsets.points, np.ascontiguousarray(offsets.jacobian.transpose(0, 2, 1)))


def lift_up(blade: "Blade", flat: FloatArray) -> Lifted:
    """Return the same of heights along up, whatever the blade's are along."""
    jet = blade.height_map.jet(flat[:, :2], 1)
    heights, slopes = np.ascontiguousarray(jet[:, 0]), np.ascontiguousarray(jet[:, 1:])
    found = Lifted(np.empty_like(flat), np.empty((len(flat), 3, 3)))
    frame = blade.frame

    def task(start: int, stop: int) -> None:
        spline = (frame.breaks, frame.axis, frame.normal)
        projection_loops.fill_lift(start, stop, flat, heights, slopes, *spline, found.world, found.columns)

    run_blocks(task, len(flat), BLOCK)
    return found


def pull_back(columns: FloatArray, inner: FloatArray) -> FloatArray:
    r"""Return the (n, 3) world gradients A⁻ᵀ g of functions with gradients g by z; A has the lift's columns ∂X/∂z."""
    gradients = np.empty_like(inner)
    run_blocks(
        lambda start, stop: projection_loops.pull_back(start, stop, columns, inner, gradients), len(inner), BLOCK
    )
    return gradients


def texture_jets(leaf: OnBlade, flat: FloatArray, level: int) -> tuple[FloatArray, ...]:
    """Return F and its derivatives to order `level` at (n, 3) flat coordinates in the leaf's unit."""
    jets = leaf.texture.jets(flat * leaf.scale, level)
    return tuple(part * leaf.scale**order if order else part for order, part in enumerate(jets))


def thickness(leaf: OnBlade) -> float:
    """Return the height of the texture's patch, in the leaf's unit: the length that all others are measured by."""
    return float(np.ptp(leaf.texture.cell[:, 2]) / leaf.scale)


def project(leaf: "MultiscaleLeaf", x: npt.ArrayLike) -> FloatArray:
    """Return the points of G = 0 that Newton's method reaches from x; see `MultiscaleLeaf.project`."""
    points = as_points(x, "x", dim=3)
    result = np.empty_like(points)
    for first, last in blocks(len(points), CHUNK):
        flat, settled = descend(leaf, leaf.blade.flatten(points[first:last]))
        result[first:last] = leaf.blade.lift(flat)
        lost = first + np.flatnonzero(~settled)
        if len(lost):
            result[lost] = leaf.closest_points(points[lost])
    return result


def descend(leaf: "MultiscaleLeaf", flat: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    r"""Follow the gradient in the world to F = 0 by Newton's method, halving steps that do not bring |F| down.

    .. math:: x ← x - λ\,G(x)\,∇G(x)/|∇G(x)|²

    Returns
    -------
    flat : (n, 3) ndarray
        Where it ended, in flat coordinates.
    settled : (n,) ndarray of bool
        Whether F vanishes there but for rounding.
    """
    here, step = flat.copy(), np.zeros_like(flat)
    share, best = np.ones(len(flat)), np.full(len(flat), np.inf)
    settled, size = np.zeros(len(flat), dtype=bool), thickness(leaf)
    active = np.arange(len(flat))
    for _ in range(MOST_STEPS):
        trial = here[active] + share[active, np.newaxis] * step[active]
        values, inner = texture_jets(leaf, trial, 1)
        better = np.abs(values) < best[active]
        rows, worse = active[better], active[~better]
        here[rows], best[rows], share[rows] = trial[better], np.abs(values[better]), 1.0
        step[rows] = _steps(leaf.blade, trial[better], values[better], inner[better], LONGEST * size)
        share[worse] /= 2
        settled[rows] = np.abs(step[rows]).max(axis=1, initial=0.0) <= SETTLED * size
        settled[worse] = np.abs(step[worse]).max(axis=1, initial=0.0) <= ROUNDED * size
        active = active[~settled[active] & (share[active] >= LEAST_SHARE)]
        if not len(active):
            break
    return here, settled


def _steps(blade: "Blade", flat: FloatArray, values: FloatArray, inner: FloatArray, longest: float) -> FloatArray:
    """Return Newton's steps in z along the world gradient, none longer than `longest` in the world."""
    columns, steps = lift(blade, flat).columns, np.empty_like(flat)

    def task(start: int, stop: int) -> None:
        projection_loops.gradient_steps(start, stop, columns, values, inner, longest, steps)

    run_blocks(task, len(flat), BLOCK)
    return steps


def normals(leaf: "MultiscaleLeaf", x: npt.ArrayLike) -> FloatArray:
    """Return the unit vectors −∇G/|∇G|, 0 where ∇G vanishes; see `MultiscaleLeaf.normals`."""
    gradient = leaf.gradient(x)
    length = np.linalg.norm(gradient, axis=1)
    return np.asarray(-gradient / np.where(length > 0, length, 1.0)[:, np.newaxis], dtype=np.float64)


def mean_curvature(leaf: "MultiscaleLeaf", x: npt.ArrayLike) -> FloatArray:
    """Return div n/2 of the level sets of G, n = −∇G/|∇G|; see `MultiscaleLeaf.mean_curvature`."""
    points = as_points(x, "x", dim=3)
    result = np.empty(len(points))
    for first, last in blocks(len(points), CHUNK):
        _fill_curvature(leaf, leaf.blade.flatten(points[first:last]), result[first:last])
    return result


def _fill_curvature(leaf: "MultiscaleLeaf", flat: FloatArray, curvatures: FloatArray) -> None:
    """Write the mean curvatures of one chunk of points."""
    _, inner, bends = texture_jets(leaf, flat, 2)
    columns = lift(leaf.blade, flat).columns
    second = lift_bends(leaf.blade, flat)

    def task(start: int, stop: int) -> None:
        projection_loops.mean_curvatures(start, stop, columns, inner, bends, second, curvatures)

    run_blocks(task, len(flat), BLOCK)


def lift_bends(blade: "Blade", flat: FloatArray) -> FloatArray:
    """Return ∂²X/∂z_a∂z_b, (n, 3, 3, 3), from central differences of the analytic Jacobian; X is linear in z₃."""
    bends = np.zeros((len(flat), 3, 3, 3))
    step = DIFFERENCE * float(np.ptp(blade.outline.bounds[:, 1]))
    for axis in range(2):
        ahead, behind = (lift(blade, flat + sign * step * np.eye(3)[axis]).columns for sign in (1.0, -1.0))
        bends[:, axis] = (ahead - behind) / (2 * step)
    bends[:, 2, :2] = bends[:, :2, 2]
    return (bends + bends.transpose(0, 2, 1, 3)) / 2
