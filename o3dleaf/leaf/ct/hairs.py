"""Hairs that the sides of a patch cut: every tile would end in half a hair. Found, and a crop that avoids them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import find_objects, gaussian_filter, generate_binary_structure, label

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.ct.blade import piece_sizes, thin_axis
from o3dleaf.leaf.ct.heights import fit_plane
from o3dleaf.leaf.ct.volume import Volume, thinned

BLUR = 0.5
"""Voxels: a third of the noise goes, and a hair two voxels wide stays."""
OUT = 3.0
"""Typical deviations of a face from its plane; crests of ridges reach two."""
MIN_RELIEF = 0.7
"""Voxels: of a flat face noise is the relief."""
SPECK = 8
"""Voxels: smaller pieces are noise, and no hairs."""
MIN_COLUMNS = 2
"""That a hair covers. Of 24 hairs of `samples.wheat_ct` at noise 0 to 0.05, cut so that most of each was left, 22 to 24
are found, of halves 20 to 22, of tips 15 to 17; in 40 volumes in which none is cut, one is found, at noise 0.05."""
MIN_SHARE = 0.5
"""A crop that leaves less of the patch is none to propose."""

Rectangle = npt.NDArray[np.int_]


@dataclass(frozen=True)
class CutHairs:
    """Hairs that the sides of a volume cut.

    Attributes
    ----------
    count : int
    crop : (2, 3) ndarray, optional
        The largest box found that cuts none, in the volume's unit; None if none is cut, or too little would be left.
    """

    count: int
    crop: FloatArray | None

    def __str__(self) -> str:
        cut = f"{self.count} {'hair is' if self.count == 1 else 'hairs are'} cut by the sides of the volume"
        if self.crop is None:
            return cut
        return f"{cut}; crop to '{' '.join(f'{value:.6g}' for value in self.crop.ravel())}'"


def find_cut_hairs(volume: Volume, level: float) -> CutHairs:
    """Return how many hairs the sides of a volume cut at a level; its blade may lean, but not stand on edge.

    A hair is where a face of the blade is more than 3 typical deviations off its plane, outward.
    """
    small = thinned(volume)
    # Of smoothed intensities: noise beside a crest is no hair.
    values: npt.NDArray[Any] = small.data.astype(np.float32)
    gaussian_filter(values, BLUR, output=values)
    values -= level
    solid = _without_specks(values > 0)
    if not solid.any():
        return CutHairs(0, None)
    axis = thin_axis(solid, small.spacing)
    values[(values > 0) & ~solid] = 0.0
    columns = _hair_columns(np.moveaxis(values, axis, 2))
    hairs = label(columns, generate_binary_structure(2, 2))[0]
    sizes = np.bincount(hairs.ravel())[1:]
    boxes = [
        np.array([[each.start, each.stop - 1] for each in place]).T
        for place, size in zip(find_objects(hairs), sizes, strict=True)
        if size >= MIN_COLUMNS
    ]
    whole = np.array([[0, 0], np.array(hairs.shape) - 1])
    cut = [box for box in boxes if _crosses(box, whole)]
    left = _avoid(whole, boxes) if cut else None
    if left is None:
        return CutHairs(len(cut), None)
    others = [each for each in range(3) if each != axis]
    crop = volume.bounds.copy()
    crop[:, others] = small.origin[others] + small.spacing[others] * (left + np.array([[-0.5], [0.5]]))
    return CutHairs(len(cut), crop)


def _without_specks(solid: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Take specks out of what is solid, and return it; plane by plane, as an index takes eight bytes a voxel."""
    pieces, count = label(solid)
    sizes = piece_sizes(pieces, count)
    for number, plane in enumerate(pieces):
        solid[number] &= sizes[plane] >= SPECK
    return solid


def _hair_columns(values: FloatArray) -> npt.NDArray[np.bool_]:
    """Return the columns, along the third axis, in which either end of what is above 0 stands out."""
    u, v = (np.arange(count, dtype=np.float64) for count in values.shape[:2])
    found = np.zeros(values.shape[:2], dtype=bool)
    for each in (values, values[:, :, ::-1]):
        face = _ends(each)
        slopes, height = fit_plane(u, v, face)
        out = face - (u[:, np.newaxis] * slopes[0] + v * slopes[1] + height)
        off = out - np.nanmedian(out)
        found |= np.nan_to_num(off) > OUT * max(float(np.nanmedian(abs(off))), MIN_RELIEF)
    return found


def _ends(values: FloatArray) -> FloatArray:
    """Return where each column falls below 0 for the last time, in voxels, between two of them; NaN if it is below."""
    inside = values > 0
    last = values.shape[2] - 1 - np.argmax(inside[:, :, ::-1], axis=2)[:, :, np.newaxis]
    at = np.take_along_axis(values, last, axis=2)
    beyond = np.take_along_axis(values, np.minimum(last + 1, values.shape[2] - 1), axis=2)
    met = inside.any(axis=2)
    ends = np.full(met.shape, np.nan)
    ends[met] = (last[met] + at[met] / np.maximum(at - beyond, at)[met])[:, 0]
    return ends


def _crosses(hair: Rectangle, box: Rectangle) -> bool:
    """Whether a side of a box touches or cuts a hair: both (2, 2), first and last column."""
    apart = (hair[1] < box[0]).any() or (hair[0] > box[1]).any()
    inside = (hair[0] > box[0]).all() and (hair[1] < box[1]).all()
    return not apart and not inside


def _avoid(whole: Rectangle, hairs: list[Rectangle]) -> Rectangle | None:
    """Return a rectangle that crosses no hair: sides are moved past one after the other, where it costs least."""
    box = whole.copy()
    while (crossing := next((hair for hair in hairs if _crosses(hair, box)), None)) is not None:
        tried = []
        for axis in range(2):
            for end, beyond in ((0, crossing[1, axis] + 1), (1, crossing[0, axis] - 1)):
                moved = box.copy()
                moved[end, axis] = beyond
                tried.append(moved)
        box = max(tried, key=_area)
    return box if _area(box) >= MIN_SHARE * _area(whole) else None


def _area(box: Rectangle) -> int:
    return int(np.prod(np.maximum(box[1] - box[0] + 1, 0)))
