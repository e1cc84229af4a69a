"""Solids whose surface is known exactly, to measure a reconstruction against the truth and not against another mesh."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive, Whole
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_near
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.parallel import run_blocks
from o3dleaf.samples.domain import BLOCK, evaluate

TURN = Rotation.from_euler("xyz", [23.0, 37.0, 11.0], degrees=True).as_matrix()
"""How all solids stand in the world: no face, axis or plane of symmetry along a lattice's."""
CENTER = np.array([0.31, -0.17, 0.09])
MARGIN = 0.25
"""What the bounds leave around a solid's box, of that box's diagonal."""
TOLERANCE = 1e-9
"""Nearer than this, of the box's diagonal, a point is on the surface: the way to its foot has no direction."""


class Feet(NamedTuple):
    """Closest points of a surface: (n, 3) points, (n, 3) unit normals there, outward, (n,) distances, < 0 inside."""

    points: FloatArray
    normals: FloatArray
    distance: FloatArray

    def __repr__(self) -> str:
        return f"Feet({len(self.points):,} points)"


class Solid(ABC):
    r"""A closed surface of known shape, as a Field: F(x) = −d(x), the signed distance turned larger inside.

    A kind of solid says where its closest points are, in coordinates of its own; here they are turned
    and moved into the world, so that nothing lies along the axes.

    Attributes
    ----------
    bounds : (2, 3) ndarray
        A box around it with room; outside, F is the value at the nearest point of it less the distance.
    unit : None
    area : float
        Of the surface.
    """

    unit: str | None = None

    @property
    @abstractmethod
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of a box around it, in its own coordinates."""

    @property
    @abstractmethod
    def area(self) -> float:
        """Area of the surface."""

    @abstractmethod
    def _feet(self, points: FloatArray) -> Feet:
        """Return the closest points, all in its own coordinates."""

    @abstractmethod
    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return (count, 3) points uniform by area, on the surface or near it, in its own coordinates."""

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lower, then upper corner of the domain."""
        corners = np.stack(np.meshgrid(*self.box.T, indexing="ij"), axis=-1).reshape(-1, 3) @ TURN.T + CENTER
        pad = MARGIN * np.linalg.norm(self.box[1] - self.box[0])
        return np.stack([corners.min(axis=0) - pad, corners.max(axis=0) + pad])

    def closest(self, points: npt.ArrayLike) -> Feet:
        """Return the closest points of the surface to (n, 3) points, with outward normals and signed distances.

        Parameters
        ----------
        points : (n, 3) array_like

        Returns
        -------
        Feet
            On an edge of the surface the normal is that of the face which the point is farthest out of.

        Raises
        ------
        InputError
            If a point is not finite.
        """
        where = as_near(points, self.bounds)
        closest = Feet(np.empty_like(where), np.empty_like(where), np.empty(len(where)))

        def task(start: int, stop: int) -> None:
            feet, normals, distance = self._feet((where[start:stop] - CENTER) @ TURN)
            closest.points[start:stop] = feet @ TURN.T + CENTER
            closest.normals[start:stop] = normals @ TURN.T
            closest.distance[start:stop] = distance

        run_blocks(task, len(where), BLOCK)
        return closest

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) distances of (n, 3) points to the surface, negative inside, near and far."""
        return self.closest(points).distance

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n,) values −d at (n, 3) points."""
        return evaluate(self._inside, self.bounds, points)[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) gradients at (n, 3) points: unit vectors, inward along the way to the closest point."""
        return evaluate(self._inside, self.bounds, points)[1]

    @checked
    def sample(self, count: Whole, seed: Whole = 0) -> tuple[FloatArray, FloatArray]:
        """Return `count` points of the surface, uniform by area and independent, and their outward unit normals.

        Parameters
        ----------
        count : int
        seed : int

        Returns
        -------
        points, normals : (count, 3) ndarrays

        Raises
        ------
        InputError
            If `count` is not above zero.
        """
        require_positive(count, "count")
        drawn = self._draw(int(count), np.random.default_rng(seed))
        feet = self.closest(drawn @ TURN.T + CENTER)
        return feet.points, feet.normals

    def _inside(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        feet, normals, distance = self._feet((points - CENTER) @ TURN)
        on = np.abs(distance) < TOLERANCE * np.linalg.norm(self.box[1] - self.box[0])
        way = (points - (feet @ TURN.T + CENTER)) / np.where(on, 1.0, distance)[:, np.newaxis]
        return -distance, -np.where(on[:, np.newaxis], normals @ TURN.T, way)


@checked
@dataclass(frozen=True, eq=False)
class Sphere(Solid):
    """A sphere.

    Attributes
    ----------
    radius : float
    """

    radius: Positive = 0.5

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of its box."""
        return self.radius * np.array([[-1.0] * 3, [1.0] * 3])

    @property
    def area(self) -> float:
        """Area of the surface."""
        return float(4 * np.pi * self.radius**2)

    def _feet(self, points: FloatArray) -> Feet:
        normals, length = directions(points, np.array([1.0, 0.0, 0.0]))
        return Feet(self.radius * normals, normals, length - self.radius)

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        return directions(rng.normal(size=(count, 3)), np.array([1.0, 0.0, 0.0]))[0] * self.radius


@checked
@dataclass(frozen=True, eq=False)
class Torus(Solid):
    """A torus about its own third axis.

    Attributes
    ----------
    radius, tube : float
        Of the circle in its middle, and of the tube around it.
    """

    radius: Positive = 0.4
    tube: Positive = 0.15

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of its box."""
        reach = self.radius + self.tube
        return np.array([[-1.0], [1.0]]) * [reach, reach, self.tube]

    @property
    def area(self) -> float:
        """Area of the surface."""
        return float(4 * np.pi**2 * self.radius * self.tube)

    def _feet(self, points: FloatArray) -> Feet:
        flat = points * [1.0, 1.0, 0.0]
        middle = self.radius * directions(flat, np.array([1.0, 0.0, 0.0]))[0]
        normals, length = directions(points - middle, np.array([0.0, 0.0, 1.0]))
        return Feet(middle + self.tube * normals, normals, length - self.tube)

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        # Area goes with the distance from the axis: angles around the tube are kept in that proportion.
        angle = np.empty(0)
        while len(angle) < count:
            tried, level = rng.uniform(0.0, 2 * np.pi, 2 * count), rng.random(2 * count)
            kept = level * (self.radius + self.tube) < self.radius + self.tube * np.cos(tried)
            angle = np.concatenate([angle, tried[kept]])[:count]
        around = rng.uniform(0.0, 2 * np.pi, count)
        far = self.radius + self.tube * np.cos(angle)
        return np.column_stack([far * np.cos(around), far * np.sin(around), self.tube * np.sin(angle)])


@checked
@dataclass(frozen=True, eq=False)
class Block(Solid):
    """A block with sharp edges and corners.

    Attributes
    ----------
    sides : (3,) tuple
        Lengths of its edges.
    """

    sides: tuple[Positive, Positive, Positive] = (1.0, 0.7, 0.4)

    @property
    def box(self) -> FloatArray:
        """(2, 3) lower, then upper corner of the block."""
        return np.array([[-0.5], [0.5]]) * self.sides

    @property
    def area(self) -> float:
        """Area of the surface."""
        a, b, c = self.sides
        return 2 * (a * b + b * c + c * a)

    def _feet(self, points: FloatArray) -> Feet:
        half, rows = self.box[1], np.arange(len(points))
        beyond = np.abs(points) - half
        axis = beyond.argmax(axis=1)
        sign = np.where(points < 0, -1.0, 1.0)
        feet = np.clip(points, -half, half)
        outside = beyond[rows, axis] > 0
        inner = np.flatnonzero(~outside)
        feet[inner, axis[inner]] = (sign * half)[inner, axis[inner]]
        normals = np.zeros_like(points)
        normals[rows, axis] = sign[rows, axis]
        return Feet(feet, normals, np.where(outside, 1.0, -1.0) * np.linalg.norm(points - feet, axis=1))

    def _draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        half = self.box[1]
        face = half.prod() / half
        axis = rng.choice(3, count, p=face / face.sum())
        points = rng.uniform(-half, half, (count, 3))
        points[np.arange(count), axis] = rng.choice([-1.0, 1.0], count) * half[axis]
        return points


def directions(vectors: FloatArray, otherwise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (n, 3) and lengths (n,); where a length is zero, the direction is `otherwise`."""
    length = np.linalg.norm(vectors, axis=1)
    zero = length == 0
    unit = vectors / np.where(zero, 1.0, length)[:, np.newaxis]
    return np.where(zero[:, np.newaxis], otherwise, unit), length
