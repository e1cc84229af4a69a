"""Report, defects and deviations of a mesh from one pass over it."""

from dataclasses import dataclass

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, Unit
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import MeshLike
from o3dleaf.surface.mesh.defects import Defects, defects_of
from o3dleaf.surface.mesh.deviation import Deviation
from o3dleaf.surface.mesh.measurements import MeshMeasurements
from o3dleaf.surface.mesh.mesh_report import MeshReport, measure_and_compare, report_of


@dataclass(frozen=True, eq=False, repr=False)
class Inspection:
    """Report, defects, deviations and measurements of one mesh.

    Attributes
    ----------
    report : MeshReport
        The figures.
    defects : Defects
        The triangles of every defect.
    deviation : Deviation
        Distances to field and scan, one a vertex and one a point, for color maps and histograms.
    measurements : MeshMeasurements
        Pieces, loops, angles, areas and edge lengths, one a triangle or an edge.
    """

    report: MeshReport
    defects: Defects
    deviation: Deviation
    measurements: MeshMeasurements

    def __repr__(self) -> str:
        return f"Inspection({self.report!r}, {self.defects!r}, {self.deviation!r})"


@checked
def inspect_mesh(
    mesh: MeshLike,
    field: Field | None = None,
    cloud: CloudLike | None = None,
    unit: Unit | None = None,
    *,
    isovalue: Finite = 0.0,
) -> Inspection:
    """Return report, defects and deviations of a mesh, for the price of one; the arguments are `mesh_report`'s.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    field, cloud, unit, isovalue
        As in `mesh_report`.

    Raises
    ------
    InputError, UnitError
        As `mesh_report`.
    """
    measured, deviation = measure_and_compare(mesh, field, cloud, unit, isovalue)
    return Inspection(report_of(measured, deviation), defects_of(measured), deviation, measured)
