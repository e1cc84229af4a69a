"""Places of patches, and at which of them a patch differs least from what it is laid over."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.fft

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray
from o3dleaf.leaf.texture.wang.least_cut import disc
from o3dleaf.leaf.texture.wang.quilt import REACH

TRIES = 8
"""Places of the least mismatch that are cut: the best is the one whose cut costs least."""


class Spot(NamedTuple):
    """A place of a patch: its number, and the node of it."""

    patch: int
    i: int
    j: int


@dataclass(eq=False)
class SpotSearch:
    """Patches looked through at all their nodes at once.

    Attributes
    ----------
    patches : tuple of (n, m, l) ndarrays
        Values at nodes and heights.
    random : numpy.random.Generator
        Draws the places that may be taken, so that seeds differ.
    """

    patches: tuple[FloatArray, ...]
    random: np.random.Generator

    def __post_init__(self) -> None:
        self._spectra = [
            (scipy.fft.rfft2(patch, axes=(0, 1)), scipy.fft.rfft2((patch**2).sum(axis=2))) for patch in self.patches
        ]

    def mismatches(self, values: FloatArray, mask: BoolArray) -> list[FloatArray]:
        """Return for each patch the sum of squared differences of masked values (a, b, l) at all its places."""
        masked = np.where(mask[..., np.newaxis], values, 0.0)
        maps = []
        for patch, (spectrum, squares) in zip(self.patches, self._spectra, strict=True):
            shape = patch.shape[:2]
            spread = scipy.fft.rfft2(masked, s=shape, axes=(0, 1)).conj()
            cross = scipy.fft.irfft2((spectrum * spread).sum(axis=2), s=shape)
            square = scipy.fft.irfft2(squares * scipy.fft.rfft2(mask.astype(np.float64), s=shape).conj(), s=shape)
            room = tuple(slice(0, whole - part + 1) for whole, part in zip(shape, mask.shape, strict=True))
            maps.append(((masked**2).sum() - 2 * cross + square)[room])
        return maps

    def least(self, maps: Sequence[FloatArray], taken: Sequence[Spot], count: int) -> list[Spot]:
        """Return the `TRIES` places of the least entries in maps of the patches, apart from another and from `taken`.

        Of `count` places in all each keeps a disc to itself, of a radius for which there always is one more.
        """
        area = sum(each.size for each in maps)
        radius = float(np.sqrt(area / (np.pi * count)))
        scores = []
        for number, each in enumerate(maps):
            score = np.where(self.random.random(each.shape) < 0.5, each, np.inf)
            for spot in taken:
                if spot.patch == number:
                    score[disc(score.shape, (spot.i, spot.j), radius)] = np.inf
            scores.append(score)
        found: list[Spot] = []
        for _ in range(TRIES):
            best = [float(score.min(initial=np.inf)) for score in scores]
            patch = int(np.argmin(best))
            if not np.isfinite(best[patch]):
                break
            i, j = np.unravel_index(int(np.argmin(scores[patch])), scores[patch].shape)
            found.append(Spot(patch, int(i), int(j)))
            scores[patch][disc(scores[patch].shape, (i, j), REACH)] = np.inf
        if not found:
            raise InputError("tile: leaves no room in the patches for tiles that differ; give a smaller one")
        return found


def sums_under(values: FloatArray, box: FloatArray) -> FloatArray:
    """Return the sums of values (n, m, 1) under a box at all its places."""
    shape = values.shape[:2]
    spread = scipy.fft.rfft2(box[..., 0], s=shape).conj()
    sums = scipy.fft.irfft2(scipy.fft.rfft2(values[..., 0]) * spread, s=shape)
    return np.asarray(sums[: shape[0] - box.shape[0] + 1, : shape[1] - box.shape[1] + 1])
