"""From any scan of a leaf to one open sheet: a mesh without handles, averaged where the scan is no sheet."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.leaf.sheet.holes import cut_off_flaps, fill_small_holes
from o3dleaf.leaf.sheet.leftovers import Leftovers, place_of, tell_averaging, tell_cuts
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, nearest_layers
from o3dleaf.leaf.sheet.widths import (
    OFF,
    STEEP,
    WIDEST,
    Layers,
    find_layers,
    noise_width,
    same_facing,
    widen,
)
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.preprocess import usable_rows
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import find_holes
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

MOST = 20_000
"""Points that a sheet is made of at most; a chart needs no more, and the surface is fitted to all of them later."""
FEWEST = 24
"""Points of a sheet at least, as `detect_outliers` has it."""
ROUNDS = 6
"""Times that a cloud is averaged anew at most, each time where the sheet before it lay double."""
FULL = 0.6
"""Flatness above which points fill a volume, as when normals are oriented."""
THICK = 25.0
"""Spacings up to which the two sides of a closed surface are taken for those of a thin leaf."""
SAMPLE = 400
"""Vertices at which the thickness of a closed surface is measured."""
MEETING = 3.0
"""Spacings that the sides of a thin leaf are brought within, by thinning, before they are averaged."""
LINK = 3.0
"""Spacings within which places of layers are one layer."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """An open sheet through a scan, from which a chart is made; smoother than the scan, and never far from it.

    Attributes
    ----------
    vertices : (n, 3) ndarray
        In the unit of the scan.
    triangles : (m, 3) ndarray of int64
        Connected, oriented, manifold, of genus 0, with a rim; holes where the scan has some.
    rows : (k,) ndarray of int64
        The points of the scan that belong to it, in rising order.
    spacing : float
        1/√(points per unit area) of the scan on this sheet, the median.
    scale : float
        Largest width over which points were averaged to make it one sheet, beyond their noise; 0: as scanned.
    notes : tuple of str
        What was left out, averaged or cut: one line each, with how much and where.
    """

    vertices: FloatArray
    triangles: IntArray
    rows: IntArray
    spacing: float
    scale: float
    notes: tuple[str, ...]


def find_sheet(points: CloudLike, *, piece: int | None = None, one_sheet: bool = True) -> Sheet:
    """Return the open sheet through a scan, whatever its curls, folds, gaps and holes.

    Points are averaged across the surface as much as their noise needs, and more where layers lie closer than four
    spacings and face one way: passes of a scanner that disagree, or the two sides of a thin leaf. Triangles are the
    Delaunay stars of the tangent planes, glued along their edges so that no handle comes about. Layers that averaging
    does not join are other sheets, and left out.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
        Of a leaf, and whatever else was scanned.
    piece : int, optional
        Which of the pieces and layers, 1 for the one with most points; left out, the largest.
    one_sheet : bool
        Whether layers that lie close together are one surface. If not, a scan with such layers is refused.

    Raises
    ------
    InputError
        If the points are too few or not finite, or `piece` is below 1.
    ReconstructionError
        If there is no open sheet: what was found instead, and where.
    """
    if piece is not None and piece < 1:
        raise InputError(f"piece: is {piece}; count pieces from 1, the largest")
    cleaning, finding = progress.split(1, 6)
    with cleaning:
        scan = OrientedCloud.of(points).points
        used = usable_rows(scan)
        some = used[thinned(len(used), -(-len(used) // MOST))]
    with finding:
        found = _sheet_of(scan, some, one_sheet=one_sheet)
        leftovers = Leftovers.of(scan, found.rows, found.vertices, found.triangles, found.spacing)
        if piece is None or piece == 1:
            return _told(found, leftovers.tell())
        rows = leftovers.piece(piece)
        return _told(_sheet_of(scan, rows[thinned(len(rows), -(-len(rows) // MOST))], one_sheet=one_sheet), ())


class _Solved(NamedTuple):
    """Sheets at widths (n,), which exceed `base` where layers were averaged, and the points' spacing."""

    sheets: OpenSheets
    width: FloatArray
    base: float
    rows: IntArray


def _told(sheet: Sheet, notes: tuple[str, ...]) -> Sheet:
    return Sheet(sheet.vertices, sheet.triangles, sheet.rows, sheet.spacing, sheet.scale, sheet.notes + notes)


def _sheet_of(scan: FloatArray, some: IntArray, *, one_sheet: bool) -> Sheet:
    """Return the sheet through the points `some` (k,) of a scan (n, 3)."""
    solved = _solve(scan, some, one_sheet=one_sheet)
    sheets, spacing = solved.sheets, solved.sheets.spacing
    vertices, triangles = sheets.sheet()
    normals = vertex_normals(vertices, triangles)
    overlaps = nearest_layers(vertices, normals, WIDEST * spacing, STEEP)
    vertices, triangles, flaps = cut_off_flaps(vertices, triangles, same_facing(overlaps))
    vertices, triangles = fill_small_holes(vertices, triangles, 2 * np.pi * sheets.gap)
    if not find_holes(vertices, triangles).is_rim.any():
        raise ReconstructionError(
            f"scan: its points close around a volume at {place_of(vertices)}, {np.ptp(vertices, axis=0).max():.3g} "
            "across, and no sheet is open there; give one side of the leaf"
        )
    held = distance_to_mesh(vertices, triangles, sheets.points) <= OFF * spacing
    if held.sum() < FEWEST:
        raise ReconstructionError(
            f"scan: only {held.sum()} of {len(held):,} points lie on one sheet, at {place_of(vertices)}; "
            "give the points of a leaf, closer together"
        )
    rows = _spread(scan, solved.rows, held)
    wide = solved.width > solved.base
    notes = tell_averaging(scan[solved.rows], solved.width, solved.base) + tell_cuts(sheets.cut, flaps)
    whole = spacing * float(np.sqrt(held.sum() / len(rows)))
    return Sheet(vertices, triangles, rows, whole, float(solved.width.max()) if wide.any() else 0.0, notes)


def _spread(scan: FloatArray, some: IntArray, held: BoolArray) -> IntArray:
    """Return the rows of a scan whose nearest point of `some` (k,) is `held` (k,)."""
    return np.flatnonzero(held[cKDTree(scan[some]).query(scan, workers=-1)[1]])


def _solve(scan: FloatArray, some: IntArray, *, one_sheet: bool) -> _Solved:
    """Return the sheets of points of a scan, averaged by noise and where layers lie."""
    cloud = OrientedCloud.of(scan[some])
    if cloud.surfels.flatness > FULL:
        raise ReconstructionError(
            f"scan: its {len(cloud):,} points at {place_of(cloud.points)} show no surface: they fill a volume or lie "
            "along lines; give the points of a leaf, with less noise"
        )
    spacing = cloud.spacing
    base = noise_width(cloud.noise, spacing)
    width = np.full(len(cloud), base)
    layers = Layers.none()
    sheets = OpenSheets.of(cloud.points, width, spacing)
    if not one_sheet:
        _refuse_layers(sheets)
        return _Solved(sheets, width, base, some)
    fewer = _thin_sides(sheets)
    if fewer > 1 and len(some) // fewer >= FEWEST:
        return _solve(scan, some[thinned(len(some), fewer)], one_sheet=one_sheet)
    for round_ in range(ROUNDS):
        after = layers.after(*find_layers(sheets), LINK * spacing)
        if after.like(layers):
            break
        layers = after
        width = widen(cloud.points, np.full(len(cloud), base), layers)
        sheets = OpenSheets.of(cloud.points, width, spacing)
        progress.report(round_ + 1, ROUNDS)
    return _Solved(sheets, width, base, some)


def _thin_sides(sheets: OpenSheets) -> int:
    """Return how many times to thin a closed surface for its sides to lie within three spacings of each other."""
    vertices, triangles = sheets.sheet()
    if find_holes(vertices, triangles).is_rim.any():
        return 1
    normals = vertex_normals(vertices, triangles)
    some = thinned(len(vertices), -(-len(vertices) // SAMPLE))
    overlaps = nearest_layers(vertices, normals, THICK * sheets.spacing, STEEP, some)
    apart = np.where(overlaps.facing < 0, overlaps.distance, np.inf).min(axis=1)
    thick = float(np.median(apart))
    return int(np.ceil((thick / (MEETING * sheets.spacing)) ** 2)) if np.isfinite(thick) else 1


def _refuse_layers(sheets: OpenSheets) -> None:
    """Raise `ReconstructionError` where layers lie over the largest sheet."""
    layers = Layers.none().after(*find_layers(sheets), LINK * sheets.spacing)
    if len(layers.places):
        raise ReconstructionError(
            f"scan: is no single sheet: at {len(layers.places)} places, most around {place_of(layers.places)}, another "
            f"layer lies up to {layers.need.max():.3g} off; allow them to be averaged into one sheet, or cut them out"
        )
    if len(sheets.cut):
        raise ReconstructionError(
            f"scan: is no single sheet: parts far apart along it touch at {place_of(sheets.cut)}; allow points to be "
            "averaged into one sheet, or cut them apart there"
        )
