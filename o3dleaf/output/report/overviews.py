"""The whole mesh from several sides, its places marked, and maps of its deviations in colors."""

from dataclasses import replace
from html import escape
from typing import NamedTuple

import numpy as np
import open3d as o3d
from scipy.spatial import KDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import ray_scene
from o3dleaf.core.parallel import get_num_threads
from o3dleaf.output.report.places import KINDS, DefectPlace
from o3dleaf.output.report.reduce import ReducedMesh
from o3dleaf.output.report.shots import Colors, Picture, leaf_green, shoot, vertex_paint
from o3dleaf.output.report.words import unit_of
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.shade import Paint
from o3dleaf.surface.mesh.inspection import Inspection

WIDE, HALF = 1040, 505
"""Width of a picture that takes the whole line, and of one that shares it."""

MAX_HEIGHT = 620
"""Height of a picture at most."""

REACH = 3.0
"""Vertices farther than this many median spacings of the scan from it have no deviation from it."""


class Side(NamedTuple):
    """A side to look from: its name, and how."""

    name: str
    view: View


def sides_of(reduced: ReducedMesh) -> list[Side]:
    """Return the sides that the mesh is looked at from: both faces, a long edge, an end, and a corner."""
    front = Camera.framing(reduced.vertices, reduced.triangles, View(tilt=0.0))

    def way(*parts: float) -> tuple[float, float, float]:
        direction = np.array(parts) @ np.stack([front.right, front.up, front.toward])
        return float(direction[0]), float(direction[1]), float(direction[2])

    def upright(view: View) -> View:
        # What the front shows is up: a mesh on its back is lit from below.
        up = Camera.framing(reduced.vertices, reduced.triangles, view).up
        return view if up @ front.toward >= 0 else replace(view, turn=180.0)

    return [
        Side("From the front", View(tilt=20.0)),
        Side("From behind", View(direction=way(0, 0, -1), tilt=20.0)),
        Side("From the edge", upright(View(direction=way(0, -1, 0), tilt=0.0))),
        Side("From the end", upright(View(direction=way(1, 0, 0), tilt=0.0))),
        Side("From a corner", upright(View(direction=way(0.7, -0.5, 0.6), tilt=0.0, perspective=True))),
    ]


def draw_sides(reduced: ReducedMesh, places: list[DefectPlace], unit: str | None, own: FloatArray | None = None) -> str:
    """Return the figures of the mesh from its sides, the first two with the places marked.

    They show the linear RGB of its vertices, `own` (k, 3), or leaf green.
    """
    paint = leaf_green if own is None else vertex_paint(own, reduced.triangles)
    middle = reduced.vertices.mean(axis=0)
    scene = ray_scene(reduced.vertices - middle, reduced.triangles)
    figures = list[str]()
    for number, side in enumerate(sides_of(reduced)):
        shot = _frame(reduced, side.view, paint)
        ink = _markers(shot, places, _hidden(scene, places, shot.camera, middle)) if number < 2 else []
        figures.append(_figure(shot.svg(unit, ink), side.name, shot))
    return "\n".join(figures)


def _frame(reduced: ReducedMesh, view: View, paint: Paint) -> Picture:
    """Return the picture of the whole mesh, as wide as its shape requires."""
    fitted = Camera.framing(reduced.vertices, reduced.triangles, view)
    width = WIDE if fitted.width > 1.9 * fitted.height else HALF
    height = int(np.clip(round(width * fitted.height / fitted.width), 90, MAX_HEIGHT if width == WIDE else HALF))
    camera = Camera.framing(reduced.vertices, reduced.triangles, view, width / height)
    return shoot(reduced.vertices, reduced.triangles, paint, camera, (width, height))


def _figure(picture: str, caption: str, shot: Picture) -> str:
    """Return a figure, over the whole line if it is a wide one."""
    kind = "wide" if shot.size[0] == WIDE else "half"
    return f'<figure class="{kind}">{picture}<figcaption>{escape(caption)}</figcaption></figure>'


def _hidden(
    scene: o3d.t.geometry.RaycastingScene, places: list[DefectPlace], camera: Camera, middle: FloatArray
) -> list[bool]:
    """Return for each place whether the mesh hides it from a camera."""
    if not places:
        return []
    start = np.stack([place.center for place in places]) - middle + 0.004 * camera.width * camera.toward
    rays = np.hstack([start, np.broadcast_to(camera.toward, start.shape)]).astype(np.float32)
    return [bool(each) for each in scene.test_occlusions(o3d.core.Tensor.from_numpy(rays)).numpy()]


def _markers(shot: Picture, places: list[DefectPlace], hidden: list[bool]) -> list[str]:
    """Return a ring at each place and its number beside it, no number over another."""
    ink, taken = list[str](), list[FloatArray]()
    if not places:
        return ink
    dots = shot.camera.project(np.stack([place.center for place in places]), shot.size)
    for number, (place, dot, unseen) in enumerate(zip(places, dots, hidden, strict=True), 1):
        label = _free_spot(dot, taken, dots, shot.size)
        taken.append(label)
        color = KINDS[place.kind].color
        dashes = ' stroke-dasharray="3 2"' if unseen else ""
        ink += [
            f'<path class="lead" d="M{dot[0]:.1f} {dot[1]:.1f}L{label[0]:.1f} {label[1]:.1f}"/>',
            f'<circle class="ring" style="stroke:{color}"{dashes} cx="{dot[0]:.1f}" cy="{dot[1]:.1f}" r="5"/>',
            f'<a href="#place-{number}"><circle fill="{color}" cx="{label[0]:.1f}" cy="{label[1]:.1f}" r="9"/>',
            f'<text class="number" x="{label[0]:.1f}" y="{label[1] + 4:.1f}">{number}</text></a>',
        ]
    return ink


def _free_spot(dot: FloatArray, taken: list[FloatArray], dots: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return a spot near a dot where a number covers neither another one nor a dot."""
    best, least = dot, np.inf
    others = np.concatenate([dots, *[each[np.newaxis] for each in taken]])
    for far in (20, 32, 46, 62, 80):
        for turn in np.radians(np.arange(-90, 270, 30)):
            spot = dot + far * np.array([np.cos(turn), np.sin(turn)])
            if (spot < 11).any() or (spot > np.array(size) - 11).any():
                continue
            gaps = np.linalg.norm(others - spot, axis=1)
            cost = far + 40 * float(np.sum(gaps[: len(dots)] < 15)) + 400 * float(np.sum(gaps[len(dots) :] < 20))
            if cost < least:
                best, least = spot, cost
    return best


def field_colors(inspection: Inspection, reduced: ReducedMesh) -> Colors | None:
    """Return the distances to the field as colors on a reduced mesh, None without a field."""
    distance = inspection.deviation.to_field
    if distance is None:
        return None
    return _colors(reduced.worst(distance), f"distance to the field{_unit(inspection)}", "viridis")


def scan_colors(inspection: Inspection, reduced: ReducedMesh, points: FloatArray | None) -> Colors | None:
    """Return for each vertex how far the nearest point of the scan is from the mesh; NaN where none is near."""
    deviation = inspection.deviation
    if points is None or deviation.from_scan is None or deviation.spacing is None:
        return None
    away, nearest = KDTree(points).query(reduced.vertices, workers=get_num_threads())
    values = np.where(away <= max(REACH * deviation.spacing, 2 * reduced.step), deviation.from_scan[nearest], np.nan)
    return _colors(values, f"distance of the scan from the mesh{_unit(inspection)}", "plasma")


def _colors(values: FloatArray, label: str, color_map: str) -> Colors | None:
    """Return colors that reach as far as 99 % of the values do; None where there is no value."""
    known = values[np.isfinite(values)]
    if not len(known):
        return None
    high = float(np.quantile(known, 0.99)) or float(known.max()) or 1.0
    return Colors(values, label, (0.0, high), color_map)


def _unit(inspection: Inspection) -> str:
    unit = unit_of("length", inspection.report.unit).strip()
    return f", {unit}" if unit else ""


def draw_map(reduced: ReducedMesh, colors: Colors, unit: str | None, caption: str) -> str:
    """Return two figures of the mesh in colors, from both faces."""
    figures = list[str]()
    for side in sides_of(reduced)[:2]:
        shot = _frame(reduced, side.view, colors.paint(reduced.triangles))
        figures.append(_figure(shot.svg(unit, (), colors), f"{side.name}. {caption}", shot))
    return "\n".join(figures)
