"""Triangles glued along their edges into oriented sheets without handles, cut where there would be one."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.sheet.gluing_loops import glue, orient_triangles
from o3dleaf.surface.cloud.parity_loops import flatten
from o3dleaf.surface.mesh.topology import EdgeTable, label_nodes


def glue_sheets(triangles: IntArray, normals: FloatArray, quality: FloatArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return oriented triangles (m, 3) of manifold sheets of genus 0, where their vertices came from, and cut edges.

    A cut runs where two rims of a piece would be joined, which makes a handle, or where the two sides of a Moebius
    strip meet; its edges are the worst ones of those that would have done.

    Parameters
    ----------
    triangles : (m, 3) ndarray
        Of either orientation, one or two on each edge.
    normals : (m, 3) ndarray
        Their unit normals, by their corners' order.
    quality : (m,) ndarray
        Of each triangle, the less the better.
    """
    pair, turned = _pairs(triangles)
    one, other = pair[:, 0] // 3, pair[:, 1] // 3
    bend = 1 - np.abs(np.einsum("ij,ij->i", normals[one], normals[other]))
    order = np.argsort(bend + quality[one] + quality[other], kind="stable")
    parent, sign = np.arange(len(triangles)), np.ones(len(triangles), np.int8)
    in_tree = np.zeros(len(pair), bool)
    orient_triangles(pair, turned, order, parent, sign, in_tree)
    flatten(parent, sign)
    over = sign < 0
    oriented = triangles.copy()
    oriented[over] = triangles[over][:, ::-1]
    pair = np.where(over[pair // 3], 3 * (pair // 3) + (4 - pair % 3) % 3, pair)
    agrees = turned == (sign[one] != sign[other])
    mate, opposite = np.full(triangles.size, -1), np.full(triangles.size, -1)
    mate[pair[agrees]] = pair[agrees][:, ::-1]
    glue(pair, order, in_tree, mate, opposite)
    cut = pair[opposite[pair[:, 0]] < 0]
    half = np.flatnonzero(opposite >= 0)
    after = np.where(half % 3 == 2, half - 2, half + 1)
    corner = label_nodes(after, opposite[half], triangles.size)
    source = np.empty(int(corner.max(initial=-1)) + 1, np.int64)
    source[corner] = oriented.ravel()
    return corner.reshape(-1, 3), source, cut


def _pairs(triangles: IntArray) -> tuple[IntArray, BoolArray]:
    """Return the pairs (e, 2) of half-edges on one edge, and whether both run the same way."""
    edges = EdgeTable.of(triangles)
    shared = np.flatnonzero(edges.count == 2)
    first = edges.first(shared)
    pair = np.column_stack([edges.order[first], edges.order[first + 1]]).astype(np.int64)
    return pair, np.asarray(edges.inconsistent[shared])
