"""Close-ups of defects: triangles with their edges, those concerned in color, what is broken drawn over them."""

import json
from dataclasses import replace
from html import escape

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.output.report.places import KINDS, DefectPlace, look_at
from o3dleaf.output.report.shots import linear_color, shoot
from o3dleaf.output.report.words import in_words, unit_of
from o3dleaf.output.view.camera import Camera
from o3dleaf.output.view.shade import Paint
from o3dleaf.surface.mesh.inspection import Inspection

SIZE = (340, 300)
"""Width and height of a close-up on the page."""

FRONT, BACK, LINE = linear_color("#b9c8b4"), linear_color("#a99bc4"), linear_color("#2c352e")
"""Outside and inside of the surface, and edges between triangles, in linear RGB."""

MAX_OUTLINES = 400
"""Outlines that are drawn at most."""

MIN_PIXELS = 26
"""What takes fewer pixels of the page than this is ringed."""


def draw_closeup(inspection: Inspection, place: DefectPlace, number: int) -> str:
    """Return a figure of a place: picture, outlines, and a caption with what and where it is."""
    measurements, kind = inspection.measurements, KINDS[place.kind]
    camera = look_at(inspection, place)
    triangles = measurements.triangles[place.window]
    used, corner = np.unique(triangles, return_inverse=True)
    vertices, triangles = measurements.vertices[used], corner.reshape(-1, 3)
    chosen = np.isin(place.window, place.rows)
    if place.kind == "duplicate":
        # Which of two that lie in one place is seen is chance: both are in color.
        _, alike = np.unique(np.sort(triangles, axis=1), axis=0, return_inverse=True)
        chosen = np.isin(alike, alike[chosen])
    width, height = SIZE
    camera = replace(camera, height=camera.width * height / width)
    paint = _with_edges(vertices, triangles, chosen, kind.color, camera.width / width)
    shot = shoot(vertices, triangles, paint, camera, SIZE, smooth=False)
    ink = _outlines(camera, vertices[triangles[chosen]], kind.color)
    ink += _broken(inspection, place, camera)
    picture = shot.svg(inspection.report.unit, ink)
    caption = _caption(inspection, place, number, camera)
    return f'<figure class="closeup" id="place-{number}" data-kind="{place.kind}">{picture}{caption}</figure>'


def _with_edges(vertices: FloatArray, triangles: IntArray, chosen: np.ndarray, color: str, pixel: float) -> Paint:
    """Return the colors of triangles with their edges, as wide as a pixel of the page; some triangles in color."""
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    opposite = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
    doubled = np.linalg.norm(normal, axis=1)[:, np.newaxis]
    altitude = doubled / np.where(opposite > 0, opposite, 1.0)
    # Of triangles a few pixels small, edges would leave nothing but black.
    strength = np.clip((altitude.min(axis=1) / pixel - 3) / 5, 0.0, 0.85)
    bright = linear_color(color)

    def paint(triangle: IntArray, weights: FloatArray, facing: FloatArray) -> FloatArray:
        base = np.where(facing[:, np.newaxis] > 0, FRONT, BACK)
        base = np.where(chosen[triangle, np.newaxis], bright * np.where(facing > 0, 1.0, 0.75)[:, np.newaxis], base)
        near = (weights * altitude[triangle]).min(axis=1) < 0.6 * pixel
        share = (near * strength[triangle])[:, np.newaxis]
        return np.asarray(base * (1 - share) + LINE * share)

    return paint


def _outlines(camera: Camera, corners: FloatArray, color: str) -> list[str]:
    """Return the outlines of triangles (k, 3, 3), seen through what hides them, and a ring about what is small."""
    projected = camera.project(corners[:MAX_OUTLINES].reshape(-1, 3), SIZE).reshape(-1, 3, 2)
    drawn = " ".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in each) + "Z" for each in projected)
    ink = [f'<path class="outline" style="stroke:{color}" d="{drawn}"/>']
    flat = projected.reshape(-1, 2)
    if np.ptp(flat, axis=0).max(initial=0) < MIN_PIXELS or np.linalg.norm(np.ptp(flat, axis=0)) < MIN_PIXELS:
        middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
        ink.append(
            f'<circle class="ring" style="stroke:{color}" cx="{middle[0]:.1f}" cy="{middle[1]:.1f}" r="{MIN_PIXELS}"/>'
        )
    return ink


def _broken(inspection: Inspection, place: DefectPlace, camera: Camera) -> list[str]:
    """Return the edges or vertices in which the defect lies: open ones, shared by too many, bow-ties."""
    measurements = inspection.measurements
    triangles = measurements.triangles[place.window]
    if place.kind == "nonmanifold_vertex":
        names = np.unique(triangles[measurements.bowtie[triangles]])
        dots = camera.project(measurements.vertices[names], SIZE)
        return [f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="6"/>' for x, y in dots]
    if place.kind not in {"hole", "boundary", "nonmanifold_edge"}:
        return []
    ends = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(ends, axis=0, return_counts=True)
    # The window holds all triangles of the vertices near its middle: their edges are counted in full.
    full = (np.linalg.norm(measurements.vertices[edges] - place.center, axis=2) < 1.3 * place.radius).any(axis=1)
    wanted = edges[full & ((count > 2) if place.kind == "nonmanifold_edge" else (count == 1))]
    lines = camera.project(measurements.vertices[wanted].reshape(-1, 3), SIZE).reshape(-1, 2, 2)
    drawn = " ".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in lines)
    return [f'<path class="edge" d="{drawn}"/>'] if drawn else []


def _caption(inspection: Inspection, place: DefectPlace, number: int, camera: Camera) -> str:
    """Return number, kind, place and figures of a close-up, and the way there in the interactive view."""
    measurements, report, kind = inspection.measurements, inspection.report, KINDS[place.kind]
    first = place.rows[np.argmin(measurements.smallest_angle[place.rows])]
    # Digits as fine as what is shown: no 1e-16 where 0 is meant.
    digits = max(0, 2 - int(np.floor(np.log10(place.radius))))
    where = ", ".join(f"{each + 0.0:.{digits}f}" for each in np.round(place.center, digits)) + unit_of(
        "length", report.unit
    )
    angle = in_words("min_angle_deg", float(measurements.smallest_angle[first]), None)
    several = f"{len(place.rows)} triangles, the sharpest" if len(place.rows) > 1 else "triangle"
    way = escape(json.dumps([place.center.tolist(), camera.toward.tolist(), place.radius]), quote=True)
    return (
        f'<figcaption><b><i class="key" style="background:{kind.color}">{number}</i> {kind.title}</b>: '
        f"{kind.text}.<br>"
        f"At {where}; {several} {first}, {angle}. "
        f'<a href="#viewer" data-place="{way}">Show in 3-D</a></figcaption>'
    )
