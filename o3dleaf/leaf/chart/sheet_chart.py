"""`chart_sheet`: a sheet laid flat and turned so that its midrib lies along u."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, drop_unused_vertices, triangle_areas
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.core.places import tell_place
from o3dleaf.core.units import tell_share
from o3dleaf.leaf.chart.carry import carry
from o3dleaf.leaf.chart.flatten import LARGEST_FLAP, OVERLAP, lay_flat, overlap_error
from o3dleaf.leaf.chart.flattening.overlap import find_overlap, without_flaps
from o3dleaf.leaf.chart.flattening.sheet_shape import require_sheet
from o3dleaf.leaf.chart.flattening.stretch import Stretch, stretch_quantiles
from o3dleaf.leaf.chart.midline import Midline, find_midline, midline_through
from o3dleaf.leaf.chart.turn import facing, turn_chart


@dataclass(frozen=True, eq=False)
class Chart:
    """A blade's sheet and its place in the plane: u along the midrib, v across it, in the sheet's unit.

    Attributes
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
        Counter-clockwise seen from the upper side, in space and in the plane.
    uv : (n, 2) ndarray
    midline : Midline
        From u = 0 to the tip; its mean line is v = 0.
    stretch : Stretch
    notes : tuple of str
        What was decided, with places in the world.
    """

    vertices: FloatArray
    triangles: IntArray
    uv: FloatArray
    midline: Midline
    stretch: Stretch
    notes: tuple[str, ...]


@single_threaded_blas()
def chart_sheet(
    vertices: FloatArray,
    triangles: IntArray,
    *,
    midrib: FloatArray | None = None,
    up: FloatArray | None = None,
    base: FloatArray | None = None,
    junction: FloatArray | None = None,
) -> Chart:
    """Return the chart of a sheet.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        One oriented manifold piece of genus 0 with a boundary.
    midrib : (k, 3) ndarray, optional
        Points along it from base to tip, on the sheet or near; found if left out.
    up : (3,) array_like, optional
        Direction that the upper (adaxial) side faces on the mean; the world's z if left out.
    base : (3,) array_like, optional
        A point of the world near the base of the blade.
    junction : (3,) ndarray, optional
        Where a petiole was cut off: the middle of the base.

    Raises
    ------
    ReconstructionError
        If it cannot be laid flat, with the place.
    """
    vertices, triangles = drop_unused_vertices(np.asarray(vertices, dtype=np.float64), np.asarray(triangles, np.int64))
    flattening, turning = progress.split(5, 2)
    hint = None if base is None else np.asarray(base, dtype=np.float64)
    upright, facing_note = facing(vertices, triangles, up)
    notes = [facing_note]
    with flattening:
        flat = lay_flat(vertices, triangles)
        kept, flaps = _single_layer(vertices, triangles, flat)
        vertices, triangles, used = _part(vertices, triangles, kept)
        flat = flat[used]
        notes += [flaps] if flaps else []
    with turning:
        if midrib is None:
            start = None
            if junction is not None and _begins_there(vertices, junction, hint):
                start = carry(vertices, triangles, flat, junction[np.newaxis])[0]
            midline = find_midline(vertices, triangles, flat, base=hint, junction=start)
        else:
            midline = midline_through(vertices, triangles, flat, _from_hint(midrib, base))
        uv, midline, bend = turn_chart(flat, midline, mirrored=not upright)
    if not upright:
        triangles = triangles[:, ::-1].copy()
    notes += [*midline.notes, *([bend] if bend else [])]
    return Chart(vertices, triangles, uv, midline, stretch_quantiles(vertices, triangles, uv), tuple(notes))


def _part(vertices: FloatArray, triangles: IntArray, kept: BoolArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the sheet of some triangles, and which of the old vertices its own are."""
    return *drop_unused_vertices(vertices, triangles[kept]), np.unique(triangles[kept])


def _from_hint(midrib: FloatArray, base: FloatArray | None) -> FloatArray:
    """Return control points from base to tip: turned round if the last one is nearer to the hint."""
    if base is None:
        return midrib
    first, last = np.linalg.norm(midrib[[0, -1]] - np.asarray(base, dtype=np.float64), axis=1)
    return midrib[::-1] if last < first else midrib


def _begins_there(vertices: FloatArray, junction: FloatArray, hint: FloatArray | None) -> bool:
    """Return whether the blade begins at a junction: not if a point given is nearer to what is farthest from it."""
    if hint is None:
        return True
    other = vertices[np.argmax(np.linalg.norm(vertices - junction, axis=1))]
    return bool(np.linalg.norm(hint - junction) <= np.linalg.norm(hint - other))


def _single_layer(vertices: FloatArray, triangles: IntArray, flat: FloatArray) -> tuple[BoolArray, str | None]:
    """Return which (m,) triangles stay so that the chart lies over itself nowhere, and a note if some go."""
    overlap = find_overlap(flat, triangles, require_sheet(vertices, triangles))
    if overlap is None:
        return np.ones(len(triangles), dtype=bool), None
    kept = without_flaps(vertices, triangles, overlap)
    area = triangle_areas(vertices, triangles)
    share = float(area[~kept].sum() / area.sum())
    if share > LARGEST_FLAP:
        raise overlap_error(overlap, vertices, triangles)
    if share <= OVERLAP:
        return kept, "single triangles that lay over others were left out of the chart"
    middle = area[~kept] @ vertices[triangles[~kept]].mean(axis=1) / area[~kept].sum()
    about = tell_place(middle, vertices)
    return kept, f"{tell_share(share)} of the sheet was cut off about {about}: laid flat, it lies over the rest"
