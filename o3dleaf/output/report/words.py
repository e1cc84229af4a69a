"""Figures in words: what each figure of a report is called, its kind, and its value with its unit."""

from typing import Any, NamedTuple

POWERS = {"length": "", "area": "²", "volume": "³"}
"""Kinds of figure that carry the mesh's unit, and what follows it."""


class Figure(NamedTuple):
    """One figure of a report: what it is called on the page, its kind, and the table it stands in."""

    label: str
    kind: str
    table: str


SIZE, TOPOLOGY, DEFECTS, SHAPE = "Size", "Topology", "Defects", "Shape of the triangles"
CHART = ""
"""The table of what is drawn instead."""

FIELD, SCAN, OTHER = "Distance to the field", "Distance to the scan", "Other figures"
FIGURES = {
    "watertight": Figure("watertight", "flag", TOPOLOGY),
    "manifold": Figure("manifold", "flag", TOPOLOGY),
    "oriented": Figure("oriented", "flag", TOPOLOGY),
    "orientable": Figure("orientable", "flag", TOPOLOGY),
    "components": Figure("components", "count", TOPOLOGY),
    "genus": Figure("genus", "count", TOPOLOGY),
    "boundary_edges": Figure("boundary edges", "count", TOPOLOGY),
    "boundary_loops": Figure("boundary loops", "count", TOPOLOGY),
    "holes": Figure("holes", "count", TOPOLOGY),
    "nonmanifold_edges": Figure("non-manifold edges", "count", DEFECTS),
    "nonmanifold_vertices": Figure("non-manifold vertices", "count", DEFECTS),
    "inconsistent_edges": Figure("inconsistently oriented edges", "count", DEFECTS),
    "flipped_triangles": Figure("flipped triangles", "count", DEFECTS),
    "self_intersections": Figure("self-intersecting triangles", "count", DEFECTS),
    "degenerate_triangles": Figure("degenerate triangles", "count", DEFECTS),
    "duplicate_triangles": Figure("duplicate triangles", "count", DEFECTS),
    "vertices": Figure("vertices", "count", SIZE),
    "triangles": Figure("triangles", "count", SIZE),
    "area": Figure("area", "area", SIZE),
    "volume": Figure("enclosed volume", "volume", SIZE),
    "lower": Figure("lower corner", "length", SIZE),
    "upper": Figure("upper corner", "length", SIZE),
    "extent": Figure("extent", "length", SIZE),
    "unit": Figure("unit of length", "text", SIZE),
    "min_angle_deg": Figure("smallest angle", "degrees", SHAPE),
    "max_angle_deg": Figure("largest angle", "degrees", SHAPE),
    "share_below_1deg": Figure("smallest angle below 1°", "share", SHAPE),
    "share_below_5deg": Figure("smallest angle below 5°", "share", SHAPE),
    "share_below_10deg": Figure("smallest angle below 10°", "share", SHAPE),
    "share_below_20deg": Figure("smallest angle below 20°", "share", SHAPE),
    "shortest_edge": Figure("shortest edge", "length", SHAPE),
    "edge_1pc": Figure("edges, 1 %", "length", SHAPE),
    "edge_5pc": Figure("edges, 5 %", "length", SHAPE),
    "median_edge": Figure("edges, median", "length", SHAPE),
    "mean_edge": Figure("edges, mean", "length", SHAPE),
    "edge_95pc": Figure("edges, 95 %", "length", SHAPE),
    "edge_99pc": Figure("edges, 99 %", "length", SHAPE),
    "longest_edge": Figure("longest edge", "length", SHAPE),
    "angle_histogram": Figure("triangles by smallest angle, a degree a bin", "count", CHART),
    "field_distance_mean": Figure("vertices to the field's surface, mean", "length", FIELD),
    "field_distance_95pc": Figure("the same, 95 %", "length", FIELD),
    "field_distance_99pc": Figure("the same, 99 %", "length", FIELD),
    "field_distance_max": Figure("the same, largest", "length", FIELD),
    "scan_distance_mean": Figure("points of the scan to the mesh, mean", "length", SCAN),
    "scan_distance_95pc": Figure("the same, 95 %", "length", SCAN),
    "scan_distance_max": Figure("the same, largest", "length", SCAN),
    "support_median": Figure("vertices to the nearest point of the scan, median", "length", SCAN),
    "support_95pc": Figure("the same, 95 %", "length", SCAN),
    "support_max": Figure("the same, largest", "length", SCAN),
    "scan_spacing": Figure("spacing of the scan, median", "length", SCAN),
    "unsupported_share": Figure("area without a point of the scan near", "share", SCAN),
}
"""By name in the JSON; one that is not here goes by its name, to the last table."""

TABLES = (SIZE, TOPOLOGY, DEFECTS, SHAPE, FIELD, SCAN, OTHER)


def figure_of(name: str) -> Figure:
    """Return what is known of a figure."""
    return FIGURES.get(name, Figure(name.replace("_", " "), "text", OTHER))


def in_words(name: str, value: Any, unit: str | None) -> str:
    """Return the value of a figure with its unit, rounded to what a reader takes in; "–" where there is none."""
    kind = figure_of(name).kind
    if value is None or isinstance(value, bool):
        return {None: "–", True: "yes", False: "no"}[value]
    if isinstance(value, list | tuple):
        return ", ".join(in_words(name, each, None) for each in value) + unit_of(kind, unit)
    if isinstance(value, str):
        return in_unit(value)
    plain = {"count": "{:,.0f}", "degrees": "{:.4g}°"}.get(kind, "{:.5g}")
    return f"{100 * value:.4g} %" if kind == "share" else plain.format(value) + unit_of(kind, unit)


def unit_of(kind: str, unit: str | None) -> str:
    """Return what follows a figure of a kind: " mm²"; nothing where no unit is known or none belongs."""
    return f" {in_unit(unit)}{POWERS[kind]}" if unit and kind in POWERS else ""


def in_unit(unit: str) -> str:
    """Return a unit as it is printed."""
    return "µm" if unit == "um" else unit
