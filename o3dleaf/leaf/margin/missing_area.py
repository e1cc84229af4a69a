"""The area of a leaf beyond the triangles that a sample of it covers: by Pick's theorem, or Efron's identity.

A lattice and a random sample end differently. In a lattice half a cell is missing at each point of the border. Of
random points those that the others do not cover tell what is missing: a point of the same leaf, drawn once more,
would fall outside as often.
"""

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation, components_of, inner_points, longest_sides

RANDOM = 35 / (2 * np.pi**2) - 1
"""Variance of the area of a random sample's Delaunay triangles, in squares of its mean (Rathie 1992); 0 in a
lattice."""
FLAT = np.cos(3 * np.pi / 4)
"""Cosine of the angle of a triangle from which on its points are nearer to one row, 180°, than to a lattice, 90°."""


def missing_area(
    mesh: Triangulation, kept: BoolArray, spacing: FloatArray, randomness: float, longest: float
) -> FloatArray:
    """Return for each point (n,) the area that the triangles kept leave out there.

    Parameters
    ----------
    mesh : Triangulation
    kept : (m,) bool ndarray
        Its triangles that the sample covers.
    spacing : (n,) ndarray
        Square root of the area that a point stands for.
    randomness : float
        How much of `_lost` is taken (`randomness`); the rest is that of a lattice.
    longest : float
        Triangles with longer sides, in spacings, are never covered.
    """
    missing = np.zeros(len(mesh.points))
    if randomness > 0:
        missing += randomness * spacing**2 * _lost(mesh, kept, spacing, longest)
    if randomness < 1:
        missing += (1 - randomness) * _left_out_by_lattice(mesh, kept, spacing)
    return missing


def randomness(areas: FloatArray, corners: IntArray) -> float:
    """Return how random a sample is, from 0, a lattice, to 1, independent points.

    It is the variance of the areas of its Delaunay triangles as a share of that of independent points.

    Parameters
    ----------
    areas : (m,) array
        Of triangles, in cells of the sample there.
    corners : (m,) int array
        How many corners of each are points that no border has cut. All triangles of a point are taken, and each as
        often: among those that lie inside as a whole, large ones are rare.

    References
    ----------
    Rathie, P. N. (1992): On the volume distribution of the typical Poisson-Delaunay cell. J. Appl. Probab. 29, 740-744.
    """
    if not corners.any():
        return 0.0
    mean = np.average(areas, weights=corners)
    return float(np.clip((np.average(areas**2, weights=corners) / mean**2 - 1) / RANDOM, 0.0, 1.0))


def _left_out_by_lattice(mesh: Triangulation, kept: BoolArray, spacing: FloatArray) -> FloatArray:
    """Return for each point (n,) the area that the border of a lattice leaves out.

    n points of which b lie on the border of one piece have 2 n − b − 2 triangles (Euler), two to a cell; in a lattice
    all are half a cell, and their area is n − b/2 − 1 cells (Pick). So half a cell is missing at each point of the
    border, and what a triangle there is smaller than half a cell, as flat ones are: along a row they lie in layers, of
    which only the first is at the border. It is as much less where one is larger, but those of more than a cell lie in
    pockets that were filled: their area is the leaf's.
    """
    used, inner = inner_points(mesh, kept)
    border = used & ~inner
    half = 0.5 * (spacing[mesh.triangles] ** 2).mean(axis=1)
    at_border = kept & (~np.append(kept, False)[mesh.neighbors]).any(axis=1)
    at_border |= _reached(mesh, kept & (_widest_angles(mesh) < FLAT), at_border)
    small = np.where(at_border & (mesh.areas < 2 * half), half - mesh.areas, 0.0)
    weight = border[mesh.triangles].astype(float)
    weight[~weight.any(axis=1)] = 1.0  # deeper layers may have no corner on the border
    weight *= (small / weight.sum(axis=1))[:, None]
    missing: FloatArray = np.where(border, 0.5 * spacing**2, 0.0)
    missing += np.bincount(mesh.triangles.ravel(), weight.ravel(), len(mesh.points))
    return np.maximum(missing, 0.0)


def _widest_angles(mesh: Triangulation) -> FloatArray:
    """Return the cosine (m,) of the widest angle of each triangle."""
    corners = mesh.points[mesh.triangles]
    ways = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(ways, axis=2)
    facing = -(ways * np.roll(ways, 1, axis=1)).sum(axis=2)
    return np.asarray((facing / np.maximum(lengths * np.roll(lengths, 1, axis=1), 1e-300)).min(axis=1))


def _reached(mesh: Triangulation, chosen: BoolArray, begin: BoolArray) -> BoolArray:
    """Return those of the chosen triangles (m,) that are reached through such from where they `begin` (m,)."""
    labels = components_of(mesh, chosen)
    return chosen & np.isin(labels, labels[chosen & begin])


def _lost(mesh: Triangulation, kept: BoolArray, spacing: FloatArray, longest: float) -> BoolArray:
    """Return which points (n,) the others do not cover.

    If X are independent points of density ρ in a leaf, and C(X) is what they cover, ρ E|leaf ∖ C(X)| is the expected
    number of points x that do not lie in C(X ∖ x), whatever way C is found (Mecke's formula; Efron's identity, where C
    is the hull). Without x its star is triangulated anew; the triangle around x has corners of the star alone.

    References
    ----------
    Efron, B. (1965): The convex hull of a random set of points. Biometrika 52, 331-343.
    Baldin, N., Reiß, M. (2016): Unbiased estimation of the volume of a convex body. Stoch. Process. Appl. 126.
    """
    used, inner = inner_points(mesh, kept)
    ends = used & ~inner
    apart = np.flatnonzero(~used)
    ends[apart[cKDTree(mesh.points[used]).query(mesh.points[apart])[0] <= longest * spacing[apart]]] = True
    lost = np.zeros(len(mesh.points), dtype=bool)
    for point, link in _links(mesh.triangles, ends):
        corners = _around(mesh.points[link], mesh.points[point])
        if corners is None:
            lost[point] = True
            continue
        a, b, c = mesh.points[link[corners]][:, None]
        reach = float(longest_sides((a, b, c), mesh.metric[[point]])[0])
        lost[point] = reach > longest * spacing[link[corners]].mean()
    return lost


def _links(triangles: IntArray, chosen: BoolArray) -> list[tuple[int, IntArray]]:
    """Return the chosen points, and the points (k,) that each shares a triangle with."""
    row, corner = np.nonzero(chosen[triangles])
    center = np.repeat(triangles[row, corner], 2)
    other = np.stack([triangles[row, (corner + 1) % 3], triangles[row, (corner + 2) % 3]], axis=1).ravel()
    pairs = np.unique(np.stack([center, other], axis=1), axis=0)
    points, first = np.unique(pairs[:, 0], return_index=True)
    return list(zip(points.tolist(), np.split(pairs[:, 1], first[1:]), strict=True))


def _around(places: FloatArray, point: FloatArray) -> IntArray | None:
    """Return the corners of the Delaunay triangle of (k, 2) places that a point lies in; None where it lies in none."""
    try:
        delaunay = Delaunay(places - point)
    except QhullError:
        return None
    triangle = int(delaunay.find_simplex(np.zeros((1, 2)))[0])
    return None if triangle < 0 else np.asarray(delaunay.simplices[triangle], dtype=np.int64)
