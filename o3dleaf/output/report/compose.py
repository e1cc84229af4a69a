"""The parts of the page, from what was found of a mesh."""

import platform
from html import escape
from importlib.metadata import version

import numpy as np

from o3dleaf.core import journal, progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.units import measure_in_words, tell_count
from o3dleaf.output.report.charts import Histogram, Mark
from o3dleaf.output.report.closeups import draw_closeup
from o3dleaf.output.report.overviews import draw_map, draw_sides, field_colors, scan_colors
from o3dleaf.output.report.page import Section, as_data, figures_tables, viewer_section, write_page
from o3dleaf.output.report.places import KINDS, find_places
from o3dleaf.output.report.reduce import ReducedMesh, reduce_mesh
from o3dleaf.output.report.requirements import CheckResult
from o3dleaf.output.report.shots import Colors
from o3dleaf.output.report.viewer import angle_colors, viewer_data
from o3dleaf.output.report.words import in_words, unit_of
from o3dleaf.surface.mesh.inspection import Inspection

MAX_DRAWN = 1_500_000
"""Triangles that the pictures of the whole are drawn with at most: more than they have pixels."""

MAX_INTERACTIVE = 300_000
"""Triangles that the interactive view has at most."""

PACKAGES = ("o3dleaf", "numpy", "open3d", "numba")


def compose_page(
    inspection: Inspection,
    verdict: CheckResult,
    points: FloatArray | None,
    title: str,
    *,
    colors: FloatArray | None = None,
) -> str:
    """Return the page of a mesh; `points` are those of the scan, `colors` linear RGB of the vertices, if any."""
    report = inspection.report
    sections = [Section("figures", "Figures", figures_tables(report.to_dict(), report.unit))]
    if inspection.report.area > 0:
        sections += _pictures(inspection, points, colors)
    else:
        sections.append(
            Section("pictures", "Pictures", "<p>The mesh has no triangle with an area; there is nothing to draw.</p>")
        )
    charts = _charts(inspection, verdict)
    if charts:
        # Numbers before pictures: the histograms follow the tables.
        sections.insert(1, Section("histograms", "Histograms", f'<div class="row">{charts}</div>'))
    return write_page(title, verdict, sections, _footer(), lead=_lead(inspection))


def _pictures(inspection: Inspection, points: FloatArray | None, colors: FloatArray | None) -> list[Section]:
    """Return the sections of pictures, close-ups, maps and the interactive view."""
    measurements, report = inspection.measurements, inspection.report
    with journal.stage("reduced for pictures"):
        drawn = reduce_mesh(measurements.vertices, measurements.triangles, MAX_DRAWN)
        turned = reduce_mesh(measurements.vertices, measurements.triangles, MAX_INTERACTIVE)
    with journal.stage("places"):
        places = find_places(inspection)
        closeups = list[str]()
        for number, place in enumerate(places, 1):
            closeups.append(draw_closeup(inspection, place, number))
            progress.report(number, len(places))
    with journal.stage("pictures"):
        sides = draw_sides(drawn, places, report.unit, None if colors is None else drawn.mean(colors))
    with journal.stage("maps"):
        maps = _maps(inspection, drawn, points)
    with journal.stage("interactive view"):
        layers = [
            angle_colors(inspection, turned),
            field_colors(inspection, turned),
            scan_colors(inspection, turned, points),
        ]
        data = viewer_data(inspection, turned, [each for each in layers if each is not None], places)
    legend = "A number marks a close-up below; a dashed ring lies behind the surface." if places else ""
    note = f'<p class="note">{legend} {_reduced_note(drawn, report.unit)}</p>'
    sections = [
        Section(
            "pictures",
            "Pictures",
            f'{note}<div class="row">{sides}</div>',
        ),
        Section(
            "places",
            "Defects and worst triangles",
            _defects_table(inspection) + f'<div class="closeups">{"".join(closeups)}</div>',
        ),
    ]
    if maps:
        sections.append(Section("deviation", "Deviation", f'<div class="row">{maps}</div>'))
    view = viewer_section(data, report.triangles, _reduced_note(turned, report.unit))
    return [*sections, Section("view", "Interactive view", view)]


def _reduced_note(reduced: ReducedMesh, unit: str | None) -> str:
    """Return a sentence if what is drawn is not the mesh itself."""
    if not reduced.is_less:
        return ""
    step = f", vertices within {in_words('median_edge', reduced.step, unit)} put together" if reduced.step else ""
    return (
        f"Drawn with {len(reduced.triangles):,} of {reduced.full:,} triangles{step}; "
        "colors are the worst of what a vertex stands for, defects and close-ups are those of the full mesh."
    )


def _maps(inspection: Inspection, drawn: ReducedMesh, points: FloatArray | None) -> str:
    """Return the maps of the deviations that were measured."""
    unit, figures = inspection.report.unit, list[str]()
    maps: list[tuple[Colors | None, str]] = [
        (field_colors(inspection, drawn), "Distance of the vertices to the field's surface."),
        (
            scan_colors(inspection, drawn, points),
            "Distance from the mesh of the scan's nearest point; gray: no point near.",
        ),
    ]
    for colors, caption in maps:
        if colors is not None:
            figures.append(draw_map(drawn, colors, unit, f"{caption} Colors end at 99 %."))
    return "\n".join(figures)


def _defects_table(inspection: Inspection) -> str:
    """Return how many triangles each kind of defect concerns."""
    rows = [
        f'<tr><td><i class="key" style="background:{KINDS[name].color}">&nbsp;</i> {KINDS[name].title}</td>'
        f"<td>{KINDS[name].text}</td><td>{tell_count(len(rows_of_kind), 'triangle')}</td></tr>"
        for name, rows_of_kind in inspection.defects.rows().items()
        if len(rows_of_kind)
    ]
    note = (
        '<p class="note">Triangles concerned are in color and outlined where something hides them; '
        "violet is the inside of the surface, black lines and dots are where it is broken.</p>"
    )
    table = f'<table class="figures">{"".join(rows)}</table>' if rows else "<p>No defect was found.</p>"
    return table + note


def _charts(inspection: Inspection, verdict: CheckResult) -> str:
    """Return the histograms of angles, edges and deviations."""
    report, measurements, deviation = inspection.report, inspection.measurements, inspection.deviation
    if not report.triangles:
        return ""
    limits = {each.requirement.rule.attribute: each.requirement.wanted for each in verdict.findings}

    def marks(attribute: str, kind: str) -> list[Mark]:
        limit = limits.get(attribute)
        unit = "°" if kind == "degrees" else unit_of(kind, report.unit)
        return [] if limit is None else [Mark(limit, f"required {limit:g}{unit}", is_limit=True)]

    shares = [
        Mark(limit, f"{100 * getattr(report, f'share_below_{limit}deg'):.3g} % below {limit}°") for limit in (10, 20)
    ]
    charts = [
        Histogram(
            "smallest angle of each triangle",
            report.angle_histogram,
            0,
            60,
            "degrees",
            None,
            [*shares, *marks("min_angle_deg", "degrees")],
        ),
        Histogram.of_lengths(
            "edge lengths",
            measurements.edge_length,
            report.unit,
            [*marks("shortest_edge", "length"), *marks("longest_edge", "length")],
        ),
    ]
    for title, values, attribute in (
        ("distance of the vertices to the field", deviation.to_field, "field_distance_max"),
        ("distance of the scan's points to the mesh", deviation.from_scan, "scan_distance_max"),
        ("distance of the vertices to the nearest point of the scan", deviation.to_scan, "support_max"),
    ):
        if values is not None and np.isfinite(values).any():
            charts.append(Histogram.of_lengths(title, values, report.unit, marks(attribute, "length")))
    exact = as_data("angle_histogram", list(report.angle_histogram), "")
    return exact + "".join(f"<figure>{each.svg()}</figure>" for each in charts)


def _lead(inspection: Inspection) -> str:
    """Return the mesh in one line."""
    report = inspection.report
    kind = "closed" if not report.boundary_edges else f"{report.boundary_edges:,} boundary edges"
    size = measure_in_words(report.extent, report.unit, join=" × ")
    known = "" if report.unit else "; the unit of length is not known"
    return escape(f"{report.triangles:,} triangles in {tell_count(report.components, 'piece')}, {kind}, {size}{known}")


def _footer() -> str:
    """Return what made the page."""
    made = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return escape(f"Made by {made} and Python {platform.python_version()}. This file needs no network.")
