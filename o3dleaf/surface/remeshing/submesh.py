"""A mesh, or a part of one with its border locked, whose triangles are improved in passes."""

import numpy as np

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.surface.remeshing.blocks import Charted
from o3dleaf.surface.remeshing.edit_loops import collapse_short, flip_edges, improve_slivers, mark_long, split_edges
from o3dleaf.surface.remeshing.halfedge_loops import CREASE, LOCKED, HalfEdges, link_twins
from o3dleaf.surface.remeshing.limits import Limits
from o3dleaf.surface.remeshing.move_loops import fill_shifts, fill_tries, move_vertices
from o3dleaf.surface.remeshing.projection_target import Masks, ProjectionTarget

CAPACITY = 3
"""Triangles that there is room for, of those that there are: splitting adds some."""
SWEEPS = 8
"""Times that all edges, or slivers, are looked at in one pass, at most."""
SHARE = 0.7
"""Of the way to the middle of its triangles that a vertex goes at once."""
TRIES = (0.3, 0.1, 0.5, 0.2)
"""Shares of the edges along which the corners of slivers are moved, one after another."""

NOT_MANIFOLD = "mesh: is not manifold, or its triangles are not consistently oriented; clean it first"


class Submesh:
    """Half-edges with places, charts and labels."""

    def __init__(self, mesh: Charted, locked: BoolArray) -> None:
        """Take a mesh, of which the border and the `locked` (n,) vertices stay.

        Raises
        ------
        InputError
            If an edge has three triangles, or two that run along it in one direction.
        """
        n, m = len(mesh.places), len(mesh.triangles)
        room_m = CAPACITY * m + 32
        room_n = n + room_m // 2
        self.places, self.charts = np.zeros((room_n, 3)), np.zeros((room_n, 3))
        self.places[:n], self.charts[:n] = mesh.places, mesh.charts
        self.on_surface, self.fixed = np.ones(room_n, dtype=bool), np.zeros(room_n, dtype=bool)
        self.on_surface[:n], self.fixed[:n] = mesh.on_surface, locked
        self.labels = np.zeros(room_m, dtype=np.uint8)
        self.labels[:m] = mesh.labels
        self.vertices, self.triangles = n, m
        self.mesh = self._link(mesh.triangles)

    def _link(self, triangles: IntArray) -> HalfEdges:
        """Return the half-edges of (m, 3) triangles."""
        room_n, half, whole = len(self.places), triangles.size, 3 * len(self.labels)
        origin, twin = np.full(whole, -1, dtype=np.int64), np.full(whole, -1, dtype=np.int64)
        ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
        order = np.argsort(np.minimum(*ends) * (room_n + 1) + np.maximum(*ends), kind="stable")
        if not link_twins(triangles, order, origin[:half], twin[:half]):
            raise InputError(NOT_MANIFOLD)
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
        return HalfEdges(origin, twin, crease, outgoing, kind)

    def improve(self, target: ProjectionTarget, limits: Limits, rounds: int) -> None:
        """Bring vertices to the target, then edges to their length and triangles into shape, in some rounds."""
        self._bring(target, limits)
        for _ in range(rounds):
            self._split_long(target, limits)
            self._collapse_short(limits)
            flip_edges(self._used(), self.places, limits, SWEEPS)
            self._relax(target, limits)
            self._relax(target, limits)
        for _ in range(2):
            improve_slivers(self._used(), self.labels[: self.triangles], self.places, limits, SWEEPS)
            self._relax(target, limits)
        for part in limits.relaxed():
            for share in TRIES:
                improve_slivers(self._used(), self.labels[: self.triangles], self.places, part, SWEEPS)
                self._attempt(target, part, share)

    def _used(self) -> HalfEdges:
        """Return the half-edges without the room that is left."""
        origin, twin, crease, outgoing, kind = self.mesh
        half, n = 3 * self.triangles, self.vertices
        return HalfEdges(origin[:half], twin[:half], crease[:half], outgoing[:n], kind[:n])

    def _masks(self) -> Masks:
        """Return which labels the triangles around each vertex have, as bits."""
        origin = self.mesh.origin[: 3 * self.triangles]
        alive = origin >= 0
        masks = np.zeros(self.vertices, dtype=np.uint8)
        np.bitwise_or.at(
            masks, origin[alive], np.repeat((1 << self.labels[: self.triangles]).astype(np.uint8), 3)[alive]
        )
        return masks

    def _bring(self, target: ProjectionTarget, limits: Limits) -> None:
        """Project vertices that are not known to be on the surface."""
        mesh = self._used()
        rows = np.flatnonzero((mesh.outgoing >= 0) & ~self.fixed[: self.vertices] & ~self.on_surface[: self.vertices])
        self._move(target, limits, rows, np.zeros((len(rows), 3)))

    def smooth(self, target: ProjectionTarget, limits: Limits, rounds: int) -> None:
        """Move vertices to the middle of their triangles, whatever becomes of these: it undoes crossings."""
        for _ in range(rounds):
            rows, shifts = self._shifts(1.0)
            charts, places, reached = self._project(target, limits, rows, shifts)
            self.places[rows[reached]], self.charts[rows[reached]] = places[reached], charts[reached]

    def _relax(self, target: ProjectionTarget, limits: Limits) -> None:
        """Move vertices towards the middle of their triangles, along the surface."""
        self._move(target, limits, *self._shifts(SHARE))

    def _shifts(self, share: float) -> tuple[IntArray, FloatArray]:
        """Return the vertices that may move, and how far it is to the middle of their triangles."""
        mesh = self._used()
        shifts = np.zeros((self.vertices, 3))
        fill_shifts(mesh, self.places, share, shifts)
        rows = np.flatnonzero((mesh.outgoing >= 0) & (mesh.kind != LOCKED))
        return rows, shifts[rows]

    def _attempt(self, target: ProjectionTarget, limits: Limits, share: float) -> None:
        """Move the corners of triangles below the quality along their edges, where that makes them better."""
        mesh = self._used()
        none = np.empty(0, dtype=np.int64), np.empty((0, 3))
        count = fill_tries(mesh, self.places, limits.quality, share, *none)
        rows, shifts = np.empty(count, dtype=np.int64), np.empty((count, 3))
        fill_tries(mesh, self.places, limits.quality, share, rows, shifts)
        self._move(target, limits, rows, shifts)

    def _project(
        self, target: ProjectionTarget, limits: Limits, rows: IntArray, shifts: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the charts and places of vertices after shifts, and which reached the surface, not far away."""
        creased = self.mesh.kind[rows] == CREASE
        charts, places, reached = target.project(self.charts[rows], shifts, self._masks()[rows], creased)
        return charts, places, reached & (np.linalg.norm(places - self.places[rows], axis=1) <= limits.longest)

    def _move(self, target: ProjectionTarget, limits: Limits, rows: IntArray, shifts: FloatArray) -> None:
        """Move vertices by shifts and onto the surface, where they reach it and nothing gets worse."""
        mesh = self._used()
        charts, places, reached = self._project(target, limits, rows, shifts)
        rows, charts, places = rows[reached], charts[reached], places[reached]
        moved = np.zeros(len(rows), dtype=bool)
        for part, on_surface in ((limits._replace(floor=0.0), True), (limits.loose, False)):
            some = np.flatnonzero(self.on_surface[rows] == on_surface)
            done = np.zeros(len(some), dtype=bool)
            move_vertices(mesh, self.labels, self.places, rows[some], places[some], part, done)
            moved[some] = done
        # Of several ways for one vertex the last that was taken counts, as numpy's assignment has it.
        self.charts[rows[moved]] = charts[moved]
        self.on_surface[rows[moved]] = True

    def _split_long(self, target: ProjectionTarget, limits: Limits) -> None:
        """Split edges that are too long, and the longest of their triangles, in the middle, on the surface."""
        for _ in range(3):
            mesh = self._used()
            halves = np.empty(len(mesh.origin) // 3, dtype=np.int64)
            halves = halves[: mark_long(mesh, self.places, limits.longest, halves)]
            room = min(len(self.places) - self.vertices, (len(self.labels) - self.triangles) // 2)
            halves = halves[:room]
            if not len(halves):
                return
            twins = mesh.twin[halves]
            a, b = mesh.origin[halves], mesh.origin[twins]
            masks = (1 << self.labels[halves // 3]) | (1 << self.labels[twins // 3])
            middle = (self.places[a] + self.places[b]) / 2
            charts = (self.charts[a] + self.charts[b]) / 2
            charts, places, reached = target.project(
                charts, np.zeros((len(a), 3)), masks.astype(np.uint8), mesh.crease[halves]
            )
            near = reached & (np.linalg.norm(places - middle, axis=1) <= limits.longest / 2)
            halves, charts, places = halves[near], charts[near], places[near]
            n, m = self.vertices, self.triangles
            done = split_edges(self.mesh, self.labels, self.places, halves, places, limits, n, m)
            self.charts[n : n + done] = charts[halves[:done]]
            self.vertices, self.triangles = n + done, m + 2 * done
            if not done:
                return

    def _collapse_short(self, limits: Limits) -> None:
        """Collapse edges that are too short, the shortest first."""
        mesh = self._used()
        alive = np.flatnonzero(mesh.origin >= 0)
        ends = mesh.origin[alive], mesh.origin[alive - alive % 3 + (alive + 1) % 3]
        length = np.linalg.norm(self.places[ends[0]] - self.places[ends[1]], axis=1)
        short = alive[length < limits.shortest]
        order = short[np.argsort(length[length < limits.shortest], kind="stable")]
        collapse_short(mesh, self.labels, self.places, order, limits)

    def result(self) -> Charted:
        """Return what there is now: vertices keep their rows, new ones follow; some are in no triangle any more."""
        corners = self._used().origin.reshape(-1, 3)
        alive = corners[:, 0] >= 0
        n, labels = self.vertices, self.labels[: self.triangles]
        return Charted(self.places[:n], self.charts[:n], corners[alive], labels[alive], self.on_surface[:n])
