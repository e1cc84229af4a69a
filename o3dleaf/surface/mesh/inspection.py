"""One look at a mesh from which the report, the defects and the maps of its deviations are all read."""

from dataclasses import dataclass

from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import MeshLike, mesh_arrays
from o3dleaf.core.parallel import Progress
from o3dleaf.surface.mesh.defects import Defects, defects_of
from o3dleaf.surface.mesh.deviation import Deviation
from o3dleaf.surface.mesh.measurements import Anatomy
from o3dleaf.surface.mesh.mesh_report import MeshReport, report_of


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found out about a mesh, by one pass over it.

    Attributes
    ----------
    report : MeshReport
        The figures.
    defects : Defects
        The triangles of every defect.
    deviation : Deviation
        Distances to field and scan, one a vertex and one a point, for colour maps and histograms.
    anatomy : Anatomy
        Pieces, loops, angles, areas and edge lengths, one a triangle or an edge.
    """

    report: MeshReport
    defects: Defects
    deviation: Deviation
    anatomy: Anatomy


def inspect_mesh(
    mesh: MeshLike,
    field: Field | None = None,
    cloud: CloudLike | None = None,
    unit: str | None = None,
    progress: Progress | None = None,
    *,
    isovalue: float = 0.0,
) -> Inspection:
    """Return report, defects and deviations of a mesh, for the price of one; the arguments are `mesh_report`'s.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    field, cloud, unit, progress, isovalue
        As in `mesh_report`.

    Raises
    ------
    InputError, UnitError
        As `mesh_report`.
    """
    anatomy = Anatomy.of(*mesh_arrays(mesh), progress)
    deviation = Deviation.of(anatomy, field, cloud, unit, isovalue=isovalue, progress=progress)
    return Inspection(report_of(anatomy, deviation), defects_of(anatomy), deviation, anatomy)
