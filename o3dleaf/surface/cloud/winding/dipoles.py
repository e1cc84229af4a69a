"""The winding number that dipoles make anywhere, near them and far, by a tree of their moments."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.parallel import run_blocks
from o3dleaf.surface.cloud.winding import expansion_loops
from o3dleaf.surface.cloud.winding.dipole_tree import DipoleTree

PLACES = 256
"""Places that are summed at, at once."""


@dataclass(frozen=True, eq=False)
class Dipoles:
    r"""Dipoles f = a n of points with normals n and areas a, and the winding number that they make at any places.

    .. math:: w(x) = \frac{1}{4π} \sum_j f_j · g(x_j - x), \qquad g(e) = \frac{e}{(|e|^2 + s^2)^{3/2}}

    Those of a node of the tree, at c + d_j, that is far from x are taken as one: with e = c − x and
    q = (|e|² + s²)^(−1/2),

    .. math:: \sum_j f_j · g(e + d_j) ≈ q^3 \Bigl( e_a \sum f_a + \sum d_a f_a - 3 q^2 e_a e_b \sum d_a f_b
              - \tfrac{3}{2} q^2 e_a \sum (2 d_a d_b f_b + d_b d_b f_a)
              + \tfrac{15}{2} q^4 e_a e_b e_c \sum d_a d_b f_c \Bigr).

    Attributes
    ----------
    tree : DipoleTree
    flux : (n, 3) ndarray
        f, in the order of the tree.
    terms : (m, 23) ndarray
        What multiplies the monomials of e, for each node.

    References
    ----------
    Barill et al. (2018), ACM Trans. Graph. 37, 43 (winding numbers by a tree, moments up to the second).
    """

    tree: DipoleTree
    flux: FloatArray
    terms: FloatArray

    @classmethod
    def of(cls, points: FloatArray, flux: FloatArray) -> "Dipoles":
        """Return the dipoles (n, 3) of points (n, 3), in any order."""
        tree = DipoleTree(points)
        ordered = np.ascontiguousarray(flux[tree.order])
        return cls(tree, ordered, _terms(*expansion_loops.sum_moments(tree.points, tree.nodes, ordered)))

    def __repr__(self) -> str:
        return f"Dipoles({len(self.flux):,} points)"

    def winding_at(self, places: FloatArray, width: FloatArray) -> FloatArray:
        """Return the winding number (k,) at places (k, 3), distances softened by s = `width` (k,) of the place.

        Widths are in the unit of the points; where one is 0, a point that lies at the place makes nothing.
        """
        targets, square, number = np.ascontiguousarray(places), width**2, np.empty(len(places))
        tree = self.tree

        def task(start: int, stop: int) -> None:
            expansion_loops.wind_at(
                targets, square, tree.points, self.flux, tree.nodes, self.terms, start, stop, number
            )

        run_blocks(task, len(targets), PLACES)
        return number


def _terms(zeroth: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the terms (m, 23) of moments (m, 3), (m, 3, 3) and (m, 3, 3, 3): those of equal monomials are summed."""
    traces = 2 * np.einsum("kaba->kb", second) + np.einsum("kaab->kb", second)
    pairs = ((0, 1), (1, 2), (2, 0))
    squares = [first[:, a, a] for a in range(3)] + [first[:, a, b] + first[:, b, a] for a, b in pairs]

    def cubic(a: int, b: int, c: int) -> FloatArray:
        every = {(a, b, c), (a, c, b), (b, a, c), (b, c, a), (c, a, b), (c, b, a)}
        return np.asarray(sum(second[:, i, j, k] for i, j, k in every))

    cubics = [(0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 2), (1, 1, 1), (1, 1, 0), (1, 1, 2)]
    cubics += [(2, 2, 2), (2, 2, 0), (2, 2, 1)]
    parts = [zeroth, np.einsum("kaa->k", first), *squares, traces, *(cubic(*each) for each in cubics)]
    return np.ascontiguousarray(np.column_stack(parts))
