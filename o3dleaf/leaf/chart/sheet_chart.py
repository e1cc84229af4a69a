"""`chart_sheet`: a sheet without its petiole, laid flat and turned so that its midrib lies along u."""

from dataclasses import dataclass

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, drop_unused_vertices, triangle_areas
from o3dleaf.leaf.parametric.flatten import OVERLAP, carry, coarsen, lay_flat, overlap_error
from o3dleaf.leaf.chart.flattening.overlap import find_overlap, without_flaps
from o3dleaf.leaf.chart.flattening.sheet_shape import largest_sheet, place_of, require_sheet
from o3dleaf.leaf.chart.flattening.stretch import Stretch, stretch_quantiles
from o3dleaf.leaf.parametric.midline import Midline, find_midline
from o3dleaf.leaf.parametric.petiole import Petiole, find_petiole
from o3dleaf.leaf.parametric.turn import facing, turn_chart

LARGEST_FLAP = 0.1
"""Share of the area that may go where the chart lies over itself; of more it is open which layer is the leaf."""


@dataclass(frozen=True, eq=False)
class Chart:
    """A blade's sheet and its place in the plane: u along the midrib, v across it, in the sheet's unit.

    Attributes
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
        Counter-clockwise seen from the upper side, in space and in the plane; without petiole.
    uv : (n, 2) ndarray
    midline : Midline
        From u = 0 to the tip; its mean line is v = 0.
    petiole : Petiole or None
        What was found, cut off or not.
    stretch : Stretch
    notes : tuple of str
        What was decided, with places in the world.
    """

    vertices: FloatArray
    triangles: IntArray
    uv: FloatArray
    midline: Midline
    petiole: Petiole | None
    stretch: Stretch
    notes: tuple[str, ...]


def chart_sheet(
    vertices: FloatArray,
    triangles: IntArray,
    *,
    up: FloatArray | None = None,
    base: FloatArray | None = None,
    keep_petiole: bool = False,
) -> Chart:
    """Return the chart of a sheet.

    Parameters
    ----------
    vertices : (n, 3) ndarray
    triangles : (m, 3) ndarray of int
        One oriented manifold piece of genus 0 with a boundary.
    up : (3,) array_like, optional
        Direction that the upper (adaxial) side faces on the mean; the world's z if left out.
    base : (3,) array_like, optional
        A point of the world near the base of the blade.
    keep_petiole : bool
        Whether a petiole or stem stub stays part of the blade.

    Raises
    ------
    ReconstructionError
        If it cannot be laid flat, with the place.
    """
    vertices, triangles = np.asarray(vertices, dtype=np.float64), np.asarray(triangles, dtype=np.int64)
    finding, flattening, turning = progress.split(1, 5, 2)
    with finding:
        require_sheet(vertices, triangles)
        petiole, blade = _split_petiole(vertices, triangles)
    notes = []
    cut = petiole is not None and not keep_petiole
    if petiole is not None:
        notes.append(f"{petiole}: {'cut off' if cut else 'kept as part of the blade'}")
    if cut:
        vertices, triangles = drop_unused_vertices(vertices, triangles[blade])
    upright, note = facing(vertices, triangles, up)
    notes.append(note)
    with flattening:
        flat = lay_flat(vertices, triangles)
        kept, cut_off = _single_layer(vertices, triangles, flat)
    if cut_off:
        notes.append(cut_off)
        used = np.unique(triangles[kept])
        vertices, triangles = drop_unused_vertices(vertices, triangles[kept])
        flat = flat[used]
    with turning:
        junction = np.array(petiole.junction) if petiole is not None and cut else None
        hint = np.asarray(base, dtype=np.float64) if base is not None else None
        if hint is None and petiole is not None:
            hint = np.array(petiole.end)
        midline = find_midline(vertices, triangles, flat, base=hint, junction=junction)
        uv, midline, bend = turn_chart(flat, midline, mirrored=not upright)
    if not upright:
        triangles = triangles[:, ::-1].copy()
    notes += [*midline.notes, *([bend] if bend else [])]
    return Chart(vertices, triangles, uv, midline, petiole, stretch_quantiles(vertices, triangles, uv), tuple(notes))


def _split_petiole(vertices: FloatArray, triangles: IntArray) -> tuple[Petiole | None, BoolArray]:
    """Return the petiole, found on a coarse mesh, and which triangles of the whole one are blade."""
    coarse, faces = coarsen(vertices, triangles)
    blade, petiole = find_petiole(coarse, faces)
    if petiole is None or coarse is vertices:
        return petiole, largest_sheet(vertices, triangles, blade)
    # The share of blade around each vertex, carried to the fine mesh, is one half along the cut.
    weight = np.repeat(triangle_areas(coarse, faces), 3)
    whole = np.bincount(faces.ravel(), weights=weight, minlength=len(coarse))
    share = np.bincount(faces.ravel(), weights=weight * np.repeat(blade, 3), minlength=len(coarse)) / np.maximum(
        whole, np.finfo(float).tiny
    )
    fine = carry(coarse, faces, share[:, np.newaxis], vertices)[:, 0]
    return petiole, largest_sheet(vertices, triangles, fine[triangles].mean(axis=1) > 0.5)


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
    return kept, (
        f"{100 * share:.2g} % of the sheet was cut off about {place_of(middle)}: laid flat, it lies over the rest"
    )
