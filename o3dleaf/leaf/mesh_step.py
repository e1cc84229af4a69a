"""The step of a mesh where none was asked for: from the scan's spacing and the thickness of the micro-structure."""

import math
from dataclasses import dataclass

from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.residuals.off_blade import rows_of_piece
from o3dleaf.surface.cloud.usable_points import remove_faults

STEPS_PER_PATCH = 5
"""Steps in the height of a micro-CT patch: what stands out of a blade, ridges between its veins and hairs, is about as
wide as the patch is high, and with five steps has a crown, two flanks and two feet."""


@dataclass(frozen=True)
class MeshStep:
    """The step of a mesh, and why it is that.

    Attributes
    ----------
    length : float
        In the scan's unit.
    reason : str
        Half a sentence.
    """

    length: float
    reason: str


def choose_step(scan: CloudLike, thickness: float | None, blade: Blade | None = None) -> MeshStep:
    """Return the step that shows what was measured: the scan's point spacing, or less where there is more to show.

    Of a blade that was made of one piece of the scan it is that piece's.

    Parameters
    ----------
    scan : (n, 3) array_like or Open3D point cloud
    thickness : float, optional
        Height of the patch of micro-structure, in the scan's unit; a fifth of it, a round number, is the step where
        the scan's spacing is not smaller.
    blade : Blade, optional

    Raises
    ------
    InputError
        If most points of the scan lie on a line or in one place.
    """
    whose = "scan"
    if blade is not None and blade.other_pieces is not None:
        points = points_of(scan, "scan")
        scan, whose = points[rows_of_piece(blade, points)], "piece"
    # What lies far off does not move a median, and is not looked for.
    spacing = float(f"{remove_faults(scan, None).spacing:.1e}")
    fine = math.inf if thickness is None else _to_round_number(thickness / STEPS_PER_PATCH)
    if fine <= spacing:
        return MeshStep(fine, "a fifth of the height of the micro-structure")
    return MeshStep(spacing, f"the {whose}'s median point spacing")


def _to_round_number(length: float) -> float:
    """Return the one of 1, 2 and 5 times a power of ten that is nearest in ratio."""
    power = math.floor(math.log10(length))
    near = [float(f"{digit}e{power}") for digit in (1, 2, 5, 10)]
    return min(near, key=lambda each: abs(math.log(each / length)))
