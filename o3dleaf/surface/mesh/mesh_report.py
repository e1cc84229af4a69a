"""A mesh in numbers: pieces, holes, manifoldness, self-intersections, angles, sizes, deviations."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Finite, Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.field import Field
from o3dleaf.core.mesh_arrays import MeshLike, mesh_arrays
from o3dleaf.core.resources.measured import REPORTED_TRIANGLE
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.units import tell_count
from o3dleaf.surface.mesh.deviation import Deviation
from o3dleaf.surface.mesh.measurements import MeshMeasurements

SHARES = (1, 5, 10, 20)
"""Angles, in degrees, below which triangles are counted."""


@dataclass(frozen=True, repr=False)
class MeshReport:
    """The figures of a mesh; lengths in `unit`, areas and the volume in its square and cube.

    Attributes
    ----------
    vertices, triangles : int
        As stored, unused vertices included.
    components : int
        Edge-connected pieces.
    boundary_edges : int
        Edges of one triangle.
    boundary_loops, holes : int
        Closed walks along the boundary, and those of them that are not the rim of an open sheet.
        The longest loop of a piece is its rim if perimeter^2 >= pi area; so a sphere that lacks a
        triangle has a hole, and a leaf's blade has none but a rim.
    genus : int or None
        Handles, summed over the pieces: (2 components - boundary_loops - Euler number) / 2; None
        where the mesh is not manifold and oriented.
    nonmanifold_edges, nonmanifold_vertices : int
        Edges of three triangles or more; vertices with more than one fan of triangles (bow-ties).
    manifold : bool
        None of these two.
    inconsistent_edges : int
        Edges that two triangles run along in the same direction: one of them is flipped.
    oriented : bool
        None of these.
    orientable : bool
        Whether triangles can be turned until it is oriented; a Möbius strip is not, nor is what has
        an edge of three triangles.
    flipped_triangles : int
        Triangles that run against the larger part, by area, of their orientable patch.
    self_intersections : int
        Triangles that meet another one in more than a common corner or edge (`find_crossings`).
    watertight : bool
        Open3D's sense: no boundary, manifold, no self-intersection.
    degenerate_triangles, duplicate_triangles : int
        Without an area (to rounding); further triangles on the same three vertices as one before.
    min_angle_deg, max_angle_deg : float
        The smallest and the largest angle of all triangles, in degrees; 0 and 180 for a degenerate one.
    share_below_1deg, share_below_5deg, share_below_10deg, share_below_20deg : float
        Parts of the triangles whose smallest angle is below that.
    angle_histogram : tuple of int
        Triangles by their smallest angle, in steps of one degree from 0 to 60.
    shortest_edge, mean_edge, longest_edge : float
        Edge lengths.
    edge_1pc, edge_5pc, median_edge, edge_95pc, edge_99pc : float
        Their quantiles.
    lower, upper, extent : tuple of three float
        Corners of the bounding box of the vertices that triangles use, and its sides.
    area, volume : float (volume: or None)
        Total area; enclosed volume, positive if the triangles face outward, None for an open mesh.
    field_distance_mean, field_distance_95pc, field_distance_99pc, field_distance_max : float or None
        Distances of the vertices to the field's surface (`inspect_mesh` says how); None without a field.
    scan_distance_mean, scan_distance_95pc, scan_distance_max : float or None
        Distances of the scan's points to the mesh; None without a scan.
    support_median, support_95pc, support_max : float or None
        Distances of the mesh's vertices to the nearest point of the scan; None without a scan.
    scan_spacing : float or None
        Median distance of the scan's points to their nearest neighbor.
    unsupported_share : float or None
        Part of the area farther than `SUPPORT` times that from every point of the scan.
    unit : str or None
        Unit of length.
    """

    vertices: int
    triangles: int
    components: int
    boundary_edges: int
    boundary_loops: int
    holes: int
    genus: int | None
    nonmanifold_edges: int
    nonmanifold_vertices: int
    manifold: bool
    inconsistent_edges: int
    oriented: bool
    orientable: bool
    flipped_triangles: int
    self_intersections: int
    watertight: bool
    degenerate_triangles: int
    duplicate_triangles: int
    min_angle_deg: float
    max_angle_deg: float
    share_below_1deg: float
    share_below_5deg: float
    share_below_10deg: float
    share_below_20deg: float
    angle_histogram: tuple[int, ...]
    shortest_edge: float
    mean_edge: float
    longest_edge: float
    edge_1pc: float
    edge_5pc: float
    median_edge: float
    edge_95pc: float
    edge_99pc: float
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    extent: tuple[float, ...]
    area: float
    volume: float | None
    field_distance_mean: float | None
    field_distance_95pc: float | None
    field_distance_99pc: float | None
    field_distance_max: float | None
    scan_distance_mean: float | None
    scan_distance_95pc: float | None
    scan_distance_max: float | None
    support_median: float | None
    support_95pc: float | None
    support_max: float | None
    scan_spacing: float | None
    unsupported_share: float | None
    unit: str | None

    def __repr__(self) -> str:
        state = "watertight" if self.watertight else "manifold" if self.manifold else "not manifold"
        size = f"{self.vertices:,} vertices, {self.triangles:,} triangles in {tell_count(self.components, 'piece')}"
        return f"MeshReport({size}, {state}, {self.self_intersections:,} crossing, unit {self.unit})"

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as one flat dictionary, ready for JSON; `None` for what was not requested."""
        return asdict(self)


@checked
def mesh_report(
    mesh: MeshLike,
    field: Field | None = None,
    cloud: CloudLike | None = None,
    unit: Unit | None = None,
    *,
    isovalue: Finite = 0.0,
) -> MeshReport:
    """Return the figures of a mesh: its pieces, defects, angles and sizes, and how far it is from what it shows.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    field : Field, optional
        The mesh is a surface of it: distances of the vertices to it are measured, see `Deviation`.
    cloud : (n, 3) array_like or Open3D point cloud, optional
        The scan, in the mesh's unit: distances to it and from it are measured.
    unit : str, optional
        The unit of the vertices ("mm", "um", ...), stated in the report; that of the field by default.
    isovalue : float
        The surface is where the field has this value.

    Raises
    ------
    InputError, UnitError
        If it is no mesh, or the unit is unknown, or only the mesh has one and the field none.
    """
    measured, deviation = measure_and_compare(mesh, field, cloud, unit, isovalue)
    return report_of(measured, deviation)


def measure_and_compare(
    mesh: MeshLike, field: Field | None, cloud: CloudLike | None, unit: str | None, isovalue: float
) -> tuple[MeshMeasurements, Deviation]:
    """Return all that a report is made of; the arguments are those of `mesh_report`."""
    vertices, triangles = mesh_arrays(mesh)
    held = REPORTED_TRIANGLE * len(triangles)
    require_resources(held, f"report: {len(triangles):,} triangles", "simplify the mesh first")
    measuring, comparing = progress.split(1, field is not None)
    with measuring:
        measured = MeshMeasurements.of(vertices, triangles)
    with comparing:
        return measured, Deviation.of(measured, field, cloud, unit, isovalue=isovalue)


def report_of(measured: MeshMeasurements, deviation: Deviation) -> MeshReport:
    """Return the figures of what was found."""
    pieces, loops = measured.pieces, measured.loops
    bowties, inconsistent = int(measured.bowtie.sum()), int(measured.edges.inconsistent.sum())
    manifold, oriented = measured.nonmanifold_edges == 0 and bowties == 0, inconsistent == 0
    crossings, boundary = int(measured.is_crossing.sum()), len(loops.edges)
    euler = int(measured.is_used.sum()) - len(measured.edges.count) + len(measured.triangles)
    return MeshReport(
        vertices=len(measured.vertices),
        triangles=len(measured.triangles),
        components=pieces,
        boundary_edges=boundary,
        boundary_loops=len(loops.is_rim),
        holes=int((~loops.is_rim).sum()),
        genus=(2 * pieces - len(loops.is_rim) - euler) // 2 if manifold and oriented else None,
        nonmanifold_edges=measured.nonmanifold_edges,
        nonmanifold_vertices=bowties,
        manifold=manifold,
        inconsistent_edges=inconsistent,
        oriented=oriented,
        orientable=measured.orientable,
        flipped_triangles=int(measured.is_flipped.sum()),
        self_intersections=crossings,
        watertight=boundary == 0 and manifold and crossings == 0 and len(measured.triangles) > 0,
        degenerate_triangles=int(measured.is_degenerate.sum()),
        duplicate_triangles=int(measured.is_duplicate.sum()),
        **_shape_figures(measured),
        volume=measured.volume if boundary == 0 else None,
        **deviation.figures(),
        unit=deviation.unit,
    )


def _shape_figures(measured: MeshMeasurements) -> dict[str, Any]:
    """Return angles, edge lengths, bounds and area by their names in the report."""
    angle, length = measured.smallest_angle, measured.edge_length
    lower, upper = measured.bounds
    first, fifth, median, late, last = _quantiles(length, (0.01, 0.05, 0.5, 0.95, 0.99))
    shares = {f"share_below_{limit}deg": float(np.mean(angle < limit)) if len(angle) else 0.0 for limit in SHARES}
    return shares | {
        "min_angle_deg": float(angle.min()) if len(angle) else 0.0,
        "max_angle_deg": float(measured.largest_angle.max(initial=0.0)),
        "angle_histogram": tuple(np.histogram(angle, bins=60, range=(0, 60))[0].tolist()),
        "shortest_edge": float(length.min()) if len(length) else 0.0,
        "mean_edge": float(length.mean()) if len(length) else 0.0,
        "longest_edge": float(length.max(initial=0.0)),
        "edge_1pc": first,
        "edge_5pc": fifth,
        "median_edge": median,
        "edge_95pc": late,
        "edge_99pc": last,
        "lower": tuple(lower.tolist()),
        "upper": tuple(upper.tolist()),
        "extent": tuple((upper - lower).tolist()),
        "area": float(measured.area.sum()),
    }


def _quantiles(values: FloatArray, levels: tuple[float, ...]) -> list[float]:
    """Return quantiles of (n,) values, 0 of none."""
    return [float(value) for value in np.quantile(values, levels)] if len(values) else [0.0] * len(levels)
