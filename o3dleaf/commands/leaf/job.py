"""`o3dleaf leaf`: read a scan and a volume, build the leaf, mesh it, and write what a run leaves behind."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.leaf.mesh import WINDOW_MM, MeshOptions
from o3dleaf.commands.patch import MODEL, BlockOption, CtOptions, resumed
from o3dleaf.core import journal
from o3dleaf.core.arguments.kinds import Positive
from o3dleaf.core.atomic_files import write_json
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import Names, argument, option, output
from o3dleaf.core.jobs.shared import ColumnsOption, ResumeOption
from o3dleaf.core.parallel import run_together
from o3dleaf.core.units import measure_in_words, unit_scale
from o3dleaf.leaf.options import BladeOptions

if TYPE_CHECKING:
    import open3d as o3d

    from o3dleaf.core.resources.needs import Need
    from o3dleaf.leaf.blade.blade import Blade
    from o3dleaf.leaf.ct.volume import Volume
    from o3dleaf.leaf.fit_quality import FitQuality
    from o3dleaf.leaf.instancing.sets.tile_set import TilesAhead
    from o3dleaf.leaf.meshing import MeshPlan
    from o3dleaf.leaf.multiscale import MultiscaleLeaf
    from o3dleaf.leaf.texture.patches import PatchBlend
    from o3dleaf.leaf.texture.tiling import TiledField
    from o3dleaf.leaf.texture.wang.wang_field import WangField
    from o3dleaf.leaf.textured_blade import Texture


@dataclass(frozen=True)
class LeafJob(MeshOptions, ColumnsOption, BladeOptions, CtOptions, BlockOption, ResumeOption, LongJob):
    """Build a leaf from a laser scan, with the micro-structure of a micro-CT volume if one is given.

    Writes the mesh, and beside it a picture (.png) and a summary (.json) of the same name, and of a scan that has
    several pieces a picture of these (.pieces.png).
    """

    scan: Path = argument("Point cloud of one leaf: PLY, PCD, XYZ, PTS, TXT, CSV, ASC, LAS, E57, ...", reads=True)
    output: Path = output("o3dleaf.io.triangle_mesh:SUFFIXES")
    ct: Path | None = option(
        None, "Micro-CT volume of a patch, or a model that `patch` wrote; without it, the blade only.", reads=True
    )
    grid: Path | None = option(
        None,
        "Also sample the leaf on a grid: .vti or .nrrd.",
        writes="o3dleaf.leaf.distance.grid:SUFFIXES",
        needs=("ct",),
    )
    grid_of: str = option(
        "field",
        "Values on the grid: 'field', 'distance' or 'mask'.",
        choices="o3dleaf.leaf.distance.grid:KINDS",
        needs=("grid",),
    )
    grid_step: Positive | None = option(
        None, "Step of the grid (the mesh spacing if not given)", unit="scan-unit", needs=("grid",)
    )
    distortion: str | None = option(
        None,
        "Draw a map of the leaf's distortion: along, across, shear, thickness, area or volume.",
        choices="o3dleaf.output.view.maps:MEASURES",
    )
    fit_map: bool = option(False, "Draw a map of the residuals: where the leaf does not hold the scan.")
    picture: bool = option(True, "Draw the picture.")
    model: Path | None = option(None, "Also write the leaf as a model file (.o3l).", writes=MODEL)

    @property
    def volume(self) -> Path | None:
        """Whether --ct is a volume, and no model: its file."""
        return self.volume_of(self.ct)

    def outputs(self) -> list[tuple[Path, Names]]:
        """Return the files that are written, those beside the mesh too."""
        beside = {
            ".png": self.picture,
            ".json": True,
            ".distortion.png": self.distortion is not None,
            ".fit.png": self.fit_map,
        }
        return [*super().outputs(), *((self.beside(suffix), ()) for suffix, wanted in beside.items() if wanted)]

    def beside(self, suffix: str) -> Path:
        """Return the name of a file beside the mesh."""
        return self.output.with_suffix(suffix)

    def check(self) -> None:
        """Refuse what does not go together."""
        from o3dleaf.leaf.meshing import require_reduction

        super().check()
        self.check_frame()
        self.check_texture()
        require_reduction(self.simplify, self.remesh_tile)

    def estimate(self) -> "list[Need]":
        """Return what scan and volume take, by their heads; if that is all that is asked, the mesh too."""
        from o3dleaf.io.clouds.counts import count_points
        from o3dleaf.leaf.pipeline import need_for_blade

        needs = [] if self.ct is None else self.need_for(self.ct)
        needs.append(need_for_blade(count_points(self.scan)))
        if self.only_estimate and self.spacing is not None:
            for need in needs:
                need.require()
            scan, _ = self.read_scan()
            needs += self.need_for_mesh(scan, None if self.ct is None else self.read_patch(self.ct))
        return needs

    def read_scan(self) -> "tuple[o3d.geometry.PointCloud, int]":
        """Return the scan without the places where a depth camera saw nothing, NaN, and their number; they are told."""
        from o3dleaf.io.point_cloud import read_point_cloud

        scan = read_point_cloud(self.scan, finite=False, columns=self.columns)
        whole = len(scan.points)
        scan = scan.remove_non_finite_points()
        left_out = whole - len(scan.points)
        if left_out and left_out == whole:
            raise InputError(f"{self.scan}: all {whole:,} points are NaN or infinite")
        if left_out:
            journal.note(f"left out: {left_out:,} points that are NaN or infinite")
        return scan, left_out

    def need_for_mesh(
        self, scan: "o3d.geometry.PointCloud", patch: "Volume | TiledField | PatchBlend | WangField | None"
    ) -> "list[Need]":
        """Return what the mesh takes at least, where its spacing was given; one that is chosen fits the data."""
        from o3dleaf.core.cloud_arrays import points_of
        from o3dleaf.leaf.mesh_needs import need_for_sheet, need_for_tile

        if self.spacing is None:
            return []
        if patch is not None:
            return [need_for_tile(patch, self.spacing, self.scan_unit, wang=self.wang)]
        window = self.window or WINDOW_MM * unit_scale("mm", self.scan_unit)
        region = self.region if self.around is None else ((0.0, 0.0), (window, window))
        return [need_for_sheet(points_of(scan, "scan"), self.spacing, region)]

    def work(self) -> dict[str, Any]:
        """Write mesh, picture, summary and model, and return the summary."""
        with resumed(self.output, self) if self.resume else nullcontext():
            return self.build()

    def build(self) -> dict[str, Any]:
        """Write mesh, picture, summary and model, and return the summary."""
        from o3dleaf.io.point_cloud import read_point_cloud
        from o3dleaf.leaf.fit_quality import FitQuality
        from o3dleaf.output.report.summary import seconds_of_stages, summarize, warnings_of

        with journal.stage("read"):
            scan, left_out = self.read_scan()
            midrib = None if self.midrib is None else read_point_cloud(self.midrib, least=2)
            patch = None if self.ct is None else self.read_patch(self.ct)
        for need in self.need_for_mesh(scan, patch):
            need.require()
        with self.refusals_shown(scan):
            blade, leaf = self.create(scan, patch, midrib)
        step = self.step_for(scan, None if leaf is None else leaf.thickness, blade)

        def measure() -> "FitQuality":
            with journal.stage("measure fit"):
                return FitQuality.of(blade, scan)

        def check() -> dict[str, Any]:
            with journal.stage("check mesh"):
                return summarize(blade, mesh, self.settings, leaf=leaf, surface=surface, scan=scan, fit=fit)

        # Each is serial in part.
        (mesh, surface), fit = run_together(lambda: self.write(blade, leaf, step.length), measure)
        summary: dict[str, Any]
        summary, _ = run_together(check, lambda: self.draw(leaf or blade, mesh, scan, fit))
        summary["seconds"] = seconds_of_stages()
        summary["scan"] = {"points": len(scan.points), "not_finite": left_out}
        summary["mesh_step"] = {"length": step.length, "reason": step.reason}
        write_json(summary, self.beside(".json"))
        for line in (*fit.lines(), *(f"warning: {warning}" for warning in warnings_of(summary))):
            journal.note(line)
        return summary

    @contextmanager
    def refusals_shown(self, scan: "o3d.geometry.PointCloud") -> Iterator[None]:
        """Draw a scan that is refused inside, where the error knows places or pieces, and name the picture in it."""
        try:
            yield
        except ReconstructionError as cause:
            if not self.picture or (cause.places is None and not cause.pieces):
                raise
            from o3dleaf.output.view.leaf_picture import render_refusal

            path = self.beside(".refused.png")
            render_refusal(scan, cause, path, self.scan_unit)
            raise ReconstructionError(f"{cause}; see {path.name}", cause.places, cause.pieces) from cause

    def create(
        self,
        scan: "o3d.geometry.PointCloud",
        patch: "Volume | TiledField | PatchBlend | WangField | None",
        midrib: "o3d.geometry.PointCloud | None",
    ) -> "tuple[Blade, MultiscaleLeaf | None]":
        """Return the blade, and the leaf where there is a micro-structure."""
        from o3dleaf.leaf.pipeline import build_multiscale_leaf, create_blade

        if patch is None:
            create = partial(create_blade, scan, midrib, unit=self.scan_unit, options=self)
            return run_together(create, self.import_drawing)[0], None
        leaf = build_multiscale_leaf(
            scan, patch, midrib, unit=self.scan_unit, blade=self, texture=self, ahead=self.work_ahead
        )  # fmt: skip
        return leaf.blade, leaf

    def work_ahead(self, texture: "Texture") -> "TilesAhead":
        """Return the tiles of mesh and picture, and import what draws: beside the blade, which leaves a core idle."""
        from o3dleaf.leaf.tile_lattice import extract_tiles_ahead

        tiles: TilesAhead = {}
        # Finished parts of a tile that are to be resumed are kept where the tile is meshed; with hairs thinned out, its
        # tiles depend on the blade.
        if not self.resume and self.hair_density is None:
            with journal.stage("polygonize tiles ahead"):
                tiles = extract_tiles_ahead(texture, self.scan_unit, self.tiles_wanted())
        self.import_drawing()
        return tiles

    def tiles_wanted(self) -> Iterator[tuple[float, int, bool]]:
        """Yield the tiles that mesh and picture will be made of, as far as they are known: see `TilesAhead`."""
        yield from super().tiles_wanted()
        if self.picture and self.around is None:
            from o3dleaf.output.view.leaf_picture import inset_step

            yield inset_step(self.scan_unit, self.region), 0, True

    def import_drawing(self) -> None:
        """Import what `draw` calls: half a second."""
        if self.picture:
            import_module("o3dleaf.output.view.leaf_picture")

    def draw(
        self,
        leaf: "MultiscaleLeaf | Blade",
        mesh: "o3d.geometry.TriangleMesh",
        scan: "o3d.geometry.PointCloud",
        fit: "FitQuality",
    ) -> None:
        """Draw the picture and the maps that are wanted."""
        from o3dleaf.leaf.multiscale import MultiscaleLeaf
        from o3dleaf.output.view.leaf_picture import render_leaf
        from o3dleaf.output.view.maps import render_distortion, render_residuals

        blade = leaf.blade if isinstance(leaf, MultiscaleLeaf) else leaf
        if self.picture:
            with journal.stage("draw picture"):
                render_leaf(leaf, mesh, self.beside(".png"), self.region_of(blade), fit.warnings)
        if self.picture and blade.several_pieces:
            self.draw_pieces(scan)
        if self.distortion is not None:
            with journal.stage("draw distortion"):
                render_distortion(blade, self.beside(".distortion.png"), measure=self.distortion)
        if self.fit_map:
            with journal.stage("draw fit"):
                render_residuals(blade, scan, self.beside(".fit.png"), fit=fit)

    def draw_pieces(self, scan: "o3d.geometry.PointCloud") -> None:
        """Draw the pieces of a scan that has several, with the numbers by which they are asked for, and name the file.

        It is written only then, as the picture of a scan that is refused is.
        """
        from o3dleaf.leaf.pipeline import find_pieces
        from o3dleaf.output.view.leaf_picture import render_pieces

        path = self.beside(".pieces.png")
        with journal.stage("draw pieces"):
            pieces = find_pieces(scan, unit=self.scan_unit, one_sheet=self.one_sheet)
            render_pieces(pieces, path, unit=self.scan_unit)
        journal.note(f"the scan's {len(pieces)} pieces, with their numbers: see {path.name}")

    def line(self, summary: dict[str, Any]) -> str:
        """Return what was built."""
        return in_a_line(summary)

    def write(
        self, blade: "Blade", leaf: "MultiscaleLeaf | None", spacing: float
    ) -> "tuple[o3d.geometry.TriangleMesh, MeshPlan | None]":
        """Write mesh, tile, grid and model, and return the mesh and the plan of the surface that it is of."""
        from o3dleaf.io.models.model_file import write_model

        mesh: o3d.geometry.TriangleMesh
        surface: MeshPlan | None = None
        if leaf is None:
            mesh = self.write_sheet(blade, spacing, self.output)
        else:
            write = self.write_windows if self.fine else self.write_leaf
            mesh, surface = write(leaf, spacing, self.output)
            self.write_more(leaf, spacing)
        if self.model is not None:
            with journal.stage("write model"):
                write_model(leaf or blade, self.model)
        return mesh, surface

    def write_more(self, leaf: "MultiscaleLeaf", spacing: float) -> None:
        """Write a flat tile and a grid, where they are requested."""
        from o3dleaf.leaf.meshing import write_flat_tile

        if self.tile_solid is not None:
            with journal.stage("write tile"):
                write_flat_tile(leaf.texture, leaf.scale, spacing, self.tile_solid, leaf.unit)
        if self.grid is not None:
            with journal.stage("write grid"):
                leaf.write_grid(self.grid, self.grid_step or spacing, what=self.grid_of, closed=self.closed)


def in_a_line(summary: dict[str, Any]) -> str:
    """Return what was written, in one line for a terminal; where only a coarser mesh was looked at, its area."""
    report = summary["mesh"]
    written = summary["surface"] if "note" in report else report
    area = measure_in_words(report["area"], summary["unit"], power=2)
    return f"{summary['settings']['output']}: {written['triangles']:,} triangles, {area}"
