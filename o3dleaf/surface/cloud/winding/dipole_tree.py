"""Sums over all points of a cloud, each a softened dipole, in n log n by a binary tree."""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.core.resume.blocks import kept_block
from o3dleaf.surface.cloud.winding import dipole_loops

BLOCK = 16
"""Leaves of sixteen points that are summed at once."""


class DipoleTree:
    r"""Points of a cloud in the order of a tree, and the sums over dipoles at them.

    A point with normal n and area a is a dipole f = a n, of which the winding number at x is

    .. math:: w(x) = \frac{1}{4π} \sum_j \frac{f_j · (x_j - x)}{(|x_j - x|^2 + s_j^2)^{3/2}},

    1 inside, 0 outside and 1/2 on a closed surface. The width :math:`s_j`, about the radius of the disc that the
    point stands for, keeps bounded what points make at their next neighbors, and within which the number goes from
    one side's to the other's.

    Attributes
    ----------
    order : (n,) ndarray
        The rows of the cloud, in the order of the tree, in which all arrays are given and returned here.
    points : (n, 3) ndarray

    References
    ----------
    Barill et al. (2018), ACM Trans. Graph. 37, 43 (winding numbers by a tree).
    """

    def __init__(self, points: FloatArray) -> None:
        self.order = cKDTree(points).indices
        self.points = np.ascontiguousarray(points[self.order])
        self.nodes: dipole_loops.Nodes = dipole_loops.build_nodes(self.points)

    def __repr__(self) -> str:
        return f"DipoleTree({len(self.points):,} points)"

    def with_leaves(self, wanted: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return a mask (n,) of all points of the leaves that contain one of `wanted` (n,)."""
        first = self.nodes.first[self._leaves - 1 :]
        last = self.nodes.last[self._leaves - 1 :]
        held = np.concatenate([[0], np.cumsum(wanted)])
        return np.repeat(held[last] > held[first], last - first)

    def winding(self, flux: FloatArray, width: FloatArray, wanted: npt.NDArray[np.bool_]) -> FloatArray:
        """Return the winding number at the wanted points, and its gradient (n, 4); 0 at the others.

        Parameters
        ----------
        flux : (n, 3) ndarray
        width : (n,) ndarray
            In the unit of the points.
        wanted : (n,) ndarray of bool
        """
        square, total = width**2, np.zeros((len(self.points), 4))
        sizes = np.maximum(self.nodes.last - self.nodes.first, 1)
        mean_square = self._moments(square[:, np.newaxis])[:, 0] / sizes
        sums = self._moments(flux)

        def task(start: int, stop: int) -> None:
            dipole_loops.wind(self.points, flux, square, self.nodes, sums, mean_square, wanted, start, stop, total)

        def make() -> tuple[FloatArray]:
            run_blocks(task, self._leaves, BLOCK)
            return (total,)

        return kept_block(make)[0]

    def pull(self, error: FloatArray, width: FloatArray, wanted: npt.NDArray[np.bool_]) -> FloatArray:
        """Return the derivative (n, 3) of the sum of error · w over the wanted points for each one's dipole.

        Parameters
        ----------
        error, width : (n,) ndarray
            Errors are 0 at points that are not wanted.
        wanted : (n,) ndarray of bool
        """
        square, total = width**2, np.zeros((len(self.points), 3))
        sums = self._moments(error[:, np.newaxis])

        def task(start: int, stop: int) -> None:
            dipole_loops.pull(self.points, error, square, self.nodes, sums, wanted, start, stop, total)

        def make() -> tuple[FloatArray]:
            run_blocks(task, self._leaves, BLOCK)
            return (total,)

        return kept_block(make)[0]

    @property
    def _leaves(self) -> int:
        return len(self.nodes.radius) // 2 + 1

    def _moments(self, values: FloatArray) -> FloatArray:
        moments: FloatArray = dipole_loops.sum_nodes(self.points, self.nodes, values)
        return moments
