"""Rough values of a blend on a lattice on which its balls sit alike: one matrix product for all balls of a class.

Balls that were fitted to voxels share their points, and on a lattice of the same step they share the points at which
they are asked, too: the kernel is evaluated once for a class, and its balls are columns of a product.
"""

import numpy as np
import numpy.typing as npt

from o3dleaf.core.lattice import Lattice
from o3dleaf.fitting.cover.index import BallIndex
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.rbf.tail import IntArray

COLUMNS = 2048
"""Balls in one product: 6 MB of values, beside 1 MB of kernel."""

ALIKE = 1e-8
"""Part of a step by which balls may sit differently: less than single precision tells, which errors are bounds of."""

SHARED = 8
"""Balls that a class must have on the mean, or the product does not pay."""

Singles = npt.NDArray[np.float32]


def blend_on_lattice(splines: LocalSplines, index: BallIndex, lattice: Lattice) -> Singles | None:
    """Return the values of a blend at a lattice's points within its box, or None where its balls do not sit alike.

    They are off by no more than sums in single precision, see `LocalSplines.single_error`.
    """
    first, classes = np.unique(splines.places, return_index=True, return_inverse=True)[1:]
    if SHARED * len(first) > len(classes) or index.period.any():
        return None
    spacing = np.asarray(lattice.spacing)
    places = (index.centers - np.asarray(lattice.origin)) / spacing
    steps = places - places[first][classes]
    if np.abs(steps - np.rint(steps)).max() > ALIKE or np.any(index.radii != index.radii[first][classes]):
        return None
    # Beyond the lattice lies room for the centers of balls that reach into it, and for all that these reach.
    reach = np.ceil(index.radii.max() / spacing).astype(np.int64) + 1
    room, shape = 2 * reach, np.array(lattice.shape) + 4 * reach
    near = np.all((places > -reach) & (places < np.array(lattice.shape) - 1 + reach), axis=1)
    sums, totals = np.zeros((2, int(np.prod(shape))), dtype=np.float32)
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    for number, ball in enumerate(first):
        balls = np.flatnonzero((classes == number) & near)
        if len(balls):
            corner = np.floor(places[ball])
            offsets, unit = _points_in(places[ball] - corner, spacing, float(index.radii[ball]))
            starts = (corner + np.rint(steps[balls])).astype(np.int64) + room
            _add_class(splines, balls, unit, offsets @ stride, starts @ stride, sums, totals)
    inner = tuple(slice(before, before + count) for before, count in zip(room, lattice.shape, strict=True))
    sums, totals = (each.reshape(shape)[inner] for each in (sums, totals))
    return np.asarray(sums / totals) if totals.all() else None


def _points_in(
    center: npt.NDArray[np.float64], spacing: npt.NDArray[np.float64], radius: float
) -> tuple[IntArray, npt.NDArray[np.float64]]:
    """Return the lattice points (q, 3) in a ball about `center`, in steps, and their unit coordinates."""
    low, high = np.ceil(center - radius / spacing), np.floor(center + radius / spacing)
    box = np.meshgrid(*[np.arange(a, b + 1) for a, b in zip(low, high, strict=True)], indexing="ij")
    points = np.stack(box, axis=-1).reshape(-1, len(center))
    unit = (points - center) * spacing / radius
    inside = (unit**2).sum(axis=1) < 1
    return points[inside].astype(np.int64), unit[inside]


def _add_class(  # noqa: PLR0917 - a class of balls, where it is asked, and the two sums
    splines: LocalSplines,
    balls: IntArray,
    unit: npt.NDArray[np.float64],
    offsets: IntArray,
    starts: IntArray,
    sums: Singles,
    totals: Singles,
) -> None:
    """Add the weighted values of the balls of one class, and their weights."""
    sites = splines.ball(int(balls[0]))[0]
    distance = np.sqrt(((unit[:, :, np.newaxis] - sites) ** 2).sum(axis=1))
    kernel = splines.kernel(distance).astype(np.float32)
    tail = np.prod(unit[:, np.newaxis, :] ** splines.exponents, axis=2)
    tau = np.sqrt((unit**2).sum(axis=1))
    weight = ((1 - tau) ** 4 * (4 * tau + 1)).astype(np.float32)
    columns = np.arange(sites.shape[1])
    for first in range(0, len(balls), COLUMNS):
        some, begin = balls[first : first + COLUMNS], starts[first : first + COLUMNS]
        coefficients = splines.weights[splines.offsets[some][:, np.newaxis] + columns].astype(np.float32)
        values = kernel @ coefficients.T + (tail @ splines.tails[some].T).astype(np.float32)
        for k, offset in enumerate(offsets):
            # No ball is twice among them, so that no place is.
            sums[begin + offset] += weight[k] * values[k]
            totals[begin + offset] += weight[k]
