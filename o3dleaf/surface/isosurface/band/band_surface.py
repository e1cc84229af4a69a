"""The vertices and triangles of the surface in a band: on crossed edges and, over creases, between tangent planes."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from o3dleaf.core import journal, progress
from o3dleaf.core.checks.arrays import FloatArray, require_finite
from o3dleaf.core.errors import DataWarning
from o3dleaf.core.field import Field, values_and_gradients
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.newton import euclidean
from o3dleaf.core.parallel import blocks, run_blocks
from o3dleaf.core.places import tell_middle
from o3dleaf.surface.isosurface import crease_edge_loops
from o3dleaf.surface.isosurface.band import band_loops as loops
from o3dleaf.surface.isosurface.band.band import BATCH_SIZE, BLOCK, Band, Crossing
from o3dleaf.surface.isosurface.band.band_loops import CrossedEdges
from o3dleaf.surface.isosurface.cell_loops import COUNTS, CUBES
from o3dleaf.surface.isosurface.crease_edge_loops import FirstRows, TangentPlanes
from o3dleaf.surface.isosurface.crease_edges import MIN_COSINE, CreaseVertices, join_creases, meet_planes, stop_at_level
from o3dleaf.surface.mesh.clip import trim_to_manifold

SHARES = (1, 2, 3)
"""About how long finding the vertices, sharpening them and joining them over creases take."""


def draw_band(
    band: Band, *, sharpen: bool, ends: bool, features: bool, exact: Field | None = None
) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles by the keys of points and cells, made manifold where the band `ends`.

    With `sharpen` vertices are moved to the zero of a parabola along their edges, of the field `exact` where that of
    the band is rough; with `features` there is one more in each loop of a cell whose normals disagree.
    """
    finding, sharpening, joining = progress.split(*SHARES)
    with finding:
        crossing = band.crossing()
        band.edges, many = None, len(crossing.vertices)  # what follows moves them in place
    with sharpening:
        if sharpen:
            _sharpen(replace(band, field=exact or band.field), crossing.edges, crossing.vertices)
            crossing = crossing._replace(vertices=band.place(crossing.edges))
        if band.box is not None:
            _cut(band, band.box, crossing.edges, crossing.vertices)
    with joining:
        vertices, triangles = _crease(band, crossing) if features else (crossing.vertices, _draw_smooth(crossing))
    if not ends:
        return vertices, triangles
    # Two cells may touch along an edge alone, where the others were not allowed.
    cells = np.full(len(vertices), 4, dtype=np.uint8)
    cells[:many] = 0
    loops.count_cells(crossing.corners, crossing.codes, crossing.numbering, cells)
    return trim_to_manifold(vertices, triangles, cells < 4) if (cells < 4).any() else (vertices, triangles)


def _sharpen(band: Band, edges: CrossedEdges, vertices: FloatArray) -> None:
    """Move crossings along their edges to the zero of a parabola."""
    for i, j in blocks(len(vertices), BATCH_SIZE):
        loops.sharpen_fractions(i, j, edges.here, edges.there, band.ask(vertices[i:j]), edges.fraction)
        progress.report(j, len(vertices))


def _cut(band: Band, box: FloatArray, edges: CrossedEdges, vertices: FloatArray) -> None:
    """Move the vertices on edges that leave the box onto its faces, see `end_on_box`."""
    lower = band.positions(band.keys[edges.lower])
    upper = lower + band.step * (edges.direction[:, np.newaxis] >> np.arange(3) & 1)
    rows, places = end_on_box(band, box, Ends(lower, upper, edges.here, edges.there))
    vertices[rows] = places


class Ends(NamedTuple):
    """Both ends (e, 3) of edges, and the values (e,) there."""

    lower: FloatArray
    upper: FloatArray
    here: FloatArray
    there: FloatArray


def end_on_box(band: Band, box: FloatArray, ends: Ends) -> tuple[IntArray, FloatArray]:
    """Return which edges (e,) leave the box, and where the solid ends on them.

    That is on a face of the box, or on the level where that comes before: along such an edge the field counts as linear
    from its end inside to the face.
    """
    rows = np.flatnonzero(band.is_outside(box, ends.lower) != band.is_outside(box, ends.upper))
    if not len(rows):
        return rows, np.empty((0, 3))
    lower, upper, here, there = (each[rows] for each in ends)
    inner = np.where((here > 0)[:, np.newaxis], lower, upper)
    face = np.clip(np.where((here > 0)[:, np.newaxis], upper, lower), *box)
    here, there = np.maximum(here, there), band.values_at(face)
    share = np.where(there > 0, 1.0, here / np.maximum(here - there, np.finfo(np.float64).tiny))
    return rows, np.where((share == 1.0)[:, np.newaxis], face, inner + share[:, np.newaxis] * (face - inner))


def _crease(band: Band, crossing: Crossing) -> tuple[FloatArray, IntArray]:
    """Return vertices and triangles with a vertex more in each loop of a cell whose normals disagree."""
    corners, codes, numbering, edges, vertices = crossing
    feet, normals = tangent_planes(band.field, vertices, band.level, float(band.step.max()))
    if band.box is not None:
        ended = ((vertices == band.box[0]) | (vertices == band.box[1])).any(axis=1)
        feet[ended] = vertices[ended]  # the solid ends there, whatever the field is
    creases, drawn = np.empty((2, len(codes)), dtype=np.int64)

    def count(start: int, stop: int) -> None:
        crease_edge_loops.count_creases(start, stop, corners, codes, numbering, normals, MIN_COSINE, creases, drawn)

    run_blocks(count, len(codes), BLOCK)
    offsets = FirstRows(np.cumsum(creases) - creases, np.cumsum(drawn) - drawn)
    many, triangles = int(creases.sum()), np.empty((drawn.sum(), 3), dtype=np.int64)
    planes = TangentPlanes(
        np.empty((many, 3, 3)), np.empty((many, 3)), np.empty((many, 3)), np.empty(many, dtype=np.int64)
    )

    def draw(start: int, stop: int) -> None:
        cells, shape = (start, stop, corners, codes, numbering), (edges.fraction, vertices, feet, normals, MIN_COSINE)
        crease_edge_loops.draw_creases(*cells, *shape, offsets, planes, triangles)

    run_blocks(draw, len(codes), BLOCK)
    if not many:
        return vertices, triangles
    lower = band.positions(band.keys[corners[planes.of_cell, 0]])
    met = meet_planes(planes.squares, planes.right, planes.middle)
    met = stop_at_level(planes.middle, met, band.ask)
    triangles = join_creases(triangles, len(vertices))
    vertices, left = CreaseVertices(met, planes.middle, lower, band.step).place(vertices, triangles)
    if len(left):
        place = tell_middle(vertices[triangles[left, 0]], vertices)
        cause = f"{len(left):,} of {len(triangles):,} triangles cross others, as at {place}: creases turn within a step"
        journal.tell(f"{cause}; no mesh without creases has such, nor clean_mesh(mesh, untangle=True)", DataWarning)
    return vertices, triangles


def tangent_planes(field: Field, points: FloatArray, level: float, max_step: float) -> tuple[FloatArray, FloatArray]:
    """Return feet and unit normals (n, 3) of the planes F + ∇F · (x − p) = level of points p (n, 3) near the surface.

    Edges that end on both sides of a crease are crossed neither where the field would be if it were linear along them,
    nor at the zero of a parabola; where it is made of smooth sheets these planes are tangent to them all the same.

    Feet are those of Newton's steps, none longer than `max_step`.
    """
    feet, normals = np.empty_like(points), np.empty_like(points)
    for i, j in blocks(len(points), BATCH_SIZE):
        values, slopes = values_and_gradients(field, points[i:j])
        slopes = require_finite(slopes, "field gradients")
        length = np.maximum(np.linalg.norm(slopes, axis=1), np.finfo(np.float64).tiny)
        normals[i:j] = slopes / length[:, np.newaxis]
        feet[i:j] = points[i:j] + euclidean(points[i:j], values - level, slopes, max_step)
        progress.report(j, len(points))
    return feet, normals


def _draw_smooth(crossing: Crossing) -> IntArray:
    """Return the triangles of cells by marching cubes."""
    corners, codes, numbering, edges, _ = crossing
    drawn = COUNTS[CUBES, codes]
    offsets, triangles = np.cumsum(drawn) - drawn, np.empty((drawn.sum(), 3), dtype=np.int64)

    def draw(start: int, stop: int) -> None:
        loops.draw_cells(start, stop, corners, codes, numbering, edges.fraction, offsets, triangles)

    run_blocks(draw, len(codes), BLOCK)
    return triangles
