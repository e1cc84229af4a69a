"""The pieces of a scan, as `piece` counts them."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import middle_of
from o3dleaf.leaf.sheet.pieces.leftovers import Leftovers
from o3dleaf.leaf.sheet.sheet import find_sheet
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.usable_points import usable_rows


@dataclass(frozen=True, eq=False, repr=False)
class ScanPieces:
    """Pieces of a scan: its largest sheet, or the leaves that touch, cross or rest on one another, and all others.

    Attributes
    ----------
    points : (n, 3) ndarray
        The scan.
    number : (n,) ndarray of int64
        Of the piece that each point belongs to, counted from 1; 0 of points that are in none or repeat others.
    areas : (p,) ndarray
        Of each piece, about, in the unit squared: that of as many points as dense as its own are.
    places : (p, 3) ndarray
        Of each piece, its point nearest to the median of all.
    lines : tuple of str
        Number, size and place of each.
    """

    points: FloatArray
    number: IntArray
    areas: FloatArray
    places: FloatArray
    lines: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.areas)

    def __repr__(self) -> str:
        return f"ScanPieces({len(self)}: {'; '.join(self.lines)})"

    @classmethod
    def of(cls, scan: FloatArray, used: IntArray, *, one_sheet: bool) -> "ScanPieces":
        """Return the pieces of the points of a scan (n, 3) in the rows `used` (k,); all others are in none."""
        found = _leftovers(scan[used], one_sheet=one_sheet)
        number = np.zeros(len(scan), dtype=np.int64)
        for k, rows in enumerate(found.pieces, 1):
            number[used[rows]] = k
        return cls(
            scan,
            number,
            np.array([found.area(rows) for rows in found.pieces]),
            np.array([middle_of(found.scan[rows]) for rows in found.pieces]).reshape(-1, 3),
            tuple(f"{k}: {found.name(rows)}" for k, rows in enumerate(found.pieces, 1)),
        )


def _leftovers(points: FloatArray, *, one_sheet: bool) -> Leftovers:
    """Return what the sheet of points (n, 3) leaves out, or the parts of points that have none."""
    try:
        leftovers = find_sheet(points, one_sheet=one_sheet).leftovers
    except ReconstructionError:
        leftovers = None
    if leftovers is not None:
        return leftovers
    used = usable_rows(points)
    return Leftovers.apart(points, used, OrientedCloud.of(points[used]).spacing)
