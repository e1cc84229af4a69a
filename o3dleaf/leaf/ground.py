"""The closed leaf's surface as remeshing needs it: points that have moved a little are put back onto it."""

from typing import TYPE_CHECKING

import numpy as np
import shapely

from o3dleaf.checks import FloatArray
from o3dleaf.leaf import newton
from o3dleaf.leaf.outline import in_polygon, sides_of
from o3dleaf.leaf.surface import lift, texture_jets, thickness
from o3dleaf.mesh.arrays import BoolArray, IntArray
from o3dleaf.parallel import run_blocks
from o3dleaf.remesh.ground import Masks
from o3dleaf.tiles.parts import RIM

if TYPE_CHECKING:
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

BLOCK = 1 << 12
MOST_STEPS = 12
SETTLED = 1e-6
"""Length of Newton's step, of the patch's thickness, at which a point is on the surface."""
LONGEST = 0.1
"""The same: no step is longer."""
ON_RIM = 1 << RIM
"""Bit of the rim among the labels around a vertex."""


class LeafGround:
    """The two faces, G = 0 between the bottom and the top of the patch, and the rim, straight up along the outline.

    A chart is flat coordinates z; a step in the world is one in z through the lift's Jacobian.
    """

    def __init__(self, leaf: "MultiscaleLeaf", outline: shapely.Geometry) -> None:
        """Stand on a leaf that is cut along an outline in the plane (along, across)."""
        self.leaf, self.outline, self.sides = leaf, outline, sides_of(outline)
        self.tree = shapely.STRtree(shapely.linestrings(self.sides.reshape(-1, 2, 2)))

    def settle(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return charts, places in the world, and which of them are on the surface; see `o3dleaf.remesh.ground`."""
        del creased
        blade = self.leaf.blade
        flat = charts + _to_flat(lift(blade, charts).columns, shifts) if np.any(shifts) else charts.copy()
        settled = np.ones(len(flat), dtype=bool)
        on_rim, on_face = masks & ON_RIM > 0, masks & ~np.uint8(ON_RIM) > 0
        flat[on_rim, :2] = self._to_outline(flat[on_rim, :2])[0]
        # The wall ends where the leaf does.
        beside = on_rim & ~on_face
        beside[beside] = texture_jets(self.leaf, flat[beside], 0)[0] < 0
        for rows, step in ((on_face & ~on_rim, self._face_steps), (on_face & on_rim | beside, self._edge_steps)):
            active = np.flatnonzero(rows)
            for _ in range(MOST_STEPS):
                if not len(active):
                    break
                moved = step(flat, active)
                active = active[moved > SETTLED * thickness(self.leaf)]
            settled[active] = False
        settled &= on_rim | in_polygon(self.outline, flat[:, :2])
        return flat, blade.lift(flat), settled

    def _face_steps(self, flat: FloatArray, rows: IntArray) -> FloatArray:
        """Take a step of Newton's method along the gradient in the world; return how far each point went."""
        here = flat[rows]
        values, inner = texture_jets(self.leaf, here, 1)
        columns, steps = lift(self.leaf.blade, here).columns, np.empty_like(here)
        longest = LONGEST * thickness(self.leaf)

        def task(start: int, stop: int) -> None:
            newton.gradient_steps(start, stop, columns, values, inner, longest, steps)

        run_blocks(task, len(here), BLOCK)
        return self._go(flat, rows, values, steps)

    def _edge_steps(self, flat: FloatArray, rows: IntArray) -> FloatArray:
        """Take such a step within the wall over the outline, and return to the outline."""
        here = flat[rows]
        values, inner = texture_jets(self.leaf, here, 1)
        _, along = self._to_outline(here[:, :2])
        slope = np.einsum("ij,ij->i", inner[:, :2], along)
        square = np.maximum(slope**2 + inner[:, 2] ** 2, 1e-300)
        share = -values / square
        share /= np.maximum(np.abs(share) * np.sqrt(square) / (LONGEST * thickness(self.leaf)), 1.0)
        moved = self._go(flat, rows, values, share[:, np.newaxis] * np.column_stack([slope[:, np.newaxis] * along, inner[:, 2]]))
        flat[rows, :2] = self._to_outline(flat[rows, :2])[0]
        return moved

    def _go(self, flat: FloatArray, rows: IntArray, values: FloatArray, steps: FloatArray) -> FloatArray:
        """Add steps, but for points of the leaf that they would take out of the patch: it is cut there, and closed."""
        low, high = self.leaf.texture.cell[:, 2] / self.leaf.scale
        before = flat[rows]
        there = before + steps
        there[:, 2] = np.clip(there[:, 2], low, high)
        at_end = (before[:, 2] == there[:, 2]) & (values > 0) & (np.abs(steps[:, 2]) > 0) & ((there[:, 2] == low) | (there[:, 2] == high))
        there[at_end] = before[at_end]
        flat[rows] = there
        return np.asarray(np.abs(there - before).max(axis=1, initial=0.0))

    def _to_outline(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest points (n, 2) of the outline, and the direction (n, 2) that it has there."""
        sides = self.sides[self.tree.nearest(shapely.points(plane))] if len(plane) else np.empty((0, 4))
        along = sides[:, 2:] - sides[:, :2]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        share = np.einsum("ij,ij->i", plane - sides[:, :2], along)[:, np.newaxis] / length**2
        return sides[:, :2] + np.clip(share, 0, 1) * along, along / length


def _to_flat(columns: FloatArray, shifts: FloatArray) -> FloatArray:
    """Return steps in z of steps in the world, by the lift's columns ∂X/∂z."""
    return np.asarray(np.linalg.solve(columns.transpose(0, 2, 1), shifts[..., np.newaxis])[..., 0])
