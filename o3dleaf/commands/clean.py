"""`o3dleaf clean`: a mesh cleaned, simplified on request, and compared with what it was."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from o3dleaf.core import journal
from o3dleaf.core.arguments.kinds import Count, NotNegative, Positive, Whole
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import argument, option, output
from o3dleaf.core.journal import stage

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.surface.mesh.mesh_report import MeshReport

FIGURES = (
    "vertices",
    "triangles",
    "components",
    "boundary_edges",
    "holes",
    "nonmanifold_edges",
    "nonmanifold_vertices",
    "inconsistent_edges",
    "self_intersections",
    "degenerate_triangles",
    "duplicate_triangles",
    "min_angle_deg",
    "area",
)
"""Of `MeshReport`: what a table of before and after shows."""

UNIT = "the mesh's unit"
MIN_PER_RIM_EDGE = 3
"""Triangles for each edge of the rim, which stays as it is: of fewer it is the rim that keeps them."""
MAX_OVER = 1.02
"""Times the triangles asked for that are left without a word: one edge takes two at a time."""


@dataclass(frozen=True, kw_only=True)
class CleaningOptions:
    """The arguments of `clean_mesh`."""

    HEADING: ClassVar = "Cleaning"

    merge: NotNegative = option(0.0, "Merge vertices up to this distance apart", unit=UNIT)
    smallest_component: NotNegative = option(0.0, "Remove components of less than this diameter", unit=UNIT)
    smallest_area: NotNegative = option(0.0, "Remove components of less than this area", unit=f"the square of {UNIT}")
    fewest_triangles: Whole = option(0, "Remove components of fewer triangles.")
    largest_hole: NotNegative = option(0.0, "Close holes up to this perimeter", unit=UNIT)
    smallest_height: NotNegative = option(0.0, "Remove, by edge flips, triangles of at most this height", unit=UNIT)
    fold_angle: NotNegative = option(
        1.0, "Angle of two triangles below which they count as folded (0: none)", unit="degrees"
    )
    untangle: bool = option(False, "Remove triangles that intersect others.")
    orient: bool = option(True, "Flip triangles whose orientation contradicts their neighbors.")

    def cleaning(self) -> dict[str, Any]:
        """Return the arguments by name."""
        return {each.name: getattr(self, each.name) for each in fields(CleaningOptions)}


@dataclass(frozen=True)
class CleanJob(CleaningOptions, LongJob):
    """Clean a mesh, and simplify it on request; no defect is added, and labels and the lines between them are kept."""

    mesh: Path = argument("Mesh to clean: PLY, OBJ, STL or OFF.", reads=True)
    output: Path = output("o3dleaf.io.triangle_mesh:SUFFIXES")
    triangles: Count | None = option(None, "Simplify to about this many triangles, after cleaning.", unless=("edge",))
    edge: Positive | None = option(None, "Simplify to this mean edge length", unit=UNIT)
    deviation: Positive | None = option(None, "Simplify with at most this deviation of the surface", unit=UNIT)

    def estimate(self) -> "list[Need]":
        """Return what the triangles of the file take."""
        from o3dleaf.core.resources.measured import CLEANED_TRIANGLE
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.io.clouds.counts import count_triangles

        count = count_triangles(self.mesh)
        return [need_of(CLEANED_TRIANGLE * count, f"clean: {count:,} triangles", "simplify the mesh first")]

    def work(self) -> "Comparison":
        """Write the mesh with its labels, if it has any, and return what it was and is."""
        from o3dleaf.io.triangle_mesh import read_mesh, write_mesh
        from o3dleaf.output.export.consumers import export_mesh
        from o3dleaf.surface.mesh.mesh_report import mesh_report
        from o3dleaf.surface.mesh.surface_distance import surface_distance
        from o3dleaf.surface.repair.clean import clean_mesh
        from o3dleaf.surface.repair.simplify import simplify_mesh

        given = read_mesh(self.mesh)
        with stage("clean"):
            cleaned = result = clean_mesh(given, **self.cleaning())
        meshes, distance = [given, cleaned], None
        simplifying: dict[str, Any] = {
            "target_triangles": self.triangles,
            "target_edge": self.edge,
            "deviation": self.deviation,
        }
        if any(each is not None for each in simplifying.values()):
            with stage("simplify"):
                result = simplify_mesh(cleaned, **simplifying)
                meshes, distance = [*meshes, result], surface_distance(cleaned.mesh, result.mesh)
        with stage("report"):
            reports = [mesh_report(each.mesh) for each in meshes]
        if result.labels is None:
            write_mesh(result.mesh, self.output)
        else:
            export_mesh(result, self.output)
        comparison = Comparison(reports, distance, self.triangles if self.deviation is None else None)
        for warning in comparison.warnings:
            journal.note(warning)
        return comparison

    def lines(self, summary: "Comparison") -> list[str]:
        """Return the table of before and after; nothing if quiet."""
        return [] if self.quiet else summary.table()


@dataclass(frozen=True)
class Comparison:
    """Reports of a mesh before and after cleaning.

    Attributes
    ----------
    reports : list of MeshReport
        Of the mesh as it came, cleaned, and simplified.
    distance : float, optional
        Between the cleaned and the simplified surface.
    asked : int, optional
        Triangles to come down to, where nothing but the mesh forbids it.
    """

    reports: "list[MeshReport]"
    distance: float | None = None
    asked: int | None = None

    @property
    def warnings(self) -> list[str]:
        """One line if more triangles are left than were asked for, and one if simplifying made some that cross."""
        if len(self.reports) < 3:
            return []
        before, after = self.reports[-2:]
        lines = []
        if self.asked is not None and after.triangles > MAX_OVER * self.asked:
            why = "with fewer, its triangles would cross or its topology change"
            if after.triangles < MIN_PER_RIM_EDGE * after.boundary_edges:
                why = f"the {after.boundary_edges:,} edges of its rim stay as they are, and {why}"
            lines.append(f"simplified to {after.triangles:,} triangles, not to the {self.asked:,} asked for: {why}")
        if after.self_intersections > before.self_intersections:
            crossing = f"{after.self_intersections:,} of its {after.triangles:,} triangles cross others"
            why = "a mesh that has some gets more; clean it with --untangle"
            lines.append(
                f"the simplified mesh crosses itself: {crossing}, {before.self_intersections:,} did before; {why}"
            )
        return lines

    def table(self) -> list[str]:
        """Return lines that compare the reports, and the distance."""
        heads = ("before", "cleaned", "simplified")[: len(self.reports)]
        lines = ["".join([f"{'':<22}", *(f"{head:>14}" for head in heads)])]
        for name in FIGURES:
            values = (getattr(each, name) for each in self.reports)
            cells = (f"{each:>14,.6g}" if isinstance(each, float) else f"{each:>14,}" for each in values)
            lines.append("".join([f"{name.replace('_', ' '):<22}", *cells]))
        return lines + ([] if self.distance is None else [f"{'moved by simplifying':<22}{self.distance:>14,.6g}"])
