"""A blade whose surface, outline and stretch are known: a sheet rolled about a cylinder, or flat, anywhere in space."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import open3d as o3d
import shapely

from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.blade.lifted import Lifted
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.samples.leaves.plane_mesh import triangulate

LENS = shapely.Polygon(
    [(x, 6 * np.sin(np.pi * x / 80)) for x in np.linspace(0, 80, 161)]
    + [(x, -6 * np.sin(np.pi * x / 80)) for x in np.linspace(80, 0, 161)[1:-1]]
)
"""A leaf of 80 by 12 with two sharp tips."""


@dataclass
class KnownHole:
    """A hole as the outline of a blade tells it."""

    place: Any
    area: float
    width: float
    filled: bool


@dataclass
class KnownOutline(AlphaShape):
    """A polygon as an outline."""

    polygon: shapely.Polygon
    holes: tuple = ()

    @property
    def rounded(self):
        return self.polygon

    @property
    def bounds(self):
        return np.array(self.polygon.bounds).reshape(2, 2)

    @property
    def area(self):
        return self.polygon.area

    def contains(self, points):
        return shapely.intersects_xy(self.polygon, *np.asarray(points).T)


@dataclass(eq=False)
class RolledBlade(Blade):
    """S(u, v) = R (a u, r sin(b v / r), r − r cos(b v / r)) + t: isometric where the stretches a and b are 1."""

    outline: KnownOutline = field(default_factory=lambda: KnownOutline(LENS))
    radius: float = 8.0
    stretch: tuple = (1.0, 1.0)
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    length_unit: str | None = "mm"
    other_pieces: np.ndarray | None = None

    @property
    def unit(self):
        return self.length_unit

    def flatten(self, x):
        local = (np.asarray(x) - self.shift) @ self.rotation
        away = np.hypot(local[:, 1], self.radius - local[:, 2])
        angle = np.arctan2(local[:, 1], self.radius - local[:, 2])
        return np.column_stack(
            [local[:, 0] / self.stretch[0], angle * self.radius / self.stretch[1], self.radius - away]
        )

    def lift(self, flat):
        return self.lift_with_jacobian(np.asarray(flat)).world

    def lift_with_jacobian(self, flat):
        (a, b), (u, v, w) = self.stretch, flat.T
        angle, nil = b * v / self.radius, np.zeros(len(flat))
        inward = np.column_stack([nil, -np.sin(angle), np.cos(angle)])
        tangent = np.column_stack([nil, np.cos(angle), np.sin(angle)])
        local = np.column_stack([a * u, nil, nil + self.radius]) + (w - self.radius)[:, np.newaxis] * inward
        scale = (b * (1 - w / self.radius))[:, np.newaxis]
        columns = np.stack([np.tile([a, 0.0, 0.0], (len(flat), 1)), scale * tangent, inward], axis=1)
        return Lifted(local @ self.rotation.T + self.shift, columns @ self.rotation.T)

    def focal_heights(self, plane):
        return np.full(len(plane), self.radius)

    def extract_mesh(self, spacing, region=None) -> o3d.geometry.TriangleMesh:
        plane, triangles = triangulate(self.outline.polygon, spacing)
        return build_mesh(self.lift(np.column_stack([plane, np.zeros(len(plane))])), triangles)

    def describe(self):
        return {}

    def moved(self, rotation, shift):
        """Return the blade after x -> R x + t."""
        return replace(self, rotation=rotation @ self.rotation, shift=rotation @ self.shift + shift)

    def scan(self, spacing, noise=0.0, seed=0):
        """Return points, random by area, with normal errors of `noise` spacings, and their places."""
        rng = np.random.default_rng(seed)
        low, high = self.outline.bounds
        places = rng.uniform(low, high, (round(float(np.prod((high - low) / spacing * self.stretch))), 2))
        places = places[self.outline.contains(places)]
        points = self.lift(np.column_stack([places, np.zeros(len(places))]))
        return points + noise * spacing * rng.standard_normal(points.shape), places
