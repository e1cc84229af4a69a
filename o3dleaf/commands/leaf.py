"""One run of the leaf job on files: read, build, mesh, and write what a run leaves behind."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import open3d as o3d

from o3dleaf.core.atomic_files import require_apart, require_writable
from o3dleaf.core.checks import require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.journal import Journal
from o3dleaf.core.units import unit_scale
from o3dleaf.io.model_file import SUFFIX as MODEL
from o3dleaf.io.model_file import write_model
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import SUFFIXES, write_triangle_mesh
from o3dleaf.leaf.ct.formats import read_volume
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.distance.grid import KINDS
from o3dleaf.leaf.distance.grid import SUFFIXES as GRIDS
from o3dleaf.leaf.instancing.stream import write_mesh
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.meshing import MeshPlan
from o3dleaf.leaf.models import load
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.pipeline import BladeOptions, PatchOptions, create_blade, create_texture
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.output.report.describe import write_json
from o3dleaf.output.report.summary import summarise
from o3dleaf.output.view.maps import MEASURES, render_distortion
from o3dleaf.output.view.picture import Inset, render
from o3dleaf.surface.isosurface.polygonize import METHODS

MOST_TO_CHECK = 3_000_000
"""Triangles up to which a mesh is held to be drawn and checked; of a larger one, a coarser mesh is drawn."""
PICTURE_STEP_MM = 0.1
"""The step of that one."""
WINDOW_MM = 2.4
"""Side of the inset's window on the leaf."""
WINDOW_STEP_MM = 0.012
"""Its mesh step: half a voxel of a 24 µm CT, so that hairs are round."""


@dataclass(frozen=True)
class LeafRun:
    """What a run is asked for; the names are those of ``o3dleaf leaf``.

    Attributes
    ----------
    scan, output : Path
    ct, midrib, model : Path, optional
        Volume or model of the micro-structure; control points; model file to write.
    scan_unit, ct_unit : str
    voxel_spacing, spacing, alpha : float
        In ct_unit, scan_unit and scan_unit.
    region : (2, 2) nested sequence, optional
        Lower and upper (along, across), in scan_unit.
    around : (3,) sequence, optional
        Mesh a `window` wide region around this point of the world instead, both in scan_unit.
    window : float
    closed : bool
        One solid with a rim instead of two sheets.
    fine : sequence of (along, across, along, across, step)
        Finer windows in the mesh: lower and upper corner and step, in scan_unit.
    simplify, remesh : float, optional
        Share of its triangles that a tile is simplified to; edge length, in scan_unit, that the whole is remeshed to.
    remesh_tile : float, optional
        Edge length, in scan_unit, that a tile is remeshed to.
    tile_solid : Path, optional
        Where to write one flat period of the micro-structure as a closed block.
    grid : Path, optional
        Where to write the field on a regular grid, `grid_of` it ("field", "distance" or "mask"), `grid_step` apart.
    distortion : str, optional
        Draw a map of this measure of the frame's distortion beside the mesh.
    offset : {"up", "normal"}
        What the micro-structure's heights are measured along.
    period, flip, shift
        As in `PatchOptions`.
    level, rho : float or str
        As in `PatchOptions`.
    method : str
    picture : bool
    """

    scan: Path
    output: Path
    ct: Path | None = None
    midrib: Path | None = None
    model: Path | None = None
    scan_unit: str = "mm"
    ct_unit: str | None = None
    voxel_spacing: float | None = None
    spacing: float = 0.1
    region: Any = None
    around: Any = None
    window: float = 3.0
    closed: bool = False
    fine: Any = ()
    simplify: float | None = None
    remesh: float | None = None
    remesh_tile: float | None = None
    tile_solid: Path | None = None
    grid: Path | None = None
    grid_of: str = "field"
    grid_step: float = 0.1
    distortion: str | None = None
    offset: str = "up"
    period: Any = None
    flip: str | None = None
    shift: float = 0.0
    level: float | str = "valley"
    rho: Any = "gcv"
    alpha: float | None = None
    method: str = "cubes"
    picture: bool = True

    def __post_init__(self) -> None:
        """Refuse what can be refused before any work."""
        require_writable(self.output, SUFFIXES)
        beside = self.tile_solid, self.grid, *map(self.beside, (".png", ".json", ".distortion.png"))
        require_apart((self.output, self.model, *beside), (self.scan, self.ct, self.midrib))
        for path, suffixes in ((self.model, (MODEL,)), (self.tile_solid, SUFFIXES), (self.grid, GRIDS)):
            if path is not None:
                require_writable(path, suffixes)
        if self.ct is None and (self.closed or self.fine or self.tile_solid or self.grid):
            raise InputError(
                "closed, fine, tile-solid, grid: need a micro-structure, which gives the blade its thickness; give ct"
            )
        if self.region is not None and self.around is not None:
            raise InputError("region, around: name the same window in two ways; give one of them")
        if self.fine and (
            self.region is not None or self.around is not None or self.simplify or self.remesh or self.remesh_tile
        ):
            raise InputError("fine: windows are set into the whole leaf as it is polygonised; leave the others out")
        if self.distortion is not None:
            require_choice(self.distortion, MEASURES, "distortion")
        require_positive(self.spacing, "spacing")
        require_positive(self.grid_step, "grid-step")
        require_choice(self.grid_of, KINDS, "grid-of")
        require_choice(self.method, METHODS, "method")

    def beside(self, suffix: str) -> Path:
        """Return the name of a file beside the mesh."""
        return self.output.with_suffix(suffix)

    def run(self, journal: Journal) -> dict[str, Any]:
        """Write mesh, picture, summary and model, and return the summary."""
        with journal.stage("read"):
            scan = read_point_cloud(self.scan)
            midrib = None if self.midrib is None else read_point_cloud(self.midrib, least=2)
            patch = None if self.ct is None else read_patch(self.ct, self.voxel_spacing, self.ct_unit)
        macro = BladeOptions(alpha=self.alpha, offset=self.offset)
        blade = create_blade(scan, midrib, unit=self.scan_unit, options=macro, journal=journal)
        leaf = surface = None
        if patch is None:
            mesh = self.write_sheet(blade, journal)
        else:
            micro = PatchOptions(self.level, self.rho, self.period, self.flip, self.shift)
            texture = create_texture(patch, options=micro, journal=journal) if isinstance(patch, Volume) else patch
            leaf = MultiscaleLeaf(texture, blade.frame, blade.height_map, blade.outline, offset=blade.offset)
            mesh, surface = self.write_windows(leaf, journal) if self.fine else self.write_leaf(leaf, journal)
            self.write_more(leaf, journal)
        if self.model is not None:
            with journal.stage("write model"):
                write_model(self.model, leaf or blade)
        if self.picture:
            with journal.stage("draw picture"):
                draw(self.beside(".png"), mesh, blade, leaf)
        if self.distortion is not None:
            with journal.stage("draw distortion"):
                render_distortion(blade, self.beside(".distortion.png"), measure=self.distortion)
        with journal.stage("check mesh"):
            summary = summarise(blade, mesh, journal, asdict(self), leaf=leaf, surface=surface, scan=scan)
        write_json(self.beside(".json"), summary)
        for warning in summary["frame"]["warnings"]:
            journal.note(f"warning: {warning}")
        return summary

    def write_sheet(self, blade: Blade, journal: Journal) -> o3d.geometry.TriangleMesh:
        """Write the blade alone, an open sheet, and return it."""
        with journal.stage("extract mesh"):
            region = self.region if self.around is None else blade.window(self.around, self.window)
            mesh = blade.extract_mesh(self.spacing, region)
        with journal.stage("write mesh"):
            write_triangle_mesh(self.output, mesh)
        return mesh

    def write_leaf(self, leaf: MultiscaleLeaf, journal: Journal) -> tuple[o3d.geometry.TriangleMesh, MeshPlan]:
        """Write the surface of the multi-scale leaf, and return a mesh to look at and what was written."""
        region = self.region if self.around is None else leaf.blade.window(self.around, self.window)
        parts: dict[str, Any] = {"region": region, "closed": self.closed, "method": self.method}
        with journal.stage("polygonise one tile"):
            reduced = parts | {"simplify": self.simplify, "remesh_tile": self.remesh_tile}
            surface = leaf.plan_mesh(self.spacing, **reduced)
        steps = " × ".join(f"{step:.4g}" for step in surface.spacing)
        journal.note(
            f"{surface.triangles:,} triangles at {steps} {self.scan_unit}, {surface.bytes(self.output) / 1e6:,.0f} MB, "
            f"about {surface.seconds:.1f} s and what the disk takes"
        )
        if self.remesh is not None:
            with journal.stage("remesh"):
                found = surface.extract(remesh=self.remesh)
            with journal.stage("write mesh"):
                write_mesh(found, self.output)
            return found.mesh, surface
        with journal.stage("write mesh"):
            surface.write(self.output)
        with journal.stage("extract mesh"):
            if surface.triangles <= MOST_TO_CHECK:
                return surface.extract().mesh, surface
            coarse = max(self.spacing, PICTURE_STEP_MM * unit_scale("mm", leaf.unit))
            return leaf.plan_mesh(coarse, **parts).extract().mesh, surface

    def write_windows(self, leaf: MultiscaleLeaf, journal: Journal) -> tuple[o3d.geometry.TriangleMesh, None]:
        """Write the surface of the leaf with finer windows in it, and return it."""
        levels = [((row[:2], row[2:4]), row[4]) for row in self.fine]
        with journal.stage("extract mesh"):
            found = leaf.extract_levels(self.spacing, levels, closed=self.closed)
        with journal.stage("write mesh"):
            write_mesh(found, self.output)
        return found.mesh, None

    def write_more(self, leaf: MultiscaleLeaf, journal: Journal) -> None:
        """Write a flat tile and a grid, where they are asked for."""
        if self.tile_solid is not None:
            with journal.stage("write tile"):
                write_mesh(leaf.extract_tile(self.spacing), self.tile_solid)
        if self.grid is not None:
            with journal.stage("write grid"):
                leaf.write_grid(self.grid, self.grid_step, what=self.grid_of, closed=self.closed)


def read_patch(
    path: Path, voxel_spacing: float | None = None, unit: str | None = None
) -> Volume | TiledField | PatchBlend:
    """Return the volume of a file, or the micro-structure of a model file.

    Raises
    ------
    InputError
        If it can be read as neither.
    """
    if path.suffix.lower() != MODEL:
        return read_volume(path, spacing=voxel_spacing, unit=unit)
    found = load(path)
    texture = found.texture if isinstance(found, MultiscaleLeaf) else found
    if not isinstance(texture, TiledField | PatchBlend):
        raise InputError(f"{path}: holds a {type(found).__name__}, no micro-structure; give one that `patch` made")
    return texture


def draw(path: Path, mesh: o3d.geometry.TriangleMesh, blade: Blade, leaf: MultiscaleLeaf | None) -> None:
    """Draw the whole leaf, with an inset of the micro-structure where there is one."""
    insets = []
    if leaf is not None:
        scale = unit_scale("mm", blade.unit)
        middle, half = blade.outline.polygon.representative_point(), WINDOW_MM * scale / 2
        window = [[middle.x - half, middle.y - half], [middle.x + half, middle.y + half]]
        insets = [Inset(leaf.extract_mesh(WINDOW_STEP_MM * scale, window))]
    render(mesh, path, insets=insets, unit=blade.unit)
