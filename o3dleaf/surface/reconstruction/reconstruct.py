"""The whole job for any point cloud, one step a line: prepare, merge, fit, follow the surface, trim, clean, support."""

import warnings
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import open3d as o3d

from o3dleaf.core.checks import FloatArray, require_positive
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import CloudWarning
from o3dleaf.core.journal import Journal
from o3dleaf.core.parallel import Progress, finish, share_out
from o3dleaf.fitting.local.fitter import Fitter
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.smoothing import SmoothingValue
from o3dleaf.surface.cloud.downsample import Merged
from o3dleaf.surface.cloud.neighbors import Neighbourhoods, nearest_neighbours
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud, prepare_cloud
from o3dleaf.surface.cloud.point_spacing import cloud_spacing
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines
from o3dleaf.surface.isosurface.isosurface import extract_isosurface
from o3dleaf.surface.reconstruction.along_mesh import turned_over
from o3dleaf.surface.reconstruction.fit import Constrain, constrain, fit_surface, merge_noise
from o3dleaf.surface.reconstruction.proximity import local_spacing, near_data
from o3dleaf.surface.reconstruction.trim import trim_to_support
from o3dleaf.surface.reconstruction.vertex_support import Support, attach_support, support, support_colours

Mesh = o3d.geometry.TriangleMesh
FINEST = 0.6
"""Mesh step over the cloud's spacing: of few points the surface between is known better than such triangles show."""
ENOUGH = 200_000
"""Triangles beyond which the mesh step grows, up to the cloud's spacing."""
PER_POINT = 3.0
"""Triangles for each point of a mesh whose step is the cloud's spacing."""
MARGIN = 4.0
"""Spacings that the surface is followed beyond its data, one more than the widest gap that is closed."""

TURNED = 1e-3
"""Share of the surface that may face away from its data without a word: what noise does to single vertices."""


def create_from_point_cloud_rbfpu(  # noqa: PLR0913 - the steps of the job, each of which can be replaced
    pcd: CloudLike,
    spacing: float | None = None,
    rho: SmoothingValue | None = "gcv",
    *,
    smoothing: SmoothingValue | None = None,
    local: str | Fitter = "rbf",
    creases: Literal["auto", False] | float = "auto",
    points_per_ball: int | tuple[int, int] | None = None,
    unit: str | None = None,
    prepare: Callable[[CloudLike], OrientedCloud] = prepare_cloud,
    merge: Callable[[OrientedCloud], Merged] | None = merge_noise,
    constraints: Constrain = constrain,
    trim: Callable[..., Mesh] | None = trim_to_support,
    clean: Callable[[Mesh], Mesh] | None = None,
    measure: str | None = "distance",
    journal: Journal | None = None,
) -> tuple[Any, PUInterpolant]:
    r"""Return the surface of a point cloud as a mesh, and the field whose zero it is.

    Beside `o3d.geometry.TriangleMesh.create_from_point_cloud_poisson`: open where the data are open and closed
    where they are closed, smoothed as much as the noise asks for, and with no parameter that must be given.

    Parameters
    ----------
    pcd : (n, 3) array_like or Open3D point cloud, legacy or tensor
        With outward normals or without.
    spacing : float, optional
        Step of the lattice that the mesh is made on, in the cloud's unit; left out, see `mesh_step`.
    rho, smoothing
        How much to smooth, as in `PUInterpolant.fit`; "gcv" leaves points out and takes what foretells them best.
    local : {"rbf", "hermite", "curl-free", "mls", "auto"} or object with a fit
        What lives in the balls, see `fit_surface`.
    creases : "auto", False or float
        Sharp edges, for "rbf": degrees that normals turn across them at least. "auto" is 30, for clouds whose noise is
        far below their spacing.
    points_per_ball : int or (least, most), optional
    unit : str, optional
        Of the coordinates; the field keeps it.
    prepare : callable
        ``prepare(cloud) -> OrientedCloud``: what is wrong with the cloud goes, every point has an outward normal.
    merge : callable or None
        ``merge(cloud) -> Merged``: points averaged where noise is thicker than the spacing. None: as they are.
    constraints : callable
        ``constraints(points, normals, spacing) -> OffSurface``, for "rbf".
    trim : callable or None
        ``trim(mesh, points, spacings) -> mesh``: what no data support goes. None: the surface ends four
        spacings past the data.
    clean : callable or None
        ``clean(mesh) -> mesh``, such as `clean_mesh` or a `simplify_mesh` with your numbers; the surface is manifold
        as it comes.
    measure : {"distance", "weight", "residual"} or None
        Support that the vertices are coloured by; None leaves support out.
    journal : Journal, optional
        Told of each stage and of what was decided; without one, decisions are warnings (`CloudWarning`).

    Returns
    -------
    mesh : open3d.geometry.TriangleMesh, or open3d.t.geometry.TriangleMesh for a tensor cloud
        Triangles counter-clockwise seen from outside. The vertices have the colours of their support and, of a
        tensor mesh, the attributes `distance`, `weight` and `residual`; `support` gives those of any mesh.
    field : PUInterpolant
        Larger inside, in the cloud's unit about the signed distance near the surface; `field.save(path)` keeps it.

    Raises
    ------
    InputError, OrientationError
        If no surface can be told from the cloud, with the reason.
    ReconstructionError
        If no surface is left.
    """
    log = journal or Journal()
    with log.stage("prepare cloud") as progress:
        cloud = prepare_cloud(pcd, progress=progress) if prepare is prepare_cloud else prepare(pcd)
    for line in decisions(cloud):
        _tell(line, journal)
    with log.stage("merge points") as progress:
        merging, finding, spacing_out = share_out(progress, 2, 2, 1)
        if merge is merge_noise:
            merged = merge_noise(cloud, progress=merging)
        else:
            merged = merge(cloud) if merge else Merged(cloud.points, cloud.normals, np.ones(len(cloud.points)))
        near, median = surroundings(cloud, merged.points, finding)
        if len(merged.points) < len(cloud.points):
            log.note(
                f"noise is thicker than the spacing: {len(cloud.points):,} points make {len(merged.points):,} means"
            )
        each, tree = local_spacing(merged.points, (near.distance, near.row)), near.tree
        del cloud, near  # sixteen neighbours of each point, the largest arrays of the job
        apart = float(np.median(each))
        finish(spacing_out)
    with log.stage("fit balls") as progress:
        field = fit_surface(
            merged,
            rho=None if smoothing is not None and rho == "gcv" else rho,
            smoothing=smoothing,
            local=local,
            constraints=constraints,
            creases=creases,
            points_per_ball=points_per_ball,
            margin=MARGIN * float(each.max()),
            spacing=median,
            tree=tree,
            unit=unit,
            progress=progress,
        )
    with log.stage("follow surface") as progress:
        step = mesh_step(apart, len(merged.points)) if spacing is None else require_positive(spacing, "spacing")
        mesh = extract_isosurface(
            field,
            step,
            seeds=merged.points,
            within=near_data(merged.points, each, tree=tree),
            features=isinstance(field.local, LocalCreasedSplines),
        )
    with log.stage("trim to data") as progress:
        # Our own step shares what is known of the cloud.
        trimming, looking = share_out(progress, 2, 1)
        ours = {"normals": merged.normals, "tree": tree, "progress": trimming} if trim is trim_to_support else {}
        mesh = trim(mesh, merged.points, each, **ours) if trim else mesh
        turned = turned_over(mesh, merged.points, merged.normals, tree)
        finish(looking)
    if turned.mean() > TURNED:
        _tell(
            f"{100 * turned.mean():.2g} % of the surface faces away from all data near it: it joins sheets that face "
            "the same way and lie close together, such as two scans of one sheet that do not fit",
            journal,
        )
    with log.stage("clean mesh"):
        mesh = clean(mesh) if clean else mesh
    if measure is None:
        return mesh, field
    with log.stage("measure support") as progress:
        found = support(mesh, merged.points, field, spacing=apart, tree=tree, progress=progress)
        return coloured(mesh, found, measure, tensor=hasattr(pcd, "point")), field


def _tell(line: str, journal: Journal | None) -> None:
    """Note a decision in the journal or, without one, warn of it at the line that called the job."""
    journal.note(line) if journal else warnings.warn(line, CloudWarning, stacklevel=3)


def surroundings(
    cloud: OrientedCloud, points: FloatArray, progress: Progress | None = None
) -> tuple[Neighbourhoods, float]:
    """Return neighbourhoods and median spacing of the points that are fitted, the cloud's own if they are its."""
    if cloud.near and points is cloud.points:
        return cloud.near, cloud.spacing
    near = nearest_neighbours(points, progress=progress)
    return near, cloud_spacing(points, near).median


def mesh_step(spacing: float, count: int) -> float:
    """Return the step of the mesh of a cloud of `count` points 1/√(points per unit area) = `spacing` apart.

    It is 0.6 spacings; where that would make more than 200,000 triangles, more, but not more than one spacing.
    """
    return spacing * float(np.clip(np.sqrt(PER_POINT * count / ENOUGH), FINEST, 1.0))


def decisions(cloud: OrientedCloud) -> tuple[str, ...]:
    """Return what preparing a cloud removed and decided, one sentence each; nothing of a cloud without fault."""
    removed = {
        "not finite": cloud.non_finite,
        "repeated": cloud.repeated,
        "far from all others": cloud.stray,
        "averaged with others of their voxel": cloud.merged,
    }
    found = ", ".join(f"{count:,} {why}" for why, count in removed.items() if count)
    return (f"points left out: {found}", *cloud.notes) if found else cloud.notes


def coloured(mesh: Mesh, found: Support, measure: str, *, tensor: bool) -> Any:
    """Return the mesh in the colours of a measure of its support; as a tensor mesh, with all of it as attributes."""
    if tensor:
        return attach_support(mesh, found, measure=measure)
    mesh.vertex_colors = o3d.utility.Vector3dVector(support_colours(found, measure=measure).astype(np.float64))
    return mesh
