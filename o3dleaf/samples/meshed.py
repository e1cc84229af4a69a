"""Solids that are sampled by way of a fine mesh of theirs."""

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.lattice import Lattice
from o3dleaf.core.mesh_arrays import IntArray, triangle_areas
from o3dleaf.core.parallel import run_blocks
from o3dleaf.samples.domain import BLOCK
from o3dleaf.samples.solids import Solid
from o3dleaf.surface.isosurface.polygonize import polygonize

CUBE = 4
"""Points along an edge of the cubes whose middles are evaluated first: with 3 or 6 it takes a third longer."""


class Meshed(Solid):
    """A solid whose samples are drawn from the triangles of its level set and then moved to the closest points.

    Triangles of step h are off by h²/8R where the surface bends with radius R: the density of the
    samples is uneven by about (h/R)²/8 there, and their places are exact.
    """

    @property
    @abstractmethod
    def step(self) -> float:
        """Step of the lattice of the mesh."""

    def _level(self, points: FloatArray) -> FloatArray:
        """Return (n,) values, larger inside, that vanish on the surface."""
        return -self._feet(points).distance

    @cached_property
    def mesh(self) -> tuple[FloatArray, IntArray]:
        """Vertices and triangles of the level set, in the solid's own coordinates."""
        return level_mesh(self._level, self.box, self.step)

    @property
    def area(self) -> float:
        """Area of that mesh, too small by about (h/R)²/8."""
        return float(triangle_areas(*self.mesh).sum())

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        return draw_on_triangles(*self.mesh, count, rng)[0]


def level_mesh(
    level: Callable[[FloatArray], FloatArray], box: FloatArray, step: float, steepness: float = 1.0
) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles where values (n,) at points (n, 3), larger inside, vanish within a (2, 3) box.

    They change by no more than `steepness` times the way, as distances do by the way: the value in the middle of a cube
    of `CUBE`³ points of the lattice that is far from the surface tells the side of them all.
    """
    lattice = Lattice.covering(box + step * np.array([[-1.0], [1.0]]), step)
    axes = [o + s * np.arange(n) for o, s, n in zip(lattice.origin, lattice.spacing, lattice.shape, strict=True)]
    middles = [axis[::CUBE] + (CUBE - 1) / 2 * s for axis, s in zip(axes, lattice.spacing, strict=True)]
    grid = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)
    values = _evaluate(level, grid.reshape(-1, 3)).reshape(grid.shape[:3])
    for axis, count in enumerate(lattice.shape):
        values = values.repeat(CUBE, axis=axis).take(np.arange(count), axis=axis)
    # Half a cube's diagonal, and a step more for values that are distances but for their error far off.
    reach = (CUBE - 1) / 2 * np.linalg.norm(lattice.spacing) + max(lattice.spacing)
    near = np.nonzero(np.abs(values) <= steepness * reach)
    values[near] = _evaluate(level, np.stack([axis[k] for axis, k in zip(axes, near, strict=True)], axis=1))
    crossings, triangles = polygonize(values, 0.0)
    return lattice.positions(crossings), triangles


def _evaluate(level: Callable[[FloatArray], FloatArray], points: FloatArray) -> FloatArray:
    values = np.empty(len(points))

    def task(start: int, stop: int) -> None:
        values[start:stop] = level(points[start:stop])

    run_blocks(task, len(points), BLOCK)
    return values


def draw_on_triangles(
    vertices: FloatArray, triangles: IntArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    """Return (count, 3) points of a mesh, uniform by area and independent, and the triangles that they are on."""
    area = triangle_areas(vertices, triangles)
    chosen = rng.choice(len(triangles), count, p=area / area.sum())
    # Folding the unit square's corner back keeps the points uniform over a triangle.
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = vertices[triangles[chosen]].transpose(1, 0, 2)
    return np.asarray(a + u * (b - a) + v * (c - a)), chosen
