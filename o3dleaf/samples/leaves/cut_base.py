"""Flat leaves that are bent in their plane, their margins rough, cut off obliquely: with the midrib that they have."""

from typing import NamedTuple

import numpy as np
import shapely

from o3dleaf.core.checks.arrays import FloatArray

STATIONS = 400
LENGTH = 100.0
WAVES = 0.3
"""Length of a margin's waves, in widths."""
CUT = 0.02
"""Share of the length that is cut off at the base, in the middle."""


class CutLeaf(NamedTuple):
    """A leaf in the plane, some 100 long.

    Attributes
    ----------
    outline : shapely.Polygon
    midrib : (k, 2) ndarray
        Mid-way between the margins before they were made rough, from the cut to the tip.
    width : float
    """

    outline: shapely.Polygon
    midrib: FloatArray
    width: float


def drawn_cut_leaf(number: int, roughness: float, *, held_out: bool = False) -> CutLeaf:
    """Return one of a family: 3 to 12 times as long as wide, cut up to 25 degrees obliquely, all by chance.

    Parameters
    ----------
    number : int
    roughness : float
        Standard deviation of the width on either side, as a share.
    """
    rng = np.random.default_rng((57_000 if held_out else 5700) + number)
    aspect, at = rng.uniform(3, 12), np.linspace(0, 1, STATIONS)
    width, bend = LENGTH / aspect, rng.uniform(-1.2, 1.2, 2) * min(1.0, aspect / 6)
    turn = bend[0] * at + bend[1] * at**2
    midrib = np.stack([np.cumsum(np.cos(turn)), np.cumsum(np.sin(turn))], axis=1)
    midrib = (midrib - midrib[0]) * LENGTH / STATIONS
    normal = np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    base, taper = rng.uniform(0.4, 1), rng.uniform(0.3, 0.6)
    half = width / 2 * (base + (1 - base) * np.minimum(at / 0.3, 1) ** 0.7) * np.minimum(1, (1 - at) / taper) ** 0.7
    left, right = (half * (1 + roughness * _waves(rng, width)) for _ in range(2))
    ring = np.concatenate([midrib + left[:, None] * normal, (midrib - right[:, None] * normal)[-2::-1]])
    slope = np.radians(rng.uniform(-25, 25))
    ahead, aside = np.array([[np.cos(slope), np.sin(slope)], [-np.sin(slope), np.cos(slope)]]) * width
    place = midrib[0] + CUT * LENGTH * ahead / width
    off = shapely.Polygon([place + aside, place - aside, place - aside - ahead, place + aside - ahead])
    parts = shapely.get_parts(shapely.Polygon(ring).buffer(0).difference(off))
    outline = max(parts, key=lambda part: float(part.area))
    return CutLeaf(outline, midrib[int(np.argmax((midrib - place) @ ahead > 0)) :], width)


def _waves(rng: np.random.Generator, width: float) -> FloatArray:
    """Return waves (k,) along the leaf of unit variance, `WAVES` widths long."""
    reach = max(1, round(WAVES * width / LENGTH * STATIONS))
    bell = np.exp(-0.5 * (np.arange(-4 * reach, 4 * reach + 1) / reach) ** 2)
    bell /= np.sqrt((bell**2).sum())
    return np.convolve(rng.normal(size=STATIONS + 8 * reach), bell, "valid")
