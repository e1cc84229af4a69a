"""The solid angle that data fill, seen from a place: the winding number of an oriented cloud."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.winding.dipoles import Dipoles

AROUND = 100
"""Points whose median is the level at one of them: at the tip of a thin part, one that is as thick as it is long."""

SOFTENING = 0.25
"""Spacings by which distances are softened there: noise does not count, and the far side of a thin part does."""

SAMPLE_SIZE = 100
"""Points whose median is the level of the whole cloud."""


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
    dipoles : Dipoles
        a_j n_j.

    References
    ----------
    Jacobson, Kavan and Sorkine-Hornung (2013), Robust inside-outside segmentation using generalized winding numbers.
    Barill et al. (2018), Fast winding numbers for soups and clouds.
    """

    data: OrientedCloud
    dipoles: Dipoles

    @classmethod
    def of(cls, cloud: CloudLike) -> "WindingNumber":
        """Return that of a cloud with outward normals, or raise `InputError` where it has none."""
        data = OrientedCloud.of(cloud)
        return cls(data, Dipoles.of(data.points, data.require_normals() * (data.point_spacing**2)[:, np.newaxis]))

    def __repr__(self) -> str:
        return f"WindingNumber({len(self.data):,} points)"

    def __call__(self, places: FloatArray, softening: FloatArray | float = 0.0) -> FloatArray:
        """Return w (n,) at places (n, 3), distances softened by a length: r² + softening² for r²."""
        return self.dipoles.winding_at(places, np.broadcast_to(softening, len(places)))

    def levels(self, rows: IntArray) -> FloatArray:
        """Return the level of w (n,) on the surface around some of the data.

        It is 1/2 on a closed surface, 0 on a sheet, and −1/2 where normals point into what is closed: the median of
        the nearest data's.
        """
        near = self.data.tree.query(self.data.points[rows], np.arange(1, min(AROUND, len(self.data)) + 1))[1]
        asked = np.unique(near)
        asked = asked[np.isnan(self._own[asked])]
        self._own[asked] = self(self.data.points[asked], SOFTENING * self.data.point_spacing[asked])
        return np.asarray(np.median(self._own[near], axis=1))

    @cached_property
    def _own(self) -> FloatArray:
        """(n,) the number at the data themselves, NaN where it was not asked yet: `levels` share most of them."""
        return np.full(len(self.data), np.nan)

    @property
    def level(self) -> float:
        """The level of the whole cloud, the median of a sample's."""
        rows = np.random.default_rng(0).permutation(len(self.data))[:SAMPLE_SIZE]
        own = self(self.data.points[rows], SOFTENING * self.data.point_spacing[rows])
        return float(np.median(own))
