"""A mesh examined: its figures, whether it is what it must be, and the page and the JSON that say so."""

from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError
from o3dleaf.core.field import Field
from o3dleaf.core.journal import Journal
from o3dleaf.core.mesh_arrays import MeshLike
from o3dleaf.core.units import check_unit
from o3dleaf.io.point_cloud import read_point_cloud
from o3dleaf.io.triangle_mesh import read_triangle_mesh
from o3dleaf.leaf.models import load
from o3dleaf.output.report.compose import compose_page
from o3dleaf.output.report.describe import write_json
from o3dleaf.output.report.requirements import Verdict, judge, parse_requirements, require_inputs
from o3dleaf.output.report.words import in_words
from o3dleaf.surface.mesh.inspection import Inspection, inspect_mesh


@dataclass(frozen=True, eq=False)
class Examination:
    """What was found of a mesh.

    Attributes
    ----------
    inspection : Inspection
        Its `report` has the figures.
    verdict : Verdict
    points : (k, 3) ndarray, optional
        The scan it was measured against, in the mesh's unit.
    """

    inspection: Inspection
    verdict: Verdict
    points: FloatArray | None = None

    @classmethod
    def of(
        cls,
        mesh: MeshLike,
        *,
        field: Field | None = None,
        cloud: CloudLike | None = None,
        unit: str | None = None,
        require: str = "",
        journal: Journal | None = None,
    ) -> "Examination":
        """Examine a mesh; the arguments are those of `write_report`."""
        requirements = parse_requirements(require) if require.strip() else ()
        require_inputs(requirements, {"field": field is not None, "cloud": cloud is not None})
        points = None if cloud is None else points_of(cloud, "cloud", least=2)
        with (journal or Journal()).stage("figures"):
            inspection = inspect_mesh(mesh, field, points, unit)
        return cls(inspection, judge(inspection.report, requirements), points)

    @cached_property
    def figures(self) -> dict[str, Any]:
        """The figures of the report and the verdict as one flat dictionary, ready for JSON."""
        return self.inspection.report.to_dict() | self.verdict.to_dict()

    def write_json(self, path: str | PathLike[str]) -> None:
        """Write the figures and the verdict as one flat JSON object, whole or not at all."""
        write_json(path, self.figures)

    def write_html(self, path: str | PathLike[str], title: str, journal: Journal | None = None) -> None:
        """Write the page, whole or not at all."""
        with journal or nullcontext():
            page = compose_page(self.inspection, self.verdict, self.points, title)
        with whole_file(path) as temporary:
            temporary.write_text(page, encoding="utf-8")


def write_report(
    path: str | PathLike[str],
    mesh: MeshLike,
    *,
    field: Field | None = None,
    cloud: CloudLike | None = None,
    unit: str | None = None,
    require: str = "",
    title: str = "Mesh",
    journal: Journal | None = None,
) -> Verdict:
    """Write a report on a mesh as one HTML file that needs no network, or as JSON, by the suffix of the name.

    The page has the verdict, every figure of `mesh_report`, histograms, the mesh from several sides,
    close-ups of the worst triangles and of every defect, maps of its distance to field and scan, and
    a view that can be turned. A large mesh is drawn with fewer triangles; all figures are of the mesh
    itself. A JSON file is one flat object: the figures, ``verdict`` ("passed", "failed" or "not
    asked"), ``required`` and ``failures``.

    Parameters
    ----------
    path : path-like
        A .html or .json file.
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    field : Field, optional
        What the mesh is a surface of.
    cloud : (n, 3) array_like or Open3D point cloud, optional
        The scan, in the mesh's unit.
    unit : str, optional
        The unit of the vertices ("mm", "um", ...); that of the field by default.
    require : str
        What the mesh must be, "watertight,components=1,min-angle=10"; see `check_mesh`.
    title : str
        The page's heading.
    journal : Journal, optional
        Told of the stages.

    Returns
    -------
    Verdict

    Raises
    ------
    InputError, UnitError
        If it is no mesh, a requirement or the unit is unknown, or the file is of another kind.
    """
    target = require_writable(path, (".html", ".htm", ".json"))
    found = Examination.of(mesh, field=field, cloud=cloud, unit=unit, require=require, journal=journal)
    if target.suffix.lower() == ".json":
        found.write_json(target)
    else:
        found.write_html(target, title, journal)
    return found.verdict


def examine_files(
    mesh: Path,
    *,
    field: Path | None = None,
    cloud: Path | None = None,
    unit: str | None = None,
    require: str = "",
    html: Path | None = None,
    journal: Journal,
) -> Examination:
    """Examine the mesh of a file against the model and the scan of others, and write the page if one is asked for.

    Raises
    ------
    InputError, UnitError
        If a file is not what it should be, a requirement is unknown or needs one that is not given,
        or a file could not be written.
    """
    requirements = parse_requirements(require) if require.strip() else ()
    require_inputs(requirements, {"field": field is not None, "cloud": cloud is not None})
    check_unit(unit)
    if html is not None:
        require_writable(html, (".html", ".htm"))
    with journal.stage("read"):
        read = read_triangle_mesh(mesh)
        model = None if field is None else require_field(load(field), str(field))
        scan = None if cloud is None else read_point_cloud(cloud, least=2)
    found = Examination.of(read, field=model, cloud=scan, unit=unit, require=require, journal=journal)
    if html is not None:
        found.write_html(html, mesh.name, journal)
    return found


def verdict_lines(found: Examination, *, figures: bool = True) -> list[str]:
    """Return what a terminal shows: the figures, each failure in a line, the verdict."""
    report, verdict = found.inspection.report, found.verdict
    lines = [
        f"{name:>24}  {in_words(name, value, report.unit)}"
        for name, value in report.to_dict().items()
        if figures and value is not None and name != "angle_histogram"
    ]
    lines += [f"{'not met':>24}  {each}" for each in verdict.failures]
    met = (
        f" ({len(verdict.findings) - len(verdict.failures)} of {len(verdict.findings)} met)" if verdict.findings else ""
    )
    return [*lines, f"{'verdict':>24}  {verdict.word}{met}"]


def require_field(model: object, name: str) -> Field:
    """Return a model if it is a field, else raise `InputError`."""
    if not isinstance(model, Field):
        raise InputError(
            f"{name}: holds a {type(model).__name__}, which has no surface of its own; give a leaf or an interpolant"
        )
    return model
