"""Layers told apart in a scan without noise, where they lie closer together than its points."""

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.surface.mesh.topology import label_nodes

NEIGHBORS = 40
"""Points around each one that planes are tried on: in two layers twenty of its own, within 2.5 spacings."""
TRIED = 12
"""The nearest of them that span the planes; of two layers six are of its own, and they span fifteen."""
SLOPE = float(np.sin(np.radians(10.0)))
"""Sine of the angle that points of one layer lie off its plane: a bend of a radius of three distances."""
LINK = 2.0
"""Spacings up to which points are linked: random ones hang together from 1.2 on (Meester and Roy 1996)."""
ALIKE = float(np.cos(np.radians(25.0)))
"""Cosine between the planes of linked points."""
FEWEST = 24
"""Points of a layer at least."""
PASS = 0.5
"""Share of the sheet's points from which on a layer is another pass over all of it, not another sheet."""


def other_layers(points: FloatArray, spacing: float, noise: float) -> IntArray:
    """Return the rows of points (n, 3) of other layers than the largest, none if there are none or they are passes."""
    layer = part_layers(points, spacing, noise)
    size = np.bincount(layer, minlength=2)
    return np.flatnonzero(layer > 0) if FEWEST <= size[1] <= PASS * size[0] else np.empty(0, np.int64)


def part_layers(points: FloatArray, spacing: float, noise: float) -> IntArray:
    """Return the layer (n,) of each point, 0 for the largest: what hangs together along the planes through points.

    The plane at a point is that through it and two neighbors which most of the neighbors lie on, so that a layer above
    does not tilt it; a plane of least squares would run between both.

    Parameters
    ----------
    points : (n, 3) ndarray
    spacing, noise : float
        Of the points; the noise less than a tenth of the distance of layers.
    """
    normals = _majority_planes(points, noise)
    pairs = cKDTree(points).query_pairs(LINK * spacing, output_type="ndarray")
    away = points[pairs[:, 1]] - points[pairs[:, 0]]
    allowed = SLOPE * np.linalg.norm(away, axis=1) + 3 * noise
    flat = np.abs(np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]])) >= ALIKE
    for end in range(2):
        flat &= np.abs(np.einsum("ij,ij->i", away, normals[pairs[:, end]])) <= allowed
    linked = pairs[flat].astype(np.int64)
    label = label_nodes(np.ascontiguousarray(linked[:, 0]), np.ascontiguousarray(linked[:, 1]), len(points))
    order = np.argsort(-np.bincount(label), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return _joined(points, normals, rank[label])


def _joined(points: FloatArray, normals: FloatArray, layer: IntArray) -> IntArray:
    """Return the layers (n,) with points of tiny ones given to that of the neighbor whose plane they are nearest to."""
    large = np.bincount(layer)[layer] >= FEWEST
    if large.all() or not large.any():
        return layer
    rows, few = np.flatnonzero(large), np.flatnonzero(~large)
    near = rows[query(cKDTree(points[rows]), points[few], k=[*range(1, 1 + min(TRIED, len(rows)))])[1]]
    away = points[few][:, np.newaxis] - points[near]
    slope = np.abs(np.einsum("nki,nki->nk", away, normals[near])) / np.maximum(np.linalg.norm(away, axis=2), 1e-300)
    joined = layer.copy()
    joined[few] = layer[near[np.arange(len(few)), slope.argmin(axis=1)]]
    return joined


def _majority_planes(points: FloatArray, noise: float) -> FloatArray:
    """Return the unit normals (n, 3) of the planes through points (n, 3) that most of their neighbors lie on."""
    count = min(NEIGHBORS, len(points) - 1)
    near = query(cKDTree(points), points, k=count + 1)[1][:, 1:]
    away = points[near] - points[:, np.newaxis]
    length = np.linalg.norm(away, axis=2)
    allowed = SLOPE * length + 3 * noise
    most, best = np.full(len(points), -1.0), np.zeros((len(points), 3))
    tried = min(TRIED, count)
    for i in range(tried):
        for j in range(i + 1, tried):
            across = np.cross(away[:, i], away[:, j])
            size = np.linalg.norm(across, axis=1)
            normal = across / np.where(size > 0, size, 1.0)[:, np.newaxis]
            height = np.abs(np.einsum("nki,ni->nk", away, normal))
            votes = np.maximum(1 - (height / np.maximum(allowed, 1e-300)) ** 2, 0.0).sum(axis=1)
            better = (votes > most) & (size > 0)
            most[better], best[better] = votes[better], normal[better]
    return best
