"""The leaf's surface as remeshing needs it: points that have moved a little are put back onto it."""

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.leaf.distance import projection_loops
from o3dleaf.leaf.distance.projection import OnBlade, lift, texture_jets, thickness
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.leaf.macro.outline import in_polygon, sides_of
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.projection_target import FieldTarget, Masks
from o3dleaf.surface.remeshing.remesh import remesh_charted

Labels = npt.NDArray[np.uint8]

BLOCK = 1 << 12
MOST_STEPS = 12
SETTLED = 2e-4
"""Length of Newton's last step, of the patch's thickness: what is left is about its square."""
LONGEST = 0.1
"""The same: no step is longer."""
ON_RIM = 1 << RIM
"""Bit of the rim among the labels around a vertex."""
NEAR = 1e-3
"""Distance from F = 0, of the edge, within which a vertex lies on a face."""
CHUNK = 1 << 17
"""Vertices looked at together."""


class LeafGround:
    """The two faces, G = 0 between the bottom and the top of the patch, and the rim, straight up along the outline.

    A chart is flat coordinates z; a step in the world is one in z through the lift's Jacobian.
    """

    def __init__(self, leaf: OnBlade, outline: shapely.Geometry, tile: Tile) -> None:
        """Stand on a leaf that is cut along an outline in the plane (along, across); the `tile` knows its pockets."""
        self.leaf, self.outline, self.sides = leaf, outline, sides_of(outline)
        nx, ny, nz = tile.lattice.shape
        self.lattice = tile.lattice
        self.inside = (tile.runs.expand(np.arange(nx * ny)) == INSIDE).reshape(nx, ny, nz)
        self.tree = shapely.STRtree(shapely.linestrings(self.sides.reshape(-1, 2, 2)))

    def project(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return charts, places in the world, and which of them are on the surface; see `projection_target`."""
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
        settled &= on_rim | in_polygon(self.outline, flat[:, :2]) & ~self._in_pocket(flat)
        return flat, blade.lift(flat), settled

    def _in_pocket(self, flat: FloatArray) -> BoolArray:
        """Return which points lie on the wall of a pocket, which is filled: in a cell with all its corners inside.

        Where the patch is cut, at its bottom or top, the surface is no wall.
        """
        shape = np.array(self.inside.shape)
        low = np.floor((flat - self.lattice.origin) / self.lattice.spacing).astype(np.int64)
        held = np.asarray(~np.isin(flat[:, 2], self.leaf.texture.cell[:, 2] / self.leaf.scale))
        for corner in np.ndindex(2, 2, 2):
            i, j, k = (low + corner).T
            held &= self.inside[i % shape[0], j % shape[1], np.clip(k, 0, shape[2] - 1)]
        return held

    def _face_steps(self, flat: FloatArray, rows: IntArray) -> FloatArray:
        """Take a step of Newton's method along the gradient in the world; return how far each point went."""
        here = flat[rows]
        values, inner = texture_jets(self.leaf, here, 1)
        columns, steps = lift(self.leaf.blade, here).columns, np.empty_like(here)
        longest = LONGEST * thickness(self.leaf)

        def task(start: int, stop: int) -> None:
            projection_loops.gradient_steps(start, stop, columns, values, inner, longest, steps)

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
        moved = self._go(
            flat, rows, values, share[:, np.newaxis] * np.column_stack([slope[:, np.newaxis] * along, inner[:, 2]])
        )
        flat[rows, :2] = self._to_outline(flat[rows, :2])[0]
        return moved

    def _go(self, flat: FloatArray, rows: IntArray, values: FloatArray, steps: FloatArray) -> FloatArray:
        """Add steps, but for points of the leaf that they would take out of the patch: it is cut there, and closed."""
        low, high = self.leaf.texture.cell[:, 2] / self.leaf.scale
        before = flat[rows]
        there = before + steps
        there[:, 2] = np.clip(there[:, 2], low, high)
        at_end = (
            (before[:, 2] == there[:, 2])
            & (values > 0)
            & (np.abs(steps[:, 2]) > 0)
            & ((there[:, 2] == low) | (there[:, 2] == high))
        )
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


def remesh_leaf(  # noqa: PLR0917 - a mesh is its vertices, triangles and labels
    leaf: OnBlade,
    outline: shapely.Geometry,
    tile: Tile,
    flat: FloatArray,
    triangles: IntArray,
    labels: Labels,
    target_edge: float,
) -> Charted:
    """Return the mesh of a leaf's surface, remeshed; its rim meets the faces in a sharp edge over the outline.

    Parameters
    ----------
    leaf : OnBlade
    outline : shapely geometry
        What the leaf is cut along, in the plane (along, across).
    tile : Tile
    flat : (n, 3) ndarray
        Vertices in flat coordinates: on F = 0, or on the rim.
    triangles : (m, 3) ndarray of int64
    labels : (m,) ndarray of uint8
        Adaxial, abaxial, rim.
    target_edge : float
    """
    places = np.empty_like(flat)
    run_blocks(lambda i, j: places.__setitem__(slice(i, j), leaf.blade.lift(flat[i:j])), len(flat), BLOCK)
    labels = _without_chamfers(triangles, labels, _on_faces(leaf, flat, NEAR * target_edge))
    ground = LeafGround(leaf, outline, tile)
    return remesh_charted(Charted.of(places, flat, triangles, labels), ground, target_edge)


def remesh_flat(leaf: OnBlade, flat: FloatArray, triangles: IntArray, target_edge: float) -> Charted:
    """Return a tile's mesh remeshed on F = 0 in the plane, its border bit for bit.

    Parameters
    ----------
    leaf : OnBlade
    flat : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    target_edge : float
        In the leaf's unit.
    """
    ground = FieldTarget(
        lambda points: texture_jets(leaf, points, 0)[0],
        lambda points: texture_jets(leaf, points, 1)[1],
        target_edge / 2,
    )
    return remesh_charted(
        Charted.of(flat, flat, triangles, np.zeros(len(triangles), dtype=np.uint8)), ground, target_edge
    )


def _on_faces(leaf: OnBlade, flat: FloatArray, near: float) -> BoolArray:
    """Return which points (n, 3) lie on F = 0 to within `near`."""
    found = np.empty(len(flat), dtype=bool)
    for first, last in blocks(len(flat), CHUNK):
        values, slopes = texture_jets(leaf, flat[first:last], 1)
        found[first:last] = np.abs(values) <= near * np.linalg.norm(slopes, axis=1)
    return found


def _without_chamfers(triangles: IntArray, labels: Labels, on_face: BoolArray) -> Labels:
    """Return labels by which the rim's triangles with a vertex on a face belong to that face.

    Marching cubes cuts the edge between the rim and a face off: what lies between becomes part of the face,
    and has only to be drawn up along the rim, where the lattice is fine, to make the edge sharp.
    """
    labels = labels.copy()
    face_of = np.full(len(on_face), RIM, dtype=np.uint8)
    while True:
        for face in (face for face in range(RIM) if (labels == face).any()):
            own = np.zeros(len(on_face), dtype=bool)
            own[triangles[labels == face]] = True
            face_of[own & on_face & (face_of == RIM)] = face
        rows = np.flatnonzero(labels == RIM)
        face = face_of[triangles[rows]].min(axis=1, initial=RIM)
        if not (face < RIM).any():
            break
        labels[rows] = face
    # What is left of a rim of one triangle's height has to stay one.
    bare = ~on_face
    bare[triangles[labels == RIM]] = False
    labels[bare[triangles].any(axis=1)] = RIM
    return labels
