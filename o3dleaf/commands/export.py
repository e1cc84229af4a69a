"""One export from file to file: a mesh or a model in; a mesh, particles or distances out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from o3dleaf.core.atomic_files import require_apart, require_writable
from o3dleaf.core.checks import FloatArray, as_points, require_choice, require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.journal import Journal
from o3dleaf.core.mesh_arrays import build_mesh, drop_unused_vertices, mesh_arrays
from o3dleaf.core.parallel import Progress
from o3dleaf.core.progress import split
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.io.model_file import SUFFIX as MODEL
from o3dleaf.leaf.meshing import extract_flat_tile
from o3dleaf.leaf.models import load
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.output.export.consumers import CONSUMERS, SUFFIXES, export_mesh
from o3dleaf.output.export.distance_grid import SUFFIXES as DISTANCE_SUFFIXES
from o3dleaf.output.export.distance_grid import export_distance
from o3dleaf.output.export.particles import SUFFIXES as PARTICLE_SUFFIXES
from o3dleaf.output.export.particles import export_particles, fill_particles, sample_particles
from o3dleaf.output.export.read import read_labelled_mesh

WHAT = {
    "mesh": SUFFIXES,
    "surface-particles": PARTICLE_SUFFIXES,
    "volume-particles": PARTICLE_SUFFIXES,
    "distance": DISTANCE_SUFFIXES,
}
"""What can be exported, and as which files."""
SCALARS = ("curvature", "deviation")


@dataclass(frozen=True)
class ExportRun:
    """The settings of one export; see `o3dleaf export --help`, which they come from.

    Attributes
    ----------
    source, output : Path
    what : {"mesh", "surface-particles", "volume-particles", "distance"}
    consumer : str, optional
        Of a mesh: the program that it is for.
    unit, to_unit : str, optional
        Of the source, where it is a mesh, and of the output.
    spacing : float, optional
        Mesh step, where the source is a model, in its unit.
    remesh : float, optional
        Edge length, in the model's unit, that the surface of a leaf is remeshed to; see `edge`.
    raw : bool
        The surface as it was polygonised, whatever the program.
    region : (2, 2) nested tuples, optional
        Part of a leaf, in leaf coordinates.
    part : str, optional
        The one label to keep, by name: an open surface.
    sheets, tile : bool
        Two open sheets instead of a closed solid; one flat period instead of the leaf.
    step : float, optional
        Of particles and distances, in the source's unit.
    bounds : (2, 3) nested tuples, optional
        Box of the distances, in the source's unit, before the origin is moved.
    origin : tuple of float, optional
        The point of the source that becomes 0 0 0.
    field : Path, optional
        A leaf model that the scalars of a mesh are asked of.
    scalars : tuple of str
        curvature, deviation.
    """

    source: Path
    output: Path
    what: str = "mesh"
    consumer: str | None = None
    unit: str | None = None
    to_unit: str | None = None
    spacing: float | None = None
    remesh: float | None = None
    raw: bool = False
    region: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    part: str | None = None
    sheets: bool = False
    tile: bool = False
    step: float | None = None
    bounds: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    origin: tuple[float, float, float] | None = None
    field: Path | None = None
    scalars: tuple[str, ...] = ()

    @property
    def edge(self) -> float | None:
        """Edge length that the leaf is remeshed to: what was asked for, or the mesh step if a solver is to take it.

        None: the surface stays as it was polygonised. A tile's opposite walls must match, and so it always does.
        """
        solver = self.consumer is not None and CONSUMERS[self.consumer].solver
        if self.raw or self.tile or self.remesh is not None or not solver:
            return self.remesh
        return self.spacing

    def check(self) -> None:
        """Raise `InputError` before the work for what would fail after it."""
        suffixes = WHAT[require_choice(self.what, WHAT, "what")]
        if self.consumer is not None:
            consumer = CONSUMERS[require_choice(self.consumer, CONSUMERS, "for")]
            if self.what != "mesh":
                raise InputError(f"for: {self.consumer} is about meshes; leave it out for {self.what}")
            suffixes = consumer.suffixes
        require_writable(self.output, suffixes)
        require_apart([self.output], [self.source, self.field])
        if self.what != "mesh" and self.step is None:
            raise InputError(f"step: {self.what} need one; give it in the unit of {self.source.name}")
        for name in self.scalars:
            require_choice(name, SCALARS, "scalar")
        if self.remesh is not None:
            self._check_remesh(self.remesh)

    def _check_remesh(self, edge: float) -> None:
        """Raise `InputError` where nothing can be remeshed to edges of that length."""
        require_positive(edge, "remesh")
        if self.raw:
            raise InputError("remesh, no-remesh: contradict each other; give one of them")
        self._refuse_remeshed_tile(tile=self.tile)
        if self.source.suffix.lower() != MODEL:
            raise InputError(
                f"remesh: {self.source} is a mesh already; give the model, or remesh it in Python: "
                "o3l.remesh(mesh, edge)"
            )

    def _refuse_remeshed_tile(self, *, tile: bool) -> None:
        if tile and self.remesh is not None:
            raise InputError("remesh: opposite walls of a tile must match; leave it out, or give a region of the leaf")

    def run(self, journal: Journal | None = None) -> str:
        """Export; return a line that says what was written."""
        self.check()
        journal = journal or Journal()
        with journal.stage("mesh" if self.source.suffix.lower() == MODEL else "read"):
            mesh, model = self._mesh()
            mesh = mesh if self.part is None else part_of(mesh, self.part)
        scalars = {}
        if self.scalars:
            with journal.stage("scalars"):
                scalars = self._scalars(mesh, model)
        with journal.stage("write") as progress:
            return self._write(self._moved(mesh), scalars, progress)

    def _mesh(self) -> tuple[LabelledMesh, Any]:
        """Return the mesh of the source, and the model where there is one."""
        if self.source.suffix.lower() != MODEL:
            found = read_labelled_mesh(self.source)
            unit = self.unit or found.unit
            model = None if self.field is None else load(self.field)
            return LabelledMesh(found.mesh, found.labels, found.names, unit), model
        model = load(self.source)
        if self.spacing is None:
            raise InputError(f"spacing: {self.source} is a model; give the step to mesh it at")
        spacing = require_positive(self.spacing, "spacing")
        if isinstance(model, TiledField | PatchBlend):
            self._refuse_remeshed_tile(tile=True)
            made = extract_flat_tile(model, 1.0, spacing)
        elif not isinstance(model, MultiscaleLeaf):
            raise InputError(
                f"{self.source}: holds a {type(model).__name__}, which has no surface; give a leaf's model"
            )
        elif self.tile:
            made = model.extract_tile(spacing)
        else:
            planning, extracting = split(1, 2)
            with planning:
                plan = model.plan_mesh(spacing, self.region, closed=not self.sheets)
            with extracting:
                made = plan.extract(remesh=self.edge)
        return LabelledMesh(made.mesh, made.labels, unit=model.unit), model

    def _scalars(self, mesh: LabelledMesh, model: Any) -> dict[str, FloatArray]:
        """Return what is asked of the leaf's field at the vertices."""
        if not isinstance(model, MultiscaleLeaf) or self.tile:
            raise InputError("scalar: is asked of a leaf's field; give its model (--field leaf.o3l)")
        vertices = mesh_arrays(mesh.mesh)[0]
        calls: dict[str, Callable[[MultiscaleLeaf, FloatArray], FloatArray]]
        calls = {"curvature": MultiscaleLeaf.mean_curvature, "deviation": field_deviation}
        return {name: calls[name](model, vertices) for name in self.scalars}

    def _moved(self, mesh: LabelledMesh) -> LabelledMesh:
        """Return the mesh with the new origin."""
        if self.origin is None:
            return mesh
        vertices, triangles = mesh_arrays(mesh.mesh)
        moved = build_mesh(vertices - as_points(self.origin, "origin", dim=3), triangles)
        return LabelledMesh(moved, mesh.labels, mesh.names, mesh.unit)

    def _write(self, mesh: LabelledMesh, scalars: dict[str, FloatArray], progress: Progress) -> str:
        """Write what was asked for; return a line about it."""
        step, ours = self.step or 0.0, mesh.unit or "of no stated unit"
        if self.what == "mesh":
            how: dict[str, Any] = {"consumer": self.consumer, "to_unit": self.to_unit, "scalars": scalars}
            export_mesh(self.output, mesh, **how, progress=progress)
            return f"{len(mesh.mesh.triangles):,} triangles"
        if self.what == "distance":
            box = None if self.bounds is None else np.array(self.bounds) - (self.origin or (0.0, 0.0, 0.0))
            export_distance(self.output, mesh, step, box, to_unit=self.to_unit, progress=progress)
            return f"distances at {step:g} {ours}"
        if self.what == "surface-particles":
            found = sample_particles(mesh, step, progress=progress)
        else:
            found = fill_particles(mesh, step, progress=progress)
        export_particles(self.output, found, to_unit=self.to_unit)
        return f"{len(found.points):,} particles"


def part_of(mesh: LabelledMesh, name: str) -> LabelledMesh:
    """Return the triangles of one label, and their vertices.

    Raises
    ------
    InputError
        If the mesh has no labels, or none of that name.
    """
    if mesh.labels is None:
        raise InputError("part: the mesh has no labels; give one that o3dleaf wrote as PLY, OBJ or STL")
    number = mesh.names.index(require_choice(name, mesh.names, "part"))
    vertices, triangles = mesh_arrays(mesh.mesh)
    kept = mesh.labels == number
    if not kept.any():
        raise InputError(f"part: no triangle is {name}; choose another part")
    return LabelledMesh(
        build_mesh(*drop_unused_vertices(vertices, triangles[kept])), mesh.labels[kept], mesh.names, mesh.unit
    )


def field_deviation(leaf: MultiscaleLeaf, points: FloatArray) -> FloatArray:
    r"""Return the (n,) signed distances to the leaf's faces to first order, −G/\|∇G\|; negative inside, 0 where ∇G is.

    At the rim of a closed mesh, where its surface is not G = 0, they say nothing.
    """
    slope = np.linalg.norm(leaf.gradient(points), axis=1)
    return np.asarray(-leaf(points) / np.where(slope > 0, slope, np.inf))
