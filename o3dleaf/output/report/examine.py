"""Inspection of a mesh: its figures, its check against requirements, and the page and JSON of both."""

from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.atomic_files import require_writable, write_json, write_text
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.journal import stage
from o3dleaf.core.mesh_arrays import MeshLike
from o3dleaf.output.report.compose import compose_page
from o3dleaf.output.report.requirements import CheckResult, check_report, parse_requirements, require_inputs
from o3dleaf.output.view.scene import own_colors
from o3dleaf.surface.mesh.inspection import Inspection, inspect_mesh


@dataclass(frozen=True, eq=False, repr=False)
class Examination:
    """Inspection of a mesh, and its check against requirements.

    Attributes
    ----------
    inspection : Inspection
        Its `report` has the figures.
    result : CheckResult
        Each requirement, met or not.
    points : (k, 3) ndarray, optional
        The scan it was measured against, in the mesh's unit.
    colors : (n, 3) ndarray, optional
        Linear RGB of its vertices, as pictures show them.
    """

    inspection: Inspection
    result: CheckResult
    points: FloatArray | None = None
    colors: FloatArray | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.inspection.report.triangles:,} triangles, {self.result})"

    @classmethod
    def of(
        cls,
        mesh: MeshLike,
        *,
        field: Field | None = None,
        cloud: CloudLike | None = None,
        unit: str | None = None,
        require: str = "",
    ) -> "Examination":
        """Examine a mesh; the arguments are those of `write_report`."""
        require_inputs(parse_requirements(require), {"field": field is not None, "cloud": cloud is not None})
        points = None if cloud is None else points_of(cloud, "cloud", least=2)
        with stage("figures"):
            inspection = inspect_mesh(mesh, field, points, unit)
        return cls(inspection, check_report(inspection.report, require), points, own_colors(mesh))

    @cached_property
    def figures(self) -> dict[str, Any]:
        """The figures of the report and the verdict as one flat dictionary, ready for JSON."""
        return self.inspection.report.to_dict() | self.result.to_dict()

    def write_json(self, path: str | PathLike[str]) -> None:
        """Write the figures and the verdict as one flat JSON object, whole or not at all."""
        write_json(self.figures, path)

    def write_html(self, path: str | PathLike[str], title: str) -> None:
        """Write the page, whole or not at all."""
        page = compose_page(self.inspection, self.result, self.points, title, colors=self.colors)
        write_text(page, path)


@checked
def write_report(
    mesh: MeshLike,
    path: str | PathLike[str],
    *,
    field: Field | None = None,
    cloud: CloudLike | None = None,
    unit: Unit | None = None,
    require: str = "",
    title: str = "Mesh",
) -> CheckResult:
    """Write a report on a mesh as one HTML file that needs no network, or as JSON, by the suffix of the name.

    The page has the verdict, every figure of `mesh_report`, histograms, the mesh from several sides,
    close-ups of the worst triangles and of every defect, maps of its distance to field and scan, and
    a view that can be turned. A large mesh is drawn with fewer triangles; all figures are of the mesh
    itself. A JSON file is one flat object: the figures, ``verdict`` ("passed", "failed" or "not
    asked"), ``required`` and ``failures``.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    path : path-like
        A .html or .json file.
    field : Field, optional
        What the mesh is a surface of.
    cloud : (n, 3) array_like or Open3D point cloud, optional
        The scan, in the mesh's unit.
    unit : str, optional
        The unit of the vertices ("mm", "um", ...); that of the field by default.
    require : str
        What the mesh must be, "watertight,components=1,min-angle=10"; see `check_report`.
    title : str
        The page's heading.

    Returns
    -------
    CheckResult

    Raises
    ------
    InputError, UnitError
        If the first argument is no mesh, a requirement or the unit is unknown, or the file is of another kind.
    """
    target = require_writable(path, (".html", ".htm", ".json"))
    examined = Examination.of(mesh, field=field, cloud=cloud, unit=unit, require=require)
    if target.suffix.lower() == ".json":
        examined.write_json(target)
    else:
        examined.write_html(target, title)
    return examined.result


def require_field(model: object, name: str) -> Field:
    """Return a model if it is a field, else raise `InputError`."""
    if not isinstance(model, Field):
        raise InputError(
            f"{name}: contains a {type(model).__name__}, which has no surface of its own; give a leaf or an interpolant"
        )
    return model
