"""From the points of one leaf to its blade as a parametrised surface, step by step."""

from typing import NamedTuple

import igl
import numpy as np

from o3dleaf.core import journal
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.chart.petiole import find_petiole
from o3dleaf.leaf.chart.sheet_chart import Chart, chart_sheet
from o3dleaf.leaf.fit_noise import local_noise
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.options import BladeOptions
from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.leaf.parametric.surface_fit import fit_chart_surface
from o3dleaf.leaf.parametric.thickness import ThicknessMap, as_factors
from o3dleaf.leaf.parametric.tight_bends import past_tight_bends
from o3dleaf.leaf.sheet.sheet import OpenSheet, find_sheet
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud

MAX_RESIDUAL = 10.0
"""Noise deviations beyond which a point says nothing of where the leaf ends, where that is more than `NEAR`."""
NEAR = 0.5
"""Spacings within which it does: its foot is off by less than its residual, and a scan without noise has small ones
of every size."""
ROUNDING = 1e-6
"""Relative difference of distances to a sheet and to a part of it that is none."""


def build_parametric_blade(
    points: FloatArray, midrib: FloatArray | None, unit: str | None, options: BladeOptions
) -> ParametricBlade:
    """Return the blade of the points of one leaf.

    Parameters
    ----------
    points : (n, 3) ndarray
    midrib : (k, 3) ndarray, optional
        Control points from base to tip; found on the sheet if not given.
    unit : str, optional
    options : BladeOptions

    Raises
    ------
    ReconstructionError
        If the points are no single sheet, or one that cannot be laid flat; it says where.
    """
    # One open sheet near the points: passes that disagree are averaged, what lies over it is left out.
    with journal.stage("find sheet"):
        points, petiole = _part_petiole(points, options)
        sheet = find_sheet(points, piece=options.piece, one_sheet=options.one_sheet)
    # Laid flat with little stretch and turned, base at u = 0 and the midrib along v = 0.
    with journal.stage("lay flat"):
        chart = chart_sheet(
            sheet.vertices,
            sheet.triangles,
            midrib=midrib,
            up=options.up,
            base=petiole.base if options.base is None else options.base,
            junction=petiole.junction,
        )
    # A smoothed partition of unity S(u, v) through the points at their feet.
    with journal.stage("fit surface"):
        rows = _rows_of_blade(points, sheet, chart)
        mesh = ChartMesh(chart.vertices, chart.triangles, chart.uv)
        fit = fit_chart_surface(points[rows], mesh, smoothing=options.smoothing, unit=unit)
    # Where the leaf ends: a smooth closed curve in the chart, past the outermost points.
    with journal.stage("find margin"):
        shows = _near(fit) & ~past_tight_bends(fit, sheet.spacing)
        margin = Margin.fit(fit.feet[shows], fill_holes=options.fill_holes, noise=_noise(fit), unit=unit)
    notes = (*sheet.notes, *petiole.notes, *chart.notes, *fit.notes, *margin.notes)
    for note in notes:
        journal.note(note)
    table = None if options.thickness is None else as_factors(options.thickness, "thickness")
    thickness = None if table is None else ThicknessMap(table, margin.bounds)
    return ParametricBlade(fit.surface, margin, rim_radius=options.rim_radius, notes=notes, thickness=thickness)


class _Parted(NamedTuple):
    """What a petiole says of the blade: its base, the middle of the cut, and a line of the read-out."""

    base: FloatArray | None = None
    junction: FloatArray | None = None
    notes: tuple[str, ...] = ()


def _part_petiole(points: FloatArray, options: BladeOptions) -> tuple[FloatArray, _Parted]:
    """Return the points without those of the petiole, unless it is to be kept, and what is known of it.

    Of several pieces the largest one's petiole is looked for: it is that of the leaf, unless another is asked for.
    """
    if options.piece not in (None, 1):
        return points, _Parted()
    try:
        noise = OrientedCloud.of(points).noise
    except InputError:
        # No surface shows in these points; the search for a sheet says so, and where.
        return points, _Parted()
    blade, petiole = find_petiole(points, noise)
    if petiole is None:
        return points, _Parted()
    end, junction = np.array(petiole.end), np.array(petiole.junction)
    if options.keep_petiole:
        return points, _Parted(end, None, (f"{petiole}: kept as part of the blade",))
    return points[blade], _Parted(end, junction, (f"{petiole}: cut off",))


def _rows_of_blade(points: FloatArray, sheet: OpenSheet, chart: Chart) -> IntArray:
    """Return the rows of the points that belong to the sheet, and not to a part of it that the chart leaves out."""
    rows = sheet.rows
    whole, part = (_squared_distances(points[rows], each.vertices, each.triangles) for each in (sheet, chart))
    return rows[part <= whole * (1 + ROUNDING)]


def _squared_distances(points: FloatArray, vertices: FloatArray, triangles: IntArray) -> FloatArray:
    return np.asarray(igl.point_mesh_squared_distance(points, vertices, triangles)[0])


def _near(fit: SurfaceFit) -> BoolArray:
    """Return which points are near enough to the surface to say where it ends."""
    spacing = np.sqrt(fit.mesh.area / len(fit.heights))
    return np.asarray(np.abs(fit.heights) <= max(MAX_RESIDUAL * _noise(fit), NEAR * spacing))


def _noise(fit: SurfaceFit) -> float:
    """Return the deviation of the points from the surface, which is taken for that along it too."""
    return local_noise(fit.surface.jet(fit.feet, 0)[0], fit.heights)
