"""How wide a cloud must be averaged to be one sheet: by its noise everywhere, and more where layers lie."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray
from o3dleaf.core.trees import query
from o3dleaf.leaf.sheet.open_sheets import OpenSheets, Overlaps, nearest_layers
from o3dleaf.surface.cloud.surfels import thinned
from o3dleaf.surface.mesh.deviation import nearest_on_mesh
from o3dleaf.surface.mesh.topology import label_nodes
from o3dleaf.surface.reconstruction.along_mesh import vertex_normals

CLEAN = 0.05
"""Noise in spacings up to which points are not averaged."""
PER_NOISE = 10.0
"""Square of the width over noise times spacing: averaged over h, noise σ of points s apart falls to σ s/2h, of which
0.15 of the vertices' distance, 0.35 h, may be left."""
NOISE_WIDTHS = 1.0, 5.0
"""Least and largest width in spacings for noise."""
WIDEST = 4.0
"""Distance in spacings up to which layers are passes of one sheet. Where there is more between them it shows."""
MEETING = 3.0
"""Spacings that the sides of a thin leaf are brought within, by thinning, before they are averaged."""
STEEP = 0.8
"""Cosine to the normal from which on a point lies above another one, not beside it."""
PARALLEL = 0.35
"""Cosine between the normals of passes of one sheet at least, 70°: they are rough where passes lie double; a sheet that
stands upright on another one is no pass of it."""
MOSTLY = 0.5
"""The same of half the places of a pass, 60°: single ones are rough. What lies askew as a whole is the other side of a
fold."""
OFF = 1.5
"""Distance in spacings from which on a point is off a sheet, not between its vertices nor beside its margin."""
FALL = 0.5
"""How much the width falls with each unit of distance from a place that needs it: a neighbor's is alike."""
LEVELS = 6
PLACES, AROUND = 400, 128
"""Places at which two layers are sought in the noise, and points around each: the kurtosis of noise is off by 0.4."""
SLAB, CHANCE = -1.2, 0.05
"""Excess kurtosis of points that fill a slab evenly, and the share of places that may have less by chance."""
LEFT = 0.2
"""Share of the places of layers that may be left after they were averaged; where it is more the layer lasts."""
LINK = 3.0
"""Spacings within which places of layers are one layer."""
FEWEST = 8
"""Fewer places than this are no layer: single points that noise has lifted, and creases, are as many."""
MORE = 1.2
"""Times its distance that a layer is averaged over: passes that are just met do not quite come together."""


def noise_width(noise: float, spacing: float) -> float:
    """Return the width over which noise is averaged for triangles to fit together, 0 for a clean cloud."""
    if noise <= CLEAN * spacing:
        return 0.0
    least, most = NOISE_WIDTHS
    return float(spacing * np.clip(np.sqrt(PER_NOISE * noise / spacing), least, most))


def find_layers(sheets: OpenSheets, *, is_tube: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return places (k, 3) where a second layer lies over the largest sheet, and how far off it is (k,).

    Layers are points above or below the sheet that lie parallel to it, and parts of the sheet that face its way with
    nothing between; of a sheet without a rim, but of no tube, also the side that faces away, as of a thin leaf scanned
    from both sides.
    """
    vertices, triangles = sheets.sheet()
    reach = WIDEST * sheets.spacing
    normals = vertex_normals(vertices, triangles)
    off, parallel = _points_above(sheets, vertices, triangles, normals)
    distance, facing, _ = nearest_layers(vertices, normals, reach, STEEP)
    layer = np.isfinite(distance) & (facing >= PARALLEL)
    if sheets.is_closed and not is_tube:
        layer |= np.isfinite(distance) & (facing <= -PARALLEL)
    gap = np.where(layer, distance, 0.0)
    rows = np.flatnonzero(gap.max(axis=1) > 0)
    places, need = (
        np.concatenate([sheets.points[off], vertices[rows]]),
        np.append(sheets.off[off], gap.max(axis=1)[rows]),
    )
    facing = np.append(parallel, np.abs(facing[rows, gap[rows].argmax(axis=1)]))
    kept = _lie_parallel(places, facing, LINK * sheets.spacing)
    return places[kept], need[kept]


def _points_above(
    sheets: OpenSheets, vertices: FloatArray, triangles: IntArray, normals: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return the points (k,) that lie above or below a sheet, not beside it, and the cosine between the normals."""
    off = np.flatnonzero((sheets.off > OFF * sheets.spacing) & (sheets.off <= WIDEST * sheets.spacing))
    if not len(off):
        return off, np.empty(0)
    feet = nearest_on_mesh(vertices, triangles, sheets.points[off])
    below = normals[query(cKDTree(vertices), feet)[1]]
    height = np.abs(np.einsum("ij,ij->i", sheets.points[off] - feet, below))
    parallel: FloatArray = np.abs(np.einsum("ij,ij->i", sheets.normals[off], below))
    above = (height >= STEEP * sheets.off[off]) & (parallel >= PARALLEL)
    return off[above], parallel[above]


def _lie_parallel(places: FloatArray, facing: FloatArray, link: float) -> BoolArray:
    """Return which places (k,) belong to clusters that lie parallel to the sheet below them, by their cosines (k,)."""
    group = _clusters(places, link)
    middle = np.array([np.median(facing[group == number]) for number in range(int(group.max(initial=-1)) + 1)])
    return np.asarray(middle[group] >= MOSTLY)


class Passes(NamedTuple):
    """Places (k, 3) where two layers were averaged as if they were noise, how far apart, of what share of points."""

    places: FloatArray
    apart: float
    share: float


def find_passes(points: FloatArray, sheets: OpenSheets) -> Passes:
    """Return where points (n, 3) were averaged from two layers as if they were noise.

    Among the points around a place their heights over the sheet fall into two groups there: the excess kurtosis, of
    noise 0 and of a full slab -1.2, is less. In fewer than a twentieth of the places that is chance.
    """
    rows = thinned(len(points), -(-len(points) // PLACES))
    near = query(cKDTree(sheets.points), sheets.points[rows], k=min(AROUND, len(points)))[1]
    off = points - sheets.points
    side = np.sign(np.einsum("ma,mka->mk", sheets.normals[rows], sheets.normals[near]))
    height = side * np.einsum("mka,mka->mk", sheets.normals[near], off[near])
    height -= height.mean(axis=1, keepdims=True)
    square = (height**2).mean(axis=1)
    double = (height**4).mean(axis=1) < (3 + SLAB) * square**2
    if double.mean() < CHANCE:
        return Passes(np.empty((0, 3)), 0.0, 0.0)
    return Passes(points[rows[double]], 2 * float(np.sqrt(np.median(square[double]))), float(double.mean()))


def same_facing(overlaps: Overlaps) -> IntArray:
    """Return the vertex (v,) above or below each in the nearest layer that faces its way, -1 for none."""
    distance = np.where(overlaps.facing > 0, overlaps.distance, np.inf)
    side = distance.argmin(axis=1)
    each = np.arange(len(side))
    return np.where(np.isfinite(distance[each, side]), overlaps.row[each, side], -1)


def widen(points: FloatArray, width: FloatArray, layers: "Layers") -> FloatArray:
    """Return the width (n,) at points (n, 3), no less than layers around need, falling off from there."""
    wide = width.copy()
    if not len(layers.places):
        return wide
    for level in np.unique(np.quantile(layers.need, np.linspace(0, 1, LEVELS))):
        distance = query(cKDTree(layers.places[layers.need >= level]), points)[0]
        wide = np.maximum(wide, level - FALL * np.maximum(distance - 2 * level, 0.0))
    return wide


@dataclass(frozen=True, eq=False)
class Layers:
    """Places (k, 3) where layers lie over a sheet, how far off they are (k,), and the places (f, 3) of lasting ones.

    Layers last that are still there after averaging over their distance: other sheets, not passes of this one.
    """

    places: FloatArray
    need: FloatArray
    lasting: FloatArray

    @classmethod
    def none(cls) -> "Layers":
        """Return no layers."""
        return cls(np.empty((0, 3)), np.empty(0), np.empty((0, 3)))

    def like(self, other: "Layers") -> bool:
        """Return whether no layer came about, nor was given up, since `other`."""
        return len(self.places) == len(other.places) and len(self.lasting) == len(other.lasting)

    def after(self, places: FloatArray, need: FloatArray, link: float) -> "Layers":
        """Return these layers, those that were found after averaging added, or where most are left given up.

        Places within `link` of one another are judged together.
        """
        group = _clusters(self.places, link)
        left = _within(places, self.places, link)
        nearest = query(cKDTree(self.places), places[left])[1] if len(self.places) else left[:0]
        before = np.bincount(group, minlength=1)
        after = np.bincount(group[nearest], minlength=len(before))
        lasts = ((after > LEFT * before) & (after >= FEWEST))[group] if len(group) else np.zeros(0, bool)
        lasting = np.concatenate([self.lasting, self.places[lasts]])
        fresh = np.setdiff1d(np.arange(len(places)), _within(places, lasting, link))
        fresh = fresh[_of_many(places[fresh], link)]
        return Layers(
            np.concatenate([self.places[~lasts], places[fresh]]),
            np.concatenate([self.need[~lasts], MORE * need[fresh]]),
            lasting,
        )


def _of_many(places: FloatArray, link: float) -> BoolArray:
    """Return which places (k,) belong to clusters of eight and more."""
    group = _clusters(places, link)
    return np.asarray(np.bincount(group, minlength=1)[group] >= FEWEST)


def _clusters(places: FloatArray, link: float) -> IntArray:
    """Return the cluster (k,) of each place; those nearer than `link` belong together."""
    pairs = cKDTree(places).query_pairs(link, output_type="ndarray") if len(places) else np.empty((0, 2), np.int64)
    return label_nodes(np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1]), len(places))


def _within(places: FloatArray, others: FloatArray, link: float) -> IntArray:
    """Return the rows of places within `link` of one of some others."""
    if not len(places) or not len(others):
        return np.empty(0, np.int64)
    return np.flatnonzero(query(cKDTree(others), places)[0] <= link)
