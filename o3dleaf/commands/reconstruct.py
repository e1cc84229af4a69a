"""`o3dleaf reconstruct`: read a cloud, make its surface, and write what was requested."""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.patch import MODEL, resumed
from o3dleaf.core import journal
from o3dleaf.core.arguments.kinds import Positive, SmoothingValue
from o3dleaf.core.errors import InputError
from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import argument, option, output
from o3dleaf.core.jobs.shared import ColumnsOption, ResumeOption, UnitOption
from o3dleaf.core.jobs.words import number_or_word, place_of
from o3dleaf.core.journal import stage

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
    from o3dleaf.surface.mesh.mesh_report import MeshReport
    from o3dleaf.surface.reconstruction.closing import Closed

LABELS = {
    "distance": "distance to the data",
    "weight": "sampling density (1: that of a whole cloud)",
    "residual": "distance of the data from the surface",
}
"""Label of the color bar of each measure."""


SCENE = ".glb"
"""Suffix of what `o3dleaf export` makes of a mesh whose unit is known."""


CLOSED: "dict[str, Closed]" = {"auto": "auto", "yes": True, "no": False}
"""What `create_from_point_cloud_rbfpu` calls them."""


@dataclass(frozen=True)
class ReconstructJob(UnitOption, ColumnsOption, ResumeOption, LongJob):
    """Reconstruct a surface from any point cloud: open where the data are open, closed where they are closed."""

    cloud: Path = argument(
        "Any point cloud, with normals or without: PLY, XYZ, TXT, CSV, LAS, E57, NPY, ...", reads=True
    )
    output: Path = output("o3dleaf.io.triangle_mesh:SUFFIXES")
    spacing: Positive | None = option(
        None, "Mesh spacing (chosen from the points if not given)", unit="the cloud's unit"
    )
    rho: SmoothingValue = option(
        "gcv", "Smoothing, the paper's rho in unit³, or 'gcv'.", kind=str, parse=number_or_word
    )
    local: str = option("rbf", "Local fit in each ball: rbf, hermite, curl-free, mls or auto.")
    viewpoint: Any = option(
        None,
        "Where the cloud was scanned from, X,Y,Z: normals are turned to it",
        unit="the cloud's unit",
        kind=str,
        parse=place_of,
    )
    closed: str = option(
        "auto",
        "Close all gaps in the data (yes), none (no), or none that is wide but what only the fit left open (auto).",
        choices=tuple(CLOSED),
    )
    untrimmed: bool = option(False, "Keep the surface up to four spacings beyond the data.", "--untrimmed")
    measure: str = option(
        "auto",
        "Color of the mesh: the cloud's own or, where it has none, the distance to the data (auto); distance, weight "
        "(sampling density) or residual.",
        choices="o3dleaf.surface.reconstruction.finish:SHOWN",
    )
    model: Path | None = option(None, "Also write the field as a model (.o3l).", writes=MODEL)
    picture: Path | None = option(
        None, "Also write a picture of the colored mesh.", writes="o3dleaf.output.view.picture:SUFFIXES"
    )

    def check(self) -> None:
        """Refuse a scene for a mesh, an unknown unit, and a viewpoint that is no place."""
        from o3dleaf.core.checks.attributes import as_viewpoint

        if self.output.suffix.lower() == SCENE:
            made = f"o3dleaf export {self.output.with_suffix('.ply')} --for web --unit UNIT -o {self.output}"
            raise InputError(f"{self.output}: is a scene in meters; write a .ply, and make one of it by `{made}`")
        super().check()
        if self.viewpoint is not None:
            as_viewpoint(self.viewpoint, 1)

    def estimate(self) -> "list[Need]":
        """Return what the points of the file take, to be read and to be made a surface."""
        from o3dleaf.io.clouds.counts import count_points
        from o3dleaf.surface.reconstruction.reconstruct import need_for

        return [need_for(count_points(self.cloud))]

    def work(self) -> "MeshReport":
        """Make the surface, write it, and return what it is."""
        with resumed(self.output, self) if self.resume else nullcontext():
            return self.build()

    def build(self) -> "MeshReport":
        """Make the surface, write it, and return what it is."""
        import open3d as o3d

        from o3dleaf.io.point_cloud import has_faces, read_point_cloud
        from o3dleaf.io.triangle_mesh import write_mesh
        from o3dleaf.output.view.picture import render
        from o3dleaf.output.view.scene import Scalars
        from o3dleaf.surface.mesh.mesh_report import mesh_report
        from o3dleaf.surface.reconstruction.reconstruct import create_from_point_cloud_rbfpu
        from o3dleaf.surface.reconstruction.trim import trim_to_data

        with stage("read cloud"):
            cloud = read_point_cloud(self.cloud, finite=False, columns=self.columns)
        if has_faces(self.cloud):
            count = len(cloud.points)
            journal.note(f"{self.cloud} is a mesh: its {count:,} vertices are taken for points, its faces are not used")
        mesh, field = create_from_point_cloud_rbfpu(
            o3d.t.geometry.PointCloud.from_legacy(cloud, o3d.core.float64),
            self.spacing,
            self.rho,
            local=self.local,
            unit=self.unit,
            viewpoint=self.viewpoint,
            merge=self.merged,
            measure=self.measure,
            closed=CLOSED[self.closed],
            trim=None if self.untrimmed else trim_to_data,
        )
        with stage("write mesh"):
            write_mesh(mesh, self.output)
        if self.model is not None:
            with stage("write model"):
                field.save(self.model)
        colored = cloud.has_colors()
        del cloud, field  # of what memory is stated, the check needs what they hold
        if self.picture is not None:
            with stage("draw picture"):
                values = Scalars(mesh.vertex[self.shown].numpy().ravel(), self.label)
                own = self.measure == "auto" and colored
                render(mesh, self.picture, scalars=None if own else values, unit=self.unit)
        with stage("check mesh"):
            return mesh_report(mesh, unit=self.unit)

    def merged(self, cloud: "OrientedCloud") -> "OrientedCloud":
        """Return a cloud with its points averaged as by default, if the check of its mesh has room at the end."""
        from o3dleaf.surface.cloud.downsample import adaptive_down_sample
        from o3dleaf.surface.reconstruction.reconstruct import need_for_mesh

        averaged = adaptive_down_sample(cloud)
        averaged.compact()
        need_for_mesh(averaged, self.spacing, self.unit, reported=True).require()
        return averaged

    @property
    def shown(self) -> str:
        """The measure that a picture of a cloud without colors shows."""
        return "distance" if self.measure == "auto" else self.measure

    @property
    def label(self) -> str:
        """Label of the color bar."""
        return LABELS[self.shown] + (f" / {self.unit}" if self.unit and self.shown != "weight" else "")

    def line(self, summary: "MeshReport") -> str:
        """Return what the surface is."""
        from o3dleaf.core.units import measure_in_words, tell_count

        crossings = summary.self_intersections
        parts = (
            f"{summary.triangles:,} triangles",
            tell_count(summary.components, "piece"),
            tell_count(summary.boundary_loops, "rim") if summary.boundary_loops else "closed",
            "genus unknown" if summary.genus is None else f"genus {summary.genus}",
            "manifold" if summary.manifold else "not manifold",
            f"crosses itself {tell_count(crossings, 'time')}" if crossings else "no crossings",
            f"area {measure_in_words(summary.area, summary.unit, power=2)}",
        )
        return f"{self.output}: {', '.join(parts)}"
