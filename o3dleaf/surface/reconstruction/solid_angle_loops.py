"""The compiled loop of the winding number of a cloud, of far cells as one dipole each."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from o3dleaf.core.compiled.decorator import njit


class DipoleCells(NamedTuple):
    """Oriented points in the order of their cells, and each cell as a whole.

    Cell c has the points first[c]:last[c] (m,), their area's mean place centers[c] (m, 3), the sum of their fluxes
    sums[c] (m, 3), normal times area, and the square of the distance beyond which it is one dipole, far[c] (m,).
    """

    points: npt.NDArray[np.float64]
    fluxes: npt.NDArray[np.float64]
    first: npt.NDArray[np.int64]
    last: npt.NDArray[np.int64]
    centers: npt.NDArray[np.float64]
    sums: npt.NDArray[np.float64]
    far: npt.NDArray[np.float64]


@njit(nogil=True, cache=True)
def _dipole(places, fluxes, j, x, soft):
    """Return f_j · (x_j − x)/(|x_j − x|² + soft)^1.5, 0 where x_j is x."""
    ex, ey, ez = places[j, 0] - x[0], places[j, 1] - x[1], places[j, 2] - x[2]
    square = ex * ex + ey * ey + ez * ez + soft
    if square == 0.0:
        return 0.0
    return (fluxes[j, 0] * ex + fluxes[j, 1] * ey + fluxes[j, 2] * ez) / (square * np.sqrt(square))


@njit(nogil=True, cache=True)
def sum_dipoles(start, stop, targets, cells, soft, number):
    """Write the winding number of the cells' points at each target (n,), distances softened by √soft (n,)."""
    for i in range(start, stop):
        x, total = targets[i], 0.0
        for c in range(len(cells.first)):
            square = 0.0
            for axis in range(3):
                gap = cells.centers[c, axis] - x[axis]
                square += gap * gap
            if square > cells.far[c]:
                total += _dipole(cells.centers, cells.sums, c, x, soft[i])
                continue
            for j in range(cells.first[c], cells.last[c]):
                total += _dipole(cells.points, cells.fluxes, j, x, soft[i])
        number[i] = total / (4.0 * np.pi)
