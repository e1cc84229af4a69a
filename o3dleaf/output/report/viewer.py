"""Data of the interactive view: a mesh small enough for a page, colors by vertex, the defects as they are."""

import base64
import json
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.output.report.places import KINDS, DefectPlace
from o3dleaf.output.report.reduce import ReducedMesh
from o3dleaf.output.report.shots import Colors
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.surface.mesh.inspection import Inspection

STEPS = 65535
"""Of a coordinate of the reduced mesh, over its extent."""

LEVELS = 254
"""Of a color; one more is for no value."""

MAX_DEFECTS = 20_000
"""Triangles of one kind of defect that are passed on at most."""

QUIET = ("boundary", "sharpest")
"""Kinds that every mesh may have: marked on request."""


def viewer_script() -> str:
    """Return the program of the view."""
    return (files("o3dleaf.output.report") / "assets" / "viewer.js").read_text(encoding="utf-8")


def viewer_data(
    inspection: Inspection, reduced: ReducedMesh, layers: Sequence[Colors], places: list[DefectPlace]
) -> dict[str, Any]:
    """Return what the view draws, as JSON holds it; arrays are base64 of deflated little-endian numbers.

    Positions are whole numbers over the extent of the mesh; both they and the corners of triangles are
    stored as differences from the row before. Triangles of defects are not reduced: float32.
    """
    low = reduced.vertices.min(axis=0)
    extent = np.maximum(np.ptp(reduced.vertices, axis=0), 1e-30)
    steps = np.round((reduced.vertices - low) / extent * STEPS).astype(np.int64)
    camera = Camera.framing(reduced.vertices, reduced.triangles, View(tilt=35.0))
    depth = float(np.ptp(reduced.vertices @ camera.toward))
    return {
        "reduced": reduced.is_less,
        "low": low.tolist(),
        "extent": extent.tolist(),
        "middle": (low + extent / 2).tolist(),
        "radius": float(np.linalg.norm(extent) / 2),
        "camera": {
            "target": camera.target.tolist(),
            "right": camera.right.tolist(),
            "up": camera.up.tolist(),
            "width": camera.width,
            "height": camera.height,
            "depth": depth,
        },
        "vertices": _pack(np.diff(steps, axis=0, prepend=0) % (STEPS + 1), "<u2"),
        "triangles": _pack(np.diff(reduced.triangles, axis=0, prepend=0) % (1 << 32), "<u4"),
        "layers": [_layer(each) for each in layers],
        "defects": _defects(inspection, places),
    }


def _layer(colors: Colors) -> dict[str, Any]:
    """Return one way to color the mesh."""
    low, high = colors.limits
    known = np.isfinite(colors.values)
    part = np.clip((np.where(known, colors.values, low) - low) / ((high - low) or 1.0), 0, 1)
    table = np.round(255 * colors.table()).astype(np.uint8)
    return {
        "label": colors.label,
        "low": f"{low:.3g}",
        "high": f"{high:.3g}",
        "css": f"linear-gradient(to right, {', '.join(colors.stops())})",
        "map": base64.b64encode(table.tobytes()).decode("ascii"),
        "values": _pack(np.where(known, np.round(part * LEVELS), LEVELS + 1), "u1"),
    }


def _defects(inspection: Inspection, places: list[DefectPlace]) -> list[dict[str, Any]]:
    """Return the triangles of each kind of defect that was found, and where its close-ups are."""
    measurements, defects = inspection.measurements, list[dict[str, Any]]()
    rows = inspection.defects.rows() | {"sharpest": inspection.defects.sharpest}
    for name, kind in KINDS.items():
        if not len(rows[name]):
            continue
        color = [int(kind.color[each : each + 2], 16) / 255 for each in (1, 3, 5)]
        defects.append(
            {
                "name": name,
                "count": len(rows[name]),
                "color": color,
                "shown": name not in QUIET,
                "places": [place.center.tolist() for place in places if place.kind == name],
                "soup": _pack(measurements.vertices[measurements.triangles[rows[name][:MAX_DEFECTS]]], "<f4"),
            }
        )
    return defects


def angle_colors(inspection: Inspection, reduced: ReducedMesh) -> Colors:
    """Return the smallest angle of the triangles at each vertex, red where it is small."""
    measurements = inspection.measurements
    least = np.full(len(measurements.vertices), np.inf)
    for corner in range(3):
        np.minimum.at(least, measurements.triangles[:, corner], measurements.smallest_angle)
    least[np.isinf(least)] = np.nan
    return Colors(
        reduced.worst(least, least=True), "smallest angle of the triangles there, degrees", (0.0, 45.0), "RdYlGn"
    )


def _pack(array: npt.NDArray[Any] | FloatArray, kind: str) -> str:
    """Return the base64 of an array, deflated."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(array, dtype=kind).tobytes(), 7)).decode("ascii")


def as_json(data: dict[str, Any]) -> str:
    """Return JSON that can stand inside a script element."""
    return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
