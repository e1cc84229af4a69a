"""A surface cut where the sheets of its data branch: along the line, and where it bends from one sheet to another."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.trees import query
from o3dleaf.surface.cloud.branchings.branchings import Branchings
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.reconstruction.trim import cut_below

BESIDE = 3.0
"""Clearances from a line within which a field may bend from one sheet to another: beyond, they are far apart."""
OFF = 0.3
"""Clearances that a surface may lie off the planes of the data near it there: half a spacing, a third of what lies
between the ends of two sheets."""
NEAREST = 4
"""Data of which the nearest plane counts: the normal of one may be wrong."""


def cut_at_branchings(
    vertices: FloatArray, triangles: IntArray, data: OrientedCloud, branchings: Branchings
) -> tuple[FloatArray, IntArray]:
    """Return the part of a mesh that is not within the clearance of a line, nor a bridge between sheets beside it.

    Parameters
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    data : OrientedCloud
        With normals.
    branchings : Branchings
    """
    near = branchings.nearness(vertices)
    beside = np.flatnonzero(near < BESIDE)
    rows = query(data.tree, vertices[beside], k=np.arange(1, min(NEAREST, len(data)) + 1))[1]
    height = np.einsum("nkj,nkj->nk", vertices[beside, np.newaxis] - data.points[rows], data.require_normals()[rows])
    off = np.abs(height).min(axis=1) / branchings.clearance_at(vertices[beside])
    value = np.minimum(near, BESIDE) - 1.0
    value[beside] = np.minimum(value[beside], OFF - off)
    return cut_below(vertices, triangles, value)
