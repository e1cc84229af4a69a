"""What a sheet leaves of its scan: pieces, layers and branchings, by number, size and place."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError, ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray, UniqueRows
from o3dleaf.core.places import middle_of, tell_middle, tell_place
from o3dleaf.core.trees import query
from o3dleaf.core.units import tell_count, tell_length
from o3dleaf.leaf.sheet.layers.widths import Passes
from o3dleaf.surface.cloud.oriented_cloud import OrientedCloud
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.mesh.deviation import nearest_on_mesh
from o3dleaf.surface.mesh.topology import EdgeTable, label_nodes

LINK = 6.5
"""Spacings within which points are of one piece, the widest gap that a sheet's triangles join."""
NEAR = 4.0
"""Spacings from the sheet up to which half of a group's points are those of a layer over it, not a piece of its own."""
TOUCHING = 2.0
"""Spacings from the sheet at which another one meets it."""
FEWEST = 24
"""Points of a piece that can be asked for."""
SAMPLE = 2000
"""Points that the area of a piece is told by, at most: their spacing is off by a hundredth."""
LISTED = 6
"""Pieces that are listed where one has to be chosen."""
SHOWN = 3
"""Groups that are told one by one."""


@dataclass(frozen=True, eq=False)
class Leftovers:
    """Groups of points that do not belong to a sheet, the largest first.

    Attributes
    ----------
    scan : (n, 3) ndarray
    groups : tuple of (k,) ndarrays
        Rows of each group.
    distance : tuple of float
        Of each group from the sheet, the least.
    over : tuple of bool
        Which groups are layers over the sheet, near it with half of their points.
    branch : tuple of (3,) ndarray or None
        Where each group meets the sheet, away from its rim.
    held : int
        Points of the sheet.
    spacing : float
    parts : tuple of (k,) ndarrays
        Rows of each part of the sheet, where parts hang together by narrow necks or lie on one another; of these also
        points that the sheet does not hold.
    """

    scan: FloatArray
    groups: tuple[IntArray, ...]
    distance: tuple[float, ...]
    over: tuple[bool, ...]
    branch: tuple[FloatArray | None, ...]
    held: IntArray
    spacing: float
    parts: tuple[IntArray, ...] = ()

    @classmethod
    def of(
        cls,
        scan: FloatArray,
        held: IntArray,
        vertices: FloatArray,
        triangles: IntArray,
        spacing: float,
        parts: tuple[IntArray, ...] = (),
    ) -> "Leftovers":
        """Group the points that a sheet does not hold, and those of each of some `parts`, that hang together."""
        rest = np.setdiff1d(np.arange(len(scan)), held)
        groups = groups_of(scan, rest, LINK * spacing)
        edges = EdgeTable.of(triangles)
        rim = cKDTree(vertices[np.unique(edges.ends[edges.count == 1])])
        distance, over, branch = [], [], []
        for rows in groups:
            feet = nearest_on_mesh(vertices, triangles, scan[rows])
            far = np.linalg.norm(feet - scan[rows], axis=1)
            inner = np.where(rim.query(feet)[0] > NEAR * spacing, far, np.inf)
            distance.append(float(far.min()))
            over.append(bool(np.median(far) <= NEAR * spacing))
            # What nowhere leaves the sheet lies over it, and meets it nowhere.
            meets = inner.min() <= TOUCHING * spacing and far.max() > NEAR * spacing and len(rows) >= FEWEST
            branch.append(feet[inner.argmin()] if meets else None)
        together = tuple(group for part in parts for group in groups_of(scan, part, LINK * spacing))
        return cls(scan, groups, tuple(distance), tuple(over), tuple(branch), held, spacing, together)

    @classmethod
    def apart(cls, scan: FloatArray, rows: IntArray, spacing: float) -> "Leftovers":
        """Group points of a scan that has no sheet: the largest group stands for it."""
        largest, *groups = groups_of(scan, rows, LINK * spacing)
        none = (False,) * len(groups)
        return cls(scan, tuple(groups), (np.inf,) * len(groups), none, (None,) * len(groups), largest, spacing)

    def piece(self, number: int) -> IntArray:
        """Return the rows of the N-th piece, counted from 1: the sheet or its parts, and what is apart from them.

        Raises
        ------
        ReconstructionError
            If there are not so many.
        """
        pieces = self.pieces
        if number > len(pieces):
            shown = tuple(self.scan[rows] for rows in pieces)
            places = np.array([middle_of(points) for points in shown])
            raise ReconstructionError(f"piece: is {number}, but the scan has {self.listed()}", places, shown)
        return pieces[number - 1]

    def others(self, number: int) -> IntArray:
        """Return the rows of what belongs to other pieces than the N-th; a point of no piece is of the nearest one."""
        pieces = self.pieces
        of_piece = np.repeat(np.arange(1, len(pieces) + 1), [len(rows) for rows in pieces])
        nearest = query(cKDTree(self.scan[np.concatenate(pieces)]), self.scan)[1]
        return np.flatnonzero(of_piece[nearest] != number)

    @cached_property
    def pieces(self) -> tuple[IntArray, ...]:
        """Rows of all that can be asked for: the sheet, then the groups; where it has parts, by falling area."""
        of_parts = np.concatenate([np.empty(0, np.int64), *self.parts])
        groups = tuple(np.setdiff1d(group, of_parts, assume_unique=True) for group in self.groups)
        pieces = tuple(rows for rows in (*(self.parts or (self.held,)), *groups) if len(rows) >= FEWEST)
        return tuple(sorted(pieces, key=lambda rows: -self.area(rows))) if self.parts else pieces

    def off_sheet_of(self, number: int, held: IntArray) -> tuple[str, ...]:
        """Return a line if more of the N-th piece than stragglers is off the sheet of some rows (k,) that is its."""
        rows = self.pieces[number - 1]
        groups = groups_of(self.scan, np.setdiff1d(rows, held), LINK * self.spacing)
        groups = tuple(group for group in groups if len(group) >= FEWEST)
        if not groups:
            return ()
        off = sum(map(len, groups))
        of = f"{off:,} of its {len(rows):,} points lie off that, the largest group {self.name(groups[0])}"
        return (f"piece {number} is more than one sheet, of which the largest is taken: {of}; cut the scan there",)

    def listed(self) -> str:
        """Return the number of the pieces, and the first of them by number, size and place."""
        pieces = self.pieces
        shown = "; ".join(f"{k}: {self.name(rows)}" for k, rows in enumerate(pieces[:LISTED], 1))
        return f"{len(pieces)}: {shown}{'; ...' if len(pieces) > LISTED else ''}"

    def named_in(self, cause: ReconstructionError) -> ReconstructionError:
        """Return a refusal that names the pieces too, to choose one of."""
        more = f"; the scan's pieces are {self.listed()}; give `piece` to take one"
        return ReconstructionError(f"{cause}{more}", cause.places, tuple(self.scan[rows] for rows in self.pieces))

    def beyond(self, reach: float) -> IntArray:
        """Return the rows (k,) of groups too small for a piece that lie within so many spacings of the sheet."""
        near = [
            rows
            for rows, far in zip(self.groups, self.distance, strict=True)
            if len(rows) < FEWEST and far <= reach * self.spacing
        ]
        return np.concatenate([np.empty(0, np.int64), *near])

    def without(self, rows: IntArray) -> "Leftovers":
        """Return what is left out if the sheet holds some rows (k,) after all."""
        parts = [np.setdiff1d(group, rows) for group in self.groups]
        kept = sorted((i for i, part in enumerate(parts) if len(part)), key=lambda i: -len(parts[i]))
        return replace(
            self,
            groups=tuple(parts[i] for i in kept),
            distance=tuple(self.distance[i] for i in kept),
            over=tuple(self.over[i] for i in kept),
            branch=tuple(self.branch[i] for i in kept),
            held=np.union1d(self.held, rows),
        )

    def tell(self) -> tuple[str, ...]:
        """Return a line for each of the largest groups, what it is, how large and where, and one for all others."""
        notes = []
        whole = 1 + sum(not over and len(rows) >= FEWEST for over, rows in zip(self.over, self.groups, strict=True))
        if whole > 1:
            notes.append(f"{whole} pieces; the largest sheet is used: {self.name(self.held)}; `piece` takes another")
        for rows, over, far, branch in zip(self.groups[:SHOWN], self.over, self.distance, self.branch, strict=False):
            kind = "another layer" if over else "another piece"
            how = f", {tell_length(far)} off the sheet" if over else f", {tell_length(far)} away"
            taken = "; `piece` takes it instead" if over and len(rows) >= FEWEST else ""
            notes.append(f"left out: {kind}, {self.name(rows)}{how}{taken}")
            if branch is not None:
                notes.append(f"3 sheets meet at {tell_place(branch, self.scan)}")
        others = self.groups[SHOWN:]
        if others:
            count = sum(map(len, others))
            most = len(others[0])
            size = f"{tell_count(len(others), 'group')} of {most}{' or fewer' * (most > 1)}"
            notes.append(f"left out: {tell_count(count, 'point')} in {size}")
        return tuple(notes)

    def area(self, rows: IntArray) -> float:
        """Return the area of a piece, of points as dense as its own are, or if it shows no surface as the sheet's."""
        some = rows[thinned(len(rows), -(-len(rows) // SAMPLE))]
        try:
            spacing = OrientedCloud.of(self.scan[some]).spacing
        except InputError:
            return len(rows) * self.spacing**2
        return len(some) * spacing**2

    def name(self, rows: IntArray) -> str:
        """Return size and place of a piece, in words."""
        area = tell_length(self.area(rows), 2)
        points = f"{tell_count(len(rows), 'point')} (area about {area})"
        return f"{points} at {tell_middle(self.scan[rows], self.scan)}"


def groups_of(scan: FloatArray, rows: IntArray, link: float) -> tuple[IntArray, ...]:
    """Return the rows, group by group, of points that hang together by steps of about `link`, the largest first.

    Of the points in a voxel of a quarter of it one stands for all.
    """
    if not len(rows):
        return ()
    voxel = np.floor((scan[rows] - scan[rows].min(axis=0)) / (link / 4)).astype(np.int64)
    _, first, of_voxel = UniqueRows.of(voxel)
    pairs = cKDTree(scan[rows[first]]).query_pairs(link, output_type="ndarray")
    ends = np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])
    label = label_nodes(*ends, len(first))[of_voxel]
    order = np.argsort(label, kind="stable")
    parts = np.split(rows[order], np.flatnonzero(np.diff(label[order])) + 1)
    return tuple(sorted(parts, key=lambda part: -len(part)))


def tell_averaging(points: FloatArray, width: FloatArray, base: float, passes: Passes) -> tuple[str, ...]:
    """Return what is to be said of points (n, 3) averaged over a `width` (n,), wider than noise needs, `base`."""
    notes = []
    if base > 0:
        notes.append(f"noise: points were averaged over {tell_length(base)} to lay the sheet through them")
    if len(passes.places):
        notes.append(
            f"two layers {tell_length(passes.apart)} apart, as passes that disagree or both sides of a leaf, lie "
            f"within the noise and were averaged to one: about {100 * passes.share:.3g} % of the points, around "
            f"{tell_middle(passes.places, points)}"
        )
    wide = width > base
    if wide.any():
        share = 100 * wide.mean()
        notes.append(
            f"layers that face one way were averaged over up to {tell_length(float(width.max()))} to be one sheet: "
            f"{share:.3g} % of the points, around {tell_middle(points[width == width.max()], points)}"
        )
    return tuple(notes)


def tell_cuts(cut: FloatArray, flaps: FloatArray, scan: FloatArray) -> tuple[str, ...]:
    """Return what is to be said of edges cut, middles (c, 3), and of vertices (k, 3) of flaps cut off, on a scan."""
    notes = []
    if len(cut):
        edges, place = tell_count(len(cut), "edge"), tell_middle(cut, scan)
        notes.append(f"cut along {edges} around {place}, where parts far apart along the sheet touch")
    if len(flaps):
        count = tell_count(len(flaps), "vertex", "vertices")
        notes.append(f"cut off: {count} of layers over the sheet, most around {tell_middle(flaps, scan)}")
    return tuple(notes)
