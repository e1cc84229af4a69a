"""`lay_flat`: the chart of a sheet, a map to the plane that keeps lengths as well as any can."""

import numpy as np

from o3dleaf.core import progress
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import IntArray, drop_unused_vertices, mesh_arrays, triangle_areas
from o3dleaf.core.parallel import single_threaded_blas
from o3dleaf.core.places import tell_place
from o3dleaf.core.units import tell_share
from o3dleaf.leaf.chart.carry import carry
from o3dleaf.leaf.chart.flattening.embedding import conformal_chart, convex_chart, relax_rigidly, relax_without_flips
from o3dleaf.leaf.chart.flattening.one_layer import relax_in_one_layer
from o3dleaf.leaf.chart.flattening.overlap import Overlap, find_overlap
from o3dleaf.leaf.chart.flattening.sheet_shape import BoundaryRings, require_sheet, rim_first
from o3dleaf.leaf.chart.flattening.stretch import chart_areas, triangle_stretch
from o3dleaf.leaf.chart.flattening.untangle import untangle
from o3dleaf.surface.repair.simplify import simplify_mesh

TRIANGLES = 6000
"""Of the mesh that is flattened: a blade's bends are far wider than its triangles then, and noise is averaged out."""
WORST = (0.5, 2.0)
"""Stretch beyond which a texture has no meaning: it would be half or twice as wide as measured."""
WORST_SHARE = 0.01
"""Of the area, beyond `WORST`, that is refused: less is a fold of a few triangles at a rough margin."""
BAG = (
    "it is closed there like a bag or a tube, or blades are joined there; cut the scan there, or reconstruct it "
    "without a chart"
)
STEPPED = "it steps there from one thing to another, a leaf and what lies under or beside it; cut those apart"
OVERLAP = 1e-3
"""Share of the area that may lie twice in the chart: the banks of a slit that close over each other by a hair."""
LARGEST_FLAP = 0.2
"""Share of the area that may go where the chart lies over itself: what stays is four times as large. Of more it is open
which layer is the leaf."""


def overlap_error(overlap: Overlap, vertices: FloatArray, triangles: IntArray) -> ReconstructionError:
    """Return the refusal of a sheet that lies over itself when laid flat."""
    return ReconstructionError(
        f"chart: laid flat, the sheet lies over itself on {tell_share(overlap.share)} of its area, most at "
        f"{_place(vertices, triangles, overlap.worst)}, as a leaf that winds round does; cut the scan there",
        vertices[triangles[np.unique(overlap.pairs)]].mean(axis=1),
    )


@single_threaded_blas()
def lay_flat(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 2) near-isometric chart of a sheet, of its area, its triangles counter-clockwise as on the sheet.

    A conformal map (Lévy et al. 2002, ACM TOG 21:362) relaxed as rigidly as possible (Liu et al. 2008, CGF
    27:1495), on at most `TRIANGLES` triangles of the sheet; what lies between is carried along by closest points.
    No triangle of that mesh is flipped. Where it would lie over itself it is relaxed from a convex map in one layer;
    if that stretches it too far it stays so: `find_overlap`. `turn_chart` turns it.

    Parameters
    ----------
    vertices : (n, 3) ndarray
        In any unit, which is the chart's.
    triangles : (m, 3) ndarray of int
        A connected, oriented, manifold mesh of genus 0 with a boundary: a disc, with holes or without.

    Raises
    ------
    ReconstructionError
        If it is no such mesh, or has no chart of low distortion; with the place.
    """
    coarsening, flattening, carrying = progress.split(1, 2, 1)
    with coarsening:
        require_sheet(vertices, triangles)
        coarse, faces = coarsen(*_used_alone(vertices, triangles))
        rings = require_sheet(coarse, faces)
    with flattening:
        chart = _in_one_layer(coarse, faces, rings, _embed(coarse, faces, rings))
        chart *= np.sqrt(triangle_areas(coarse, faces).sum() / chart_areas(chart, faces).sum())
        require_low_distortion(coarse, faces, chart)
    with carrying:
        return chart if coarse is vertices else carry(coarse, faces, chart, vertices)


def _used_alone(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the mesh without vertices that no triangle names, itself if there are none."""
    if len(np.unique(triangles)) == len(vertices):
        return vertices, triangles
    return drop_unused_vertices(vertices, triangles)


def coarsen(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """Return a mesh of at most `TRIANGLES` triangles, or those given; the border stays."""
    if len(triangles) <= TRIANGLES:
        return vertices, triangles
    return mesh_arrays(simplify_mesh((vertices, triangles), target_triangles=TRIANGLES))


def _embed(vertices: FloatArray, triangles: IntArray, rings: BoundaryRings) -> FloatArray:
    """Return a chart without flipped triangles: relaxed from the conformal map or, failing that, from a convex one."""
    start = conformal_chart(vertices, triangles, rings)
    if start is not None:
        chart = untangle(relax_rigidly(vertices, triangles, start), triangles)
        if chart is not None and _far_share(vertices, triangles, chart) <= WORST_SHARE:
            return chart
    safe = relax_without_flips(vertices, triangles, convex_chart(vertices, triangles, rings))
    chart = untangle(relax_rigidly(vertices, triangles, safe), triangles)
    if chart is not None and _far_share(vertices, triangles, chart) <= _far_share(vertices, triangles, safe):
        return chart
    flipped = np.flatnonzero(~(chart_areas(safe, triangles) > 0))
    if len(flipped):
        raise ReconstructionError(
            f"chart: the sheet cannot be laid flat at {_place(vertices, triangles, int(flipped[0]))}: "
            f"{len(flipped)} of its triangles have no area; remesh or clean the surface there",
            vertices[triangles[flipped]].mean(axis=1),
        )
    return safe


def _in_one_layer(vertices: FloatArray, triangles: IntArray, rings: BoundaryRings, chart: FloatArray) -> FloatArray:
    """Return a chart that lies over itself nowhere, where that one does and less of this one is stretched too far.

    A ruffled margin is too long to lie flat without stretch. What lies over itself so far that no part of it may be cut
    off, as what winds round does, stays so.
    """
    overlap = find_overlap(chart, triangles, rings)
    if overlap is None or not OVERLAP < overlap.share <= LARGEST_FLAP:
        return chart
    start = convex_chart(vertices, triangles, rings)
    if not (chart_areas(start, triangles) > 0).all():
        return chart
    single = relax_in_one_layer(vertices, triangles, start, rim_first(rings))
    return single if _far_share(vertices, triangles, single) <= min(overlap.share, WORST_SHARE) else chart


def _far_share(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> float:
    """Return the share of the area whose stretch is beyond `WORST`."""
    return float(_far(vertices, triangles, chart)[1])


def _far(vertices: FloatArray, triangles: IntArray, chart: FloatArray) -> tuple[FloatArray, float]:
    """Return how far each triangle is beyond isometry, as a logarithm, and the share of the area beyond `WORST`."""
    area = triangle_areas(vertices, triangles)
    scale = np.sqrt(area.sum() / np.abs(chart_areas(chart, triangles)).sum())
    values = np.nan_to_num(scale * triangle_stretch(vertices, triangles, chart), nan=1.0)
    beyond = (values[:, 1] < WORST[0]) | (values[:, 0] > WORST[1])
    away = np.maximum(values[:, 0], 1 / np.maximum(values[:, 1], 1e-12))
    return np.where(beyond, away, 0.0) * area, float(area[beyond].sum() / area.sum())


def require_low_distortion(
    vertices: FloatArray,
    triangles: IntArray,
    chart: FloatArray,
    most: float = WORST_SHARE,
    why: str = BAG,
    sheet: FloatArray | None = None,
) -> None:
    """Raise `ReconstructionError` if more than a share of the area is stretched beyond `WORST` in a chart; with why.

    Places are those of the vertices (n, 3), or of the same vertices on a `sheet` that a wild surface was fitted to.
    """
    weight, share = _far(vertices, triangles, chart)
    if share > most:
        vertices = vertices if sheet is None else sheet
        raise ReconstructionError(
            f"chart: {tell_share(share)} of the sheet would be stretched below {WORST[0]:g} or above {WORST[1]:g} when "
            f"laid flat, most at {_place(vertices, triangles, int(np.argmax(weight)))}: {why}",
            vertices[triangles[weight > 0]].mean(axis=1),
        )


def _place(vertices: FloatArray, triangles: IntArray, triangle: int) -> str:
    """Return the middle of a triangle as text."""
    return tell_place(vertices[triangles[triangle]].mean(axis=0), vertices)
