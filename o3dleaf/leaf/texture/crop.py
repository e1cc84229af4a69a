"""The crop of a patch whose faces match best: offset and period by search, on real data alone."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.texture.seams import MAX_SECTIONS, Crop, SampledPatch

MIN_SHARE = 0.5
"""A tile found by search has at least this share of the patch's extent, so that repetition shows less."""

FADE_RADII, FADE_SHARE = 0.5, 1 / 16
"""Reach of the cross-fade on either side of a seam: half the radius of a ball, but at most this share of the patch."""

MIN_STEP_SHARE = 1 / 8
"""Sections of a given period with little room to be moved in lie closer, but no closer than this share of the usual."""

MAX_CANDIDATES = 6
"""Distances that are refined, such as those of two to seven ridges: the best may lie between sections."""

MAX_STEPS = 4
"""Steps of Gauss and Newton, which double the digits from a quarter of a section on."""

TOLERANCE = 1e-3
"""Share of a section; a voxel is about one, and the scanner's noise moves the period by more than that."""


def reach_of_fade(field: PUInterpolant) -> FloatArray:
    """Return the (2,) reach of a cross-fade on either side of a seam, where none is given."""
    extent = (field.bounds[1] - field.bounds[0])[:2]
    reach: FloatArray = np.minimum(FADE_RADII * field.cover.typical[0], FADE_SHARE * extent)
    return reach


def best_crop(field: PUInterpolant, period: tuple[float | None, float | None], fade: FloatArray) -> Crop:
    r"""Search offset and period of the tile whose faces match best, on the data of the patch alone.

    Sections of the patch are compared in pairs (i, j), all at once, since
    :math:`|X_i - X_j|^2 = |X_i|^2 + |X_j|^2 - 2 X_i \cdot X_j` is one matrix product. A pair's mismatch is the mean
    over the band of the cross-fade, on either side of which the patch has data; what is made least is
    mismatch over period, the mismatch a length of leaf. Periods then leave the sections by steps of
    Gauss and Newton. Across comes first, for the ridges; along on what that leaves; then across again.

    Parameters
    ----------
    field : PUInterpolant
    period : pair of float or None
        Period along each axis; None is searched for.
    fade : (2,) ndarray
        Reach of the cross-fade on either side of a seam.
    """
    patch = SampledPatch.of(field)
    low, high = field.bounds[:, :2]
    whole = [wish is not None and wish >= (high - low)[axis] * (1 - 1e-12) for axis, wish in enumerate(period)]
    # A given period leaves what it leaves: half of it to fade over, half to move the tile in.
    room = [np.inf if wish is None else ((high - low)[axis] - wish) / 4 for axis, wish in enumerate(period)]
    fade = np.where(whole, 0.0, np.minimum(fade, room))
    crop = Crop(low.copy(), high - low, fade, np.zeros(2, dtype=bool), 0.0)
    for axis in (1, 0, 1):
        if whole[axis]:
            continue
        offset, tile = crop.offset.copy(), crop.tile.copy()
        offset[axis], tile[axis] = _Search(patch, axis, period[axis], float(fade[axis])).run(crop)
        crop = replace(crop, offset=offset, tile=tile)
    return crop


@dataclass(frozen=True, eq=False)
class _Search:
    """The search along one axis, for a period of its own (None) or for the offset of a given one."""

    patch: SampledPatch
    axis: int
    period: float | None
    reach: float

    @property
    def limits(self) -> tuple[float, float]:
        low, high = self.patch.field.bounds[:, self.axis]
        return float(low), float(high)

    def run(self, crop: Crop) -> tuple[float, float]:
        """Return offset and period, the other axis being cropped as in `crop`."""
        low, high = self.limits
        step, other = self._step(), 1 - self.axis
        sections = np.asarray(low + step * np.arange(int((high - low) / step + 1e-9) + 1), dtype=np.float64)
        count = max(int(np.ceil(crop.tile[other] / self.patch.step[other])), 1)
        beside = crop.offset[other] + (np.arange(count) + 0.5) * crop.tile[other] / count
        refined = [
            self._refined(float(sections[i]), float(sections[j] - sections[i]), step, beside)
            for i, j in self._coarse(sections, beside, step)
        ]
        if not refined:
            raise InputError(
                f"fade: {self.reach:.4g} on either side of a tile leaves less than half the patch; fade less"
            )
        return min(refined)[1:]

    def _step(self) -> float:
        """Return the distance between sections, which divides a period that is given."""
        step, (low, high) = float(self.patch.step[self.axis]), self.limits
        if self.period is None:
            return step
        slack = max(high - low - self.period - 2 * self.reach, 0.0)
        return self.period / int(
            np.clip(np.ceil(self.period / max(min(step, slack / 2), MIN_STEP_SHARE * step)), 1, 4 * MAX_SECTIONS)
        )

    def _coarse(self, sections: FloatArray, beside: FloatArray, step: float) -> list[tuple[int, int]]:
        """Return pairs of sections: for each of the best distances apart the pair that matches best."""
        n, band, (low, high) = len(sections), int(self.reach / step + 1e-9), self.limits
        flat = self.patch.sections(sections, beside, self.axis, np.float32).reshape(n, -1).astype(np.float64)
        with single_threaded_blas():
            product = flat @ flat.T
        square = np.diag(product)
        mismatch = np.maximum(square[:, np.newaxis] + square - 2 * product, 0.0)
        i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        least, most = (MIN_SHARE * (n - 1), n) if self.period is None else [round(self.period / step)] * 2
        allowed = (j - i >= least) & (j - i <= most) & (i >= band) & (j <= n - 1 - band)
        # What lies a section too far out is moved in by the refinement.
        allowed &= (sections[i] - low > self.reach - step) & (high - sections[j] > self.reach - step)
        rows, columns = np.nonzero(allowed)
        stations = np.arange(-band, band + 1)
        means = mismatch[rows[:, np.newaxis] + stations, columns[:, np.newaxis] + stations].mean(axis=1)
        score, best = np.full(n + 1, np.inf), np.zeros(n + 1, dtype=np.int64)
        for apart in np.unique(columns - rows):
            same = np.flatnonzero(columns - rows == apart)
            first = same[np.argmin(means[same])]
            score[apart], best[apart] = means[first] / apart, rows[first]
        return [(int(best[apart]), int(best[apart] + apart)) for apart in _dips(score, MAX_CANDIDATES)]

    def _refined(self, offset: float, period: float, step: float, beside: FloatArray) -> tuple[float, float, float]:
        """Return mismatch over period, offset and period after steps of Gauss and Newton within one section."""
        low, high = self.limits
        least = max(period - step, MIN_SHARE * (high - low))
        most = min(period + step, high - low - 2 * self.reach)
        best = (np.inf, offset, period)
        for _ in range(MAX_STEPS if self.period is None else 1):
            period = float(np.clip(period, min(least, most), most)) if self.period is None else self.period
            offset = float(np.clip(offset, low + self.reach, high - self.reach - period))
            seam = offset + self.patch.stations(self.reach, self.axis)
            ending = self.patch.sections(seam + period, beside, self.axis)
            mismatch = ending - self.patch.sections(seam, beside, self.axis)
            best = min(best, (float(np.mean(mismatch**2)) / period, offset, period))
            slope = self.patch.derivatives(seam + period, beside, self.axis)
            slope[np.abs(ending) == self.patch.cut_off] = 0.0
            square = float(np.sum(slope**2))
            change = float(np.sum(mismatch * slope)) / square if square else 0.0
            if abs(change) <= TOLERANCE * step:
                break
            period -= change
        return best


def _dips(score: FloatArray, count: int) -> npt.NDArray[np.int64]:
    """Return the rows of the `count` least entries that are finite and no larger than their neighbors."""
    padded = np.pad(score, 1, constant_values=np.inf)
    minima = np.flatnonzero(np.isfinite(score) & (score <= padded[:-2]) & (score <= padded[2:]))
    return minima[np.argsort(score[minima], kind="stable")[:count]]
