"""The area of a leaf beyond the triangles that a sample of it covers: by Pick's theorem, or Efron's identity.

A lattice and a random sample end differently. In a lattice half a cell is missing at each point of the border. Of
random points those that the others do not cover tell what is missing: a point of the same leaf, drawn once more,
would fall outside as often.
"""

import numpy as np
from scipy.spatial import Delaunay, QhullError, cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.sample_lines import SampleLines
from o3dleaf.leaf.margin.sample_spacing import BoolArray
from o3dleaf.leaf.margin.sample_triangles import Triangulation, border_distance, inner_points, longest_sides

RANDOM = 35 / (2 * np.pi**2) - 1
"""Variance of the area of a random sample's Delaunay triangles, in squares of its mean (Rathie 1992); 0 in a
lattice."""


def missing_area(
    mesh: Triangulation,
    kept: BoolArray,
    spacing: FloatArray,
    randomness: float,
    longest: FloatArray,
    lines: SampleLines | None = None,
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
        How much of `_lost` is taken (`randomness`) of a sample without lines; the rest is that of a lattice.
    longest : (n,) ndarray
        Triangles around a point with longer sides, in spacings, are never covered.
    lines : SampleLines, optional
        Those that the sample lies on, as even as a lattice across them: what is left out of it is what its points stand
        for beyond their triangles, however random they are along the lines.
    """
    share = randomness if lines is None else 0.0
    missing = np.zeros(len(mesh.points))
    if share > 0:
        missing += share * spacing**2 * _lost(mesh, kept, spacing, longest)
    if share < 1:
        missing += (1 - share) * _left_out_by_lattice(mesh, kept, spacing, lines)
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


def _left_out_by_lattice(
    mesh: Triangulation, kept: BoolArray, spacing: FloatArray, lines: SampleLines | None
) -> FloatArray:
    """Return for each point (n,) the area that the border of a lattice leaves out.

    n points of which b lie on the border of one piece have 2 n − b − 2 triangles (Euler), two to a cell; in a lattice
    all are half a cell, and their area is n − b/2 − 1 cells (Pick). So half a cell is missing at each point of the
    border, and what a triangle there is smaller than half a cell, as flat ones are. Larger ones lie in pockets that
    were filled: their area is the leaf's.
    """
    used, inner = inner_points(mesh, kept)
    border = used & ~inner
    triangles = mesh.triangles[kept]
    at_border = (~np.append(kept, False)[mesh.neighbors[kept]]).any(axis=1)
    half = 0.5 * (spacing[triangles] ** 2).mean(axis=1)
    small = np.where(at_border, np.maximum(half - mesh.areas[kept], 0.0), 0.0)
    weight = border[triangles].astype(float)
    if lines is not None:
        of_line = _of_outer_lines(mesh, kept, spacing, lines)
        small = np.where(of_line, half - mesh.areas[kept], small)
        weight[~weight.any(axis=1)] = 1.0  # deeper layers have no corner at the border
    weight *= (small / np.maximum(weight.sum(axis=1), 1.0))[:, None]
    missing: FloatArray = np.where(border, 0.5 * spacing**2, 0.0)
    return missing + np.bincount(triangles.ravel(), weight.ravel(), len(mesh.points))


def _of_outer_lines(mesh: Triangulation, kept: BoolArray, spacing: FloatArray, lines: SampleLines) -> BoolArray:
    """Return which of the triangles kept (k,) stand on a line at the border: on two of its points, or all three.

    Triangles with all corners on one line lie in layers at both sides of it. What they are smaller than half a cell at
    its inner side those are larger that reach from there to the next line; so all of both count. What is nearer to the
    border than half the distance of lines is of a line there.
    """
    triangles = mesh.triangles[kept]
    offsets = mesh.points[triangles] - mesh.points[triangles[:, :1]]
    x, y = lines.along[triangles[:, 0]].T
    across = x[:, None] * offsets[..., 1] - y[:, None] * offsets[..., 0]
    order = np.argsort(across, axis=1)
    gaps = np.diff(np.take_along_axis(across, order, axis=1), axis=1)
    upper = gaps[:, 1] < gaps[:, 0]
    pair = np.where(upper[:, None], order[:, 1:], order[:, :2])
    outer = lines.clear & (border_distance(mesh, kept, spacing) < lines.apart / 2)
    on_it = np.take_along_axis(outer[triangles], pair, axis=1).all(axis=1)
    return np.asarray(on_it & (gaps.min(axis=1) < lines.apart[triangles].mean(axis=1) / 2))


def _lost(mesh: Triangulation, kept: BoolArray, spacing: FloatArray, longest: FloatArray) -> BoolArray:
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
    ends[apart[cKDTree(mesh.points[used]).query(mesh.points[apart])[0] <= longest[apart] * spacing[apart]]] = True
    lost = np.zeros(len(mesh.points), dtype=bool)
    for point, link in _links(mesh.triangles, ends):
        corners = _around(mesh.points[link], mesh.points[point])
        if corners is None:
            lost[point] = True
            continue
        a, b, c = mesh.points[link[corners]][:, None]
        reach = float(longest_sides((a, b, c), mesh.metric[[point]])[0])
        lost[point] = reach > longest[point] * spacing[link[corners]].mean()
    return lost


def _links(triangles: IntArray, chosen: BoolArray) -> list[tuple[int, IntArray]]:
    """Return the chosen points, and the points (k,) that each shares a triangle with."""
    row, corner = np.nonzero(chosen[triangles])
    center = np.repeat(triangles[row, corner], 2)
    other = np.stack([triangles[row, (corner + 1) % 3], triangles[row, (corner + 2) % 3]], axis=1).ravel()
    pairs = UniqueRows.of(np.stack([center, other], axis=1)).rows
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
