"""Triangles that meet others in more than a common corner or edge."""

import numpy as np

from o3dleaf.checks import FloatArray
from o3dleaf.mesh.arrays import BoolArray, IntArray
from o3dleaf.mesh.clean import _session  # for the moment: MeshLab's


def find_crossings(vertices: FloatArray, triangles: IntArray) -> BoolArray:
    """Return which triangles meet another one in more than a common corner or edge."""
    if not len(triangles):
        return np.zeros(0, dtype=bool)
    session = _session(vertices, triangles)
    session.compute_selection_by_self_intersections_per_face()
    return np.array(session.current_mesh().face_selection_array())
