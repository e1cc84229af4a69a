"""The whole job for any point cloud, one step a line."""

from collections.abc import Callable
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core import journal, progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Positive, SmoothingValue, Unit
from o3dleaf.core.checks.arrays import FloatArray, as_array
from o3dleaf.core.checks.coordinates import require_breadth, require_cloud
from o3dleaf.core.checks.scalars import require_choice, require_positive
from o3dleaf.core.cloud_arrays import CloudLike, raw_points
from o3dleaf.core.errors import CloudWarning, InputError
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import Need, in_words, need_of
from o3dleaf.core.resume.blocks import keeping_blocks, kept
from o3dleaf.core.units import measure_in_words, tell_share
from o3dleaf.fitting.local.fitter import Fitter
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.surface.cloud.constraints import offset_constraints
from o3dleaf.surface.cloud.downsample import adaptive_down_sample
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.preprocess import preprocess_point_cloud
from o3dleaf.surface.reconstruction.along_mesh import find_inverted_regions
from o3dleaf.surface.reconstruction.attributes import interpolate_attributes
from o3dleaf.surface.reconstruction.closing import Closed, Followed, follow_surface, surroundings, verdict
from o3dleaf.surface.reconstruction.extract import PER_POINT, chosen_steps
from o3dleaf.surface.reconstruction.finish import AUTO, SHOWN, field_normals, finish_mesh
from o3dleaf.surface.reconstruction.fit import Constrain, fit_surface, surface_data
from o3dleaf.surface.reconstruction.overshoots import Surroundings
from o3dleaf.surface.reconstruction.trim import drop_unsupported, trim_to_data
from o3dleaf.surface.reconstruction.unresolved import doubts
from o3dleaf.surface.reconstruction.vertex_support import MEASURES, vertex_support

Mesh = o3d.geometry.TriangleMesh
Trim = Callable[[Mesh, OrientedCloud], Mesh]
Attributes = Callable[[CloudLike, npt.ArrayLike], dict[str, npt.NDArray[Any]]]
"""A cloud and places to what its points carry, there."""
INVERTED = 1e-3
"""Share of the surface that may face away from its data without a word: what noise does to single vertices."""


@checked
def create_from_point_cloud_rbfpu(  # noqa: PLR0913 - the steps of the job, each of which can be replaced
    pcd: CloudLike,
    spacing: Positive | None = None,
    rho: SmoothingValue | None = "gcv",
    *,
    smoothing: SmoothingValue | None = None,
    local: str | Fitter = "rbf",
    creases: Literal["auto", False] | Positive = "auto",
    points_per_ball: Count | tuple[Count, Count] | None = None,
    unit: Unit | None = None,
    viewpoint: npt.ArrayLike | None = None,
    prepare: Callable[..., CloudLike] = preprocess_point_cloud,
    merge: Callable[[OrientedCloud], CloudLike] | None = adaptive_down_sample,
    constraints: Constrain = offset_constraints,
    closed: Closed = "auto",
    trim: Trim | None = trim_to_data,
    clean: Callable[[Mesh], Mesh] | None = None,
    attributes: Attributes | None = interpolate_attributes,
    measure: str | None = "auto",
) -> tuple[Any, PUInterpolant]:
    r"""Return the surface of a point cloud as a mesh, and the field whose zero it is.

    Beside `o3d.geometry.TriangleMesh.create_from_point_cloud_poisson`: open where the data are open and closed
    where they are closed, smoothed as much as the noise requires, and with no parameter that must be given.

    Parameters
    ----------
    pcd : (n, 3) array_like or Open3D point cloud, legacy or tensor
        With outward normals or without.
    spacing : float, optional
        Step of the lattice that the mesh is made on, in the cloud's unit; left out, 0.6 spacings of the cloud, 0.8
        where it is noisy, or up to one of a large cloud. Where density differs much these are the spacings around, and
        the mesh is the dual of an octree.
    rho, smoothing
        How much to smooth, as in `PUInterpolant.fit`; "gcv" leaves points out and takes what predicts them best.
    local : {"rbf", "hermite", "curl-free", "mls", "auto"} or object with a fit
        What is fitted in the balls, see `fit_surface`.
    creases : "auto", False or float
        Sharp edges, for "rbf": degrees that normals turn across them at least. "auto" is 30, for clouds whose noise is
        far below their spacing.
    points_per_ball : int or (least, most), optional
    unit : str, optional
        Of the coordinates; the field keeps it.
    viewpoint : (3,) or (n, 3) array_like, optional
        Where the cloud, or each point, was scanned from: all normals are turned to it, and left so. For rooms, and what
        else was scanned from inside, or in part.
    prepare : callable
        ``prepare(cloud) -> OrientedCloud``, or any cloud with normals: faulty points go, normals point outward. It
        takes a `viewpoint` by name where there is one.
    merge : callable or None
        ``merge(cloud) -> OrientedCloud``: points averaged where noise is thicker than the spacing. None: as they are.
    constraints : callable
        ``constraints(cloud) -> OffsetConstraints``, for "rbf".
    closed : "auto", True or False
        What becomes of gaps. "auto" leaves those open that are wider than `trim` closes, but none that is only the
        field's: where the surface runs on past data that close around it, by their winding number, the field is
        corrected. True closes all gaps along that number, for local="rbf", and trims nothing. False takes the field as
        it is, as for a sheet.
    trim : callable or None
        ``trim(mesh, cloud) -> mesh``: what no data support goes. None: the surface ends four spacings past the data.
    clean : callable or None
        ``clean(mesh) -> mesh``, such as `clean_mesh` or a `simplify_mesh` with your numbers; the surface is manifold
        as it comes.
    attributes : callable or None
        ``attributes(pcd, vertices) -> {name: (m, c) ndarray}``: the cloud's colors and scalars at the vertices. None:
        the mesh has none of them.
    measure : {"auto", "distance", "weight", "residual"} or None
        What the colors of the vertices show: "auto" those of the cloud or, where it has none, the distance to the data;
        else the support of this name. None leaves support out, and the colors are the cloud's, if any.

    Returns
    -------
    mesh : open3d.geometry.TriangleMesh, or open3d.t.geometry.TriangleMesh for a tensor cloud
        Triangles counter-clockwise seen from outside. The vertices have the normals of the field, −∇F/|∇F|, to single
        precision, and colors; those of a tensor mesh also the attributes that the points of the cloud have
        (`interpolate_attributes`), and `distance`, `weight` and `residual`, which `vertex_support` gives of any mesh.
    field : PUInterpolant
        Larger inside, in the cloud's unit about the signed distance near the surface; `field.save(path)` keeps it.

    Raises
    ------
    InputError, OrientationError
        If the cloud is no surface, with the reason.
    ReconstructionError
        If no surface is left.

    Warns
    -----
    CloudWarning
        Of what was left out or decided; where a journal is open, it is noted there instead.
    """
    require_choice(measure or AUTO, SHOWN, "measure")
    with journal.stage("prepare cloud"), keeping_blocks("prepared"):
        require_cloud(pcd, "pcd")
        need_for(len(np.atleast_1d(as_array(raw_points(pcd, "pcd"), "pcd")))).require()
        cloud = OrientedCloud.of(prepare(pcd) if viewpoint is None else prepare(pcd, viewpoint=viewpoint))
        require_breadth(cloud.points, "pcd")
    for decision in cloud.decisions:
        journal.tell(decision, CloudWarning)
    with journal.stage("merge points"):
        count = len(cloud)
        averaging, measuring = progress.split(2, 3)
        with averaging:
            cloud = OrientedCloud.of(merge(cloud)) if merge else cloud
        with measuring:
            cloud.compact()  # sixteen neighbors of each point are the largest arrays of the job
            need_for_mesh(cloud, spacing, unit).require()
    if len(cloud) < count:
        journal.note(f"noise exceeds the point spacing: {count:,} points were averaged to {len(cloud):,}")
    with journal.stage("fit balls"):
        fit = partial(
            fit_surface,
            cloud,
            rho=rho,
            smoothing=smoothing,
            local=local,
            constraints=constraints,
            creases=creases,
            points_per_ball=points_per_ball,
            unit=unit,
        )
        field = kept("fit.o3l", fit)
    with journal.stage("follow surface"), keeping_blocks("surface"):
        around = surroundings(cloud, closed)
        data = partial(surface_data, cloud, constraints, local=local)
        followed = follow_surface(field, around, cloud, spacing, data)
        field = followed.field
    mesh, decisions = _trimmed(followed, around, cloud, closed, trim)
    for decision in decisions:
        journal.tell(decision, CloudWarning)
    with journal.stage("clean mesh"):
        mesh = clean(mesh) if clean else mesh
    vertices, _ = mesh_arrays(mesh)
    with journal.stage("carry attributes"):
        normals, carried = _carry(pcd, followed.asked, vertices, attributes)
    tensor = hasattr(pcd, "point")
    support = None
    if measure is not None and (tensor or measure != AUTO or "colors" not in carried):
        with journal.stage("measure support"):
            # A legacy mesh has room for the colors of one measure alone.
            shown = MEASURES if tensor else (MEASURES[0] if measure == AUTO else measure,)
            support = vertex_support(mesh, cloud, field, measures=shown)
    return finish_mesh(mesh, normals, carried, support, measure=measure, tensor=tensor), field


def need_for(points: int) -> Need:
    """Return what the surface of so many points takes, its mesh at the spacing that is chosen."""
    cure = "thin the cloud, for example by voxel_down_sample"
    return need_of(measured.RECONSTRUCTED_POINT * points, f"reconstruct: {points:,} points", cure)


def need_for_mesh(
    cloud: OrientedCloud,
    spacing: float | None,
    unit: str | None = None,
    *,
    reported: bool = False,
) -> Need:
    """Return what the surface of a cloud takes in steps of a spacing, or of the one that is chosen where none is given.

    Where the mesh is to be `reported` on, that takes more than to find it.

    In steps of 1/√(points per unit area) it has three triangles a point: an area of Σ s², of all points' spacings s.

    Raises
    ------
    InputError
        If the spacing is not above zero, or wider than the cloud.
    """
    own, size = cloud.point_spacing, float(np.ptp(cloud.points, axis=0).max())
    told = partial(measure_in_words, unit=unit, digits=3)
    apart = f"the points are {told(float(np.median(own)))} apart"
    what, one = ("spacing", "one") if spacing is not None else ("reconstruct", "spacing")
    if spacing is not None and spacing > size:
        cure = f"give a smaller one ({apart})"
        raise InputError(f"spacing: is {told(spacing)}, and the cloud {told(size)} long; {cure}")
    steps = chosen_steps(cloud) if spacing is None else require_positive(spacing, "spacing")
    with np.errstate(over="ignore"):
        triangles = float(PER_POINT * np.square(own / steps).sum())
    made = f"{what}: about {in_words(triangles)} triangles"
    cost = (measured.FOLLOWED_TRIANGLE if isinstance(steps, float) else measured.DUAL_TRIANGLE) * triangles
    if reported:
        cost = measured.CHECKED_MESH + measured.CHECKED_TRIANGLE * triangles
    return need_of(cost, made, f"give a larger {one} ({apart})", step=float(np.max(steps)))


def _trimmed(
    followed: Followed, around: Surroundings | None, cloud: OrientedCloud, closed: Closed, trim: Trim | None
) -> tuple[Mesh, list[str]]:
    """Return the mesh without what no data support, and what is to be said of it: as closed as it is, as it faces."""
    decisions = []
    with journal.stage("trim to data"):
        trimming, comparing = progress.split(2, 1)
        with trimming:
            if closed is True and trim:
                trim = drop_unsupported
            mesh = trim(followed.mesh, cloud) if trim else followed.mesh
        with comparing:
            inverted = find_inverted_regions(mesh, cloud).mean()
            doubtful = doubts(*mesh_arrays(mesh), cloud)
    if around and trim:
        decision, surprising = verdict(followed, around, mesh)
        decisions.append(decision) if surprising else journal.note(decision)
    if inverted > INVERTED:
        decisions.append(
            f"{tell_share(inverted)} of the surface faces away from all data near it: it joins sheets that face "
            "the same way and lie close together, such as two scans of one sheet that do not fit"
        )
    return mesh, decisions + doubtful


def _carry(
    pcd: CloudLike, field: Field, vertices: FloatArray, attributes: Attributes | None
) -> tuple[FloatArray, dict[str, npt.NDArray[Any]]]:
    """Return the normals at the vertices, and what a step says of the cloud's attributes there."""
    sloping, carrying = progress.split(1, 5)
    with sloping:
        normals = field_normals(field, vertices)
    with carrying:
        return normals, attributes(pcd, vertices) if attributes else {}
