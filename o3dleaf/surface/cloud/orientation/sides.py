"""The outward normals of surfels: by their neighbors' agreement, and pieces' signs by what encloses a volume."""

from typing import NamedTuple

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud import cloud_loops
from o3dleaf.surface.cloud.neighbors import BLOCK
from o3dleaf.surface.cloud.normals import SEAM, OrientedPieces, join_neighbors, longest_seam, repair_normals
from o3dleaf.surface.cloud.surfels import FLAT, ROUGH, Surfels
from o3dleaf.surface.cloud.winding.enclosing import enclosing_signs

ROUNDS = 3
CLEAN_EDGES = 8
"""Nearest neighbors that are compared where the cloud is clean; all 15 are under noise."""
OPEN = 0.25
"""Mean winding number below which a cloud encloses nothing: 1/2 where it does, 0.06 on leaves."""
OPEN_NOTE = (
    "the cloud encloses no volume and is treated as an open sheet: either side may be outside; a viewpoint decides"
)
DECISIVE = 0.1
"""Gain in the square of the winding number's error from which it, and not the neighbors, decides on a piece."""


class Sides(NamedTuple):
    """Outward normals (m, 3) of surfels, the mean winding number on them, and the length of their longest seam."""

    normals: FloatArray
    enclosed: float
    seam: float

    @property
    def contradictory(self) -> bool:
        """True for an open sheet whose normals contradict one another along a line."""
        return self.enclosed < OPEN and self.seam > SEAM


def find_sides(surfels: Surfels) -> Sides:
    """Find the outward normals of surfels, and whether they contradict one another."""
    points, rows = surfels.points, surfels.rows
    smoothing, joining, turning = progress.split(1, 4, 1)
    with smoothing:
        smoothed = _smoothed(surfels)
    with joining:
        near = rows if surfels.scale.flatness > FLAT else np.ascontiguousarray(rows[:, : CLEAN_EDGES + 1])
        pieces = join_neighbors(points, smoothed, near)
    with turning:
        agreed = pieces.sign[:, np.newaxis] * smoothed
        area = surfels.total(surfels.spacing**2)
        sign, winding, gain = enclosing_signs(points, agreed, area, pieces.piece)
        _follow_neighbors(pieces, sign, gain)
        repaired = repair_normals(points, sign[pieces.piece][:, np.newaxis] * agreed, rows)
    enclosed = float(np.average(winding[pieces.piece], weights=area))
    seam = longest_seam(points, repaired.normals, rows) if repaired.conflict else 0.0
    return Sides(repaired.normals, enclosed, seam)


def _smoothed(surfels: Surfels) -> FloatArray:
    """Return the normals (m, 3) of the surfels, averaged on their own sheet where they are rough."""
    normals = surfels.planes.normal
    if surfels.scale.flatness <= ROUGH:
        return normals
    noise = float(np.median(np.sqrt(surfels.planes.variance[:, 0])))
    for _ in range(ROUNDS):
        smoothed, args = np.empty_like(normals), (surfels.points, normals, surfels.rows, noise)
        run_blocks(lambda i, j: cloud_loops.smooth_normals(*args, i, j, smoothed), len(normals), BLOCK)  # noqa: B023
        normals = smoothed
    return normals


def _follow_neighbors(pieces: OrientedPieces, sign: FloatArray, gain: FloatArray) -> None:
    """Turn pieces on whose sign the winding number decides little so that they agree with larger neighbors."""
    for c in np.flatnonzero(gain < DECISIVE):
        edges = pieces.other == c  # pieces.one is the larger one
        agreement = float(np.sum(pieces.agreement[edges] * sign[pieces.one[edges]]))
        if agreement:
            sign[c] = np.sign(agreement)
