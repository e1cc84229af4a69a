"""One run of the reconstruction on files: read a cloud, make its surface, and write what was asked for."""

from dataclasses import dataclass
from pathlib import Path

import open3d as o3d

from o3dleaf.core.atomic_files import require_apart, require_writable
from o3dleaf.core.checks import require_choice
from o3dleaf.core.journal import Journal
from o3dleaf.core.units import check_unit
from o3dleaf.fitting.rbf.smoothing import Amount
from o3dleaf.io.model_file import SUFFIX as MODEL
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import SUFFIXES, write_triangle_mesh
from o3dleaf.output.view.picture import PIXELS, VECTORS, render
from o3dleaf.output.view.scene import Scalars
from o3dleaf.surface.mesh.mesh_report import MeshReport, mesh_report
from o3dleaf.surface.reconstruction.reconstruct import create_from_point_cloud_rbfpu
from o3dleaf.surface.reconstruction.trim import trim_to_support
from o3dleaf.surface.reconstruction.vertex_support import MEASURES

WORDS = {
    "distance": "distance to the data",
    "weight": "data that speak for it (1: all that a whole cloud would)",
    "residual": "data off the surface",
}


@dataclass(frozen=True)
class CloudRun:
    """What a run is asked for; the names are those of ``o3dleaf reconstruct``.

    Attributes
    ----------
    cloud, output : Path
    spacing : float, optional
        Mesh step, in the cloud's unit.
    rho : float or "gcv"
    local, measure : str
    trimmed : bool
        Whether what no data support is cut off.
    unit : str, optional
    model, picture : Path, optional
        Further files to write.
    """

    cloud: Path
    output: Path
    spacing: float | None = None
    rho: Amount = "gcv"
    local: str = "rbf"
    trimmed: bool = True
    measure: str = "distance"
    unit: str | None = None
    model: Path | None = None
    picture: Path | None = None

    def __post_init__(self) -> None:
        """Refuse, before the work, what could not be written after it."""
        require_apart([self.output, self.model, self.picture], [self.cloud])
        require_choice(self.measure, MEASURES, "measure")
        check_unit(self.unit)
        for path, suffixes in ((self.output, SUFFIXES), (self.model, (MODEL,)), (self.picture, PIXELS + VECTORS)):
            if path is not None:
                require_writable(path, suffixes)

    def run(self, journal: Journal) -> MeshReport:
        """Make the surface, write it, and return what it is."""
        with journal.stage("read cloud"):
            held = read_point_cloud(self.cloud, finite=False)
        mesh, field = create_from_point_cloud_rbfpu(
            o3d.t.geometry.PointCloud.from_legacy(held, o3d.core.float64),
            self.spacing,
            self.rho,
            local=self.local,
            unit=self.unit,
            measure=self.measure,
            trim=trim_to_support if self.trimmed else None,
            journal=journal,
        )
        with journal.stage("write mesh"):
            write_triangle_mesh(self.output, mesh)
        if self.model is not None:
            with journal.stage("write model"):
                field.save(self.model)
        if self.picture is not None:
            with journal.stage("draw picture"):
                shown = Scalars(mesh.vertex[self.measure].numpy().ravel(), WORDS[self.measure] + self._in_unit)
                render(mesh, self.picture, scalars=shown, unit=self.unit)
        with journal.stage("check mesh"):
            return mesh_report(mesh, unit=self.unit)

    @property
    def _in_unit(self) -> str:
        return f" / {self.unit}" if self.unit and self.measure != "weight" else ""


def in_a_line(found: MeshReport) -> str:
    """Return what a surface is, in one line for a terminal."""
    square = f" {found.unit}²" if found.unit else ""
    parts = (
        f"{found.triangles:,} triangles",
        _counted(found.components, "piece"),
        _counted(found.boundary_loops, "rim") if found.boundary_loops else "closed",
        "genus unknown" if found.genus is None else f"genus {found.genus}",
        "manifold" if found.manifold else "not manifold",
        f"crosses itself {_counted(found.self_intersections, 'time')}" if found.self_intersections else "no crossings",
        f"area {found.area:,.5g}{square}",
    )
    return ", ".join(parts)


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}" + "s" * (count != 1)
