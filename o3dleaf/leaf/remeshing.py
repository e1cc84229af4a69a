"""The leaf's surface as the projection target of remeshing: points that have moved a little are put back onto it."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.newton import MIN_SQUARE, Advance, Metric, project_to_level
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.io.labelled_mesh import RIM
from o3dleaf.leaf.blade.outline_area import in_polygon, sides_of
from o3dleaf.leaf.instancing.tile import Tile
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.leaf.textured_blade import TexturedBlade
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.projection_target import FieldTarget, Masks
from o3dleaf.surface.remeshing.remesh import remesh_charted

Labels = npt.NDArray[np.uint8]

BLOCK = 1 << 12
MAX_ITERATIONS = 12
TOLERANCE = 2e-4
"""Length of Newton's last step, of the patch's thickness: what is left is about its square."""
MAX_STEP = 0.1
"""The same: no step is longer."""
ON_RIM = 1 << RIM
"""Bit of the rim among the labels around a vertex."""
FACE_TOLERANCE = 1e-3
"""Distance from F = 0, of the edge, within which a vertex lies on a face."""
BATCH_SIZE = 1 << 17
"""Vertices looked at together."""


class LeafTarget:
    """The two faces, G = 0 between the bottom and the top of the patch, and the rim, straight up along the outline.

    A chart is flat coordinates z; a step in the world is one in z through the lift's Jacobian.
    """

    def __init__(self, leaf: TexturedBlade, outline: shapely.Geometry, tile: Tile, bare: Tile | None = None) -> None:
        """Take a leaf that is cut along an outline in the plane (along, across).

        The `tile` knows its pockets, and `bare` those where hairs are removed; without it, of such a leaf, the tile is
        all of the plane.
        """
        self.leaf, self.outline, self.sides = leaf, outline, sides_of(outline)
        tiles = [each for each in (tile, bare) if each is not None]
        self.inside = [_inside(each) for each in tiles]
        self.lattice, self.period = tile.lattice, leaf.period
        if len(tiles) < len(leaf.periods):
            self.period = replace(self.period, kinds=np.zeros((1, 1), dtype=np.int64), color=None)
        self.tree = shapely.STRtree(shapely.linestrings(self.sides.reshape(-1, 2, 2)))

    def project(
        self, charts: FloatArray, shifts: FloatArray, masks: Masks, creased: BoolArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return charts, places in the world, and which of them are on the surface; see `projection_target`."""
        del creased
        blade, flat = self.leaf.blade, charts.copy()
        if np.any(shifts):
            flat += blade.lift_with_jacobian(charts).to_flat(shifts)
        on_surface = np.ones(len(flat), dtype=bool)
        on_rim, on_face = masks & ON_RIM > 0, masks & ~np.uint8(ON_RIM) > 0
        flat[on_rim, :2] = self._to_outline(flat[on_rim, :2])[0]
        # The wall ends where the leaf does.
        beside = on_rim & ~on_face
        beside[beside] = self.leaf.values(flat[beside]) < 0
        inner, edge = on_face & ~on_rim, on_face & on_rim | beside
        flat[inner], on_surface[inner] = self._project(flat[inner], self.leaf.newton_steps, self._advance)
        flat[edge], on_surface[edge] = self._project(flat[edge], self._wall_steps, self._advance_along_wall)
        on_surface &= on_rim | in_polygon(self.outline, flat[:, :2]) & ~self._in_pocket(flat)
        return flat, blade.lift(flat), on_surface

    def _project(self, flat: FloatArray, metric: Metric, advance: Advance) -> tuple[FloatArray, BoolArray]:
        """Return points moved onto F = 0, and which of them got there."""
        size = self.leaf.thickness
        return project_to_level(
            flat,
            self.leaf.values_and_gradients,
            max_step=MAX_STEP * size,
            tolerance=TOLERANCE * size,
            max_iterations=MAX_ITERATIONS,
            metric=metric,
            advance=advance,
        )

    def _in_pocket(self, flat: FloatArray) -> BoolArray:
        """Return which points lie on the wall of a pocket, which is filled: in a cell with all its corners inside.

        Where the patch is cut, at its bottom or top, the surface is no wall.
        """
        low = np.floor((flat - self.lattice.origin) / self.lattice.spacing).astype(np.int64)
        inside = np.asarray(~np.isin(flat[:, 2], self.leaf.heights))
        for corner in np.ndindex(2, 2, 2):
            inside &= self._inside_at(low + corner)
        return inside

    def _inside_at(self, places: IntArray) -> BoolArray:
        """Return which places (n, 3) of the lattice are inside."""
        lattice = self.lattice
        i, j = self.period.cells(places[:, :2], np.array(lattice.shape[:2]) // self.period.kinds.shape).T
        node = i, j, np.clip(places[:, 2], 0, lattice.shape[2] - 1)
        if len(self.inside) == 1:
            return np.asarray(self.inside[0][node])
        plane = lattice.origin[:2] + places[:, :2] * np.array(lattice.spacing[:2])
        bare = self.leaf.hairs.bare_at(plane * self.leaf.scale)
        return np.asarray(np.where(bare, self.inside[1][node], self.inside[0][node]))

    def _wall_steps(self, points: FloatArray, values: FloatArray, gradients: FloatArray, max_step: float) -> FloatArray:
        """Return Newton's steps within the wall over the outline."""
        _, along = self._to_outline(points[:, :2])
        slope = np.einsum("ij,ij->i", gradients[:, :2], along)
        square = np.maximum(slope**2 + gradients[:, 2] ** 2, MIN_SQUARE)
        factor = -values / square
        factor /= np.maximum(np.abs(factor) * np.sqrt(square) / max_step, 1.0)
        return np.asarray(factor[:, np.newaxis] * np.column_stack([slope[:, np.newaxis] * along, gradients[:, 2]]))

    def _advance(self, points: FloatArray, values: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add steps, but for points of the leaf that they would take out of the patch: it is cut there, and closed."""
        low, high = self.leaf.heights
        moved = points + steps
        moved[:, 2] = np.clip(moved[:, 2], low, high)
        at_end = (
            (points[:, 2] == moved[:, 2])
            & (values > 0)
            & (np.abs(steps[:, 2]) > 0)
            & ((moved[:, 2] == low) | (moved[:, 2] == high))
        )
        moved[at_end] = points[at_end]
        return moved, np.abs(moved - points).max(axis=1, initial=0.0)

    def _advance_along_wall(
        self, points: FloatArray, values: FloatArray, steps: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Add steps, and return to the outline."""
        moved, lengths = self._advance(points, values, steps)
        moved[:, :2] = self._to_outline(moved[:, :2])[0]
        return moved, lengths

    def _to_outline(self, plane: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the nearest points (n, 2) of the outline, and the direction (n, 2) that it has there."""
        sides = self.sides[self.tree.nearest(shapely.points(plane))] if len(plane) else np.empty((0, 4))
        along = sides[:, 2:] - sides[:, :2]
        length = np.linalg.norm(along, axis=1, keepdims=True)
        share = np.einsum("ij,ij->i", plane - sides[:, :2], along)[:, np.newaxis] / length**2
        return sides[:, :2] + np.clip(share, 0, 1) * along, along / length


def _inside(tile: Tile) -> BoolArray:
    """Return which points of its lattice are inside a tile."""
    nx, ny, nz = tile.lattice.shape
    return np.asarray(tile.runs.expand(np.arange(nx * ny)) == INSIDE).reshape(nx, ny, nz)


def remesh_leaf(
    target: LeafTarget,
    flat: FloatArray,
    triangles: IntArray,
    labels: Labels,
    target_edge: float,
    lowered: FloatArray,
) -> Charted:
    """Return the mesh of a leaf's surface, remeshed; its rim meets the faces in a sharp edge over the outline.

    Parameters
    ----------
    target : LeafTarget
    flat : (n, 3) ndarray
        Vertices in flat coordinates: on F = 0, or on the rim.
    triangles : (m, 3) ndarray of int64
    labels : (m,) ndarray of uint8
        Adaxial, abaxial, rim.
    target_edge : float
    lowered : (n, 3) ndarray
        The same vertices, so low beside a tapered rim that no triangles cross where the mesh stays as it is.
    """
    leaf, places = target.leaf, np.empty_like(flat)
    run_blocks(lambda i, j: places.__setitem__(slice(i, j), leaf.blade.lift(lowered[i:j])), len(flat), BLOCK)
    if not leaf.cuts_edges:
        labels = _without_chamfers(triangles, labels, _on_faces(leaf, flat, FACE_TOLERANCE * target_edge))
    return remesh_charted(Charted.of(places, flat, triangles, labels), target, target_edge)


def remesh_flat(
    leaf: TexturedBlade, flat: FloatArray, triangles: IntArray, target_edge: float, kind: int = 0
) -> Charted:
    """Return a tile's mesh remeshed on F = 0 in the plane, its border bit for bit.

    Parameters
    ----------
    leaf : TexturedBlade
    flat : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    target_edge : float
        In the leaf's unit.
    kind : int
        Which tile of a set it is.
    """
    labels = np.zeros(len(triangles), dtype=np.uint8)
    period = leaf.period
    there, shift = TexturedBlade(period.field, leaf.blade), np.zeros(3)
    shift[:2] = period.places[kind] * period.tile / leaf.scale
    target = FieldTarget(lambda points: there.values_and_gradients(points + shift), target_edge / 2)
    return remesh_charted(Charted.of(flat, flat, triangles, labels), target, target_edge)


def _on_faces(leaf: TexturedBlade, flat: FloatArray, near: float) -> BoolArray:
    """Return which points (n, 3) lie on F = 0 to within `near`."""
    on_face = np.empty(len(flat), dtype=bool)
    for first, last in blocks(len(flat), BATCH_SIZE):
        values, gradients = leaf.values_and_gradients(flat[first:last])
        on_face[first:last] = np.abs(values) <= near * np.linalg.norm(gradients, axis=1)
    return on_face


def _without_chamfers(triangles: IntArray, labels: Labels, on_face: BoolArray) -> Labels:
    """Return labels by which the rim's triangles with a vertex on a face belong to that face.

    Marching cubes cuts the edge between the rim and a face off: what lies between becomes part of the face,
    and has only to be drawn up along the rim, where the lattice is fine, to make the edge sharp.
    """
    labels = labels.copy()
    face_of = np.full(len(on_face), RIM, dtype=np.uint8)
    while True:
        for face in (face for face in range(RIM) if (labels == face).any()):
            touched = np.zeros(len(on_face), dtype=bool)
            touched[triangles[labels == face]] = True
            face_of[touched & on_face & (face_of == RIM)] = face
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
