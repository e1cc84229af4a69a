"""The mesh that `o3dleaf leaf` writes: which part of the leaf, how fine, in which triangles."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from o3dleaf.core import journal
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.jobs.option import option
from o3dleaf.core.jobs.shared import ScanOptions
from o3dleaf.core.jobs.words import corners_of, windows_of
from o3dleaf.core.units import measure_in_words, unit_scale

if TYPE_CHECKING:
    import open3d as o3d

    from o3dleaf.leaf.blade.blade import Blade
    from o3dleaf.leaf.mesh_step import MeshStep
    from o3dleaf.leaf.meshing import MeshPlan
    from o3dleaf.leaf.multiscale import MultiscaleLeaf

MAX_CHECKED = 3_000_000
"""Triangles up to which a mesh is kept to be drawn and checked; of a larger one, a coarser mesh is drawn."""
PICTURE_STEP_MM = 0.1
"""The step of that one."""
WINDOW_MM = 3.0
"""Width of a window around a point: a droplet and some leaf around it."""
OF_MICRO_STRUCTURE: dict[str, Any] = {"needs": ("ct",), "unless": ("fine",)}
"""Of options that a blade has no use for, nor a mesh with finer windows in it."""


@dataclass(frozen=True, kw_only=True)
class MeshOptions(ScanOptions):
    """Options for the mesh of a leaf."""

    HEADING: ClassVar = "Mesh"

    spacing: Positive | None = option(
        None, "Mesh spacing (the scan's, or what shows the micro-structure, if not given)", unit="scan-unit"
    )
    region: Any = option(
        None,
        "Part to mesh, in leaf coordinates: ALONG0 ACROSS0 ALONG1 ACROSS1",
        unit="scan-unit",
        kind=tuple[float, float, float, float],
        parse=corners_of,
        unless=("around", "fine"),
    )
    around: tuple[float, float, float] | None = option(
        None, "Mesh a window around this point of the world instead: X Y Z", unit="scan-unit", unless=("fine",)
    )
    window: Positive | None = option(
        None, "Width of the window around a point (3 mm if not given)", unit="scan-unit", needs=("around",)
    )
    closed: bool = option(False, "One solid with a rim, instead of two open sheets.", needs=("ct",))
    fine: tuple[tuple[float, ...], ...] = option(
        (),
        "A finer window in the mesh, 'ALONG0 ACROSS0 ALONG1 ACROSS1 STEP'; repeat for more.",
        kind=list[str],
        parse=windows_of,
        needs=("ct",),
    )
    simplify: float | None = option(None, "Simplify a tile to this share of its triangles.", **OF_MICRO_STRUCTURE)
    remesh: Positive | None = option(
        None, "Remesh to this edge length, for solvers", unit="scan-unit", **OF_MICRO_STRUCTURE
    )
    remesh_tile: Positive | None = option(
        None,
        "Remesh one tile, which the mesh repeats, to this edge length (sooner done than the leaf)",
        unit="scan-unit",
        **OF_MICRO_STRUCTURE,
    )
    method: str = option(
        "cubes",
        "Marching 'cubes' or 'tetrahedra'.",
        choices="o3dleaf.surface.isosurface.polygonize:METHODS",
        **OF_MICRO_STRUCTURE,
    )

    def region_of(self, blade: "Blade") -> Any:
        """Return the part to mesh, in leaf coordinates; None is all."""
        if self.around is None:
            return self.region
        return blade.window(self.around, self.window or WINDOW_MM * unit_scale("mm", self.scan_unit))

    def tiles_wanted(self) -> Iterator[tuple[float, int, bool]]:
        """Yield the tiles that the mesh will be made of, as far as they are known: see `TilesAhead`."""
        from o3dleaf.surface.isosurface.polygonize import METHODS

        if self.spacing is not None and not self.fine:
            yield self.spacing, METHODS.index(self.method), self.simplify is None and self.remesh_tile is None

    def step_for(self, scan: "o3d.geometry.PointCloud", thickness: float | None, blade: "Blade") -> "MeshStep":
        """Return the mesh spacing that was given, or one that fits the data, and say so."""
        from o3dleaf.leaf.mesh_step import MeshStep, choose_step

        if self.spacing is not None:
            return MeshStep(self.spacing, "as given")
        with journal.stage("choose mesh spacing"):
            step = choose_step(scan, thickness, blade)
        length = measure_in_words(step.length, self.scan_unit)
        journal.note(f"mesh spacing {length}: {step.reason}; give --spacing for another")
        return step

    def write_sheet(self, blade: "Blade", spacing: float, path: Path) -> "o3d.geometry.TriangleMesh":
        """Write the blade alone, an open sheet, and return it."""
        from o3dleaf.io.triangle_mesh import write_mesh

        with journal.stage("extract mesh"):
            mesh = blade.extract_mesh(spacing, self.region_of(blade))
        with journal.stage("write mesh"):
            write_mesh(mesh, path)
        return mesh

    def write_leaf(
        self, leaf: "MultiscaleLeaf", spacing: float, path: Path
    ) -> "tuple[o3d.geometry.TriangleMesh, MeshPlan]":
        """Write the surface of the multi-scale leaf, and return a mesh to look at and what was written."""
        from o3dleaf.io.triangle_mesh import write_mesh

        parts: dict[str, Any] = {"region": self.region_of(leaf.blade), "closed": self.closed, "method": self.method}
        with journal.stage("polygonize one tile"):
            surface = leaf.plan_mesh(spacing, **parts, simplify=self.simplify, remesh_tile=self.remesh_tile)
        steps = " × ".join(f"{step:.4g}" for step in surface.spacing)
        journal.note(
            f"{surface.triangles:,} triangles at {steps} {self.scan_unit}, {surface.bytes(path) / 1e6:,.0f} MB, "
            f"about {surface.seconds:.1f} s plus the time for writing"
        )
        if self.remesh is not None:
            with journal.stage("remesh"):
                remeshed = surface.extract(remesh=self.remesh)
            with journal.stage("write mesh"):
                write_mesh(remeshed, path)
            return remeshed.mesh, surface
        if surface.triangles <= MAX_CHECKED:
            with journal.stage("extract mesh"):
                return surface.write_and_extract(path).mesh, surface
        with journal.stage("write mesh"):
            surface.write(path)
        with journal.stage("extract mesh"):
            coarse = max(spacing, PICTURE_STEP_MM * unit_scale("mm", leaf.unit))
            return leaf.plan_mesh(coarse, **parts).extract().mesh, surface

    def write_windows(
        self, leaf: "MultiscaleLeaf", spacing: float, path: Path
    ) -> "tuple[o3d.geometry.TriangleMesh, None]":
        """Write the surface of the leaf with finer windows in it, and return it."""
        from o3dleaf.io.triangle_mesh import write_mesh

        levels = [((row[:2], row[2:4]), row[4]) for row in self.fine]
        with journal.stage("extract mesh"):
            made = leaf.extract_levels(spacing, levels, closed=self.closed)
        with journal.stage("write mesh"):
            write_mesh(made, path)
        return made.mesh, None
