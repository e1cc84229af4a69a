"""`o3dleaf export`: a mesh or a model in; a mesh, particles or distances for the next program out."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.droplet.case_options import DropletOptions
from o3dleaf.commands.patch import MODEL
from o3dleaf.core.arguments.kinds import Count, Positive, Unit
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import Names, argument, option, output, table
from o3dleaf.core.jobs.shared import UnitOption
from o3dleaf.core.jobs.words import corners_of
from o3dleaf.core.journal import stage
from o3dleaf.core.progress import split

if TYPE_CHECKING:
    from o3dleaf.core.checks.arrays import FloatArray
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.io.labelled_mesh import LabelledMesh

WHAT = {
    "mesh": "o3dleaf.output.export.consumers:SUFFIXES",
    "surface-particles": "o3dleaf.output.export.particles:SUFFIXES",
    "volume-particles": "o3dleaf.output.export.particles:SUFFIXES",
    "distance": "o3dleaf.io.grid:SUFFIXES",
}
"""What can be exported, and where the suffixes of its files stand."""


OF_MODEL: dict[str, Any] = {"needs": ("saved_model",)}
"""Of options that a mesh has no use for."""


@dataclass(frozen=True)
class ExportJob(DropletOptions, UnitOption, LongJob):
    """Write a mesh, particles or distances for the next program, in its format and unit; see docs/consumers."""

    source: Path = argument("A mesh (PLY, STL, OBJ, OFF), or a model (.o3l) that is meshed first.", reads=True)
    output: Path = output(())
    consumer: str | None = option(
        None,
        "The next program: openfoam, dualsphysics, paraview, web, blender or gmsh; droplet, for a folder with a case "
        "of OpenFOAM; sph, for particles in layers; retention, for facets; evolver, for a static droplet.",
        "--for",
        choices="o3dleaf.output.export.consumers:PROGRAMS",
        unless=("points",),
    )
    what: str = option(
        "mesh", "'mesh', 'surface-particles', 'volume-particles' or 'distance', of a closed mesh.", choices=tuple(WHAT)
    )
    to_unit: Unit | None = option(None, "Unit of the file; by default that of the program, or --unit.")
    spacing: Positive | None = option(None, "Mesh spacing if SOURCE is a model", unit="its unit", **OF_MODEL)
    remesh: Positive | None = option(
        None,
        "Remesh the leaf of a model to this edge length, in its unit; "
        "for openfoam, dualsphysics and gmsh to the spacing by default. Tiles are never remeshed.",
        **OF_MODEL,
        unless=("tile", "no_remesh"),
    )
    no_remesh: bool = option(
        False,
        "Do not remesh for these programs: faster, but with slivers.",
        "--no-remesh",
        needs=("remeshing_program",),
    )
    region: Any = option(
        None,
        "Part of the leaf, in leaf coordinates: ALONG0 ACROSS0 ALONG1 ACROSS1.",
        kind=tuple[float, float, float, float],
        parse=corners_of,
        **OF_MODEL,
        unless=("tile",),
    )
    part: str | None = option(None, "Export only this part: adaxial, abaxial or rim.")
    sheets: bool = option(False, "Two open sheets instead of one closed solid.", "--open", **OF_MODEL, unless=("tile",))
    tile: bool = option(False, "One flat period as a closed block, instead of the leaf.", **OF_MODEL)
    step: Positive | None = option(
        None, "Spacing of particles or grid points", unit="unit", needs=("points", "consumer=sph")
    )
    layers: Count = option(
        3, "Layers of particles, the first on the surface, the next ones a step deeper each.", needs=("consumer=sph",)
    )
    vertical: tuple[float, float, float] = option(
        (0.0, 0.0, 1.0), "Direction X Y Z that inclinations of facets are measured to.", needs=("consumer=retention",)
    )
    bounds: Any = option(
        None,
        "Box of the distance grid (by default that of the mesh): X0 Y0 Z0 X1 Y1 Z1",
        unit="unit",
        kind=tuple[float, float, float, float, float, float],
        parse=corners_of,
        needs=("what=distance",),
    )
    origin: tuple[float, float, float] | None = option(None, "Point X Y Z that becomes the origin", unit="unit")
    scalar: tuple[str, ...] = option(
        (),
        "Values at the vertices: curvature or deviation; repeat for more.",
        kind=list[str],
        parse=tuple,
        choices="o3dleaf.output.export.leaf_scalars:SCALARS",
        unless=("points", "tile"),
    )
    field: Path | None = option(
        None,
        "Model of the leaf that these values are computed from, if SOURCE is a mesh.",
        reads=True,
        needs=("scalar",),
        unless=("saved_model",),
    )

    @property
    def edge(self) -> float | None:
        """Edge length that the leaf is remeshed to: the given one, or the mesh spacing if a solver is to read it.

        None: the surface stays as it was polygonized. A tile's opposite walls must match, and so it always does.
        """
        if self.no_remesh or self.tile or self.remesh is not None or not self.remeshing_program:
            return self.remesh
        return self.spacing

    @property
    def remeshing_program(self) -> bool:
        """Whether the leaf of a model is remeshed for the next program."""
        from o3dleaf.output.export.consumers import CONSUMERS

        return self.saved_model and self.consumer in CONSUMERS and CONSUMERS[self.consumer].solver

    @property
    def saved_model(self) -> bool:
        """Whether SOURCE is a model."""
        return self.source.suffix.lower() in table(MODEL)

    @property
    def points(self) -> bool:
        """Whether --what is particles or distances."""
        return self.what != "mesh"

    def check(self) -> None:
        """Refuse a file that is none for the next program, and what does not go together."""
        from o3dleaf.core.atomic_files import require_writable
        from o3dleaf.output.export.consumers import CONSUMERS, OTHERS

        super().check()
        if self.consumer == "droplet":
            self.check_case(self)
            return
        suffixes = OTHERS | {name: each.suffixes for name, each in CONSUMERS.items()}
        require_writable(self.output, suffixes[self.consumer] if self.consumer else table(WHAT[self.what]))
        if self.consumer == "evolver":
            self.check_place(self, "evolver")
            return
        made = self.what if self.points else self.consumer
        if (self.points or made == "sph") and self.step is None:
            raise InputError(f"step: is missing for {made}; give it in the unit of {self.source.name}")
        if self.saved_model and self.spacing is None:
            raise InputError(f"spacing: is missing, and {self.source} is a model; give the mesh spacing")

    def outputs(self) -> list[tuple[Path, Names]]:
        """Return the file that is written; a case is a folder, which is looked at by itself."""
        return [] if self.consumer == "droplet" else super().outputs()

    def estimate(self) -> "list[Need]":
        """Return what the triangles of a mesh take; what is made of a model is known when it is read."""
        from o3dleaf.core.resources.measured import FILED_TRIANGLE
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.io.clouds.counts import count_triangles

        if self.saved_model:
            return []
        count = count_triangles(self.source)
        return [need_of(FILED_TRIANGLE * count, f"export: {count:,} triangles", "simplify the mesh first")]

    def work(self) -> str:
        """Export, and return a line about what was written."""
        from o3dleaf.output.export.consumers import OTHERS
        from o3dleaf.output.export.selection import moved, part_of

        if self.consumer == "droplet":
            return self.write_cases(self.source, self.output, self.spacing)
        if self.consumer == "evolver":
            return self.write_static_drop(self.source, self.output)
        with stage("mesh" if self.saved_model else "read"):
            mesh, model = self.mesh()
            mesh = mesh if self.part is None else part_of(mesh, self.part)
        scalars = {}
        if self.scalar:
            with stage("scalars"):
                scalars = self.scalars(mesh, model)
        with stage("write"):
            if self.consumer in OTHERS:
                return self.hand_over(mesh, model)
            return self.write(mesh if self.origin is None else moved(mesh, self.origin), scalars)

    def mesh(self) -> "tuple[LabelledMesh, Any]":
        """Return the mesh of the source, and the model where there is one."""
        from o3dleaf.io.triangle_mesh import read_mesh
        from o3dleaf.leaf.saved.models import load

        if not self.saved_model:
            given = read_mesh(self.source)
            model = None if self.field is None else load(self.field)
            return replace(given, unit=self.unit or given.unit), model
        model = load(self.source)
        return replace(self.surface(model), unit=model.unit), model

    def surface(self, model: Any) -> "LabelledMesh":
        """Return the surface of a model, or one period of it."""
        from o3dleaf.core.checks.scalars import require_positive
        from o3dleaf.fitting.pu.interpolant import PUInterpolant
        from o3dleaf.fitting.rbf.interpolant import RBFInterpolant
        from o3dleaf.leaf.meshing import extract_flat_tile
        from o3dleaf.leaf.multiscale import MultiscaleLeaf
        from o3dleaf.leaf.texture.patches import PatchBlend
        from o3dleaf.leaf.texture.tiling import TiledField
        from o3dleaf.leaf.texture.wang.wang_field import WangField

        spacing = require_positive(self.spacing or 0.0, "spacing")
        if isinstance(model, TiledField | PatchBlend | WangField):
            if self.remesh is not None:
                raise InputError(
                    "remesh: opposite walls of a tile must match; leave it out, or give the model of a leaf"
                )
            return extract_flat_tile(model, 1.0, spacing)
        if isinstance(model, PUInterpolant | RBFInterpolant):
            raise InputError(
                f"{self.source}: is a field without the points that say where its surface ends; export the mesh that "
                f"`o3dleaf reconstruct` wrote with it, or make one by o3l.extract_isosurface(o3l.load("
                f"{str(self.source)!r}), {spacing:g}, seeds=points, within=o3l.distance_mask(points))"
            )
        if not isinstance(model, MultiscaleLeaf):
            raise InputError(
                f"{self.source}: contains a {type(model).__name__}, which has no surface; give the model of a leaf"
            )
        if self.tile:
            return model.extract_tile(spacing)
        planning, extracting = split(1, 2)
        with planning:
            plan = model.plan_mesh(spacing, self.region, closed=not self.sheets)
        with extracting:
            return plan.extract(remesh=self.edge)

    def scalars(self, mesh: "LabelledMesh", model: Any) -> "dict[str, FloatArray]":
        """Return the values of the leaf's field at the vertices."""
        from o3dleaf.core.mesh_arrays import mesh_arrays
        from o3dleaf.leaf.multiscale import MultiscaleLeaf
        from o3dleaf.output.export.leaf_scalars import SCALARS

        if not isinstance(model, MultiscaleLeaf) or self.tile:
            raise InputError("scalar: is computed from the field of a leaf; give its model (--field leaf.o3l)")
        vertices = mesh_arrays(mesh.mesh)[0]
        return {name: SCALARS[name](model, vertices) for name in self.scalar}

    def write(self, mesh: "LabelledMesh", scalars: "dict[str, FloatArray]") -> str:
        """Write what was requested; return a line about it."""
        import numpy as np

        from o3dleaf.output.export.consumers import export_mesh
        from o3dleaf.output.export.distance_grid import export_distance
        from o3dleaf.output.export.particles import export_particles, fill_particles, sample_particles

        step = self.step or 0.0
        if self.what == "mesh":
            export_mesh(mesh, self.output, consumer=self.consumer, to_unit=self.to_unit, scalars=scalars)
            return f"{len(mesh.mesh.triangles):,} triangles"
        if self.what == "distance":
            box = None if self.bounds is None else np.array(self.bounds) - (self.origin or (0.0, 0.0, 0.0))
            export_distance(mesh, self.output, step, box, to_unit=self.to_unit)
            return f"distances at {step:g} {mesh.unit or 'of no stated unit'}"
        particles = (sample_particles if self.what == "surface-particles" else fill_particles)(mesh, step)
        export_particles(particles, self.output, to_unit=self.to_unit)
        return f"{len(particles.points):,} particles"

    def hand_over(self, mesh: "LabelledMesh", model: Any) -> str:
        """Write what is no mesh for a program that is known by name; return a line about it."""
        from o3dleaf.leaf.multiscale import MultiscaleLeaf
        from o3dleaf.output.export.boundary import layer_counts, sample_boundary
        from o3dleaf.output.export.facets import export_facets, facets_of
        from o3dleaf.output.export.particles import export_particles

        leaf = model if isinstance(model, MultiscaleLeaf) and not self.tile else None
        if self.consumer == "retention":
            facets = facets_of(mesh, field=leaf, vertical=self.vertical)
            export_facets(facets.moved(self.origin or (0.0, 0.0, 0.0)), self.output, to_unit=self.to_unit)
            return f"{len(facets.areas):,} facets, {', '.join(sorted(set(facets.sides)))}"
        found = sample_boundary(mesh, self.step or 0.0, layers=self.layers, field=leaf)
        found = replace(found, points=found.points - (self.origin or (0.0, 0.0, 0.0)))
        export_particles(found, self.output, to_unit=self.to_unit)
        counts = layer_counts(found)
        return f"{len(found.points):,} particles in {len(counts)} layers, {' + '.join(f'{n:,}' for n in counts)}"

    def line(self, summary: str) -> str:
        """Return what was written."""
        return f"{self.output}: {summary}"
