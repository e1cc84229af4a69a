"""`o3dleaf qa`: a mesh examined against what it must be."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.jobs.job import LongJob
from o3dleaf.core.jobs.option import argument, option
from o3dleaf.core.jobs.shared import UnitOption
from o3dleaf.core.journal import stage

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need
    from o3dleaf.output.report.examine import Examination

FAILED = 1
"""Exit code of a mesh that is not what it must be."""


@dataclass(frozen=True)
class QaJob(UnitOption, LongJob):
    """Check a mesh: measurements, defects, requirements; exit code 1 if a requirement is not met."""

    mesh: Path = argument("Mesh to check: PLY, OBJ, STL or OFF.", reads=True)
    field: Path | None = option(None, "Model (.o3l) whose surface the mesh shows, to measure deviations.", reads=True)
    cloud: Path | None = option(None, "Scan to measure deviations, in the mesh's unit.", reads=True)
    require: str = option("", "Requirements, such as 'watertight,manifold,oriented,components=1,min-angle=10'.")
    html: Path | None = option(None, "Write a report with pictures, one file.", writes=(".html", ".htm"))
    json: Path | None = option(None, "Write measurements and result as JSON.", writes=())

    def check(self) -> None:
        """Refuse a requirement that there is not, or that needs a file which is not given."""
        from o3dleaf.output.report.requirements import parse_requirements, require_inputs

        super().check()
        given = {"field": self.field is not None, "cloud": self.cloud is not None}
        require_inputs(parse_requirements(self.require), given)

    def estimate(self) -> "list[Need]":
        """Return what the triangles of the file take."""
        from o3dleaf.core.resources.measured import REPORTED_TRIANGLE
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.io.clouds.counts import count_triangles

        count = count_triangles(self.mesh)
        return [need_of(REPORTED_TRIANGLE * count, f"report: {count:,} triangles", "simplify the mesh first")]

    def work(self) -> "Examination":
        """Examine the mesh, and write what was found as a page and as JSON."""
        from o3dleaf.io.point_cloud import read_point_cloud
        from o3dleaf.io.triangle_mesh import read_triangle_mesh
        from o3dleaf.leaf.saved.models import load
        from o3dleaf.output.report.examine import Examination, require_field

        with stage("read"):
            mesh = read_triangle_mesh(self.mesh)
            model = None if self.field is None else require_field(load(self.field), str(self.field))
            scan = None if self.cloud is None else read_point_cloud(self.cloud, least=2)
        examined = Examination.of(mesh, field=model, cloud=scan, unit=self.unit, require=self.require)
        if self.html is not None:
            examined.write_html(self.html, self.mesh.name)
        if self.json is not None:
            examined.write_json(self.json)
        return examined

    def lines(self, summary: "Examination") -> list[str]:
        """Return the figures, each failure in a line, and the verdict; of a quiet job no figures."""
        from o3dleaf.output.report.words import lines_of

        report, result = summary.inspection.report, summary.result
        lines = [] if self.quiet else lines_of(report.to_dict(), report.unit)
        lines += [f"{'not met':>24}  {each}" for each in result.failures]
        return [*lines, f"{'verdict':>24}  {result}"]

    def exit_code(self, summary: "Examination") -> int:
        """Return 1 for a mesh that is not what it must be."""
        return 0 if summary.result.passed else FAILED
