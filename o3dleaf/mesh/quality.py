"""What a mesh is, in numbers: pieces, holes, manifoldness, self-intersections, angles, sizes."""

from dataclasses import asdict, dataclass

import numpy as np

from o3dleaf.checks import FloatArray
from o3dleaf.mesh.arrays import BoolArray, IntArray, MeshLike, mesh_arrays, triangle_areas
from o3dleaf.mesh.clean import count_self_intersections
from o3dleaf.mesh.topology import EdgeTable, fans_per_vertex, find_holes, label_fans, label_triangles
from o3dleaf.units import check_unit

FLAT = 1e-12
"""A triangle is degenerate if its area is at most this times its longest edge squared (float64 rounding)."""


@dataclass(frozen=True)
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
    self_intersections : int
        Triangles that cross another one (MeshLab's filter).
    watertight : bool
        Open3D's sense: no boundary, manifold, no self-intersection.
    degenerate_triangles, duplicate_triangles : int
        Without an area (to rounding); further triangles on the same three vertices as one before.
    min_angle_deg : float
        The smallest angle of all triangles, in degrees; 0 for a degenerate one.
    share_below_5deg, share_below_10deg : float
        Parts of the triangles with a smaller angle than that.
    shortest_edge, mean_edge, longest_edge : float
        Edge lengths.
    area, volume : float (volume: or None)
        Total area; enclosed volume, positive if the triangles face outward, None for an open mesh.
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
    self_intersections: int
    watertight: bool
    degenerate_triangles: int
    duplicate_triangles: int
    min_angle_deg: float
    share_below_5deg: float
    share_below_10deg: float
    shortest_edge: float
    mean_edge: float
    longest_edge: float
    area: float
    volume: float | None
    unit: str | None

    def to_dict(self) -> dict[str, int | float | bool | str | None]:
        """Return the figures as one flat dictionary, ready for JSON."""
        return asdict(self)


def mesh_report(mesh: MeshLike, unit: str | None = None) -> MeshReport:
    """Return the figures of a mesh: its pieces, defects, angles and sizes.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    unit : str, optional
        The unit of its vertices ("mm", "um", ...), stated in the report.

    Raises
    ------
    InputError, UnitError
        If it is no mesh, or the unit is unknown.
    """
    vertices, triangles = mesh_arrays(mesh)
    edges = EdgeTable.of(triangles)
    loops = find_holes(vertices, triangles, edges)
    boundary, pieces = len(loops.edges), int(label_triangles(triangles, edges).max(initial=-1)) + 1
    bowties = int((fans_per_vertex(triangles, label_fans(triangles, edges), len(vertices)) > 1).sum())
    heavy, against = int((edges.count > 2).sum()), int(edges.inconsistent().sum())
    manifold = heavy == 0 and bowties == 0
    crossings = count_self_intersections((vertices, triangles))
    euler = len(np.unique(triangles)) - len(edges.count) + len(triangles)
    area, angle = triangle_areas(vertices, triangles), smallest_angles(vertices, triangles)
    length = np.linalg.norm(np.diff(vertices[edges.ends], axis=1)[:, 0], axis=1)
    return MeshReport(
        vertices=len(vertices),
        triangles=len(triangles),
        components=pieces,
        boundary_edges=boundary,
        boundary_loops=len(loops.is_rim),
        holes=int((~loops.is_rim).sum()),
        genus=(2 * pieces - len(loops.is_rim) - euler) // 2 if manifold and against == 0 else None,
        nonmanifold_edges=heavy,
        nonmanifold_vertices=bowties,
        manifold=manifold,
        inconsistent_edges=against,
        oriented=against == 0,
        self_intersections=crossings,
        watertight=boundary == 0 and manifold and crossings == 0 and len(triangles) > 0,
        degenerate_triangles=int((area <= FLAT * _longest_squared(vertices, triangles)).sum()),
        duplicate_triangles=len(triangles) - len(np.unique(np.sort(triangles, axis=1), axis=0)),
        min_angle_deg=float(angle.min(initial=180.0)) if len(angle) else 0.0,
        share_below_5deg=_share(angle < 5),
        share_below_10deg=_share(angle < 10),
        shortest_edge=float(length.min(initial=np.inf)) if len(length) else 0.0,
        mean_edge=float(length.mean()) if len(length) else 0.0,
        longest_edge=float(length.max(initial=0.0)),
        area=float(area.sum()),
        volume=signed_volume(vertices, triangles) if boundary == 0 else None,
        unit=check_unit(unit),
    )


def smallest_angles(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m,) smallest angle of each triangle, in degrees; 0 where two corners are in one place."""
    least = np.full(len(triangles), np.pi)
    for corner in range(3):
        apex, left, right = (vertices[triangles[:, (corner + turn) % 3]] for turn in range(3))
        to_left, to_right = left - apex, right - apex
        sine = np.linalg.norm(np.cross(to_left, to_right), axis=1)
        # arctan2 keeps small angles exact, where arccos of a number beside 1 would not.
        least = np.minimum(least, np.arctan2(sine, np.einsum("ij,ij->i", to_left, to_right)))
    return np.asarray(np.degrees(least))


def signed_volume(vertices: FloatArray, triangles: IntArray) -> float:
    """Return the volume that a closed mesh encloses, positive if its triangles face outward.

    By the divergence theorem the sum of det(a, b, c) / 6 over the triangles, measured from the
    mesh's own middle so that a mesh far from the origin loses no digits.
    """
    if not len(triangles):
        return 0.0
    centred = vertices - vertices.mean(axis=0)
    first, second, third = (centred[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", first, np.cross(second, third)) / 6)


def _longest_squared(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m,) squared length of the longest edge of each triangle."""
    sides = vertices[np.roll(triangles, -1, axis=1)] - vertices[triangles]
    return np.asarray(np.einsum("ijk,ijk->ij", sides, sides).max(axis=1, initial=0.0))


def _share(which: BoolArray) -> float:
    """Return the part of true entries, 0 for none at all."""
    return float(which.mean()) if len(which) else 0.0
