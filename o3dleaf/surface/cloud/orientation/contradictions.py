"""Normals that contradict one another along a line, as those of a sheet with one side do: told, with their place."""

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.places import tell_middle
from o3dleaf.surface.cloud.neighbors import BLOCK, LINKED, largest_group
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

OPPOSED = -0.7
"""Cosine of two normals that contradict one another: no surface turns by 135 degrees from a point to one beside it."""
LEVEL = 0.25
"""Share of the distance of two points, and of their spacing, that either may be off the plane of the other on one
sheet: what faces away nearer than that is the other side of a sheet as thin, of which nothing is known."""
MIN_OPPOSED = 2
"""Of eight neighbors: single ones oppose a point on thin noisy parts."""
MIN_LINE = 8
"""Points of a line: fewer normals against those around them are noise; the clouds of the bench have up to three."""
NOTE = (
    "the normals of {:,} points contradict those beside them, along a line around {}: the surface is torn there, or "
    "joined to itself; without normals a sheet with one side is cut"
)


def tell_contradictions(cloud: OrientedCloud, normals: FloatArray) -> tuple[str, ...]:
    """Return a line about unit normals (n, 3) of a cloud where many in a row face away from those beside them.

    Parameters
    ----------
    cloud : OrientedCloud
    normals : (n, 3) ndarray
    """
    opposed = find_contradicted(cloud, normals)
    if np.count_nonzero(opposed) < MIN_LINE:
        return ()
    line = largest_group(np.ascontiguousarray(cloud.points[opposed]), 2 * cloud.spacing)
    return (NOTE.format(len(line), tell_middle(line, cloud.points)),) if len(line) >= MIN_LINE else ()


def find_contradicted(cloud: OrientedCloud, normals: FloatArray) -> npt.NDArray[np.bool_]:
    """Return which points (n,) two or more of their eight nearest oppose that lie beside them on one plane."""
    points, near = cloud.points, cloud.neighbors
    opposed = np.zeros(len(points), dtype=bool)

    def task(start: int, stop: int) -> None:
        row, distance = near.row[start:stop, 1 : LINKED + 1], near.distance[start:stop, 1 : LINKED + 1]
        own, other = normals[start:stop], normals[row]
        offset = points[row] - points[start:stop, np.newaxis]
        height = np.maximum(
            np.abs(np.einsum("ij,ikj->ik", own, offset)), np.abs(np.einsum("ikj,ikj->ik", other, offset))
        )
        spacing = np.sqrt(np.pi / LINKED) * distance[:, -1:]
        beside = height < LEVEL * np.minimum(distance, spacing)
        facing = np.einsum("ij,ikj->ik", own, other) < OPPOSED
        opposed[start:stop] = np.count_nonzero(beside & facing, axis=1) >= MIN_OPPOSED

    if near.row.shape[1] > LINKED:
        run_blocks(task, len(points), BLOCK)
    return opposed
