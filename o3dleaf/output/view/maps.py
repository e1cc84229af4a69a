"""Maps of a leaf: where it stretches, shears or thins the micro-structure, and where it does not hold its scan."""

from collections.abc import Callable
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import open3d as o3d
import shapely
from matplotlib.colors import to_rgb
from scipy.spatial import cKDTree

from o3dleaf.core.arguments.checked import checked, require_known
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.atomic_files import require_writable
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray, build_mesh, mesh_arrays
from o3dleaf.core.trees import query
from o3dleaf.core.units import measure_in_words, tell_share
from o3dleaf.leaf.blade.blade import SAMPLE_COUNT, Blade
from o3dleaf.leaf.blade.distortion import Distortion
from o3dleaf.leaf.fit_quality import FAR, GAP, FitQuality
from o3dleaf.output.view.camera import View
from o3dleaf.output.view.picture import SUFFIXES, Inset, Scalars, draw_page, render, save_page


class Measure(NamedTuple):
    """A quantity that a map can show: a function of the distortion, its name, and its value without distortion."""

    values: Callable[[Distortion], FloatArray]
    label: str
    neutral: float


MEASURES = {
    "along": Measure(lambda distortion: distortion.along, "stretch along", 1.0),
    "across": Measure(lambda distortion: distortion.across, "stretch across", 1.0),
    "shear": Measure(lambda distortion: np.degrees(distortion.shear), "shear, degrees", 0.0),
    "thickness": Measure(lambda distortion: distortion.thickness, "thickness factor", 1.0),
    "area": Measure(lambda distortion: distortion.area, "area factor", 1.0),
    "volume": Measure(lambda distortion: distortion.volume, "volume factor", 1.0),
}
MIN_SPAN = 1e-3
"""Half the span of the colors at least, lest rounding be painted."""
FINER = 2
"""Times that the step of the mesh is halved where an outline has necks narrower than it."""
AROUND = 8
"""Points around a place whose residuals are averaged there."""
DOT = 2.5e-3
"""Radius of a point that is not held, of the leaf's extent; the margin is drawn half as wide."""
EDGE = 600
"""Points that the margin is drawn as, a ring."""
GREY, INK, BLUE, VIOLET = "#b9bdb8", "#27302a", "#0072b2", "#8a2be2"
"""Of gaps, the margin, points off the blade and points beside it."""


@checked
def render_distortion(
    blade: Blade,
    path: str | PathLike[str] | None = None,
    *,
    measure: str = "area",
    flat: bool = False,
    spacing: Positive | None = None,
    **options: Any,
) -> npt.NDArray[np.uint8]:
    """Return a picture of a blade in the colors of its distortion, and write it to a file if a path is given.

    The colors are symmetric about the value that means none, so that the middle one is undistorted;
    they reach as far as 99 % of the blade do.

    Parameters
    ----------
    blade : Blade
    path : path-like, optional
        A .png or .jpg file.
    measure : {"along", "across", "shear", "thickness", "area", "volume"}
        See `Distortion`.
    flat : bool
        Draw the plane (along, across) instead of the leaf in the world.
    spacing : float, optional
        Step of the mesh that is drawn, in the blade's unit; about twenty thousand vertices by default.
    **options
        Of `render`: size, title, view, ...

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If there is no such measure, or the path is no picture's.
    ReconstructionError
        If the blade has no triangle at this spacing.
    """
    shown = MEASURES[require_choice(measure, MEASURES, "measure")]
    require_known(options, render, but=("mesh", "path", "scalars"))
    world, triangles = _drawn(blade, spacing)
    plane = blade.flatten(world)[:, :2]
    values = shown.values(blade.distortion(plane))
    span = max(float(np.quantile(np.abs(values - shown.neutral), 0.99)), MIN_SPAN)
    scalars = Scalars(values, shown.label, "coolwarm", (shown.neutral - span, shown.neutral + span))
    vertices = np.column_stack([plane, np.zeros(len(plane))]) if flat else world
    if flat:
        options.setdefault("view", View(tilt=0.0))
    return render((vertices, triangles), path, scalars=scalars, **{"unit": blade.unit} | options)


@checked
def render_residuals(
    blade: Blade,
    scan: CloudLike,
    path: str | PathLike[str] | None = None,
    *,
    signed: bool = False,
    flat: bool = False,
    spacing: Positive | None = None,
    fit: FitQuality | None = None,
    size: tuple[int, int] = (1600, 1000),
    view: View | None = None,
) -> npt.NDArray[np.uint8]:
    """Return a picture of where a blade holds its scan and where not, and write it to a file if a path is given.

    The colors are the means of |residual| of the eight points around each place, in noise deviations; gaps of the
    scan are grey. Points that are not held are drawn as dots where they are, and the margin with the holes as a line.

    Parameters
    ----------
    blade : Blade
    scan : (n, 3) array_like or Open3D point cloud
        In the blade's unit.
    path : path-like, optional
        A .png, .jpg, .pdf or .svg file.
    signed : bool
        Show means of the residuals themselves, above the blade positive.
    flat : bool
        Draw the plane (along, across) instead of the leaf in the world; points off the blade stand at their feet.
    spacing : float, optional
        Step of the mesh that is drawn, in the blade's unit; about twenty thousand vertices by default.
    fit : FitQuality, optional
        Of the same blade and scan, where that was made before.
    size, view : optional
        See `render`.

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If the path is no picture's.
    ReconstructionError
        If the blade has no triangle at this spacing.
    """
    file = None if path is None else require_writable(path, SUFFIXES)
    points = points_of(scan, "scan", least=3)
    held = FitQuality.of(blade, points) if fit is None else fit
    points = points[held.rows]
    world, triangles = _drawn(blade, spacing)
    shown = _on_plane(blade.flatten(world)[:, :2]) if flat else world
    dots = _on_plane(held.plane) if flat else points
    values, empty = _residuals_at(world, points, held, signed=signed)
    in_gap = empty[triangles].any(axis=1)
    extent = float(np.ptp(shown, axis=0).max())
    things: list[Any] = [(shown, triangles[~in_gap])] if not in_gap.all() else []
    if in_gap.any():
        things.append(build_mesh(shown, triangles[in_gap]).paint_uniform_color(to_rgb(GREY)))
    things += [_dots(ring, DOT / 2 * extent, INK) for ring in _edges(blade, flat=flat)]
    for chosen, color in ((held.is_far, BLUE), (held.is_outside, VIOLET)):
        if chosen.any():
            things.append(_dots(dots[chosen], DOT * extent, color))
    noise = measure_in_words(held.limit / FAR, held.unit, digits=2)
    label = f"{'residual' if signed else '|residual|'}, in {noise} of noise"
    limits, colors = ((-FAR, FAR), "coolwarm") if signed else ((0.0, FAR), "YlOrRd")
    scalars = Scalars(values, label, colors, limits) if not in_gap.all() else None
    subject = Inset(things, view=view or View(tilt=0.0 if flat else 20.0), scalars=scalars, unit=blade.unit)
    page = draw_page(subject, size=size, title="\n".join(["", *held.lines(), *held.warnings]))
    page.key(BLUE, "o", f"{tell_share(held.far)} off", 0.29)
    page.key(VIOLET, "o", f"{tell_share(held.outside)} beside", 0.42)
    page.key(GREY, "s", f"{tell_share(held.gaps)} in gaps", 0.57)
    return save_page(page, file)


def _drawn(blade: Blade, spacing: float | None) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles of a blade; without a spacing, finer ones where it is narrower than the usual."""
    if spacing is not None:
        return mesh_arrays(blade.extract_mesh(spacing))
    step = float(np.sqrt(blade.outline.area / SAMPLE_COUNT))
    for finer in range(FINER):
        try:
            return mesh_arrays(blade.extract_mesh(step / 2**finer))
        except ReconstructionError:
            continue
    return mesh_arrays(blade.extract_mesh(step / 2**FINER))


def _on_plane(plane: FloatArray) -> FloatArray:
    return np.column_stack([plane, np.zeros(len(plane))])


def _residuals_at(
    world: FloatArray, points: FloatArray, held: FitQuality, *, signed: bool
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Return means of residuals around (n, 3) vertices, in noise deviations, and which of them lie in a gap."""
    inside = ~held.is_outside & ~held.is_cut
    deviation = held.limit / FAR
    sizes = (held.distance if signed else np.abs(held.distance))[inside] / deviation
    if not inside.any():
        return np.zeros(len(world)), np.ones(len(world), dtype=bool)
    near, rows = query(cKDTree(points[inside]), world, k=min(AROUND, len(sizes)))
    rows, near = rows.reshape(len(world), -1), near.reshape(len(world), -1)
    return sizes[rows].mean(axis=1), near[:, 0] > np.hypot(GAP * held.spacing, held.limit)


def _dots(points: FloatArray, radius: float, color: str) -> o3d.geometry.TriangleMesh:
    """Return small balls at (n, 3) points: icosahedra, which are round enough for a few pixels."""
    ball = o3d.geometry.TriangleMesh.create_icosahedron(radius)
    corners, faces = np.asarray(ball.vertices), np.asarray(ball.triangles, dtype=np.int64)
    first = len(corners) * np.arange(len(points), dtype=np.int64)[:, np.newaxis, np.newaxis]
    mesh = build_mesh((points[:, np.newaxis] + corners).reshape(-1, 3), (first + faces).reshape(-1, 3))
    mesh.paint_uniform_color(to_rgb(color))
    return mesh


def _edges(blade: Blade, *, flat: bool) -> list[FloatArray]:
    """Return the points (k, 3) of each ring of the outline, close together."""
    polygon = blade.outline.polygon
    rings = [shapely.segmentize(ring, polygon.length / EDGE) for ring in (polygon.exterior, *polygon.interiors)]
    planes = [_on_plane(shapely.get_coordinates(ring)) for ring in rings]
    return planes if flat else [blade.lift(plane) for plane in planes]
