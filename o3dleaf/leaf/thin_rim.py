"""Vertices lowered beside a tapered rim, where triangles would cross.

The taper keeps the order of heights, (u, v, h) → (u, v, τ(u, v) h), and so the leaf meets itself nowhere; but triangles
are flat, and where τ rises several times within one of them, as below a hair that leans over the margin, they pass
through others.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.units import measure_in_words
from o3dleaf.io.labelled_mesh import RIM, LabelArray
from o3dleaf.io.mesh_data import IndexArray
from o3dleaf.leaf.blade.blade import Blade, RimThickness
from o3dleaf.leaf.instancing.assembly import Assembly
from o3dleaf.leaf.margin.taper import Taper
from o3dleaf.leaf.residuals.places import Place, find_places, tell_places
from o3dleaf.leaf.textured_blade import TexturedBlade
from o3dleaf.surface.mesh.crossings import find_crossings

MAX_REACH = 8
"""Steps of the mesh within which the thickness rises from the rim's: beyond, the rim would be another one."""
MAX_ROUNDS = 32
"""Crossings are looked for so often: vertices that were lowered may cross others."""
EDGE = 2**0.5
"""Steps from the margin within which its edge lies: the chord of a cell."""
CLEARANCE = 2
"""Steps around what is lowered that are looked at as well: the triangles there end within them."""


@dataclass(frozen=True, eq=False)
class LoweredVertices:
    """Vertices of a mesh that lie closer to the blade than the surface does.

    Attributes
    ----------
    flat : (k, 3) ndarray
        Their flat coordinates on the surface, in `unit`.
    heights : (k,) ndarray
        The heights that they have instead.
    most : float
        By how much they are lower, at most, in the world.
    places : tuple of Place
        The largest groups of them.
    unit : str or None
    """

    flat: FloatArray
    heights: FloatArray
    most: float = 0.0
    places: tuple[Place, ...] = ()
    unit: str | None = None

    @classmethod
    def none(cls) -> "LoweredVertices":
        """Return no vertices."""
        return cls(np.empty((0, 3)), np.empty(0))

    def apply(self, flat: FloatArray) -> FloatArray:
        """Return flat coordinates (n, 3) of vertices with those lowered that are among these."""
        rows = np.flatnonzero(np.isin(flat[:, 0], self.flat[:, 0]))
        if not len(rows):
            return flat
        lowered, heights = flat.copy(), dict(zip(map(tuple, self.flat.tolist()), self.heights.tolist(), strict=True))
        for row in rows:
            lowered[row, 2] = heights.get(tuple(flat[row].tolist()), flat[row, 2])
        return lowered

    @property
    def warnings(self) -> list[str]:
        """One line, or none where no vertex is lowered."""
        if not len(self.flat):
            return []
        told = (
            f"{len(self.flat):,} vertices beside the rim lie up to {measure_in_words(self.most, self.unit)} closer to "
            f"the blade than the surface, {tell_places(self.places)}: triangles would cross there, where the texture "
            "leans over the margin"
        )
        return [told]

    def to_dict(self) -> dict[str, Any]:
        """Return what is to be said of them as plain values."""
        places = [place.to_dict() for place in self.places]
        return {"vertices": len(self.flat), "most": self.most, "places": places, "warnings": self.warnings}


@dataclass(frozen=True, eq=False)
class FlatMesh:
    """A part of a leaf's mesh in flat coordinates.

    Attributes
    ----------
    flat : (n, 3) ndarray
    triangles : (m, 3) ndarray of int64
    labels : (m,) ndarray of uint8
    """

    flat: FloatArray
    triangles: IntArray
    labels: LabelArray

    def part(self, kept: BoolArray) -> "FlatMesh":
        """Return the triangles all of whose corners are kept (n,)."""
        whole = kept[self.triangles].all(axis=1)
        numbers = np.cumsum(kept) - 1
        return FlatMesh(self.flat[kept], numbers[self.triangles[whole]], self.labels[whole])

    def on_edge(self, rim: RimThickness, reach: float) -> BoolArray:
        """Return which vertices (n,) lie on the edge along the margin: the wall's, or those of an open boundary.

        Those deeper than `reach` are on the sides of a region, or where a part of a mesh ends.
        """
        on_edge = np.zeros(len(self.flat), dtype=bool)
        on_edge[self.triangles[self.labels == RIM]] = True
        if not on_edge.any():
            edges = np.sort(self.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
            ends, uses = np.unique(edges, axis=0, return_counts=True)
            on_edge[ends[uses == 1]] = True
        return on_edge & (rim.values(self.flat[:, :2], reach) <= rim.least)


class NearMargin:
    """A sink of flat coordinates that keeps the triangles all of whose corners lie near the margin."""

    def __init__(self, vertices: int, band: Taper) -> None:
        """Make room for the numbers of so many vertices; near are those that a taper does not leave as they are."""
        self._band, self._near, self._stop = band, np.zeros(vertices, dtype=bool), 0
        self._places: list[tuple[IntArray, FloatArray]] = []
        self._triangles: list[tuple[IntArray, LabelArray]] = []

    def put_vertices(self, start: int, vertices: FloatArray) -> None:
        """Keep those near the margin of the vertices number start, ..."""
        rows = np.flatnonzero(self._band.values(vertices[:, :2]) < 1)
        self._near[start + rows] = True
        self._stop = max(self._stop, start + len(vertices))
        self._places.append((start + rows, vertices[rows]))

    def put_triangles(self, _: int, triangles: IndexArray, labels: LabelArray) -> None:
        """Keep the triangles that may be near the margin: the next row's vertices come later."""
        kept = np.all(self._near[triangles] | (triangles >= self._stop), axis=1)
        self._triangles.append((triangles[kept].astype(np.int64), labels[kept]))

    def mesh(self) -> FlatMesh:
        """Return what was kept."""
        numbers, flat = (np.concatenate(part) for part in zip(*self._places, strict=True))
        triangles, labels = (np.concatenate(part) for part in zip(*self._triangles, strict=True))
        order, kept = np.argsort(numbers), self._near[triangles].all(axis=1)
        return FlatMesh(flat[order], np.searchsorted(numbers[order], triangles[kept]), labels[kept])


def lower_crossings(leaf: TexturedBlade, assembly: Assembly, step: float) -> LoweredVertices:
    """Return the vertices of a mesh, of steps of a length, that are to be lowered so that no triangles cross.

    See `lowered_vertices`.
    """
    blade = leaf.blade
    if blade.rim is None:
        return LoweredVertices.none()
    band = Taper(blade.outline.polygon, blade.rim.radius + 2 * (MAX_REACH + CLEARANCE) * step)
    sink = NearMargin(assembly.vertices, band)
    with progress.silent():
        assembly.emit(sink, lambda flat: flat)
    return lowered_vertices(blade, sink.mesh(), step)


def lowered_vertices(blade: Blade, mesh: FlatMesh, step: float) -> LoweredVertices:
    """Return the vertices of a mesh, of steps of a length, that are to be lowered so that no triangles cross.

    Where triangles cross that would not if all of it were as thin as the rim is, the thickness is bounded: by the
    rim's, τ₀, at each of their corners y, from where it may rise to 1 within a reach r,

    .. math:: τ(x) ≤ τ_0 + (1 - τ_0) |x - y| / r

    with r one step at first and, where triangles still cross, twice as much, up to `MAX_REACH` steps. Vertices on the
    edge stay where they are: it is that thin.
    """
    rim = blade.rim
    if rim is None:
        return LoweredVertices.none()
    tapered = np.zeros(len(mesh.flat), dtype=bool)
    tapered[mesh.triangles[(rim.values(mesh.flat[:, :2]) < 1)[mesh.triangles].any(axis=1)]] = True
    outer = mesh.part(tapered)
    corners = outer.flat[outer.triangles[find_crossings(blade.lift(outer.flat), outer.triangles)].ravel(), :2]
    if not len(corners):
        return LoweredVertices.none()
    reach = (2 * MAX_REACH + CLEARANCE) * step
    distance, _ = cKDTree(corners).query(mesh.flat[:, :2], distance_upper_bound=reach)
    near = np.isfinite(distance)
    part = mesh.part(near)
    factor = _factors(blade, rim, part, distance[near] <= MAX_REACH * step, step)
    rows = np.flatnonzero(factor < 1)
    before, after = part.flat[rows], part.flat[rows] * np.column_stack([np.ones((len(rows), 2)), factor[rows]])
    world = blade.lift(before)
    most = float(np.linalg.norm(blade.lift(after) - world, axis=1).max(initial=0.0))
    places = find_places(world, np.ones(len(rows), dtype=bool), step)
    return LoweredVertices(before, after[:, 2], most, places, blade.unit)


def _factors(blade: Blade, rim: RimThickness, mesh: FlatMesh, allowed: BoolArray, step: float) -> FloatArray:
    """Return the factors (n,) of heights; the thickness is bounded from corners alone that are `allowed` (n,)."""
    flat, triangles, thickness = mesh.flat, mesh.triangles, rim.values(mesh.flat[:, :2])
    fixed = mesh.on_edge(rim, EDGE * step)

    def crossings(factor: FloatArray) -> BoolArray:
        return find_crossings(blade.lift(np.column_stack([flat[:, :2], flat[:, 2] * factor])), triangles)

    def factors(bound: FloatArray | float) -> FloatArray:
        return np.where(fixed, 1.0, np.minimum(bound / thickness, 1.0))

    factor, reach = np.ones(len(flat)), np.zeros(len(flat))
    # What crosses where all is thin crosses for another reason, such as a fold of the blade.
    crossing, other = crossings(factor), crossings(factors(rim.least))
    count = crossing.sum()
    for _ in range(MAX_ROUNDS):
        corners = np.unique(triangles[crossing & ~other])
        corners = corners[allowed[corners] & (reach[corners] < MAX_REACH * step)]
        if not len(corners):
            break
        reach[corners] = np.minimum(np.maximum(2 * reach[corners], step), MAX_REACH * step)
        factor = factors(_bound(flat[:, :2], reach, rim.least))
        crossing = crossings(factor)
    return factor if crossing.sum() < count else np.ones(len(flat))


def _bound(plane: FloatArray, reach: FloatArray, least: float) -> FloatArray:
    """Return the bound (n,) of the thickness at (n, 2) places, the least one where their `reach` (n,) is not 0."""
    bound = np.ones(len(plane))
    for length in np.unique(reach[reach > 0]):
        distance, _ = cKDTree(plane[reach == length]).query(plane, distance_upper_bound=length)
        bound = np.minimum(bound, least + (1 - least) * np.minimum(distance / length, 1.0))
    return bound
