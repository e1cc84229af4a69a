"""Places of defects: for each kind a few, each with the triangles around it and a camera that sees it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, ray_scene
from o3dleaf.output.view.camera import Camera
from o3dleaf.surface.mesh.inspection import Inspection
from o3dleaf.surface.mesh.topology import label_nodes

MARGIN = 3.0
"""Half the width of a close-up at least, in longest edges of what it shows."""

WIDE = 40.0
"""A defect wider than this many median edges is shown where it begins, lest its triangles be too small to see."""

WHOLE = 1.5
"""Half the width of a close-up, in radii of what it shows."""


class Kind(NamedTuple):
    """A kind of defect on the page: its name, its color, what it is, and how many places of it are shown."""

    title: str
    color: str
    text: str
    places: int = 3


KINDS = {
    "self_intersecting": Kind("Self-intersection", "#d3131f", "the triangle passes through another one"),
    "nonmanifold_edge": Kind("Non-manifold edge", "#b5179e", "three triangles or more share an edge"),
    "nonmanifold_vertex": Kind("Non-manifold vertex", "#7b3ff2", "pieces of surface touch in one vertex alone"),
    "flipped": Kind("Flipped triangles", "#e09f00", "they run against the triangles beside them"),
    "hole": Kind("Hole", "#e4572e", "triangles are missing"),
    "degenerate": Kind("Degenerate triangle", "#00958f", "it has no area"),
    "duplicate": Kind("Duplicate triangle", "#9c5a3c", "another one has the same vertices"),
    "stray": Kind("Stray piece", "#2d8fd5", "far smaller than the largest piece"),
    "boundary": Kind("Boundary", "#3b5fb6", "the surface ends here", 1),
    "sharpest": Kind("Smallest angle", "#f77f00", "worst shapes of all triangles", 6),
}
"""In the order of the page."""


@dataclass(frozen=True, eq=False)
class DefectPlace:
    """One place of a defect.

    Attributes
    ----------
    kind : str
        A key of `KINDS`.
    rows : (k,) ndarray of int64
        The triangles of that kind in the window.
    window : (w,) ndarray of int64
        All triangles near.
    center : (3,) ndarray
    radius : float
        Half the width that a close-up shows, in the mesh's unit.
    """

    kind: str
    rows: IntArray
    window: IntArray
    center: FloatArray
    radius: float


def find_places(inspection: Inspection) -> list[DefectPlace]:
    """Return the places to look at: the largest of each defect, and the worst triangles."""
    places, defects = list[DefectPlace](), inspection.defects
    rows = defects.rows() | {"sharpest": defects.sharpest}
    if len(rows["hole"]) == len(rows["boundary"]):
        rows["boundary"] = rows["boundary"][:0]
    for kind, each in KINDS.items():
        seen = list[DefectPlace]()
        for group in _groups(inspection, rows[kind], by_size=kind != "sharpest"):
            if len(seen) == each.places:
                break
            center = _middle(inspection, group)[0]
            if any(np.linalg.norm(center - other.center) < 0.8 * other.radius for other in seen):
                continue
            seen.append(_place(inspection, kind, group, rows[kind]))
        places += seen
    return places


def _groups(inspection: Inspection, rows: IntArray, *, by_size: bool) -> list[IntArray]:
    """Return rows of triangles that hang together by vertices, the largest group first or as they come."""
    if not len(rows):
        return []
    names, corner = np.unique(inspection.measurements.triangles[rows], return_inverse=True)
    corner = corner.reshape(-1, 3)
    pairs = np.concatenate([corner[:, 0], corner[:, 1]]), np.concatenate([corner[:, 1], corner[:, 2]])
    label = label_nodes(*pairs, len(names))[corner[:, 0]]
    _, first, of_row, count = np.unique(label, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(of_row, kind="stable")
    groups = np.split(rows[order], np.cumsum(count)[:-1])
    ranking = np.lexsort((first, -count)) if by_size else np.argsort(first)
    # More than a few dozen are never looked at.
    return [groups[each] for each in ranking[:64]]


def _middle(inspection: Inspection, rows: IntArray) -> tuple[FloatArray, float]:
    """Return the middle of some triangles and their radius about it."""
    corners = inspection.measurements.vertices[inspection.measurements.triangles[rows]].reshape(-1, 3)
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return center, float(np.linalg.norm(corners - center, axis=1).max())


def _place(inspection: Inspection, kind: str, group: IntArray, rows: IntArray) -> DefectPlace:
    """Return the window around a group of triangles, or around its first where the group is too wide to show."""
    measurements, report = inspection.measurements, inspection.report
    center, radius = _middle(inspection, group)
    if kind != "stray" and len(group) > 1 and radius > WIDE * report.median_edge:
        center, radius = _middle(inspection, group[:1])
        group = group[:1]
    corners = measurements.vertices[measurements.triangles[group]]
    longest = float(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max())
    size = max(
        WHOLE * radius,
        MARGIN * min(longest, radius),
        2 * report.median_edge if longest < report.median_edge else 0.0,
    )
    size = size or 1.0
    near = np.linalg.norm(measurements.vertices - center, axis=1) < 1.3 * size
    inside = near[measurements.triangles].any(axis=1)
    inside[group] = True
    window = np.flatnonzero(inside)
    return DefectPlace(kind, np.union1d(group, np.intersect1d(rows, window)), window, center, size)


def look_at(inspection: Inspection, place: DefectPlace) -> Camera:
    """Return the camera from which most of a place's triangles are seen, rather from above than from the side."""
    measurements = inspection.measurements
    corners = measurements.vertices[measurements.triangles[place.rows]]
    # Of the surface around, not of what may be flipped or stand out of it.
    toward = _normal(measurements.vertices[measurements.triangles[place.window]])
    if toward is None:
        toward = _thinnest(measurements.vertices[measurements.triangles[place.window]].reshape(-1, 3))
    helper = np.eye(3)[np.argmin(np.abs(toward))]
    right = np.cross(helper, toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    around = (measurements.vertices[measurements.triangles[place.window]] - place.center).reshape(-1, 3)
    scene = ray_scene(around, np.arange(len(around)).reshape(-1, 3))
    middle = corners.mean(axis=1, keepdims=True)
    points = (middle + 0.7 * (corners - middle)).reshape(-1, 3)[:600] - place.center
    best, most = toward, -1.0
    for way in _ways(toward, right, up, steep=place.kind in {"self_intersecting", "nonmanifold_edge"}):
        start = points + 1e-3 * place.radius * way
        rays = np.hstack([start, np.broadcast_to(way, start.shape)]).astype(np.float32)
        seen = 1 - float(scene.test_occlusions(o3d.core.Tensor.from_numpy(rays)).numpy().mean())
        # From inside only where little is to be seen from outside.
        gain = 0.02 if way @ toward >= 0 else 0.4
        if seen > most + gain:
            best, most = way, seen
        if most > 0.97:
            break
    right = np.cross(up, best)
    right /= np.linalg.norm(right)
    extent = 2 * place.radius
    return Camera(place.center, right, np.cross(best, right), best, extent, extent)


def _ways(toward: FloatArray, right: FloatArray, up: FloatArray, *, steep: bool) -> list[FloatArray]:
    """Return unit vectors around one, those that show relief first."""
    ways = list[FloatArray]()
    for tilt in np.radians((50, 30, 65, 0) if steep else (25, 0, 45, 65)):
        for turn in np.radians((250, 290, 200, 340, 110, 70, 160, 20)):
            side = np.cos(turn) * right + np.sin(turn) * up
            ways.append(np.cos(tilt) * toward + np.sin(tilt) * side)
    return ways + [-each for each in ways]


def _normal(corners: FloatArray) -> FloatArray | None:
    """Return the mean unit normal of triangles (k, 3, 3), None where they cancel out or have no area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = normals.sum(axis=0)
    length = float(np.linalg.norm(total))
    if length <= 0.2 * float(np.linalg.norm(normals, axis=1).sum()):
        return None
    return np.asarray(total / length)


def _thinnest(points: FloatArray) -> FloatArray:
    """Return the unit vector along which points spread least."""
    apart = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(apart.T @ apart)[1][:, 0])
