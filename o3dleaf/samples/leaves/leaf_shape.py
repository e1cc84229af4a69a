"""A leaf of known shape: an outline in the plane, a surface over it, and what else a scanner would see beside it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import KDTree
from shapely.geometry import Polygon

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_near, as_points
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.samples.domain import evaluate, inside_by_distance
from o3dleaf.samples.leaves.margin import LiftedMargin, rings_of
from o3dleaf.samples.leaves.plane_mesh import integrate, triangulate
from o3dleaf.samples.leaves.sweep import Sweep

SEED_STEP = 1.0
"""Step of the lattice, in millimeters, from whose points the search for a closest one starts: the surfaces bend with
radii of several of it."""
MARGIN_STEP = 0.2
STEPS = 30
CELLS = 60.0
"""Lattice steps of the quadrature of the area to the length of the leaf; of degree 4, right to 1e-9."""
PAD = 2.0
"""What the bounds leave around the leaf, in millimeters."""


@dataclass(frozen=True, eq=False)
class Tube:
    """A round stalk from a point along a unit direction: what is no blade.

    Attributes
    ----------
    path : (k, 3) ndarray
        Points of its axis, close together.
    radius : float
        In millimeters.
    """

    path: FloatArray
    radius: float

    @property
    def area(self) -> float:
        """Area of its mantle."""
        return float(2 * np.pi * self.radius * np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())

    def draw(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return (count, 3) points of its mantle, uniform by area and independent."""
        way = np.diff(self.path, axis=0)
        length = np.linalg.norm(way, axis=1)
        row = rng.choice(len(way), count, p=length / length.sum())
        ahead = way[row] / length[row, np.newaxis]
        # Any vector that is not along the axis makes the two that are normal to it.
        other = np.eye(3)[np.abs(way.sum(axis=0)).argmin()]
        side = np.cross(ahead, other)
        side /= np.linalg.norm(side, axis=1)[:, np.newaxis]
        angle = rng.uniform(0.0, 2 * np.pi, (count, 1))
        around = np.cos(angle) * side + np.sin(angle) * np.cross(ahead, side)
        return np.asarray(self.path[row] + rng.random((count, 1)) * way[row] + self.radius * around)


@dataclass(frozen=True, eq=False)
class LeafShape:
    r"""A leaf S(u, v) over an outline, as a Field: F(x) = half the thickness less the distance to the surface.

    Attributes
    ----------
    kind : str
        What it shows, see `leaf_shape`.
    sweep : Sweep
        The surface over the plane of (u, v): u along the leaf from its base, v across, in millimeters.
    outline : shapely Polygon
        In (u, v), with holes where something ate it.
    half_thickness : float
        Half the thickness of the leaf whose outside is F < 0, in millimeters.
    tubes : tuple of Tube
        Petiole and stem stub, which belong to the scan and not to the blade.
    layer : shapely Polygon or None
        A second sheet above the blade, in (u, v); it belongs to the scan and not to the blade either.
    layer_height : float
        How far above, along the normal, in millimeters.
    """

    kind: str
    sweep: Sweep
    outline: Polygon
    half_thickness: float = 0.1
    tubes: tuple[Tube, ...] = ()
    layer: Polygon | None = None
    layer_height: float = 0.5
    unit: str = "mm"

    def __repr__(self) -> str:
        return f"LeafShape({self.kind}, {self.sweep.length:g} {self.unit} long, {self.area:.4g} {self.unit}²)"

    @property
    def holes(self) -> int:
        """Number of holes."""
        return len(self.outline.interiors)

    @cached_property
    def area(self) -> float:
        """Area of the surface, by quadrature of ‖S_u × S_v‖."""
        return integrate(self.outline, self.stretch, self.sweep.length / CELLS)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) lower, then upper corner of a box around it with room."""
        points = self._seeds[0].data
        pad = PAD + self.half_thickness
        return np.stack([points.min(axis=0) - pad, points.max(axis=0) + pad])

    def lift(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) points S at (n, 2) places (u, v), also outside the outline."""
        return self.sweep.jet(self._near(plane)).points

    def jacobian(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3, 2) derivatives (S_u, S_v) at (n, 2) places."""
        jet = self.sweep.jet(self._near(plane))
        return np.stack([jet.along, jet.across], axis=-1)

    def normals(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) unit normals S_u × S_v / ‖S_u × S_v‖, towards the adaxial side, at (n, 2) places."""
        normal = np.cross(*self.jacobian(plane).transpose(2, 0, 1))
        return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, np.newaxis])

    def stretch(self, plane: npt.ArrayLike) -> FloatArray:
        """Return the (n,) elements of area ‖S_u × S_v‖ at (n, 2) places."""
        return np.asarray(np.linalg.norm(np.cross(*self.jacobian(plane).transpose(2, 0, 1)), axis=1))

    def contains(self, plane: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which of (n, 2) places lie in the outline."""
        return np.asarray(shapely.contains_xy(self.outline, as_points(plane, "plane", dim=2)))

    @checked
    def margin_places(self, step: Positive) -> list[FloatArray]:
        """Return the places (k, 2) of each ring of the margin, exterior first, at most `step` apart."""
        return rings_of(self.outline, require_positive(step, "step"))

    @checked
    def margin(self, step: Positive) -> list[FloatArray]:
        """Return the points (k, 3) of each ring of the margin, exterior first, at most `step` apart in the plane."""
        return [self.sweep.jet(ring).points for ring in self.margin_places(step)]

    @checked
    def mesh(self, step: Positive) -> tuple[FloatArray, IntArray]:
        """Return vertices (n, 3) on the surface and triangles (m, 3), counter-clockwise seen from above, of a step."""
        plane, triangles = triangulate(self.outline, require_positive(step, "step"))
        return self.sweep.jet(plane).points, triangles

    def closest(self, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the closest points of the leaf (n, 3), margin included, and their places (n, 2).

        Gauss and Newton's steps from the nearest of a fine set of seeds; where they leave the outline, or
        the margin is nearer, the closest point of the margin.
        """
        p = as_near(points, self.bounds)
        tree, places = self._seeds
        inner = self._refine(p, places[tree.query(p)[1]])
        rim = self._rim.closest(p)
        at_inner, at_rim = self.sweep.jet(inner).points, self.sweep.jet(rim).points
        miss, rim_miss = (((p - x) ** 2).sum(axis=1) for x in (at_inner, at_rim))
        taken = (self.contains(inner) & (miss <= rim_miss))[:, np.newaxis]
        return np.where(taken, at_inner, at_rim), np.where(taken, inner, rim)

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return half the thickness less the distance to the surface, (n,), at (n, 3) points in millimeters."""
        return evaluate(self._inside, self.bounds, points)[0]

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Return the (n, 3) gradients at (n, 3) points, towards the closest point; 0 on it."""
        return evaluate(self._inside, self.bounds, points)[1]

    def _near(self, plane: npt.ArrayLike) -> FloatArray:
        return as_near(plane, np.reshape(self.outline.bounds, (2, 2)), "plane")

    @cached_property
    def _seeds(self) -> tuple[KDTree, FloatArray]:
        plane, _ = triangulate(self.outline, SEED_STEP)
        return KDTree(self.sweep.jet(plane).points), plane

    @cached_property
    def _rim(self) -> LiftedMargin:
        return LiftedMargin.of(self.sweep, self.outline, MARGIN_STEP)

    def _refine(self, p: FloatArray, x: FloatArray) -> FloatArray:
        """Return places (n, 2) of the least distance beside `x`, by damped steps that descend."""
        miss, damping = ((p - self.sweep.jet(x).points) ** 2).sum(axis=1), np.full(len(p), 1e-6)
        for _ in range(STEPS):
            jet = self.sweep.jet(x)
            J = np.stack([jet.along, jet.across], axis=-1)
            g = np.einsum("nck,nc->nk", J, p - jet.points)
            A = np.einsum("nck,ncl->nkl", J, J)
            A[:, [0, 1], [0, 1]] *= 1 + damping[:, np.newaxis]
            trial = x + np.linalg.solve(A, g[:, :, np.newaxis])[:, :, 0]
            left = ((p - self.sweep.jet(trial).points) ** 2).sum(axis=1)
            better = left < miss
            settled = np.abs(trial - x).max(initial=0.0) < 1e-10
            x, miss = np.where(better[:, np.newaxis], trial, x), np.where(better, left, miss)
            damping = np.where(better, 0.2 * damping, 10 * damping + 1e-6)
            if settled:
                break
        return x

    def _inside(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        return inside_by_distance(points, self.closest(points)[0], self.half_thickness)
