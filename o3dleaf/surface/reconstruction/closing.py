"""Closed or open by evidence: a field corrected where its surface runs on past data that close around."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, require_triangles
from o3dleaf.core.units import measure_in_words, tell_count
from o3dleaf.fitting.local.fitter import RefittableFits, ScatteredData
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.pu.single_blend import SingleBlend
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.isosurface.remembered import RememberedField
from o3dleaf.surface.mesh.topology import find_holes, label_nodes
from o3dleaf.surface.reconstruction.extract import NearSurface, finest_spacing, quick_field
from o3dleaf.surface.reconstruction.overshoots import NO_SITES, WIDE, FreeSites, Surroundings
from o3dleaf.surface.reconstruction.proximity import Mask, distance_mask

Closed = Literal["auto"] | bool
CHOICES = ("auto", True, False)
SHARES = (9, 6)
"""About how long following a surface and drawing it take."""
ROUNDS = 3
"""Times that a field is corrected: what a correction uncovers is small, or it does not end."""


class Followed(NamedTuple):
    """A field, its surface, at how many places it was corrected, and whether the surface is closed as it is.

    `asked` is the field with the memory of what it said where the surface was followed.
    """

    field: PUInterpolant
    asked: RememberedField
    mesh: o3d.geometry.TriangleMesh
    places: int = 0
    closed: bool = False


def surroundings(cloud: OrientedCloud, closed: Closed) -> Surroundings | None:
    """Return what the data say of the space around them, None where they are not to be asked, or raise `InputError`."""
    if closed not in CHOICES:
        raise InputError(f"closed: is {closed!r}; give True, False or 'auto'")
    return None if closed is False else Surroundings(cloud, everywhere=closed is True)


def follow_surface(
    field: PUInterpolant,
    around: Surroundings | None,
    cloud: OrientedCloud,
    spacing: float | None,
    fitted_to: Callable[[], ScatteredData],
) -> Followed:
    """Return the surface of a field near its data, and the field, corrected where the surface overshoots them.

    Where it runs on farther than two spacings from the data, although they close around it (`Surroundings`), sites get
    their distance, with the sign that the data give them, and the balls with such sites are fitted again.

    Parameters
    ----------
    field : PUInterpolant
    around : Surroundings or None
        What the data say of the space around them; None to follow the field as it is.
    cloud : OrientedCloud
    spacing : float or None
        Step of the lattice, see `NearSurface`; None for those that the data ask for.
    fitted_to : callable
        ``fitted_to() -> ScatteredData``: what the field was fitted to, see `surface_data`.
    """
    quick = quick_field(field, finest_spacing(cloud, spacing))
    asked = RememberedField(quick)
    following, drawing = progress.split(*SHARES)
    with following:
        surface = NearSurface.of(asked, cloud, spacing)
    if around is None or not isinstance(field.local, RefittableFits):
        with drawing:
            return Followed(field, asked, surface.mesh())
    data, known, places, looking = None, NO_SITES, 0, around
    anew, far = _everywhere, np.empty((0, 3))
    with progress.silent():
        for _ in range(ROUNDS):
            vertices = surface.vertices()
            fresh = vertices[anew(vertices)]  # elsewhere the surface is as far as it was
            far = np.concatenate([far[~anew(far)], fresh[looking.is_far(fresh)]])
            over = looking.overshoots(asked, far)
            sites = looking.sites(asked, over)
            if not len(sites.sites):
                break
            places = max(places, _count_places(over.places, surface.widths_at(over.places)))
            data = _joined(fitted_to() if data is None else data, sites)
            known = FreeSites(*(np.concatenate(pair) for pair in zip(known, sites, strict=True)))
            changed, field = partial(field.index.share_ball, sites.sites), field.with_points(data, len(sites.sites))
            quick = replace(quick, exact=field) if isinstance(quick, SingleBlend) else field
            asked = asked.changed(quick, changed)
            surface.change(asked, changed, _mask(cloud, known) if around.everywhere else None)
            anew = _everywhere if looking.everywhere else changed
            looking = replace(looking, everywhere=False) if looking.everywhere else looking  # gaps are closed once
    with drawing:
        mesh = surface.mesh()
    return Followed(field, asked, mesh, places, not around.is_far(far, WIDE).any() and cloud.branchings is None)


def _everywhere(places: FloatArray) -> BoolArray:
    """Return that all places (n, 3) are meant."""
    return np.ones(len(places), dtype=bool)


def verdict(followed: Followed, around: Surroundings, mesh: o3d.geometry.TriangleMesh) -> tuple[str, bool]:
    """Return whether a trimmed surface is closed or open and why, and whether that is worth a warning."""
    vertices, triangles = require_triangles(mesh)
    loops = None if followed.closed else find_holes(vertices, triangles)
    if loops is None or not len(loops.perimeter):
        why = "no gap in the data is wide enough for a hole"
        if followed.places:
            where = f"at {tell_count(followed.places, 'place')}"
            why = f"{where} it had run on past data that close around them, and was fitted again"
            if around.everywhere:
                why = f"{where} gaps were closed, half way between what the data have inside and outside"
        return f"the surface is closed: {why}", False
    count, long = len(loops.perimeter), measure_in_words(loops.perimeter.max(), followed.field.unit, digits=3)
    opened = f"the surface is open: {tell_count(count, 'rim')}, the longest {long} long"
    if around.everywhere:
        return f"{opened}; its data do not say how it closes there", True
    if around.closing:
        return f"{opened}, around gaps in data that close around else; closed=True closes them", True
    return f"{opened}; its data are a sheet: winding number {around.level:.2f} on them, ½ on a closed one", False


def _count_places(places: FloatArray, widths: FloatArray) -> int:
    """Return how many groups the vertices (n, 3) of a surface make, those within a cell's diagonal being together."""
    near = cKDTree(places).query_ball_point(places, np.sqrt(3) * widths)
    one = np.repeat(np.arange(len(places)), [len(each) for each in near])
    return len(np.unique(label_nodes(one, np.concatenate(near).astype(np.int64), len(places))))


def _joined(data: ScatteredData, free: FreeSites) -> ScatteredData:
    """Return data with sites behind them, each a group of its own, of weight 1 and without a normal."""
    old, count = len(data.points), len(free.sites)
    own = {"weights": np.ones(count), "groups": np.arange(old, old + count), "normals": np.zeros((count, 3))}
    known = {name: getattr(data, name) for name in own}
    return ScatteredData(
        np.concatenate([data.points, free.sites]),
        np.concatenate([data.values, free.values]),
        **{name: None if part is None else np.concatenate([part, own[name]]) for name, part in known.items()},
        share=data.share,
    )


def _mask(cloud: OrientedCloud, free: FreeSites) -> Mask:
    """Return where a surface is followed near data and sites."""
    spacing = np.concatenate([cloud.point_spacing, np.full(len(free.sites), float(np.median(cloud.point_spacing)))])
    return distance_mask(OrientedCloud.of(np.concatenate([cloud.points, free.sites]), spacing=spacing))
