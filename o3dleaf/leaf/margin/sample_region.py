"""The part of the plane that a sample covers: Delaunay triangles without the gaps that are more than chance."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import UniqueRows
from o3dleaf.fitting.rbf.tail import IntArray
from o3dleaf.leaf.margin.gaps.joined_pieces import PIECE, joined_pieces
from o3dleaf.leaf.margin.gaps.narrow_bays import narrow_bays
from o3dleaf.leaf.margin.gaps.passed_by import passed_by_planes
from o3dleaf.leaf.margin.gaps.sample_gaps import CHANCE, enclosed_by_chance, open_gaps, slits_of, small_gaps
from o3dleaf.leaf.margin.missing_area import missing_area, randomness
from o3dleaf.leaf.margin.sample_lines import SampleLines, local_lines
from o3dleaf.leaf.margin.sample_spacing import (
    CRUDE_JUMP,
    JUMP,
    NEIGHBORS,
    BoolArray,
    cell_sizes,
    cells_of,
    crude_spacing,
    is_uneven,
    local_shape,
    spacing_between,
    uneven_sizes,
)
from o3dleaf.leaf.margin.sample_triangles import Triangulation, components_of, inner_points, measured_by, triangulate
from o3dleaf.leaf.margin.scan_planes import Lift
from o3dleaf.leaf.margin.traced_border import Border, border_of

USUAL = 0.9
"""Share of the triangles within a sample that say how long sides are: 1.5 spacings in a lattice, 2.1 by chance."""
DIAGONAL = 1.5
"""Spacings up to which sides are usual in any case: no side of a lattice's cells is longer. Triangles of one size have
sides of 1.07; a stretch of the chart, or a row of vertices along the margin, makes longer ones."""
SHORT = 1.35
"""Triangles with no side longer than this many usual ones are covered."""
FIRST_SHORT = 2.8
"""The short side of a random sample, in spacings; where the sample is too small to tell its own."""
LONG = 1.7
"""Gaps with sides longer than this many short ones stay open where they are open to the outside: 4.8 spacings of a
random sample, the widest that 100,000 points have by chance."""
VOID = 1.6
"""Width of the widest void that chance leaves, in short sides: a disc of those 16 cells."""
DEEP = 2.0
"""Spacings from the border at which cells are those of the sample."""
NARROW = 2 / 3
"""Share of the points that are deep below which a leaf is so narrow, some fifteen spacings, that those nearest to a
margin may be of the other side's density."""
ROUNDS = 2
"""Times that an uneven sample is spaced by all of its points: where it is sparser than was thought it covers more."""


@dataclass(frozen=True)
class SampleRegion:
    """What a planar sample covers.

    Attributes
    ----------
    points : (n, 2) ndarray
    triangles : (m, 3) int ndarray
        One piece of Delaunay triangles, counter-clockwise.
    filled : (f, 3) int ndarray
        Those of them that lie over gaps: between pieces that were joined, and in slits filled on request.
    spacing : (n,) ndarray
        Square root of the area that a point stands for.
    missing : (n,) ndarray
        Area of the leaf beyond the triangles at each point of their border; 0 for the others, and where it is traced.
    randomness : float
        From 0, a lattice, to 1, independent points.
    border : Border or None
        How the border runs: a mesh's vertices trace the margin. None of a sample of lines.
    bridged : int
        Number of pieces that were joined over gaps wider than chance.
    widest : float
        Length of the longest triangle over such a gap; 0: there was none.
    left_out : (k,) int ndarray
        The points in no triangle kept.
    void : float
        Width of the widest void that chance leaves in it.
    lines : SampleLines or None
        Those that it lies on.
    passed_by : float
        Area of triangles that would be gaps if the scanner's planes did not pass by them.
    """

    points: FloatArray
    triangles: IntArray
    filled: IntArray
    spacing: FloatArray
    missing: FloatArray
    randomness: float
    border: Border | None
    bridged: int
    widest: float
    left_out: IntArray
    void: float
    lines: SampleLines | None
    passed_by: float

    @property
    def traced(self) -> bool:
        """Whether the border's points were set on the margin itself."""
        return self.border is not None and self.border.traced


def cover_sample(points: FloatArray, fill_slits: float = 0.0, lift: Lift | None = None) -> SampleRegion:
    """Return what (n, 2) distinct points cover, and the slits from its border that are no wider than asked.

    With the `lift` of their chart no place is a gap that a line scanner's planes pass by.

    Raises
    ------
    InputError
        If they lie on one line.
    """
    mesh = triangulate(points)
    found = _spaced(mesh)
    local = local_lines(mesh.near, found.spacing)
    lines = local if local is not None and local.are_most and local.inside(found.deep) else None
    if lines is not None:  # of few lines deep inside no density is known; bays look as what lies between lines does
        mesh = measured_by(mesh, local_shape(mesh.near, mesh.triangles, mesh.areas))
        found = _spaced(mesh)
        lines = lines.spaced(found.spacing)
    else:
        if found.deep.mean() < NARROW and is_uneven(points[found.deep], found.cells[found.deep]):
            for _ in range(ROUNDS):
                found = _of_uneven(mesh, found)
        found = _beside_bays(mesh, found)
    spacing, short, deep = found.spacing, found.short, found.deep
    size = spacing_between(mesh.near.row, mesh.triangles, spacing, JUMP)
    covered = _covered(mesh, spacing, size, short)
    passed_by = np.zeros_like(covered)
    if lift is not None and local is not None:
        passed_by = passed_by_planes(mesh, ~covered, local.spaced(spacing), short, lift)
    covered |= passed_by
    bays = _bays(mesh, covered, size, found) if lines is None else np.zeros_like(covered)
    covered &= ~bays
    kept, bridged, widest = joined_pieces(mesh, covered, bays, spacing, LONG * short)
    chance = enclosed_by_chance(mesh, kept, size, short)
    covered, kept = covered | chance, kept | chance
    kept |= slits_of(mesh, kept, fill_slits)
    labels = components_of(mesh.neighbors, kept)
    kept &= labels == np.argmax(np.bincount(labels[kept], mesh.areas[kept]))
    left_out = np.setdiff1d(np.arange(len(points)), mesh.triangles[kept])
    random = _randomness(mesh, kept & ~passed_by, deep, spacing)
    # A line along the margin is as smooth as one that was set on it.
    border = border_of(mesh, kept, deep, spacing) if lines is None else None
    missing = np.zeros(len(points))
    if border is None or not border.traced:
        missing = missing_area(mesh, kept, spacing, random, _longest(mesh, bays & ~kept, short), lines)
    triangles, filled = mesh.triangles[kept], mesh.triangles[kept & ~covered]
    void = VOID * short * float(np.median(spacing))
    area = float(mesh.areas[kept & passed_by].sum())
    return SampleRegion(
        points, triangles, filled, spacing, missing, random, border, bridged, widest, left_out, void, lines, area
    )


def _longest(mesh: Triangulation, bays: BoolArray, short: float) -> FloatArray:
    """Return how long sides (n,) of triangles may be that are covered, in spacings: beside narrow bays no longer."""
    longest = np.full(len(mesh.points), LONG * short)
    longest[mesh.triangles[bays]] = short / SHORT
    return longest


class _Spaced(NamedTuple):
    """How a sample is spaced: triangles `kept` (m,) and the `cells` (n,) of these, `deep` points (n,), `spacing` (n,).

    And the side, in spacings, that is still `short`, and the triangles `bays` (m,) of narrow bays found so far.
    """

    kept: BoolArray
    cells: FloatArray
    deep: BoolArray
    spacing: FloatArray
    short: float
    bays: BoolArray


def _spaced(mesh: Triangulation) -> _Spaced:
    """Return how a sample is spaced, as one that is even: by its deep points."""
    spacing, short, jump = crude_spacing(mesh.near), FIRST_SHORT, CRUDE_JUMP
    for _ in range(3):  # the crude spacing is too long at margins; the third pass changes it by less than a hundredth
        kept, cells, deep = _cells(mesh, spacing, short, jump)
        spacing, jump = cell_sizes(mesh.near, cells, deep), JUMP
        short = _short(mesh, kept, deep, spacing)
    return _Spaced(kept, cells, deep, spacing, short, np.zeros_like(kept))


def _beside_bays(mesh: Triangulation, found: _Spaced) -> _Spaced:
    """Return how a sample is spaced without its narrow bays: where they were covered, cells were too large."""
    for _ in range(ROUNDS):
        size = spacing_between(mesh.near.row, mesh.triangles, found.spacing, JUMP)
        bays = _bays(mesh, _covered(mesh, found.spacing, size, found.short), size, found)
        if not np.any(bays & ~found.bays):
            break
        kept, cells, deep = _cells(mesh, found.spacing, found.short, JUMP, bays)
        spacing = cell_sizes(mesh.near, cells, deep)
        found = _Spaced(kept, cells, deep, spacing, _short(mesh, kept, deep, spacing), bays)
    return found


def _of_uneven(mesh: Triangulation, found: _Spaced) -> _Spaced:
    """Return how a sample is spaced, by all points, those at its border as what of them is not beyond it."""
    kept, cells, deep, spacing, short, bays = found
    longest = np.full(len(spacing), LONG * short)
    missing = missing_area(mesh, kept, spacing, _randomness(mesh, kept, deep, spacing), longest)
    spacing = uneven_sizes(mesh.points, cells, 1 - missing / spacing**2, spacing)
    short = _short(mesh, kept, deep, spacing)
    return _Spaced(*_cells(mesh, spacing, short, JUMP), spacing, short, bays)


def _cells(
    mesh: Triangulation,
    spacing: FloatArray,
    short: float,
    jump: float,
    bays: BoolArray | None = None,
) -> tuple[BoolArray, FloatArray, BoolArray]:
    """Return the triangles (m,) that are covered, the cells (n,) that these make, and the points deep in them (n,)."""
    kept = _covered(mesh, spacing, spacing_between(mesh.near.row, mesh.triangles, spacing, jump), short)
    kept = kept if bays is None else kept & ~bays
    return kept, cells_of(mesh.points, mesh.triangles[kept], mesh.areas[kept]), _deep(mesh, kept, spacing)


def _short(mesh: Triangulation, kept: BoolArray, deep: BoolArray, spacing: FloatArray) -> float:
    """Return the side, in spacings, up to which sides are short in the sample."""
    within = _within(mesh, kept, deep)
    usual = mesh.reach[within] / spacing[mesh.triangles[within]].mean(axis=1)
    return SHORT * max(float(np.quantile(usual, USUAL)), DIAGONAL) if len(usual) else FIRST_SHORT


def _randomness(mesh: Triangulation, kept: BoolArray, deep: BoolArray, spacing: FloatArray) -> float:
    """Return how random the sample is, by the triangles about its deep points."""
    cells = mesh.areas / (spacing[mesh.triangles] ** 2).mean(axis=1)
    return randomness(cells[kept], deep[mesh.triangles[kept]].sum(axis=1))


def _deep(mesh: Triangulation, kept: BoolArray, spacing: FloatArray) -> BoolArray:
    """Return the points that no border has cut: `DEEP` spacings from it, or in a narrow piece less.

    They are told by distance, not by rings of triangles: points with large cells have fewer rings to the border.
    """
    used, inner = inner_points(mesh, kept)
    depth = cKDTree(mesh.points[used & ~inner]).query(mesh.points)[0]
    tries = [inner & (depth > share * DEEP * spacing) for share in (1.0, 0.5, 0.0)]
    enough = min(2 * NEIGHBORS, int(used.sum()))
    return next((found for found in tries if found.sum() >= enough), used)


def _within(mesh: Triangulation, kept: BoolArray, deep: BoolArray) -> BoolArray:
    """Return the triangles that say how long sides are within the sample: those whose corners are all deep.

    Each point has two triangles. Where those that are left have less than half of theirs, the deep part is a strip as
    narrow as triangles, in which only small ones fit; then no corner need be deeper than beside the border.
    """
    within: BoolArray = kept & deep[mesh.triangles].all(axis=1)
    if within.sum() < deep.sum():
        within = kept & inner_points(mesh, kept)[1][mesh.triangles].all(axis=1)
    return within


def _covered(mesh: Triangulation, spacing: FloatArray, size: FloatArray, short: float) -> BoolArray:
    """Return the triangles that are covered: all with short sides, and the gaps that chance makes.

    Lengths are told by `size` (m,), the spacing that each triangle is judged by (`spacing_between`); in bays, which are
    open to the outside, by the `spacing` (n,) of their corners: what lies between a dense part and a sparse one may be
    no more than where both end.
    """
    gaps = mesh.reach / size > short
    own = spacing[mesh.triangles].mean(axis=1)
    pockets = open_gaps(mesh, gaps) & (mesh.reach / own <= LONG * short)
    gaps &= ~small_gaps(mesh, pockets, mesh.areas / own**2, CHANCE * short**2)
    covered: BoolArray = ~gaps | enclosed_by_chance(mesh, ~gaps, size, short)
    return covered


def _bays(mesh: Triangulation, covered: BoolArray, size: FloatArray, found: _Spaced) -> BoolArray:
    """Return the triangles (m,) of narrow bays: what is as narrow inside a leaf is a scanner's as often.

    All along their banks there are deep points, whose spacing is known: a strip too narrow for any may be as sparse.
    Of what is left where they are open fewer are deep; so those found before stay.
    """
    bays = narrow_bays(mesh, size, found.short / SHORT, found.short, LONG * found.short)
    known = cKDTree(mesh.points[found.deep]).query(mesh.points)[0] <= 2 * DEEP * found.spacing
    labels = components_of(mesh.neighbors, bays)
    bays &= ~np.isin(labels, labels[bays & ~known[mesh.triangles].all(axis=1)])
    bays = found.bays | bays & open_gaps(mesh, bays | ~covered)
    return bays & ~_cuts(mesh, covered, bays)


def _cuts(mesh: Triangulation, covered: BoolArray, bays: BoolArray) -> BoolArray:
    """Return those of the bays (m,) that have more than one piece of the leaf at their banks: they do not end in it."""
    rows = np.flatnonzero(bays)
    if not len(rows):
        return bays
    own = components_of(mesh.neighbors, bays)[rows]
    pieces = components_of(mesh.neighbors, covered & ~bays)
    large = np.bincount(pieces[pieces >= 0], minlength=1) >= PIECE
    beside = np.append(pieces, -1)[mesh.neighbors[rows]]
    row, side = np.nonzero((beside >= 0) & large[beside])
    pairs = UniqueRows.of(np.stack([own[row], beside[row, side]], axis=1)).rows
    cuts = np.zeros(len(bays), dtype=bool)
    cuts[rows] = (np.bincount(pairs[:, 0], minlength=own.max() + 1) > 1)[own]
    return cuts
