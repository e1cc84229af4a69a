"""From the points of one leaf to its blade as a parametrised surface, step by step."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import igl
import numpy as np

from o3dleaf.core import journal
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.chart.flatten import STEPPED, require_low_distortion
from o3dleaf.leaf.chart.petiole import Petiole, find_petiole
from o3dleaf.leaf.chart.sheet_chart import Chart, chart_sheet
from o3dleaf.leaf.margin.edge.least_distance import least_distance
from o3dleaf.leaf.margin.margin import Margin
from o3dleaf.leaf.options import BladeOptions
from o3dleaf.leaf.parametric.contacts import end_before_contacts
from o3dleaf.leaf.parametric.fitted import ChartMesh, SurfaceFit
from o3dleaf.leaf.parametric.mirror.halves import Halves
from o3dleaf.leaf.parametric.mirror.images import mirror_points
from o3dleaf.leaf.parametric.parametric_blade import ParametricBlade
from o3dleaf.leaf.parametric.surface_fit import extend_fit, fit_chart_surface, relax_chart
from o3dleaf.leaf.parametric.thickness import ThicknessMap, as_factors
from o3dleaf.leaf.parametric.tight_bends import past_tight_bends, without_folds
from o3dleaf.leaf.residuals.noise import local_noise
from o3dleaf.leaf.sheet.holes import split_bow_ties
from o3dleaf.leaf.sheet.layers.two_sides import find_both_sides
from o3dleaf.leaf.sheet.pieces.slits import find_slits
from o3dleaf.leaf.sheet.pieces.table import Table, find_table
from o3dleaf.leaf.sheet.sheet import OpenSheet, find_sheet
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.usable_points import usable_rows

MAX_RESIDUAL = 10.0
"""Noise deviations beyond which a point says nothing of where the leaf ends, where that is more than `NEAR`."""
NEAR = 0.5
"""Spacings within which it does: its foot is off by less than its residual, and a scan without noise has small ones
of every size."""
MEDIANS = 3.0
"""Times the median residual within which it does, too: points of both sides of a leaf lie half its thickness off the
blade between them; where one side is twice as dense, its points a third of it, and the other side's two thirds."""
FAR = 3.0
"""Noise deviations off the surface within which a point beyond the sheet lies on its continuation, or `NEAR`."""
BEYOND = 6.5
"""Spacings from the sheet within which it may: the widest gap that a sheet's triangles join."""
MAX_EXTENSIONS = 3
"""Times that such points are looked for, each on the surface through those before."""
MAX_STRETCHED = 0.1
"""Share of the surface that may be stretched below a half or above twice: what more of is no leaf's, but lies between
a leaf and what it rests on. Of scans that fold over themselves in places it is half of that."""
HIDDEN_LENGTH, HIDDEN_AREA = 0.1, 0.01
"""Of the midrib's length and of the blade's area: halves that differ in less are not told."""
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
        scan = points
        table = refuse_table(scan, options)
        points, others, apart = _piece_of(scan, options)
        points, petiole = _part_petiole(points, options) if table is None else (points, _Parted())
        points, sides = _between_sides(points, options)
        sheet = find_sheet(points, one_sheet=options.one_sheet)
    # Laid flat with little stretch and turned, base at u = 0 and the midrib along v = 0.
    with journal.stage("lay flat"), _pieces_named(scan, sheet, options):
        sheet, chart = _lay_flat(sheet, petiole, midrib, options)
    # A smoothed partition of unity S(u, v) through the points at their feet.
    with journal.stage("fit surface"):
        rows = _rows_of_blade(points, sheet, chart)
        mesh = ChartMesh(chart.vertices, chart.triangles, chart.uv)
        with _pieces_named(scan, sheet, options):
            fit = fit_chart_surface(points[rows], mesh, smoothing=options.smoothing, unit=unit)
            laid = fit.mesh
            require_low_distortion(laid.vertices, laid.triangles, laid.chart, MAX_STRETCHED, STEPPED)
        fit, leftovers = _with_tips(fit, points, sheet)
    # Where the leaf ends: a smooth closed curve in the chart, past the outermost points.
    with journal.stage("find margin"):
        margin = _margin(fit, sheet.spacing, options.fill_holes, unit)
        halves = Halves.of(margin.polygon, chart.midline.curve, sheet.spacing)
        if options.complete_margin is None:
            mirrored = _tell_hidden(halves, margin.area)
        else:
            seen = fit
            fit, mirrored = _complete(seen, halves, options.complete_margin)
            margin = margin if fit is seen else _margin(fit, sheet.spacing, options.fill_holes, unit)
        # A smoothing that was asked for has the folds that it has.
        margin, folded = without_folds(fit, margin) if options.smoothing == "robust" else (margin, ())
        margin, ends = end_before_contacts(fit.surface, margin, fit.problem.spacing)
    notes = (
        *apart,
        *sides,
        *sheet.notes,
        *leftovers,
        *petiole.notes,
        *chart.notes,
        *fit.notes,
        *margin.notes,
        *mirrored,
        *folded,
        *ends,
    )
    for note in notes:
        journal.note(note)
    # The chart once more, of the surface itself and up to its margin.
    with journal.stage("relax chart"):
        surface, margin = relax_chart(fit.surface, margin, fit.problem.spacing)
    factors = None if options.thickness is None else as_factors(options.thickness, "thickness")
    thickness = None if factors is None else ThicknessMap(factors, margin.bounds)
    rim = options.rim_radius
    several = others is not None or (sheet.leftovers is not None and len(sheet.leftovers.pieces) > 1)
    return ParametricBlade(surface, margin, rim, notes, thickness, petiole.cut, others, several)


class _Parted(NamedTuple):
    """What a petiole says of the blade: its base, the middle of the cut, a line of the read-out, and itself if cut."""

    base: FloatArray | None = None
    junction: FloatArray | None = None
    notes: tuple[str, ...] = ()
    cut: Petiole | None = None


def _piece_of(points: FloatArray, options: BladeOptions) -> tuple[FloatArray, FloatArray | None, tuple[str, ...]]:
    """Return the points of the piece that is asked for, all if none is; those of the others, and lines on them."""
    if options.piece is None:
        return points, None, ()
    sheet = find_sheet(points, piece=options.piece, one_sheet=options.one_sheet)
    own, others = points[sheet.rows], points[sheet.others]
    if not len(others):
        return own, None, sheet.off_sheet
    line = f"piece {options.piece}: {len(others):,} of the scan's {len(points):,} points belong to other pieces"
    return own, others, (f"{line}, by which the blade is not judged", *sheet.off_sheet)


def refuse_table(points: FloatArray, options: BladeOptions) -> Table | None:
    """Return the table that lies flat in one sheet with what is on it, or None; refuse one that a blade would be of.

    Raises
    ------
    ReconstructionError
        If the sheet of points (n, 3) is a table's, and no piece was asked for; it names the pieces.
    """
    table = None if options.piece is not None else find_table(points, usable_rows(points))
    if table is None or not table.is_sure:
        return table
    pieces = find_sheet(points, one_sheet=options.one_sheet).leftovers
    if pieces is None or not table.is_in(pieces.held):
        return None
    raise pieces.named_in(ReconstructionError(f"scan: {table.said()}"))


@contextmanager
def _pieces_named(scan: FloatArray, sheet: OpenSheet, options: BladeOptions) -> Iterator[None]:
    """Name the pieces of a scan, as they are counted, where its sheet is refused inside and none was asked for."""
    try:
        yield
    except ReconstructionError as cause:
        if options.piece is not None or sheet.leftovers is None or len(sheet.leftovers.pieces) < 2:
            raise
        whole = find_sheet(scan, one_sheet=options.one_sheet)
        if whole.leftovers is None or len(whole.leftovers.pieces) < 2:
            raise
        why = cause if whole.blades is None else ReconstructionError(f"scan: {whole.blades}", cause.places)
        raise whole.leftovers.named_in(why) from cause


def _part_petiole(points: FloatArray, options: BladeOptions) -> tuple[FloatArray, _Parted]:
    """Return the points without those of the petiole, unless it is to be kept, and what is known of it.

    Of several pieces the largest one's petiole is looked for: it is that of the leaf.
    """
    try:
        noise = OrientedCloud.of(points).noise
    except InputError:
        # No surface shows in these points; the search for a sheet says so, and where.
        return points, _Parted()
    blade, petiole, kept = find_petiole(points, noise)
    if petiole is None:
        return points, _Parted() if kept is None else _Parted(kept.base, notes=(str(kept),))
    end, junction = np.array(petiole.end), np.array(petiole.junction)
    if options.keep_petiole:
        return points, _Parted(end, None, (f"{petiole}: kept as part of the blade",))
    return points[blade], _Parted(end, junction, (f"{petiole}: cut off",), petiole)


def _between_sides(points: FloatArray, options: BladeOptions) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the points, moved to the middle where they lie on both sides of a thin leaf, and a line if they do."""
    both = find_both_sides(points) if options.one_sheet else None
    return (points, ()) if both is None else (both.points, (both.tell(),))


def _lay_flat(
    sheet: OpenSheet, petiole: _Parted, midrib: FloatArray | None, options: BladeOptions
) -> tuple[OpenSheet, Chart]:
    """Return a sheet and its chart; cut along its slits if it has some, and no chart without."""
    base = petiole.base if options.base is None else options.base
    chart = partial(chart_sheet, midrib=midrib, up=options.up, base=base, junction=petiole.junction)
    try:
        return sheet, chart(sheet.vertices, sheet.triangles)
    except ReconstructionError:
        slits = find_slits(sheet.vertices, sheet.triangles)
        if slits is None:
            raise
    vertices, triangles = split_bow_ties(sheet.vertices, sheet.triangles[slits.kept])
    cut = replace(sheet, vertices=vertices, triangles=triangles, notes=(*sheet.notes, slits.note))
    return cut, chart(vertices, triangles)


def _rows_of_blade(points: FloatArray, sheet: OpenSheet, chart: Chart) -> IntArray:
    """Return the rows of the points that belong to the sheet, and not to a part of it that the chart leaves out."""
    rows = sheet.rows
    whole, part = (_squared_distances(points[rows], each.vertices, each.triangles) for each in (sheet, chart))
    return rows[part <= whole * (1 + ROUNDING)]


def _squared_distances(points: FloatArray, vertices: FloatArray, triangles: IntArray) -> FloatArray:
    return np.asarray(igl.point_mesh_squared_distance(points, vertices, triangles)[0])


def _with_tips(fit: SurfaceFit, scan: FloatArray, sheet: OpenSheet) -> tuple[SurfaceFit, tuple[str, ...]]:
    """Return the fit to points beyond the sheet's rim, too, that lie on its continuation; and what is left out.

    Towards a sharp tip, a point or two wide, points are too far apart for the triangles of a sheet.
    """
    leftovers = sheet.leftovers
    if leftovers is None:
        return fit, ()
    for _ in range(MAX_EXTENSIONS):
        rows = leftovers.beyond(BEYOND)
        if not len(rows):
            break
        feet, heights, converged = fit.surface.feet(scan[rows], fit.mesh.parameters(scan[rows]))
        near = np.abs(heights) <= max(FAR * fit_noise(fit), NEAR * sheet.spacing)
        on_it = converged & near & (fit.mesh.distances(feet) > 0)
        if not on_it.any():
            break
        fit, leftovers = extend_fit(fit, scan[rows[on_it]], feet[on_it]), leftovers.without(rows[on_it])
    return fit, leftovers.tell()


def _margin(fit: SurfaceFit, spacing: float, fill_holes: float | None, unit: str | None) -> Margin:
    """Return the margin of the points that show where the leaf ends."""
    shows = _near(fit) & ~past_tight_bends(fit, spacing)
    apart = least_distance(fit.points[shows])
    lift = partial(fit.surface.jet, order=1)
    return Margin.fit(
        fit.feet[shows], fill_holes=fill_holes, noise=fit_noise(fit), thinned_to=apart, lift=lift, unit=unit
    )


def _complete(fit: SurfaceFit, halves: Halves, length: float) -> tuple[SurfaceFit, tuple[str, ...]]:
    """Return the fit to the mirror images of what hidden stretches of margin lack, too, and a line on each.

    The isometries are those of the surface that was fitted to what is seen.
    """
    whole, stretches = halves.bridged(length)
    if not stretches:
        least = tell_length(length)
        return fit, (f"no stretch of margin of at least {least} steps in and out again: nothing is completed",)
    shown = [stretch for stretch in stretches if stretch.shows_in(halves.spacing)]
    notes = [
        f"{stretch}, but the other half's mirror image lies {tell_length(stretch.beyond)} beyond it where the halves "
        f"differ by {tell_length(stretch.elsewhere)} elsewhere, which may be the leaf's own shape: not completed"
        for stretch in stretches
        if stretch not in shown
    ]
    images = [mirror_points(fit, whole, stretch) for stretch in shown]
    for stretch, (points, places, misfit) in zip(shown, images, strict=True):
        fit = extend_fit(fit, points, places)
        left = f"{tell_length(misfit)} where both halves are seen"
        notes.append(f"{stretch}: completed by the mirror image, which leaves {left}")
    return fit, tuple(notes)


def _tell_hidden(halves: Halves, area: float) -> tuple[str, ...]:
    """Return a line on each stretch of margin that lacks so much that it may be hidden."""
    _, stretches = halves.bridged(HIDDEN_LENGTH * float(halves.at[-1]))
    return tuple(
        f"{each}, {each.area / area:.1%} of the blade: hidden or eaten; complete_margin would fill it"
        for each in stretches
        if each.area >= HIDDEN_AREA * area and each.shows_in(halves.spacing)
    )


def _near(fit: SurfaceFit) -> BoolArray:
    """Return which points are near enough to the surface to say where it ends."""
    spacing, off = np.sqrt(fit.mesh.area / len(fit.heights)), np.abs(fit.heights)
    return np.asarray(off <= max(MAX_RESIDUAL * fit_noise(fit), NEAR * spacing, MEDIANS * float(np.median(off))))


def fit_noise(fit: SurfaceFit) -> float:
    """Return the deviation of the points from the surface."""
    return local_noise(fit.surface.jet(fit.feet, 0)[0], fit.heights)
