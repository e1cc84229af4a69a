"""Figures in words: what each figure of a report is called, its kind, and its value with its unit."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from o3dleaf.core.units import POWERS, in_unit, measure_in_words

KINDS_OF_POWER = {"length": 1, "area": 2, "volume": 3}
"""Kinds of figure that carry the mesh's unit, and its power."""
DIGITS = 5
"""Significant digits of a figure in a table: one more than in a line, as figures are compared there."""


class Quantity(NamedTuple):
    """One figure of a report: what it is called on the page, its kind, and the table it stands in."""

    label: str
    kind: str
    table: str


SIZE, TOPOLOGY, DEFECTS, SHAPE = "Size", "Topology", "Defects", "Shape of the triangles"
CHART = ""
"""The table of what is drawn instead."""

FIELD, SCAN, OTHER = "Distance to the field", "Distance to the scan", "Other figures"
QUANTITIES = {
    "watertight": Quantity("watertight", "flag", TOPOLOGY),
    "manifold": Quantity("manifold", "flag", TOPOLOGY),
    "oriented": Quantity("oriented", "flag", TOPOLOGY),
    "orientable": Quantity("orientable", "flag", TOPOLOGY),
    "components": Quantity("components", "count", TOPOLOGY),
    "genus": Quantity("genus", "count", TOPOLOGY),
    "boundary_edges": Quantity("boundary edges", "count", TOPOLOGY),
    "boundary_loops": Quantity("boundary loops", "count", TOPOLOGY),
    "holes": Quantity("holes", "count", TOPOLOGY),
    "nonmanifold_edges": Quantity("non-manifold edges", "count", DEFECTS),
    "nonmanifold_vertices": Quantity("non-manifold vertices", "count", DEFECTS),
    "inconsistent_edges": Quantity("inconsistently oriented edges", "count", DEFECTS),
    "flipped_triangles": Quantity("flipped triangles", "count", DEFECTS),
    "self_intersections": Quantity("self-intersecting triangles", "count", DEFECTS),
    "degenerate_triangles": Quantity("degenerate triangles", "count", DEFECTS),
    "duplicate_triangles": Quantity("duplicate triangles", "count", DEFECTS),
    "vertices": Quantity("vertices", "count", SIZE),
    "triangles": Quantity("triangles", "count", SIZE),
    "area": Quantity("area", "area", SIZE),
    "volume": Quantity("enclosed volume", "volume", SIZE),
    "lower": Quantity("lower corner", "length", SIZE),
    "upper": Quantity("upper corner", "length", SIZE),
    "extent": Quantity("extent", "length", SIZE),
    "unit": Quantity("unit of length", "text", SIZE),
    "min_angle_deg": Quantity("smallest angle", "degrees", SHAPE),
    "max_angle_deg": Quantity("largest angle", "degrees", SHAPE),
    "share_below_1deg": Quantity("smallest angle below 1°", "share", SHAPE),
    "share_below_5deg": Quantity("smallest angle below 5°", "share", SHAPE),
    "share_below_10deg": Quantity("smallest angle below 10°", "share", SHAPE),
    "share_below_20deg": Quantity("smallest angle below 20°", "share", SHAPE),
    "shortest_edge": Quantity("shortest edge", "length", SHAPE),
    "edge_1pc": Quantity("edges, 1 %", "length", SHAPE),
    "edge_5pc": Quantity("edges, 5 %", "length", SHAPE),
    "median_edge": Quantity("edges, median", "length", SHAPE),
    "mean_edge": Quantity("edges, mean", "length", SHAPE),
    "edge_95pc": Quantity("edges, 95 %", "length", SHAPE),
    "edge_99pc": Quantity("edges, 99 %", "length", SHAPE),
    "longest_edge": Quantity("longest edge", "length", SHAPE),
    "angle_histogram": Quantity("triangles by smallest angle, a degree a bin", "count", CHART),
    "field_distance_mean": Quantity("vertices to the field's surface, mean", "length", FIELD),
    "field_distance_95pc": Quantity("the same, 95 %", "length", FIELD),
    "field_distance_99pc": Quantity("the same, 99 %", "length", FIELD),
    "field_distance_max": Quantity("the same, largest", "length", FIELD),
    "scan_distance_mean": Quantity("points of the scan to the mesh, mean", "length", SCAN),
    "scan_distance_95pc": Quantity("the same, 95 %", "length", SCAN),
    "scan_distance_max": Quantity("the same, largest", "length", SCAN),
    "support_median": Quantity("vertices to the nearest point of the scan, median", "length", SCAN),
    "support_95pc": Quantity("the same, 95 %", "length", SCAN),
    "support_max": Quantity("the same, largest", "length", SCAN),
    "scan_spacing": Quantity("spacing of the scan, median", "length", SCAN),
    "unsupported_share": Quantity("area without a point of the scan near", "share", SCAN),
}
"""By name in the JSON; one that is not here goes by its name, to the last table."""

TABLES = (SIZE, TOPOLOGY, DEFECTS, SHAPE, FIELD, SCAN, OTHER)


def quantity_of(name: str) -> Quantity:
    """Return what is known of a figure."""
    return QUANTITIES.get(name, Quantity(name.replace("_", " "), "text", OTHER))


def in_words(name: str, value: Any, unit: str | None) -> str:
    """Return the value of a figure with a unit, rounded to what a reader takes in; "–" where there is none."""
    kind = quantity_of(name).kind
    if value is None or isinstance(value, bool):
        return {None: "–", True: "yes", False: "no"}[value]
    if isinstance(value, str):
        return in_unit(value)
    if kind in KINDS_OF_POWER:
        return measure_in_words(value, unit, power=KINDS_OF_POWER[kind], digits=DIGITS)
    if isinstance(value, list | tuple):
        return ", ".join(in_words(name, each, None) for each in value)
    plain = {"count": "{:,.0f}", "degrees": "{:.4g}°"}.get(kind, "{:.5g}")
    return f"{100 * value:.4g} %" if kind == "share" else plain.format(value)


def lines_of(figures: Mapping[str, Any], unit: str | None) -> list[str]:
    """Return a line for a terminal on each figure of a report that was measured, but for the bins of a chart."""
    shown = {name: value for name, value in figures.items() if value is not None and quantity_of(name).table != CHART}
    return [f"{name:>24}  {in_words(name, value, unit)}" for name, value in shown.items()]


def unit_of(kind: str, unit: str | None) -> str:
    """Return what follows a figure of a kind: " mm²"; nothing where no unit is known or none belongs."""
    return f" {in_unit(unit)}{POWERS[KINDS_OF_POWER[kind]]}" if unit and kind in KINDS_OF_POWER else ""
