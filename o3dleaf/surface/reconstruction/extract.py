"""The surface of a field near the data that it was fitted to, as a mesh."""

import numpy as np
import open3d as o3d

from o3dleaf.core.checks import require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import build_mesh, require_triangles
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from o3dleaf.surface.isosurface.remembered import RememberedField
from o3dleaf.surface.reconstruction.branch_cut import cut_at_branchings
from o3dleaf.surface.reconstruction.proximity import Mask, distance_mask

MIN_STEP = 0.6
"""Mesh step over the cloud's spacing: of few points the surface between is known better than such triangles show."""
MAX_TRIANGLES = 200_000
"""Triangles beyond which the mesh step grows, up to the cloud's spacing."""
PER_POINT = 3.0
"""Triangles for each point of a mesh whose step is the cloud's spacing."""


def extract_near(
    field: PUInterpolant | RememberedField,
    cloud: CloudLike,
    spacing: float | None = None,
    *,
    within: Mask | None = None,
) -> o3d.geometry.TriangleMesh:
    """Return the surface of a field as far as four spacings beyond its data, with the field's creases as edges.

    Where sheets of the data branch it is cut: they end beside the line along which they meet.

    Parameters
    ----------
    field : PUInterpolant, or its memory
    cloud : OrientedCloud, or what `OrientedCloud.of` makes one of
        The data.
    spacing : float, optional
        Step of the lattice that the mesh is made on, in the cloud's unit; left out, see `mesh_step`.
    within : callable, optional
        ``within(places) -> mask``: where the surface is followed, in place of four spacings.
    """
    data = OrientedCloud.of(cloud)
    step = mesh_step(float(np.median(data.point_spacing)), len(data)) if spacing is None else spacing
    fitted = field.field if isinstance(field, RememberedField) else field
    creased = isinstance(fitted, PUInterpolant) and isinstance(fitted.local, LocalCreasedSplines)
    require_positive(step, "spacing")
    mask = distance_mask(data) if within is None else within
    mesh = extract_isosurface(field, step, seeds=data.points, within=mask, features=creased)
    if data.branchings is None:
        return mesh
    return build_mesh(*cut_at_branchings(*require_triangles(mesh), data, data.branchings))


def mesh_step(spacing: float, count: int) -> float:
    """Return the step of the mesh of a cloud of `count` points 1/√(points per unit area) = `spacing` apart.

    It is 0.6 spacings; where that would make more than 200,000 triangles, more, but not more than one spacing.
    """
    return spacing * float(np.clip(np.sqrt(PER_POINT * count / MAX_TRIANGLES), MIN_STEP, 1.0))
