"""A mesh, or a part of one with its border locked, that passes make into better triangles."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.halfedge_loops import CREASE, LOCKED, link_twins
from o3dleaf.surface.remeshing.pass_loops import (
    collapse_short,
    cure_slivers,
    fill_shifts,
    fill_tries,
    flip_edges,
    mark_long,
    move_vertices,
    split_edges,
)
from o3dleaf.surface.remeshing.projection_target import Ground, Masks

ROOM = 3
"""Triangles that there is room for, of those that there are: splitting adds some."""
SWEEPS = 8
"""Times that all edges, or slivers, are looked at in one pass, at most."""
SHARE = 0.7
"""Of the way to the middle of its triangles that a vertex goes at once."""
RELAXED = ((15.0, 1.25, 0.2), (5.0, 1.5, -0.2))
"""Angles below which, and how much, slivers may have more: longer edges, sharper turns."""
TRIES = (0.3, 0.1, 0.5, 0.2)
"""Shares of the edges along which the corners of slivers are moved, one after another."""


KNOT = "mesh: is not manifold, or has triangles that run against one another; clean it first"


@dataclass(frozen=True)
class Limits:
    """What an edit may do.

    Attributes
    ----------
    shortest, longest : float
        Edges shorter are collapsed, longer ones split, and none is made longer.
    deviation : float
        How far what is taken away may lie from what is left.
    fair, flat : float
        Score that is good enough, and least cosine to the normals before; see `o3dleaf.surface.remeshing.pass_loops`.
    floor : float
        Least score of what a vertex leaves behind that comes to the ground.
    """

    shortest: float
    longest: float
    deviation: float
    fair: float = 0.5
    flat: float = 0.6
    floor: float = 0.0

    def relaxed(self) -> tuple["Limits", ...]:
        """Return what is allowed where nothing less would do."""
        return tuple(
            replace(self, longest=longer * self.longest, fair=float(np.sin(np.radians(angle))), flat=flat)
            for angle, longer, flat in RELAXED
        )

    def coarser(self, factor: float) -> "Limits":
        """Return limits for longer edges, which may lie further away."""
        return replace(
            self, shortest=factor * self.shortest, longest=factor * self.longest, deviation=factor**2 * self.deviation
        )

    @property
    def loose(self) -> "Limits":
        """What is allowed on the way to the ground."""
        return replace(self, longest=2 * self.longest, fair=0.05, flat=-0.2)

    @property
    def numbers(self) -> tuple[float, float, float, float]:
        """What the compiled passes take."""
        return self.fair, self.flat, self.deviation, self.longest


class Piece:
    """Half-edges with places, charts and labels."""

    def __init__(self, mesh: Charted, locked: BoolArray) -> None:
        """Take a mesh, of which the border and the `locked` (n,) vertices stay.

        Raises
        ------
        InputError
            If an edge has three triangles, or two that run along it in one direction.
        """
        n, m = len(mesh.places), len(mesh.triangles)
        room_m = ROOM * m + 32
        room_n = n + room_m // 2
        self.places, self.charts = np.zeros((room_n, 3)), np.zeros((room_n, 3))
        self.places[:n], self.charts[:n] = mesh.places, mesh.charts
        self.grounded, self.fixed = np.ones(room_n, dtype=bool), np.zeros(room_n, dtype=bool)
        self.grounded[:n], self.fixed[:n] = mesh.grounded, locked
        self.labels = np.zeros(room_m, dtype=np.uint8)
        self.labels[:m] = mesh.labels
        self.vertices, self.triangles = n, m
        self.mesh = self._link(mesh.triangles)

    def _link(self, triangles: IntArray) -> tuple[IntArray, IntArray, BoolArray, IntArray, Masks]:
        """Return the half-edges of (m, 3) triangles, as `o3dleaf.surface.remeshing.halfedge_loops` has them."""
        room_n, half, whole = len(self.places), triangles.size, 3 * len(self.labels)
        origin, twin = np.full(whole, -1, dtype=np.int64), np.full(whole, -1, dtype=np.int64)
        ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        order = np.argsort(np.minimum(*ends) * (room_n + 1) + np.maximum(*ends), kind="stable")
        if not link_twins(triangles, order, origin[:half], twin[:half]):
            raise InputError(KNOT)
        inner = twin[:half] >= 0
        crease = np.zeros(whole, dtype=bool)
        crease[:half] = inner & (self.labels[twin[:half] // 3] != np.repeat(self.labels[: len(triangles)], 3))
        outgoing = np.full(room_n, -1, dtype=np.int64)
        outgoing[ends[0]] = np.arange(half)
        kind = np.zeros(room_n, dtype=np.uint8)
        sharp = np.bincount(ends[0][crease[:half]], minlength=room_n)
        kind[sharp == 2] = CREASE
        kind[(sharp != 0) & (sharp != 2)] = LOCKED
        self.fixed[ends[0][~inner]], self.fixed[ends[1][~inner]] = True, True
        kind[self.fixed] = LOCKED
        return origin, twin, crease, outgoing, kind

    def improve(self, ground: Ground, limits: Limits, rounds: int) -> None:
        """Bring vertices to the ground, then edges to their length and triangles into shape, in some rounds."""
        self._bring(ground, limits)
        for _ in range(rounds):
            self._split_long(ground, limits)
            self._collapse_short(limits)
            flip_edges(self._used(), self.places, limits.numbers, SWEEPS)
            self._relax(ground, limits)
            self._relax(ground, limits)
        for _ in range(2):
            cure_slivers(self._used(), self.labels[: self.triangles], self.places, limits.numbers, SWEEPS)
            self._relax(ground, limits)
        for part in limits.relaxed():
            for share in TRIES:
                cure_slivers(self._used(), self.labels[: self.triangles], self.places, part.numbers, SWEEPS)
                self._attempt(ground, part, share)

    def _used(self) -> tuple[Any, ...]:
        """Return the half-edges without the room that is left."""
        origin, twin, crease, outgoing, kind = self.mesh
        half, n = 3 * self.triangles, self.vertices
        return origin[:half], twin[:half], crease[:half], outgoing[:n], kind[:n]

    def _masks(self) -> Masks:
        """Return which labels the triangles around each vertex have, as bits."""
        origin = self.mesh[0][: 3 * self.triangles]
        there = origin >= 0
        masks = np.zeros(self.vertices, dtype=np.uint8)
        np.bitwise_or.at(
            masks, origin[there], np.repeat((1 << self.labels[: self.triangles]).astype(np.uint8), 3)[there]
        )
        return masks

    def _bring(self, ground: Ground, limits: Limits) -> None:
        """Move vertices to the ground that are not known to be on it."""
        mesh = self._used()
        rows = np.flatnonzero((mesh[3] >= 0) & ~self.fixed[: self.vertices] & ~self.grounded[: self.vertices])
        self._move(ground, limits, rows, np.zeros((len(rows), 3)))

    def smooth(self, ground: Ground, limits: Limits, rounds: int) -> None:
        """Move vertices to the middle of their triangles, on the ground, whatever becomes of these: it undoes knots."""
        for _ in range(rounds):
            rows, shifts = self._shifts(1.0)
            charts, places, found = self._settled(ground, limits, rows, shifts)
            self.places[rows[found]], self.charts[rows[found]] = places[found], charts[found]

    def _relax(self, ground: Ground, limits: Limits) -> None:
        """Move vertices towards the middle of their triangles, on the ground."""
        self._move(ground, limits, *self._shifts(SHARE))

    def _shifts(self, share: float) -> tuple[IntArray, FloatArray]:
        """Return the vertices that may move, and how far it is to the middle of their triangles."""
        mesh = self._used()
        shifts = np.zeros((self.vertices, 3))
        fill_shifts(mesh, self.places, share, shifts)
        rows = np.flatnonzero((mesh[3] >= 0) & (mesh[4] != LOCKED))
        return rows, shifts[rows]

    def _attempt(self, ground: Ground, limits: Limits, share: float) -> None:
        """Move the corners of triangles that are not fair along the edges there, where that makes them better."""
        mesh = self._used()
        none = np.empty(0, dtype=np.int64), np.empty((0, 3))
        count = fill_tries(mesh, self.places, limits.fair, share, *none)
        rows, shifts = np.empty(count, dtype=np.int64), np.empty((count, 3))
        fill_tries(mesh, self.places, limits.fair, share, rows, shifts)
        self._move(ground, limits, rows, shifts)

    def _settled(
        self, ground: Ground, limits: Limits, rows: IntArray, shifts: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the charts and places of vertices after shifts, and which of them got to the ground, not far away."""
        creased = self.mesh[4][rows] == CREASE
        charts, places, found = ground.settle(self.charts[rows], shifts, self._masks()[rows], creased)
        return charts, places, found & (np.linalg.norm(places - self.places[rows], axis=1) <= limits.longest)

    def _move(self, ground: Ground, limits: Limits, rows: IntArray, shifts: FloatArray) -> None:
        """Move vertices by shifts and onto the ground, where they get there and nothing gets worse."""
        mesh = self._used()
        charts, places, found = self._settled(ground, limits, rows, shifts)
        rows, charts, places = rows[found], charts[found], places[found]
        moved = np.zeros(len(rows), dtype=bool)
        for part, loose in ((limits, False), (limits.loose, True)):
            some = np.flatnonzero(self.grounded[rows] != loose)
            done = np.zeros(len(some), dtype=bool)
            move_vertices(
                mesh, self.labels, self.places, rows[some], places[some], part.numbers, limits.floor * loose, done
            )
            moved[some] = done
        # Of several ways for one vertex the last that was taken counts, as numpy's assignment has it.
        self.charts[rows[moved]] = charts[moved]
        self.grounded[rows[moved]] = True

    def _split_long(self, ground: Ground, limits: Limits) -> None:
        """Split edges that are too long, and the longest of their triangles, in the middle, on the ground."""
        for _ in range(3):
            mesh = self._used()
            halves = np.empty(len(mesh[0]) // 3, dtype=np.int64)
            halves = halves[: mark_long(mesh, self.places, limits.longest, halves)]
            room = min(len(self.places) - self.vertices, (len(self.labels) - self.triangles) // 2)
            halves = halves[:room]
            if not len(halves):
                return
            origin, twin = mesh[:2]
            a, b = origin[halves], origin[twin[halves]]
            masks = (1 << self.labels[halves // 3]) | (1 << self.labels[twin[halves] // 3])
            middle = (self.places[a] + self.places[b]) / 2
            charts, places, found = ground.settle(
                (self.charts[a] + self.charts[b]) / 2, np.zeros((len(a), 3)), masks.astype(np.uint8), mesh[2][halves]
            )
            near = found & (np.linalg.norm(places - middle, axis=1) <= limits.longest / 2)
            halves, charts, places = halves[near], charts[near], places[near]
            n, m = self.vertices, self.triangles
            done = split_edges(self.mesh, self.labels, self.places, halves, places, limits.numbers, n, m)
            self.charts[n : n + done] = charts[halves[:done]]
            self.vertices, self.triangles = n + done, m + 2 * done
            if not done:
                return

    def _collapse_short(self, limits: Limits) -> None:
        """Collapse edges that are too short, the shortest first."""
        mesh = self._used()
        origin = mesh[0]
        there = np.flatnonzero(origin >= 0)
        ends = origin[there], origin[there - there % 3 + (there + 1) % 3]
        length = np.linalg.norm(self.places[ends[0]] - self.places[ends[1]], axis=1)
        short = there[length < limits.shortest]
        order = short[np.argsort(length[length < limits.shortest], kind="stable")]
        collapse_short(mesh, self.labels, self.places, order, limits.shortest, limits.numbers)

    def result(self) -> Charted:
        """Return what there is now: vertices keep their rows, new ones follow; some are in no triangle any more."""
        corners = self._used()[0].reshape(-1, 3)
        there = corners[:, 0] >= 0
        n, labels = self.vertices, self.labels[: self.triangles]
        return Charted(self.places[:n], self.charts[:n], corners[there], labels[there], self.grounded[:n])
