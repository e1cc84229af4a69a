"""The part of a volume that tiles are made of: the largest box of blade, with nothing else above or below it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import distance_transform_edt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.core.units import measure_in_words
from o3dleaf.leaf.ct.blade import OTHERS, SolidBlade, piece_sizes
from o3dleaf.leaf.ct.box import inscribed_box
from o3dleaf.leaf.ct.volume import Volume, thinned

MAX_OTHER = 0.5
"""Share of a patch below or above which something else may lie: more, at its bottom or top, is taken for the blade."""


@dataclass(frozen=True, eq=False)
class BladePatch:
    """The box of a turned volume that holds the blade, and no end of it.

    Attributes
    ----------
    box : (2, 3) ndarray
        In the patch's coordinates: those of the volume after the motion that lays the blade flat.
    within : (2, 3) ndarray
        The box around it in the volume's coordinates.
    unit : str or None
    cut : list of str
        What was left out of the volume, in words.
    """

    box: FloatArray
    within: FloatArray
    unit: str | None
    cut: list[str]

    def __str__(self) -> str:
        return "; ".join([_size(self.box, self.unit), *self.cut])


def find_patch(volume: Volume, level: float, transform: npt.ArrayLike) -> BladePatch:
    """Return the largest box that is blade from side to side, and keeps half a blade's thickness from where it ends.

    Tiles repeat what lies in the box: past the sides of a sample that was cut out of a leaf, and outside the
    scanner's field of view, there is air. A cut may lean by 45 degrees within that distance.

    Parameters
    ----------
    volume : Volume
    level : float
        The surface's intensity.
    transform : (4, 4) array_like
        From `align_blade`.

    Raises
    ------
    ReconstructionError
        If the volume has no blade, or no box of it is as wide as it is thick.
    """
    matrix = np.asarray(transform, dtype=np.float64)
    box, cut, small = inscribed_box(volume.bounds, matrix), [], thinned(volume)
    blade = SolidBlade.of(small.data > level, small.spacing)
    lattice = _Columns(small, blade, matrix)
    kept = lattice.far_from_ends()
    if not kept.all():
        box[:, :2] = lattice.largest_rectangle(kept, box[:, :2])
        share = np.prod((box[1] - box[0])[:2]) / (lattice.area * np.count_nonzero(blade.covered))
        cut.append(
            "the blade ends in it; tiles are made of its largest rectangle, "
            f"{_size(box, volume.unit)}, {100 * share:.0f} % of it"
        )
    for side, (height, share) in lattice.others(box[:, :2]).items():
        box[side, 2] = height
        cut.append(f"what lies {('below', 'above')[side]} the blade, {100 * share:.0f} % of what is solid, is left out")
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    back = (corners - matrix[:3, 3]) @ matrix[:3, :3]
    low, high = volume.bounds
    return BladePatch(box, np.clip([back.min(axis=0), back.max(axis=0)], low, high), volume.unit, cut)


@dataclass(frozen=True, eq=False)
class _Columns:
    """The columns of a volume that run through its blade, which a motion lays flat."""

    volume: Volume
    blade: SolidBlade
    transform: FloatArray

    @property
    def steps(self) -> FloatArray:
        """(2,) distances of the columns."""
        return self.volume.spacing[list(OTHERS[self.blade.axis])]

    @property
    def area(self) -> float:
        """The area of a column."""
        return float(np.prod(self.steps))

    def far_from_ends(self) -> BoolArray:
        """Return which columns are half a blade's thickness from those without a blade."""
        blade = self.blade
        thickness = np.median((blade.last - blade.first + 1)[blade.crossed]) * self.volume.spacing[blade.axis]
        if blade.covered.all():
            return blade.covered
        return np.asarray(distance_transform_edt(blade.covered, sampling=self.steps) > thickness / 2)

    def below(self, base: FloatArray) -> tuple[tuple[npt.NDArray[np.int64], ...], FloatArray]:
        """Return the columns (nx, ny) at the cells of a raster of a rectangle of the blade's plane, and its step."""
        count = np.maximum(np.rint((base[1] - base[0]) / self.steps.min()), 1).astype(np.int64)
        step = (base[1] - base[0]) / count
        x, y = (base[0, axis] + step[axis] * (np.arange(count[axis]) + 0.5) for axis in range(2))
        flat = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros(count)], axis=-1)
        # The rows of a rotation are the axes of the patch: the inverse is its transpose.
        back = (flat - self.transform[:3, 3]) @ self.transform[:3, :3]
        rows = np.rint((back - self.volume.origin) / self.volume.spacing).astype(np.int64)
        axes = OTHERS[self.blade.axis]
        return tuple(np.clip(rows[..., axis], 0, self.volume.shape[axis] - 1) for axis in axes), step

    def largest_rectangle(self, kept: BoolArray, base: FloatArray) -> FloatArray:
        """Return the largest rectangle (2, 2) within another, `base`, in which all columns are kept."""
        columns, step = self.below(base)
        cells = largest_rectangle(kept[columns])
        if cells is None:
            raise ReconstructionError(
                "volume: its blade ends within half its thickness of all its places; crop the volume less"
            )
        return np.asarray(base[0] + step * cells)

    def others(self, base: FloatArray) -> dict[int, tuple[float, float]]:
        """Return what else lies below, 0, and above, 1, `MAX_OTHER` of a rectangle of the blade and more.

        Of each the height halfway to it, and its share of what is solid; what no plane parts from the blade is none.
        """
        columns = np.zeros(self.blade.first.shape, dtype=bool)
        columns[self.below(base)[0]] = True
        pieces = np.where(np.expand_dims(columns, self.blade.axis), self.blade.pieces, 0)
        sizes = piece_sizes(pieces, int(pieces.max()))
        sizes[0], least = 0, MAX_OTHER * np.count_nonzero(columns)
        bottom, top = self.heights(pieces == self.blade.number)
        found: dict[int, tuple[float, float]] = {}
        for number in np.flatnonzero(sizes > least):
            piece = pieces == number
            if number == self.blade.number or np.count_nonzero(piece.any(axis=self.blade.axis)) <= least:
                continue
            low, high = self.heights(piece)
            share = float(sizes[number] / sizes.sum())
            if high < bottom:
                height, others = found.get(0, (-np.inf, 0.0))
                found[0] = max(height, (high + bottom) / 2), others + share
            elif low > top:
                height, others = found.get(1, (np.inf, 0.0))
                found[1] = min(height, (low + top) / 2), others + share
        return found

    def heights(self, voxels: BoolArray) -> tuple[float, float]:
        """Return the height of the lowest and of the highest of some voxels over the blade's plane."""
        volume, tilt = self.volume, self.transform[2]
        x, y, z = (
            tilt[axis] * (volume.origin[axis] + volume.spacing[axis] * np.arange(volume.shape[axis]))
            for axis in range(3)
        )
        # A plane of the lattice at a time: all heights are eight times as much memory as the voxels.
        planes = [x[i] + tilt[3] + (y[:, np.newaxis] + z)[plane] for i, plane in enumerate(voxels) if plane.any()]
        return min(float(plane.min()) for plane in planes), max(float(plane.max()) for plane in planes)


def _size(box: FloatArray, unit: str | None) -> str:
    """Return the size of a patch along and across, in words."""
    return measure_in_words((box[1] - box[0])[:2].tolist(), unit, digits=4, join=" × ")


def largest_rectangle(inside: BoolArray) -> npt.NDArray[np.int64] | None:
    """Return first and last + 1 (2, 2) of the largest rectangle of a raster that is inside; None if nothing is.

    Row by row, each column's height is that of what is inside above it; of rising heights each is the height of a
    rectangle that ends where a lower one begins.
    """
    best, corners = 0, None
    heights = np.zeros(inside.shape[1] + 1, dtype=np.int64)
    for row, line in enumerate(inside):
        heights[:-1] = np.where(line, heights[:-1] + 1, 0)
        rising: list[tuple[int, int]] = []
        for column, height in enumerate(heights.tolist()):
            start = column
            while rising and rising[-1][1] >= height:
                start, tall = rising.pop()
                if tall * (column - start) > best:
                    best = tall * (column - start)
                    corners = np.array([[row + 1 - tall, start], [row + 1, column]])
            rising.append((start, height))
    return corners
