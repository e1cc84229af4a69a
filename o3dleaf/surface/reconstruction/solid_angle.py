"""The solid angle that data fill, seen from a place: the winding number of an oriented cloud."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud.cells import Cells
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.solid_angle_loops import DipoleCells, sum_dipoles

CELL = 6.0
"""Edge of a cell in spacings: few tens of points, so that a place meets about as many cells as points."""

FAR = 2.0
"""Distance of a cell's center in its diameters beyond which it counts as one dipole: off by a sixteenth of it."""

AROUND = 100
"""Points whose median is the level at one of them: at the tip of a thin part, one that is as thick as it is long."""

SOFTENING = 0.25
"""Spacings by which distances are softened there: noise does not count, and the far side of a thin part does."""

SAMPLE_SIZE = 100
"""Points whose median is the level of the whole cloud."""

BLOCK = 64


@dataclass(frozen=True, eq=False)
class WindingNumber:
    r"""The winding number of an oriented cloud.

    .. math:: w(x) = \frac{1}{4\pi} \sum_j a_j \, n_j \cdot \frac{x_j - x}{|x_j - x|^3}, \qquad a_j = s_j^2

    The share of all directions in which the data are seen from behind, less that in which they are seen from the
    front: 1 within a closed surface, 0 outside. Of a gap in the data, what it fills of the view is what w is short of
    the one or of the other.

    Attributes
    ----------
    data : OrientedCloud
    cells : DipoleCells

    References
    ----------
    Jacobson, Kavan and Sorkine-Hornung (2013), Robust inside-outside segmentation using generalized winding numbers.
    Barill et al. (2018), Fast winding numbers for soups and clouds.
    """

    data: OrientedCloud
    cells: DipoleCells

    @classmethod
    def of(cls, cloud: CloudLike) -> "WindingNumber":
        """Return that of a cloud with outward normals, or raise `InputError` where it has none."""
        data = OrientedCloud.of(cloud)
        area = data.point_spacing**2
        sorted_cells = Cells.sort(data.points, CELL * float(np.median(data.point_spacing)))
        order, first, last = sorted_cells.order, sorted_cells.first, sorted_cells.last
        points, fluxes, area = data.points[order], (data.require_normals() * area[:, np.newaxis])[order], area[order]
        whole = np.add.reduceat(area, first)[:, np.newaxis]
        centers = np.add.reduceat(points * area[:, np.newaxis], first) / whole
        cell = np.repeat(np.arange(len(first)), last - first)
        radius = np.sqrt(np.maximum.reduceat(((points - centers[cell]) ** 2).sum(axis=1), first))
        sums = np.add.reduceat(fluxes, first)
        return cls(data, DipoleCells(points, fluxes, first, last, centers, sums, (2 * FAR * radius) ** 2))

    def __repr__(self) -> str:
        return f"WindingNumber({len(self.data):,} points in {len(self.cells.first):,} cells)"

    def __call__(self, places: FloatArray, softening: FloatArray | float = 0.0) -> FloatArray:
        """Return w (n,) at places (n, 3), distances softened by a length: r² + softening² for r²."""
        number, soft = np.empty(len(places)), np.empty(len(places))
        targets, soft[:] = np.ascontiguousarray(places), np.square(softening)
        run_blocks(lambda i, j: sum_dipoles(i, j, targets, self.cells, soft, number), len(places), BLOCK)
        return number

    def levels(self, rows: IntArray) -> FloatArray:
        """Return the level of w (n,) on the surface around some of the data.

        It is 1/2 on a closed surface, 0 on a sheet, and −1/2 where normals point into what is closed: the median of
        the nearest data's.
        """
        near = self.data.tree.query(self.data.points[rows], np.arange(1, min(AROUND, len(self.data)) + 1))[1]
        asked, place = np.unique(near, return_inverse=True)
        own = self(self.data.points[asked], SOFTENING * self.data.point_spacing[asked])
        return np.asarray(np.median(own[place.reshape(near.shape)], axis=1))

    @property
    def level(self) -> float:
        """The level of the whole cloud, the median of a sample's."""
        rows = np.random.default_rng(0).permutation(len(self.data))[:SAMPLE_SIZE]
        own = self(self.data.points[rows], SOFTENING * self.data.point_spacing[rows])
        return float(np.median(own))
