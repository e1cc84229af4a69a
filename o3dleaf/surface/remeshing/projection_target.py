"""Projection targets of vertices that have moved: a field's surface, or the mesh as it was."""

from typing import Protocol

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, ray_scene
from o3dleaf.core.newton import Jet, project_to_level

MAX_ITERATIONS = 20
TOLERANCE = 1e-4
"""Length of Newton's last step, of the longest one allowed: what is left is about its square."""

Masks = npt.NDArray[np.uint8]
"""Labels of the triangles around a point, one bit a label."""


class ProjectionTarget(Protocol):
    """A surface on which points have charts, coordinates in which it is easily evaluated."""

    def project(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Move points by `shifts` and project them onto the surface.

        Parameters
        ----------
        charts : (n, 3) ndarray
            Where they are, near the surface.
        shifts : (n, 3) ndarray
            In the world.
        masks : (n,) ndarray of uint8
        creased : (n,) ndarray of bool
            Whether they lie on an edge between labels, or a sharp one.

        Returns
        -------
        charts, places : (n, 3) ndarrays
            Where they are now; places are in the world.
        reached : (n,) ndarray of bool
            Whether they got there.
        """
        ...


class FieldTarget:
    """The surface of a field, where it is zero, and caps on the faces of a box; charts are places.

    Creases stay where they are.
    """

    def __init__(self, jet: Jet, max_step: float, box: FloatArray | None = None) -> None:
        """Take a field by its values and gradients, and the box that it ends at; no step is longer than `max_step`."""
        self.jet, self.max_step, self.box = jet, max_step, box

    def project(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        r"""Move points, then follow the gradient: x ← x − F(x) ∇F/\|∇F\|²; see `ProjectionTarget`."""
        del masks
        places = np.where(creased[:, np.newaxis], charts, charts + shifts)
        reached = ~creased | ~shifts.any(axis=1)
        free = np.flatnonzero(~creased)
        if self.box is not None:
            free = free[~self._cap(self.box, places, free)]
        places[free], reached[free] = project_to_level(
            places[free],
            self.jet,
            max_step=self.max_step,
            tolerance=TOLERANCE * self.max_step,
            max_iterations=MAX_ITERATIONS,
        )
        if self.box is not None:
            np.clip(places, *self.box, out=places)
        return places, places, reached

    def _cap(self, box: FloatArray, places: FloatArray, rows: IntArray) -> BoolArray:
        """Move those points onto a face of the box that lie in the solid and nearer to it than to zero; say which."""
        away = np.abs(places[rows, np.newaxis] - box).reshape(len(rows), 6)
        face = away.argmin(axis=1)
        capped = away[np.arange(len(rows)), face] < self.max_step
        if capped.any():
            near = np.flatnonzero(capped)
            values, slopes = self.jet(np.clip(places[rows[near]], *box))
            length = np.linalg.norm(slopes, axis=1)
            capped[near] = (values > 0) & (values > length * away[near, face[near]])
            side, axis = np.divmod(face[capped], 3)
            places[rows[capped], axis] = box[side, axis]
        return np.asarray(capped)


class MeshTarget:
    """A mesh as it was; charts are places. Creases stay where they are."""

    def __init__(self, vertices: FloatArray, triangles: IntArray) -> None:
        """Take the mesh."""
        self.middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self.scene = ray_scene(vertices - self.middle, triangles)

    def project(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Move points, then project them onto the mesh; see `ProjectionTarget`. Points that do not move are on it."""
        del masks
        moving = shifts.any(axis=1)
        places = charts.copy()
        rows = np.flatnonzero(moving & ~creased)
        if len(rows):
            query = o3d.core.Tensor.from_numpy((charts[rows] + shifts[rows] - self.middle).astype(np.float32))
            places[rows] = self.scene.compute_closest_points(query)["points"].numpy().astype(np.float64) + self.middle
        return places, places, ~(moving & creased)
