"""The distance to the leaf: to the nearest point of its two rough faces, its pockets and its rim.

The leaf is where G > 0 and (along, across) is in the outline. Its surface is sampled once over one tile, and
the blade is cut into cells that show blocks of that tile, each seen in the world through the lift's Jacobian at
its middle. A tree of boxes over the cells finds the nearest sample, Newton's method the nearest point of the
surface beside it. The rim is a band of short flat strips under a tree of their own.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.distance import projection_loops
from o3dleaf.leaf.distance.cells import CellTree, morton_order
from o3dleaf.leaf.distance.rim_strips import rim_strips
from o3dleaf.leaf.distance.search_loops import nearest_samples
from o3dleaf.leaf.distance.solid import LeafSolid
from o3dleaf.leaf.distance.strip_loops import Strips, nearest_strips
from o3dleaf.leaf.distance.tile_samples import TileSamples
from o3dleaf.leaf.margin.taper import Taper
from o3dleaf.leaf.textured_blade import TexturedBlade

BATCH_SIZE = 1 << 15
"""Points that are put in order together: 4 MB."""
BLOCK = 1 << 10
"""Points that a thread looks at together: 1 MB."""
STRIP_STEPS = 2
"""Length of a strip of the rim, in steps of the sampling."""
TOLERANCE = 0.05
"""Length of Newton's step, of the sampling's, after which another one would not be seen in the distance."""
MAX_STEP = 3.0
"""Longest of Newton's steps, of the sampling's: the nearest sample may be some steps away where many are as near."""
MAX_ITERATIONS = 5
"""Newton's steps to the closest point; two are usual."""
ACROSS = 1.5
"""How far across a rim, in steps of the sampling, better starts than the samples are sought."""
ROUNDS, PROBES = 2, 9
"""So often, closer and closer together, and at so many places."""
LEAST_DEPTH = 0.01
"""Floor of a taper that depths are told by: they are within its square of the radius of it."""
FAR = 1e4
"""Distance, in sizes of the leaf, from where it is seen as from infinity: points farther out are brought there."""


@dataclass(frozen=True, eq=False)
class SurfaceIndex:
    """Index of the surface of one leaf, for its closest points.

    Attributes
    ----------
    leaf : TexturedBlade
    solid : LeafSolid
        The solid that it bounds.
    tile : TileSamples
    cells : CellTree
    strips : Strips
        The rim.
    strip_boxes : (2k, 15) float32 ndarray
        The tree over the strips.
    middle, reach : (3,) ndarray, float
        Of the leaf: its box's center, and the distance beyond which it is seen as from infinity.
    section : RimSection or None
        Across the rim, where that is tapered.
    """

    leaf: TexturedBlade
    solid: LeafSolid
    tile: TileSamples
    cells: CellTree
    strips: Strips
    strip_boxes: npt.NDArray[np.float32]
    middle: FloatArray
    reach: float
    section: "RimSection | None"

    @classmethod
    def build(cls, leaf: TexturedBlade, *, closed: bool = False) -> "SurfaceIndex":
        """Sample the tile, lay the cells, and put up the rim, of the leaf or of the closed solid."""
        tile = TileSamples.sample(leaf, closed=closed)
        solid = LeafSolid(leaf.edge_curve(closed=closed), tile.filled)
        strips, strip_boxes = rim_strips(leaf, solid, STRIP_STEPS * tile.step)
        cells = CellTree.build(leaf, solid, tile)
        low, high = cells.cells.centers.min(axis=0), cells.cells.centers.max(axis=0)
        middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
        section = RimSection.of(leaf, tile.step)
        return cls(leaf, solid, tile, cells, strips, strip_boxes, middle, FAR * size, section)

    def closest_points(self, x: npt.ArrayLike) -> FloatArray:
        """Return the closest points (n, 3) of the leaf's surface to (n, 3) world points."""
        points = as_points(x, "x", dim=3)
        feet = np.empty_like(points)

        def task(rows: IntArray) -> None:
            feet[rows], _ = self._closest(points[rows])

        self._run_in_order(points, task)
        return feet

    def signed_distance(self, x: npt.ArrayLike) -> FloatArray:
        """Return the signed distances (n,) of (n, 3) world points, negative inside."""
        points = as_points(x, "x", dim=3)
        distances = np.empty(len(points))

        def task(rows: IntArray) -> None:
            distances[rows] = self._closest(points[rows])[1]
            # Straight up from a point of the leaf its surface is not farther than the patch is thick.
            near = rows[distances[rows] <= 1.1 * self.leaf.thickness]
            distances[near[self.solid.contains_points(self.leaf, points[near])]] *= -1

        self._run_in_order(points, task)
        return distances

    def _closest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the closest points (n, 3) of the surface, and the distances (n,) to them."""
        near_points, step = self._brought_near(points), self.tile.step
        feet, square = np.empty_like(near_points), np.full(len(near_points), np.inf)
        nearest_strips(near_points, self.strip_boxes, self.strips, feet, square)
        cell, sample = np.empty(len(near_points), dtype=np.int64), np.empty(len(near_points), dtype=np.int64)
        # A face may be nearer than the rim where its nearest sample is not; a tapered one is steep between samples.
        gap = step if self.section is None else step + float(np.abs(self.leaf.heights).max())
        bound, tree = (np.sqrt(square) + gap) ** 2, self.cells
        nearest_samples(near_points, tree.boxes, tree.cells, self.tile.arrays, tree.mask, step, cell, sample, bound)
        rows = np.flatnonzero(sample >= 0)
        flat = self.tile.samples[:, sample[rows]].T.astype(np.float64)
        flat[:, :2] += self.tile.origin + (tree.corners[cell[rows]] + 0.5) * self.tile.cell
        on_face = _refine(self.leaf, self.solid, near_points[rows], flat, step, self.section)
        nearer = np.sum((on_face - near_points[rows]) ** 2, axis=1) < square[rows]
        feet[rows[nearer]] = on_face[nearer]
        return feet, _lengths(points - feet)

    def _brought_near(self, points: FloatArray) -> FloatArray:
        """Return the points, those beyond reach moved towards the leaf: squares of their distances stay finite."""
        # A quarter of the way has a length that floating point can express, whatever the point.
        quarter, reach = points / 4 - self.middle / 4, self.reach / 4
        length = _lengths(quarter)
        share = reach / np.maximum(length, reach)
        moved = self.middle + 4 * (quarter * share[:, np.newaxis])
        return np.where((length > reach)[:, np.newaxis], moved, points)

    def _run_in_order(self, points: FloatArray, task: Callable[[IntArray], None]) -> None:
        """Call ``task(rows)`` for all points, block by block, on all threads: neighbors in space one after another.

        What is near to one point is near to the next, and still in the cache.
        """
        for first, last in blocks(len(points), BATCH_SIZE):
            near_points = self._brought_near(points[first:last])
            low = near_points.min(axis=0)
            size = float(np.max(near_points.max(axis=0) - low)) or 1.0
            order = first + morton_order(((near_points - low) * (255 / size)).astype(np.int64), 8)
            _run_rows(task, order)


@dataclass(frozen=True, eq=False)
class RimSection:
    """A tapered rim across the margin, where samples are farther apart than it is round.

    Attributes
    ----------
    near : Taper
        The depth below the margin, as far as samples are apart beyond the rim.
    radius, reach : float
        Of the rim, and how far across it places are looked for.
    """

    near: Taper
    radius: float
    reach: float

    @classmethod
    def of(cls, leaf: TexturedBlade, step: float) -> "RimSection | None":
        """Return that of a leaf whose samples are a step apart, if its rim is tapered."""
        rim, reach = leaf.blade.rim, ACROSS * step
        if rim is None:
            return None
        return cls(Taper(leaf.blade.outline.polygon, rim.radius + reach, LEAST_DEPTH), rim.radius, reach)

    def starts(self, blade: Blade, points: FloatArray, samples: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return which samples (n, 3) lie near the rim, and the places (m, 3) across it that are nearest to points.

        They are as high over the blade as their samples, and looked for at equal steps of a semicircle.
        """
        depths, *slopes = self.near.jet(samples[:, :2]).T
        rows = np.flatnonzero(depths < 1)
        inward = np.column_stack(slopes)[rows]
        inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-300)
        depth = self.near.radius * (1 - np.sqrt(1 - depths[rows] ** 2))
        ends = [np.clip(depth + sign * self.reach, 0, self.radius) for sign in (-1, 1)]
        low, high = (np.arccos(1 - end / self.radius) for end in ends)
        best = samples[rows]
        for _ in range(ROUNDS):
            least, angle, spacing = np.full(len(rows), np.inf), low.copy(), (high - low) / (PROBES - 1)
            for probe in range(PROBES):
                flat, here = samples[rows], low + probe * spacing
                flat[:, :2] += (self.radius * (1 - np.cos(here)) - depth)[:, np.newaxis] * inward
                square = np.sum((blade.lift(flat) - points[rows]) ** 2, axis=1)
                nearer = square < least
                best[nearer], least[nearer], angle[nearer] = flat[nearer], square[nearer], here[nearer]
            low, high = np.maximum(angle - spacing, low), np.minimum(angle + spacing, high)
        return rows, best


def _refine(
    leaf: TexturedBlade,
    solid: LeafSolid,
    points: FloatArray,
    start: FloatArray,
    step: float,
    section: RimSection | None,
) -> FloatArray:
    """Return the points of the surface closest to `points`, by Newton's method from samples beside them.

    Where it leads out of the outline, away from the surface, or farther away than it began, as across a bend, it begins
    at the point itself, if the sample is not a step away, and else the sample is the answer.
    """
    first, feet, good = _newton(leaf, solid, points, start, step)
    square = np.sum((first - points) ** 2, axis=1)
    good &= np.sum((feet - points) ** 2, axis=1) <= square
    rows = np.flatnonzero(~good & (square < step**2))
    if len(rows):
        _, feet[rows], found = _newton(leaf, solid, points[rows], leaf.blade.flatten(points[rows]), step)
        good[rows] = found & (np.sum((feet[rows] - points[rows]) ** 2, axis=1) <= square[rows])
    feet = np.where(good[:, np.newaxis], feet, first)
    if section is None:
        return feet
    rows, across = section.starts(leaf.blade, points, start)
    _, others, found = _newton(leaf, solid, points[rows], across, step)
    nearer = found & (np.sum((others - points[rows]) ** 2, axis=1) < np.sum((feet[rows] - points[rows]) ** 2, axis=1))
    feet[rows[nearer]] = others[nearer]
    return feet


def _newton(
    leaf: TexturedBlade, solid: LeafSolid, points: FloatArray, start: FloatArray, step: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return where Newton's method starts and ends in the world, and whether that is on the surface in the outline.

    The first step's second derivatives are kept.
    """
    flat, feet = start.copy(), np.empty_like(start)
    values, inner, hessians = leaf.jets(start, 2)
    here, active = leaf.blade.lift_with_jacobian(start), np.arange(len(start))
    first, rim = here.world, leaf.blade.rim
    # Beside a tapered rim the lift bends as much as the texture does.
    rows = np.flatnonzero(rim.values(start[:, :2]) < 1) if rim is not None else np.empty(0, dtype=np.int64)
    if len(rows):
        normals = Lifted(here.world[rows], here.columns[rows]).pull_back(inner[rows])
        hessians[rows] -= np.einsum("nabk,nk->nab", leaf.blade.lift_hessians(start[rows]), normals)
    for iteration in range(MAX_ITERATIONS):
        if iteration > 0:
            values, inner = leaf.values_and_gradients(flat[active])
            here = leaf.blade.lift_with_jacobian(flat[active])
        steps = np.empty((len(active), 3))
        projection_loops.closest_steps(
            points[active], here.world, here.columns, values, inner, hessians[active], MAX_STEP * step, steps
        )
        flat[active] += steps
        feet[active] = here.world + np.einsum("nk,nkj->nj", steps, here.columns)
        active = active[(iteration == 0) | (np.abs(steps).max(axis=1, initial=0.0) > TOLERANCE * step)]
        if not len(active):
            break
    if len(rows):
        feet[rows] = leaf.blade.lift(flat[rows])
    good = solid.contains(flat[:, :2])
    good[active] = False
    return first, feet, good


def _run_rows(task: Callable[[IntArray], None], rows: IntArray) -> None:
    run_blocks(lambda start, stop: task(rows[start:stop]), len(rows), BLOCK)


def _lengths(vectors: FloatArray) -> FloatArray:
    """Return the lengths of (n, 3) vectors of any finite size."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    scale = np.where(largest > 0, largest, 1.0)
    with np.errstate(over="ignore"):  # a length beyond all numbers is infinite
        return np.asarray(np.linalg.norm(vectors / scale[:, np.newaxis], axis=1) * largest, dtype=np.float64)
