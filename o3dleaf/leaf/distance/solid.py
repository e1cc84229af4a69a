"""The solid: where G > 0 in the outline, or the closed one that meshes draw.

In the closed one air pockets are filled, islands beside the blade are left out, and the outline is rounded.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.blade.outline_area import in_polygon
from o3dleaf.leaf.distance.search_loops import look_up
from o3dleaf.leaf.instancing.runs import find_runs, solidify
from o3dleaf.leaf.instancing.sets.tile_set import MatchingBorders
from o3dleaf.leaf.instancing.tile_loops import INSIDE
from o3dleaf.leaf.texture.period import Period
from o3dleaf.leaf.texture.wang.corners import TORUS
from o3dleaf.leaf.textured_blade import TexturedBlade

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class FilledLattice:
    """The lattice of one period: where F > 0, and where the leaf is once pockets are filled.

    Attributes
    ----------
    origin, steps : (3,) ndarrays
        Of the lattice, in the leaf's unit.
    period : Period
        What repeats, in lengths of `scale` of these.
    scale : float
    codes : (nx, ny, nz) uint8 ndarray
        1 where F > 0, plus 2 where the filled leaf is.
    """

    origin: FloatArray
    steps: FloatArray
    period: Period
    scale: float
    codes: npt.NDArray[np.uint8]

    @classmethod
    def fill(
        cls, origin: FloatArray, steps: FloatArray, positive: Bools, period: Period, scale: float
    ) -> "FilledLattice":
        """Fill the pockets of a period of samples (nx, ny, nz); those beside borders of one kind are alike.

        Raises
        ------
        ReconstructionError
            If the air above and below hang together.
        """
        nx, ny, nz = positive.shape
        columns, alike = positive.reshape(-1, nz), None
        if period.color is not None:
            tiles = period.kinds.shape
            alike = MatchingBorders((nx // tiles[0], ny // tiles[1]), nz, TORUS).columns(np.arange(nx * ny))
            columns = columns[alike]
        runs = solidify((nx, ny, nz), *find_runs(columns), alike)
        inside = runs.expand(np.arange(nx * ny)).reshape(positive.shape) == INSIDE
        codes = columns.reshape(positive.shape) + 2 * inside.astype(np.uint8)
        return cls(origin, steps, period, scale, codes)

    def is_crossed_at(self, vertices: FloatArray) -> Bools:
        """Return which vertices (n, 3) on edges of the lattice, in steps from `origin`, lie on the filled leaf."""
        low, high = (self._codes_at(ends(vertices).astype(np.int64)) for ends in (np.floor, np.ceil))
        return np.asarray(low >> 1 != high >> 1)

    def contains(self, flat: FloatArray, values: FloatArray) -> Bools:
        """Return which of (n, 3) flat coordinates, F being `values` there, lie in the filled leaf.

        A point belongs to what the nearest corner of its cell belongs to at which F has the sign that it has at the
        point; where none has, to what the nearest corner does.
        """
        inside = np.empty(len(flat), dtype=bool)
        plane = self.period.points(flat[:, :2] * self.scale) / self.scale
        places = (np.column_stack([plane, flat[:, 2]]) - self.origin) / self.steps
        look_up(places, values, self.codes, inside)
        return inside

    def _codes_at(self, places: IntArray) -> npt.NDArray[np.uint8]:
        """Return the codes at lattice points (n, 3)."""
        nx, ny, _ = self.codes.shape
        return np.asarray(self.codes[places[:, 0] % nx, places[:, 1] % ny, places[:, 2]])


@dataclass(frozen=True, eq=False)
class LeafSolid:
    """The points of the leaf.

    Attributes
    ----------
    outline : shapely.Polygon
        The curve that the plane is cut along.
    filled : tuple of FilledLattice
        The air that the blade encloses, of each of the leaf's `periods`; (): pockets are not leaf.
    """

    outline: shapely.Polygon
    filled: tuple[FilledLattice, ...]

    def contains(self, plane: FloatArray) -> Bools:
        """Return which of the (n, 2) places along and across lie in the outline."""
        return in_polygon(self.outline, plane)

    def values(self, leaf: TexturedBlade, flat: FloatArray) -> FloatArray:
        """Return F at (n, 3) flat coordinates or, where pockets are filled, ±|F| with the sign of the filled leaf."""
        values = leaf.values(flat)
        if not self.filled:
            return values
        inside, bare = np.empty(len(flat), dtype=bool), leaf.hairs.bare_at(flat[:, :2] * leaf.scale)
        for number, filled in enumerate(self.filled):
            rows = np.flatnonzero(bare == number)
            inside[rows] = filled.contains(flat[rows], values[rows])
        return np.where(inside, np.abs(values), -np.abs(values))

    def contains_points(self, leaf: TexturedBlade, points: FloatArray) -> Bools:
        """Return which of the (n, 3) world points lie in the leaf."""
        flat = leaf.blade.flatten(points)
        low, high = leaf.heights
        # What the top or bottom of the patch cuts is closed there, as in the meshes, not where the field falls to 0.
        inside: Bools = (flat[:, 2] >= low) & (flat[:, 2] <= high)
        inside[inside] = self.contains(flat[inside, :2])
        inside[inside] = self.values(leaf, flat[inside]) > 0
        return inside
