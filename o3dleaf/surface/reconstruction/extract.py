"""The surface of a field near the data that it was fitted to, as a mesh."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d

from o3dleaf.core import journal
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.checks.voxels import as_step
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.mesh_arrays import BoolArray, build_mesh
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.pu.single_blend import SingleBlend
from o3dleaf.surface.cloud.noise import CLEAN
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.creases.creased_splines import LocalCreasedSplines
from o3dleaf.surface.isosurface.continuation import Continuation
from o3dleaf.surface.isosurface.remembered import RememberedField
from o3dleaf.surface.reconstruction.branch_cut import cut_at_branchings
from o3dleaf.surface.reconstruction.proximity import Mask, distance_mask

MIN_STEP = 0.6
"""Mesh step over the cloud's spacing: of few points the surface between is known better than such triangles show."""
NOISY_STEP = 0.8
"""The same where noise is half of the spacing or more: what shorter chords would show is noise. Of folds, fins, bumps,
tori and a horse, surfaces in steps of 0.8 are nearer to the truth than in steps of 0.6, by one percent."""
NEAREST, OPPOSITE, THIN = 12, -0.5, 0.2
"""Share of the points that have one of the other side of a thin part, by the cosine of their normals, among so many
nearest ones, beyond which the step is that of a clean cloud: longer ones join the sides of noisy fins more often."""
SAMPLE_SIZE = 1000
"""Points that are looked at for it."""
MAX_TRIANGLES = 200_000
"""Triangles beyond which the mesh step grows, up to the cloud's spacing."""
PER_POINT = 3.0
"""Triangles for each point of a mesh whose step is the cloud's spacing."""
MAX_UNEVEN = 2.0
"""Times the triangles of an even cloud of as many points that the mesh of one in even steps may have."""
SEEN = 1e-3
"""Share of a step that single precision may be off in most balls, and a few times as much in the worst: noise is a
hundred times that, and vertices of a clean cloud are placed in double precision."""
SURE = 10.0
"""Times as much that a value must be for its side to be sure: one in fifty is asked again."""
MAX_SITES = 1 << 20
"""Sites of all balls, of a cloud of about 80,000 points, beyond which a copy in single precision is not made: it would
be a tenth of the job's memory, and of such clouds, meshed in longer steps, one percent of the time is gained."""


@dataclass
class NearSurface:
    """The surface of a field near its data, followed, and followed again where the field changes.

    Attributes
    ----------
    data : OrientedCloud
    followed : Continuation
    creased : bool
        Whether the field has creases.
    sharp : bool
        Whether vertices are placed where the field is zero, and not where it would be if it were linear along an edge
        of the lattice: of the steps that noise asks for both are as near to the truth.
    """

    data: OrientedCloud
    followed: Continuation
    creased: bool
    sharp: bool

    @classmethod
    def of(cls, field: PUInterpolant | RememberedField, cloud: CloudLike, spacing: float | None) -> "NearSurface":
        """Follow the surface as far as four spacings beyond the data, in steps of a spacing or of `chosen_steps`."""
        data = OrientedCloud.of(cloud)
        noisy = spacing is None and data.is_measurable and not data.is_clean
        steps = chosen_steps(data) if spacing is None else require_positive(spacing, "spacing")
        creased = isinstance(exact_field(field).local, LocalCreasedSplines)
        seeds, mask, box = data.points, distance_mask(data), field.bounds
        if isinstance(steps, float):
            followed = Continuation.of(field, as_step(steps), seeds, 0.0, within=mask, box=box)
        else:
            followed = Continuation.on_octree(field, steps, seeds, 0.0, within=mask, box=box)
            told = f"{tell_length(float(steps.min()))} to {tell_length(float(steps.max()))}"
            journal.note(
                f"density differs much: mesh steps go with the spacing around, {told}; spacing sets one for all"
            )
        return cls(data, followed, creased, not noisy)

    def widths_at(self, places: FloatArray) -> FloatArray:
        """Return the sides (n,) of the cells that contain places (n, 3)."""
        return self.followed.band.widths_at(places)

    def change(
        self,
        field: PUInterpolant | RememberedField,
        where: Callable[[FloatArray], BoolArray],
        within: Mask | None = None,
    ) -> None:
        """Follow the surface of a field that differs where ``where(places)`` says, see `Continuation.change`."""
        self.followed.change(field, where, within)

    def vertices(self) -> FloatArray:
        """Return the vertices (n, 3) before they are sharpened."""
        return self.followed.band.vertices()

    def mesh(self) -> o3d.geometry.TriangleMesh:
        """Return the surface with the creases of the field as edges, cut beside the lines along which sheets meet."""
        exact = exact_field(self.followed.band.field)
        mesh = self.followed.draw(sharpen=self.sharp, features=self.creased, exact=exact)
        if self.data.branchings is not None:
            mesh = cut_at_branchings(*mesh, self.data, self.data.branchings)
        return build_mesh(*mesh)


def quick_field(field: PUInterpolant, step: float) -> PUInterpolant | SingleBlend:
    """Return a field in single precision where that cannot be seen on a surface made in such steps, else itself."""
    splines = field.local.splines if isinstance(field.local, LocalCreasedSplines) else field.local
    if not isinstance(splines, LocalSplines) or len(splines.weights) > MAX_SITES:
        return field
    return SingleBlend(field, SURE * SEEN * step) if splines.single_rounding <= SEEN * step else field


def exact_field(field: Any) -> PUInterpolant:
    """Return the interpolant that answers: without the memory of what it said, and in double precision."""
    asked: Any = field.field if isinstance(field, RememberedField) else field
    exact: PUInterpolant = asked.exact if isinstance(asked, SingleBlend) else asked
    return exact


def chosen_steps(data: OrientedCloud) -> float | FloatArray:
    """Return the step of the mesh of a cloud where none is given or, where density differs much, those of its points.

    Where few points cover most of the area, as of a scan from one place, the step that most points ask for would make
    more than twice the triangles of an even cloud; a longer one would lose the surface where points are dense.
    """
    noisy = data.is_measurable and not data.is_clean and not _is_thin(data)
    noise = data.noise / data.spacing if noisy else 0.0
    if is_uneven(data.point_spacing):
        return data.point_spacing * mesh_step(1.0, len(data), noise)
    return mesh_step(float(np.median(data.point_spacing)), len(data), noise)


def is_uneven(point_spacing: FloatArray) -> bool:
    """Return whether the area per point, the mean square of all spacings (n,), is over twice that of most points."""
    return bool(np.mean(np.square(point_spacing)) > MAX_UNEVEN * np.median(point_spacing) ** 2)


def finest_spacing(data: OrientedCloud, spacing: float | None) -> float:
    """Return a length that no vertex must be off by a hundredth of: a spacing, if given, or of the data."""
    if spacing is None and is_uneven(data.point_spacing):
        return float(data.point_spacing.min())
    return min(np.inf if spacing is None else spacing, float(np.median(data.point_spacing)))


def mesh_step(spacing: float, count: int, noise: float = 0.0) -> float:
    """Return the step of the mesh of a cloud of `count` points 1/√(points per unit area) = `spacing` apart.

    It is 0.6 spacings, and grows with a `noise` of more than 0.1 spacings up to 0.8; where that would make more than
    200,000 triangles, more, but not more than one spacing.
    """
    least = min(MIN_STEP * (1 + max(noise - CLEAN, 0.0)), NOISY_STEP)
    return spacing * float(np.clip(np.sqrt(PER_POINT * count / MAX_TRIANGLES), least, 1.0))


def _is_thin(data: OrientedCloud) -> bool:
    """Return whether a good part of the data is so thin that the nearest points are of both sides."""
    normals, rows = data.require_normals(), np.arange(0, len(data), max(1, len(data) // SAMPLE_SIZE))
    near = query(data.tree, data.points[rows], k=min(NEAREST, len(data)))[1]
    across = np.einsum("ija,ia->ij", normals[near], normals[rows]) < OPPOSITE
    return bool(across.any(axis=1).mean() > THIN)
