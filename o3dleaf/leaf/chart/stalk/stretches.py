"""The stretch of a leaf's sections that is a stalk: long, narrow against the blade, and not tapering."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.chart.stalk.sections import Sections

NARROW = 0.25
"""Of the blade's width, that a stalk is wide at most: blades do not wait that narrow for long."""
SHOWN = 3.0
"""Degrees of freedom of sections that show them to be wider than those on either side: of fewer, which are off by two
fifths or more, it may be chance."""
SLENDER, SLENDER_NECK = 2.5, 4.0
"""Times its width that a stalk is long; and a neck with something wider outside it, a stub of the stem."""
STEADY = 0.5
"""Width of its outer third over that of its inner third: 0.2 for a tip that tapers straight, 1 for a stalk."""
STEADY_PAST_WIDER = 0.75
"""The same of one that goes on past wider sections, where a blade may have begun."""
BULGE = 0.75
"""Width of its outer third over that of its middle third, at least: 0.6 for a lobe pointed at both ends or a spindle,
1 for a stalk, more for one with a stub."""
FLARE = 1.5
"""Times its median width that a stalk may be wide where the blade begins."""
LARGEST_STUB = 0.25
"""Share of the whole area that may lie outside a neck; more is a blade by itself."""
LONG, LONG_IF_ROUND = 0.75, 0.25
"""Times the blade's width that a stalk is long if it is flat, and if its cross-section is curled: flat and shorter
ones are shreds of a margin, unless they are as slender as no shred is."""
SLENDER_FLAT = 12.0
"""Times its width from which a flat stalk may be as short as a curled one: of a broad leaf few are as long as it is
wide, and of one seen from one side, a few points wide, the noise hides the depth."""
ERRORS = 2.0
"""Of its outer third's width, 1/√(2n) of it of n degrees of freedom, within which one that is slender or curled may be
a stalk that does not taper."""
ROUND = 0.27
"""Depth of a section over its width from which it counts as curled: 0.28 an arc of 120°, what a scanner on one side
sees of a tube up to 30° from grazing; 0.34 an arc of 150°, 0.44 half a tube, 1 all."""


class StalkStretch(NamedTuple):
    """A stalk by its sections: where it begins and ends, in distance from the end of the leaf, and its width.

    Sure is one that is so long, slender or curled that it is no shred of a margin, and as wide at its end as within.
    """

    first: float
    last: float
    width: float
    is_sure: bool = True

    @property
    def length(self) -> float:
        """Of the stretch."""
        return self.last - self.first


def find_stretches(sections: Sections) -> Iterator[StalkStretch]:
    """Yield the outermost stretch of sections that is a stalk, and then as it goes on through the next narrow ones.

    It begins at the end of the leaf, or with no more than a stub outside. If none is sure it is the outermost that may
    be one. A bend or a few points beside a stalk look wide as a blade does: where no blade begins it goes on.
    """
    runs, half = _narrow_runs(sections), 0.5 * sections.area[-1]
    within = [run for run in runs if sections.area[run[1] - 1] <= half]
    unsure = None
    for number, (first, last) in enumerate(within):
        if first and sections.area[first - 1] > LARGEST_STUB * sections.area[-1]:
            break
        found = _stalk(sections, first, last)
        if found is not None and found.is_sure:
            yield found
            longer = (_stalk(sections, first, beyond, STEADY_PAST_WIDER) for _, beyond in within[number + 1 :])
            yield from (each for each in longer if each is not None and each.is_sure)
            return
        unsure = unsure or found
    if unsure is not None:
        yield unsure


def _stalk(sections: Sections, first: int, last: int, steady: float = STEADY) -> StalkStretch | None:
    """Return the stalk that the sections from one station up to another are, or None if they are none."""
    width = sections.width[first:last]
    usual = float(np.median(width))
    unflared = np.flatnonzero(width <= FLARE * usual)
    stretch = slice(first, first + int(unflared[-1]) + 1)
    length = (stretch.stop - first) * sections.step
    ratio, error = (np.inf, 0.0) if first else _steadiness(sections.width[stretch], sections.free[stretch], steady)
    slender = length >= (SLENDER_NECK if first else SLENDER) * usual
    deep = float(np.median(sections.depth[stretch])) >= ROUND * usual
    may_be_short = deep or length >= SLENDER_FLAT * usual
    may_be_steady = ratio >= 1 or (may_be_short and ratio + ERRORS * error >= 1)
    if not may_be_steady or not slender or length < LONG_IF_ROUND * sections.widest:
        return None
    is_sure = ratio >= 1 and (may_be_short or length >= LONG * sections.widest)
    return StalkStretch(first * sections.step, first * sections.step + length, usual, is_sure)


def _narrow_runs(sections: Sections) -> IntArray:
    """Return the first station of each run of narrow sections and the one past its last, (k, 2).

    What lies between two of them, and has too few points to show a width, parts nothing.
    """
    narrow = sections.width <= NARROW * sections.widest
    runs = _runs_of(narrow)
    for last, first in zip(runs[:-1, 1], runs[1:, 0], strict=True):
        narrow[last:first] = sections.free[last:first].sum() < SHOWN
    return _runs_of(narrow)


def _runs_of(held: BoolArray) -> IntArray:
    return np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]))).reshape(-1, 2)


def _steadiness(width: FloatArray, free: FloatArray, steady: float) -> tuple[float, float]:
    """Return a ratio below 1 where sections from an end on taper towards it, as a tip or a lobe does, and its error.

    Of widths (k,) and their degrees of freedom (k,).
    """
    third = len(width) // 3
    ends = max(1, third)
    outer = float(width[:ends].mean())
    within = max(steady * float(width[-ends:].mean()), BULGE * float(width[third : len(width) - third].mean()))
    ratio = outer / within if within else np.inf
    return ratio, ratio / float(np.sqrt(2 * max(1.0, free[:ends].sum())))
