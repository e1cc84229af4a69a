r"""Rings around the axis of a scan, which detector pixels of another gain leave in every slice, and their removal.

All of a circle is brighter or darker by the same amount: :math:`I(x, y, z) = I_0(x, y, z) + \rho(r, z)`, r the distance
from the axis (Sijbers and Postnov, Reduction of ring artefacts in high resolution micro-CT reconstructions, 2004). Here
:math:`\rho` is the mean, on a circle, of what its voxels are off the mean of their kind, air or leaf. Of that mean some
is chance: it is shrunk to the share that two halves of the circle, every other sector, agree on (an empirical Bayes
estimate, Efron and Morris 1973).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import solveh_banded

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import InputError
from o3dleaf.leaf.ct.corrections.pure import classes_of, pure_voxels, slabs_of
from o3dleaf.leaf.ct.threshold import MAX_VOXELS
from o3dleaf.leaf.ct.volume import PlacedVoxels, Volume

MIN_VOXELS = 1e-6
"""Added to the number of voxels on every circle, so that the system has a solution where there are none."""
FARTHEST = 1e6
"""Voxels to the axis; beyond, circles are straight lines."""
SECTORS = 16
"""Of what is seen of the circles, odd ones against even ones: what is in one place is in one of the halves."""


@dataclass(frozen=True)
class Rings:
    """Rings around an axis along z.

    Attributes
    ----------
    heights : (nz, m) ndarray
        What is to be subtracted on each circle of each slice, in intensity; circles meet the slices, a `step` apart.
    axis : (2,) ndarray
        x and y of the axis, in the volume's unit.
    step : float
        Difference of two radii, in the volume's unit.
    contrast : float
        The step from air to leaf, in intensity.
    """

    heights: FloatArray
    axis: FloatArray
    step: float
    contrast: float

    @property
    def typical(self) -> float:
        """Root mean square of the rings, as a share of the step from air to leaf."""
        return float(np.sqrt(np.mean(self.heights**2)) / self.contrast)

    def __str__(self) -> str:
        x, y = self.axis
        return f"rings around {x:.6g} {y:.6g}: typically {self.typical:.2g} of the step from air to leaf"


def middle(lattice: PlacedVoxels) -> FloatArray:
    """Return x and y of the middle of the slices, where scanners' programs place the axis."""
    center: FloatArray = lattice.bounds[:, :2].mean(axis=0)
    return center


def middle_slices(volume: Volume) -> Volume:
    """Return a few million voxels about the middle of a volume, whole slices of it, without a copy."""
    count = volume.shape[2]
    slices = min(count, max(2, MAX_VOXELS * count // volume.data.size))
    first = (count - slices) // 2
    origin = volume.origin + volume.spacing * (0, 0, first)
    return Volume(volume.data[:, :, first : first + slices], volume.spacing, origin, volume.unit)


@checked
def find_rings(volume: Volume, axis: npt.ArrayLike | None = None) -> Rings:
    r"""Return the rings around an axis along z.

    Parameters
    ----------
    volume : Volume
    axis : (2,) array_like, optional
        x and y of the scanner's axis, in the volume's unit; by default the middle of the slices. Of a volume that was
        cropped this is another place.

    Raises
    ------
    InputError
        If air and leaf cannot be told apart, or the axis lies a million voxels away.
    """
    classes = classes_of(volume)
    center = middle(volume) if axis is None else as_points(axis, "axis", dim=2)[0]
    circles = _Circles(volume, center)
    heights = np.empty((volume.shape[2], circles.count))
    levels = np.full(volume.shape[2], classes.level)
    for slab, values in slabs_of(volume):
        air, leaf = pure_voxels(volume, slab, levels)
        off = np.where(air, values - classes.means[0], values - classes.means[1])
        for k in range(slab.stop - slab.start):
            heights[slab.start + k] = circles.heights(off[:, :, k], (air | leaf)[:, :, k])
        progress.report(slab.stop, volume.shape[2])
    return Rings(heights, center, circles.step, float(classes.means[1] - classes.means[0]))


@checked
def remove_rings(volume: Volume, axis: npt.ArrayLike | None = None) -> Volume:
    """Return a volume without the rings around an axis along z, and without cupping, which is one wide ring.

    Parameters
    ----------
    volume : Volume
    axis : (2,) array_like, optional
        As of `find_rings`.

    Returns
    -------
    Volume
        In single precision.

    Raises
    ------
    InputError
        If air and leaf cannot be told apart, or the axis lies a million voxels away.
    """
    rings = find_rings(volume, axis)
    circles = _Circles(volume, rings.axis)
    data = np.empty(volume.shape, dtype=np.float32)
    for slab, values in slabs_of(volume):
        for k in range(slab.stop - slab.start):
            data[:, :, slab.start + k] = values[:, :, k] - circles.spread(rings.heights[slab.start + k])
    return Volume(data, volume.spacing, volume.origin, volume.unit)


class _Circles:
    """The circles around an axis that meet a slice, a voxel apart, and functions linear in the radius between."""

    def __init__(self, lattice: PlacedVoxels, axis: FloatArray) -> None:
        x, y = (lattice.origin[k] + lattice.spacing[k] * np.arange(lattice.shape[k]) - axis[k] for k in range(2))
        self.step = float(lattice.spacing[:2].min())
        radii = np.hypot(x[:, np.newaxis], y) / self.step
        if not radii.max() < FARTHEST:
            raise InputError(
                f"axis: lies {radii.max():.3g} voxels away; give x and y of the scanner's axis in its unit"
            )
        radii -= np.floor(radii.min())
        self.inner = radii.astype(np.int_)
        """(nx, ny) the last circle, of those that meet a slice, outside of which a voxel of it lies."""
        self.share = radii - self.inner
        """(nx, ny) how far it is on the way to the next."""
        # Angles from the direction of the middle: around an axis outside they have no jump, and a small range.
        middle = complex(x.mean(), -y.mean())
        angles = np.angle((x[:, np.newaxis] + 1j * y) * (middle if abs(middle) > self.step else 1.0))
        turns = (angles - angles.min()) / np.ptp(angles)
        self.odd = np.floor(turns * SECTORS) % 2 == 1
        self.count = int(radii.max()) + 2

    def spread(self, heights: FloatArray) -> FloatArray:
        """Return the voxels (nx, ny) of a function given on the circles."""
        values: FloatArray = (1 - self.share) * heights[self.inner] + self.share * heights[self.inner + 1]
        return values

    def heights(self, off: FloatArray, pure: npt.NDArray[np.bool_]) -> FloatArray:
        """Return the rings of a slice: the nearest function to what its pure voxels are off, less what is chance."""
        means, counts = self.nearest(off, pure)
        halves = [self.nearest(off, pure & half) for half in (self.odd, ~self.odd)]
        (first, n), (second, m) = halves
        both = np.minimum(n, m) >= 1
        if not both.any():
            return np.zeros(self.count)
        weights = 1 / (1 / n[both] + 1 / m[both])
        chance = float(np.average(weights * (first[both] - second[both]) ** 2))
        common = max(float(np.average((first * second)[both], weights=weights)), 0.0)
        return means * common * counts / (common * counts + chance + np.finfo(float).tiny)

    def nearest(self, off: FloatArray, among: npt.NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Return the function nearest to some voxels by least squares, and how many of them each circle has."""
        inner, share, values = self.inner[among], self.share[among], off[among]

        def sums(of: FloatArray, circles: npt.NDArray[np.int_]) -> FloatArray:
            total: FloatArray = np.bincount(circles, of, self.count).astype(np.float64)
            return total

        diagonal = sums((1 - share) ** 2, inner) + sums(share**2, inner + 1)
        beside = sums(share * (1 - share), inner + 1)
        right = sums((1 - share) * values, inner) + sums(share * values, inner + 1)
        # A circle without voxels is at 0.
        means = solveh_banded(np.stack([beside, diagonal + MIN_VOXELS]), right)
        return means, diagonal
