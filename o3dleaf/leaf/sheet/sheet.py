"""From any scan of a leaf to one open sheet: a mesh without handles, averaged where the scan is no sheet."""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.places import extent, tell_middle
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_length
from o3dleaf.leaf.sheet.averaged_sheets import FEWEST, average_to_sheets
from o3dleaf.leaf.sheet.holes import cut_off_flaps, fill_small_holes, split_bow_ties
from o3dleaf.leaf.sheet.layers.widths import OFF, STEEP, WIDEST, find_passes, same_facing
from o3dleaf.leaf.sheet.open_sheets import nearest_layers
from o3dleaf.leaf.sheet.pieces.blades import find_blades
from o3dleaf.leaf.sheet.pieces.crossing import find_crossing
from o3dleaf.leaf.sheet.pieces.leaf_pair import LeafPair
from o3dleaf.leaf.sheet.pieces.leftovers import Leftovers, tell_averaging, tell_cuts
from o3dleaf.leaf.sheet.pieces.necks import find_necks
from o3dleaf.leaf.sheet.pieces.peaks import JoinedParts
from o3dleaf.leaf.sheet.pieces.slits import find_slits
from o3dleaf.leaf.sheet.pieces.table import Table, find_table
from o3dleaf.leaf.sheet.pieces.tube_ends import find_tube_ends
from o3dleaf.leaf.sheet.scan_lines import without_scan_lines
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.cloud.usable_points import usable_rows
from o3dleaf.surface.mesh.deviation import distance_to_mesh
from o3dleaf.surface.mesh.topology import find_holes
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

MAX_POINTS = 20_000
"""Points that a sheet is made of at most; a chart needs no more, and the surface is fitted to all of them later."""
SHOWN = 200
"""Places that are marked of a whole surface at most: a picture shows no more."""


@dataclass(frozen=True, eq=False)
class OpenSheet:
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
        What was averaged or cut: one line each, with how much and where.
    leftovers : Leftovers or None
        What was left out; None of a sheet that is not the largest of its scan.
    others : (k,) ndarray of int64
        Where a piece was asked for, the points of the scan that belong to other ones.
    off_sheet : tuple of str
        Where a piece was asked for, a line on what of it lies off the sheet, if more than stragglers does.
    tube : (k, 3) ndarray
        Vertices around ends of tubes, which belong to no blade laid flat.
    blades : str or None
        Which blades leave a tube, if several do: no chart lays them flat together.
    """

    vertices: FloatArray
    triangles: IntArray
    rows: IntArray
    spacing: float
    scale: float
    notes: tuple[str, ...]
    leftovers: Leftovers | None = None
    others: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    off_sheet: tuple[str, ...] = ()
    tube: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    blades: str | None = None


def find_sheet(points: CloudLike, *, piece: int | None = None, one_sheet: bool = True) -> OpenSheet:
    """Return the open sheet through a scan, whatever its curls, folds, gaps and holes.

    Points are averaged across the surface as much as their noise needs, and more where layers lie closer than four
    spacings and face one way: passes of a scanner that disagree, or the two sides of a thin leaf. Triangles are the
    Delaunay stars of the tangent planes, glued along their edges so that no handle comes about. Layers that averaging
    does not join are other sheets, and left out. Leaves that rest on one another or cross are told, and parted where
    one of them is asked for.

    Parameters
    ----------
    points : (n, 3) array_like or Open3D point cloud
        Of a leaf, and whatever else was scanned.
    piece : int, optional
        Which of the pieces and layers, 1 for the largest sheet or, where parts of it hang together by narrow necks or
        lie on one another or cross, the largest of them; left out, that sheet as a whole.
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
    with finding:
        try:
            found, pair = _sheet_of(scan, used, one_sheet=one_sheet)
        except ReconstructionError as cause:
            apart, number = _pieces_apart(scan, used, piece, cause)
            return _sheet_of_piece(apart, number, one_sheet=one_sheet)
        found = _with_strays(found, scan, used)
        table = find_table(scan, used)
        joined = pair if table is None or not table.joined else table
        blades = None if joined is not None else find_blades(found.vertices, found.triangles, found.tube)
        parts, notes = _parts(scan, found, joined, blades)
        leftovers = Leftovers.of(scan, found.rows, found.vertices, found.triangles, found.spacing, parts)
        if piece is not None and (piece > 1 or parts):
            return _sheet_of_piece(leftovers, piece, one_sheet=one_sheet)
        if joined is not None:
            notes = (joined.tell(found.rows, leftovers.listed()),)
        others = found.others if piece is None else leftovers.others(piece)
        told = None if blades is None else blades.note
        return replace(found, leftovers=leftovers, notes=(*found.notes, *notes), others=others, blades=told)


def _sheet_of_piece(pieces: Leftovers, number: int, *, one_sheet: bool) -> OpenSheet:
    """Return the sheet of the N-th piece of a scan."""
    sheet, _ = _sheet_of(pieces.scan, pieces.piece(number), one_sheet=one_sheet)
    return replace(sheet, others=pieces.others(number), off_sheet=pieces.off_sheet_of(number, sheet.rows))


def _pieces_apart(
    scan: FloatArray, used: IntArray, piece: int | None, cause: ReconstructionError
) -> tuple[Leftovers, int]:
    """Return the pieces that are apart, and the number of one, where the largest makes no sheet; or raise the cause.

    Where none was asked for the refusal names them: what has no sheet may be a pot, and the leaf another piece.
    """
    apart = Leftovers.apart(scan, used, OrientedCloud.of(scan[used]).spacing)
    if len(apart.pieces) < 2:
        raise cause
    if piece is None:
        raise apart.named_in(cause) from cause
    return apart, piece


def _parts(
    scan: FloatArray, sheet: OpenSheet, joined: LeafPair | Table | None, blades: JoinedParts | None
) -> tuple[tuple[IntArray, ...], tuple[str, ...]]:
    """Return the rows of each part of a sheet that can be asked for, and a line on blades or on necks between them."""
    if joined is not None:
        return joined.parts, ()
    parts = blades or find_necks(sheet.vertices, sheet.triangles)
    if parts is None:
        return (), ()
    part = parts.part[query(cKDTree(sheet.vertices), scan[sheet.rows])[1]]
    rows = tuple(sheet.rows[part == each] for each in range(int(part.max()) + 1))
    return rows, (f"{parts.note}: `piece` takes one of them",)


def _with_strays(sheet: OpenSheet, scan: FloatArray, used: IntArray) -> OpenSheet:
    """Return a sheet with those points that were not `used` (k,), as outliers or repeated, but lie on it."""
    rest = np.setdiff1d(np.flatnonzero(np.isfinite(scan).all(axis=1)), used)
    if len(rest):
        rest = rest[distance_to_mesh(sheet.vertices, sheet.triangles, scan[rest]) <= OFF * sheet.spacing]
    return replace(sheet, rows=np.sort(np.concatenate([sheet.rows, rest])))


def _sheet_of(scan: FloatArray, pool: IntArray, *, one_sheet: bool) -> tuple[OpenSheet, LeafPair | None]:
    """Return the sheet through the points `pool` (k,) of a scan (n, 3), and leaves of them that rest or cross."""
    some = pool[thinned(len(pool), -(-len(pool) // MAX_POINTS))]
    some = some[without_scan_lines(scan[some])]
    found = average_to_sheets(scan, some, one_sheet=one_sheet)
    sheets, spacing = found.sheets, found.sheets.spacing
    vertices, triangles = sheets.sheet()
    normals = vertex_normals(vertices, triangles)
    overlaps = nearest_layers(vertices, normals, WIDEST * spacing, STEEP)
    vertices, triangles, flaps = cut_off_flaps(vertices, triangles, same_facing(overlaps))
    ends = find_tube_ends(vertices, triangles)  # before they are closed as holes, and where small holes lie beside
    vertices, triangles = fill_small_holes(vertices, triangles, 2 * np.pi * sheets.gap)
    ends = np.concatenate([ends, find_tube_ends(vertices, triangles)])
    vertices, triangles, slits = _opened(vertices, triangles)
    held = distance_to_mesh(vertices, triangles, sheets.points) <= OFF * spacing
    if held.sum() < FEWEST:
        raise ReconstructionError(
            f"scan: only {held.sum()} of {len(held):,} points lie on one sheet, at {tell_middle(vertices, vertices)}; "
            "give the points of a leaf, closer together",
            _some(vertices),
        )
    made_of = np.concatenate([found.rows, found.others])
    of_sheet = np.append(held, np.zeros(len(found.others), bool))
    nearest = query(cKDTree(scan[made_of]), scan[pool])[1]
    rows = pool[of_sheet[nearest]]
    pair = find_crossing(scan[made_of], vertices, triangles, spacing, made_of, found.resting)
    pair = None if pair is None else pair.spread(made_of[nearest], pool)
    passes = find_passes(scan[found.rows], sheets)
    joined = len(passes.places) > 0 or bool((found.width > found.base).any())
    averaged = tell_averaging(scan[found.rows], found.width, found.base, passes)
    notes = averaged + slits + tell_cuts(sheets.cut, flaps, scan)
    whole = spacing * float(np.sqrt(held.sum() / len(rows)))
    scale = float(found.width.max()) if joined else 0.0
    return OpenSheet(vertices, triangles, rows, whole, scale, notes, tube=ends), pair


def _opened(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """Return a sheet, cut along its slits if it is closed, and a line if it was; or raise `ReconstructionError`."""
    if find_holes(vertices, triangles).is_rim.any():
        return vertices, triangles, ()
    slits = find_slits(vertices, triangles)
    if slits is None:
        size = tell_length(extent(vertices))
        raise ReconstructionError(
            f"scan: its points close around a volume at {tell_middle(vertices, vertices)}, {size} across, and no sheet "
            "is open there; give one side of the leaf",
            _some(vertices),
        )
    return *split_bow_ties(vertices, triangles[slits.kept]), (slits.note,)


def _some(points: FloatArray) -> FloatArray:
    """Return those of points (n, 3) that are marked of a whole surface."""
    return points[thinned(len(points), -(-len(points) // SHOWN))]
