"""Normals turned to where their points were seen from."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.surface.cloud.orientation.orientation import Orientation


def face_viewpoint(points: FloatArray, normals: FloatArray, viewpoint: FloatArray) -> FloatArray:
    """Return normals (n, 3) turned so that none faces away from its viewpoint: a scanner sees outer sides only.

    Parameters
    ----------
    points, normals, viewpoint : (n, 3) ndarray
    """
    toward = np.einsum("ij,ij->i", normals, viewpoint - points)
    return np.where(toward < 0, -1.0, 1.0)[:, np.newaxis] * normals


def face_given(points: FloatArray, given: Orientation, viewpoint: FloatArray) -> Orientation:
    """Return normals that came with a cloud turned to its viewpoint, and say how many had to be.

    Parameters
    ----------
    points, viewpoint : (n, 3) ndarray
    given : Orientation
    """
    turned = face_viewpoint(points, given.normals, viewpoint)
    count = int(np.sum(np.einsum("ij,ij->i", turned, given.normals) < 0))
    note = f"{count:,} of {len(points):,} normals faced away from where the cloud was scanned from and were flipped"
    return Orientation(turned, (*given.notes, note) if count else given.notes)
