"""The pieces of a scan, as `piece` counts them."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import middle_of
from o3dleaf.core.units import lengths_in
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
        Of the piece that each point belongs to, counted from 1; 0 of points that are in none.
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


@checked
def find_pieces(points: CloudLike, *, unit: Unit | None = None, one_sheet: bool = True) -> ScanPieces:
    """Return the pieces of a scan, with the numbers by which `piece` of `BladeOptions` takes one.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
        Of leaves, and whatever else was scanned.
    unit : str, optional
        Of the points, for the lines.
    one_sheet : bool
        Whether layers that lie close together are one surface, as of `BladeOptions`.

    Returns
    -------
    ScanPieces

    Raises
    ------
    InputError
        If the points are too few or not finite.
    """
    with lengths_in(unit):
        found = _leftovers(points, one_sheet=one_sheet)
        rows = found.pieces
        number = np.zeros(len(found.scan), dtype=np.int64)
        for k, own in enumerate(rows, 1):
            number[own] = k
        return ScanPieces(
            found.scan,
            number,
            np.array([found.area(own) for own in rows]),
            np.array([middle_of(found.scan[own]) for own in rows]).reshape(-1, 3),
            tuple(f"{k}: {found.name(own)}" for k, own in enumerate(rows, 1)),
        )


def _leftovers(points: CloudLike, *, one_sheet: bool) -> Leftovers:
    """Return what a scan's sheet leaves out, or the parts of a scan without one."""
    try:
        leftovers = find_sheet(points, one_sheet=one_sheet).leftovers
    except ReconstructionError:
        leftovers = None
    if leftovers is not None:
        return leftovers
    cloud = OrientedCloud.of(points)
    used = usable_rows(cloud.points)
    return Leftovers.apart(cloud.points, used, OrientedCloud.of(cloud.points[used]).spacing)
