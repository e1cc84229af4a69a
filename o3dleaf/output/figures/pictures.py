"""Figures of surfaces: the scan with its control points, a tile, four tiles, a cross-section, the whole leaf."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import open3d as o3d
from matplotlib.colors import to_rgb

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import ReconstructionError
from o3dleaf.core.mesh_arrays import build_mesh, mesh_arrays
from o3dleaf.core.units import measure_in_words
from o3dleaf.leaf.blade.blade import SAMPLE_COUNT, Blade
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.figures.style import ALONG, COLUMN, LOW, PICTURE, TEXT, VERMILION, FigureSheet, words
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.panel import Page, em_of
from o3dleaf.output.view.picture import Inset, Scalars, draw_page
from o3dleaf.output.view.points import Points, make_facets

TILE_STEPS = 140
"""Mesh steps along a tile that is looked at closely."""

LEAF_STEPS = 17
"""Steps along a tile of the whole leaf, where a tile is a few pixels."""

SECTION = 0.3
"""Depth of the slab that a cross-section shows, in tiles."""

GREENS = ("#79b151", "#4f9a6a")
CUT = "#fff4d6"
"""Colors of the tiles of a pattern, and of cut leaf."""

AT = 0.4
"""Share of the leaf's length at which its micro-structure is shown: wide, and not in the shadow of a curled tip."""

CUT_WITHIN, SEAM_WITHIN = 0.25, 0.75
"""Steps of the mesh within which a vertex belongs to a cut, or to a seam."""

TILT, TURN = 52.0, 28.0
"""Degrees by which a block is seen from the side, and the midrib runs down to the right."""


class Window(NamedTuple):
    """A rectangle of the blade in leaf coordinates, whole tiles of the texture, and a tile's size there."""

    region: FloatArray
    tile: FloatArray


def scan_picture(blade: HeightMapBlade, scan: CloudLike) -> FigureSheet:
    """Return the scan colored by the way along the midrib, with the midrib and its control points.

    Parameters
    ----------
    blade : HeightMapBlade
    scan : (n, 3) array_like or Open3D point cloud
        In the blade's unit.
    """
    points = points_of(scan, "scan", least=1)
    frame = blade.frame
    control = frame.stations(frame.breaks)[0]
    size = 0.006 * frame.length
    curve = frame.stations(np.linspace(frame.breaks[0], frame.breaks[-1], 1000))[0]
    view = _of_leaf(blade)
    # The midrib runs inside the scan: moved toward the eye, it is drawn where it is, and in front.
    front = 2 * size * Camera.framing(*make_facets(points), view).toward
    things = [
        Points(points, 0.25 * size),
        Points(control + front, size, VERMILION),
        Points(curve + front, 0.25 * size, VERMILION),
    ]
    name, limits = words(blade.unit, "along the midrib"), (0.0, frame.length)
    along = Scalars(frame.to_leaf(points)[:, 0], name, ALONG, limits)
    page = _print(Inset(things, view=view, scalars=along, unit=blade.unit), size=LOW)
    page.key(VERMILION, "o", "control points and midrib")
    return FigureSheet(
        page.figure,
        f"The laser scan, {len(points):,} points colored by their first leaf coordinate, and the midrib with its "
        f"{len(control)} control points.",
    )


def one_tile(leaf: MultiscaleLeaf) -> FigureSheet:
    """Return one copy of the micro-structure on the leaf, cut out as a block."""
    window = whole_tiles(leaf, (1, 1))
    page = _picture(leaf, window, TILE_STEPS)
    return FigureSheet(
        page.figure,
        f"One copy of the micro-structure on the leaf, {_extent(leaf, window)}, as a block; cut faces are pale.",
    )


def four_tiles(leaf: MultiscaleLeaf) -> FigureSheet:
    """Return four copies of the micro-structure, each other one in another green, with the seams between them."""
    window = whole_tiles(leaf, (2, 2))
    page = _picture(leaf, window, TILE_STEPS * 2 // 3, seams=True)
    page.key(VERMILION, "-", "seams of the tiles")
    energy = leaf.texture.seam_energy().total if hasattr(leaf.texture, "seam_energy") else None
    match = "" if energy is None else f" (seam energy {energy:.3g})"
    return FigureSheet(
        page.figure,
        f"Four copies of the micro-structure, {_extent(leaf, window)} together, blended at their edges{match}; "
        "the lines are the seams.",
    )


def cross_section(leaf: MultiscaleLeaf) -> FigureSheet:
    """Return a slab across the whole width of the leaf, seen along the midrib, with an inset of its micro-structure."""
    window = whole_tiles(leaf, (1, 1))
    low, high = leaf.blade.outline.bounds[:, 1]
    middle = window.region[:, 0].mean()
    depth = SECTION * window.tile[0]
    slab = np.array([[middle - depth / 2, low], [middle + depth / 2, high]])
    close = np.array([[slab[0, 0], window.region[0, 1]], [slab[1, 0], window.region[1, 1]]])
    view = View(direction=_against_midrib(leaf.blade, middle), tilt=-12.0)
    step = float(window.tile.max()) / TILE_STEPS
    inset = Inset(block(leaf, step, close), view=view)
    page = _print(Inset(block(leaf, step, slab), view=view, unit=leaf.unit), [inset], LOW)
    place, width = (measure_in_words(each, leaf.unit, digits=3) for each in (middle, high - low))
    return FigureSheet(
        page.figure,
        f"A cross-section of the leaf, {place} along the midrib and {width} wide, the adaxial side "
        "up; cut faces are pale. Inset: a close-up.",
    )


def whole_leaf(leaf: MultiscaleLeaf) -> FigureSheet:
    """Return the whole leaf with an inset of the micro-structure on it."""
    window = whole_tiles(leaf, (1, 1))
    step = float(window.tile.max()) / LEAF_STEPS
    mesh = leaf.plan_mesh(step).extract().mesh
    fine = float(window.tile.max()) / TILE_STEPS
    solid = block(leaf, fine, window.region)
    inset = Inset(solid, view=_oblique(leaf.blade, solid))
    page = _print(Inset(mesh, view=_of_leaf(leaf.blade), unit=leaf.unit), [inset])
    return FigureSheet(
        page.figure,
        f"The whole multi-scale surface, {len(mesh.triangles):,} triangles; inset: {_extent(leaf, window)} of it.",
    )


def whole_tiles(leaf: MultiscaleLeaf, count: tuple[int, int]) -> Window:
    """Return a window of so many whole tiles near the midrib, `AT` of the way along, inside its outline.

    Raises
    ------
    ReconstructionError
        If the blade has no room for them.
    """
    texture = leaf.texture
    tile = np.asarray(getattr(texture, "tile", texture.period)) / leaf.scale
    first = np.asarray(texture.cell)[0, :2] / leaf.scale
    extent = tile * count
    low, high = leaf.blade.outline.bounds
    numbers = [
        np.arange(np.ceil(a), np.floor(b) + 1)
        for a, b in zip((low - first) / tile, (high - first - extent) / tile, strict=True)
    ]
    corners = first + np.stack(np.meshgrid(*numbers, indexing="ij"), axis=-1).reshape(-1, 2) * tile
    rim = extent * np.stack(np.meshgrid(*[np.linspace(0, 1, 9)] * 2), axis=-1).reshape(-1, 2)
    inside = (
        leaf.blade.outline.contains((corners[:, np.newaxis] + rim).reshape(-1, 2)).reshape(-1, len(rim)).all(axis=1)
    )
    if not inside.any():
        raise ReconstructionError(
            f"tile: no {count[0]} × {count[1]} whole tiles fit into the outline; give a smaller period, or a wider leaf"
        )
    # As near to the midrib as may be.
    place = np.array([low[0] + AT * (high - low)[0], 0.0])
    off = (corners[inside] + extent / 2 - place) / (high - low)
    corner = corners[inside][(off**2).sum(axis=1).argmin()]
    return Window(np.array([corner, corner + extent]), tile)


def block(
    leaf: MultiscaleLeaf, step: float, region: FloatArray, *, seams: bool = False
) -> list[o3d.geometry.TriangleMesh]:
    """Return a piece of the leaf as a solid in two meshes, the surface and the cut faces, in their colors."""
    vertices, triangles = mesh_arrays(leaf.extract_mesh(step, region, closed=True))
    plane = leaf.blade.flatten(vertices)[:, :2]
    near = np.abs(plane[:, np.newaxis] - region).min(axis=(1, 2)) < CUT_WITHIN * step
    at_cut = np.all(near[triangles], axis=1)
    meshes = []
    for chosen, color in ((~at_cut, GREENS[0]), (at_cut, CUT)):
        used = np.unique(triangles[chosen])
        mesh = build_mesh(vertices[used], np.searchsorted(used, triangles[chosen]))
        mesh.paint_uniform_color(to_rgb(color))
        if seams and color != CUT:
            mesh.vertex_colors = o3d.utility.Vector3dVector(_pattern(leaf, plane[used], region, step))
        meshes.append(mesh)
    return meshes


def _pattern(leaf: MultiscaleLeaf, plane: FloatArray, region: FloatArray, step: float) -> FloatArray:
    """Return the sRGB (n, 3) of places on the blade: each other tile in another green, seams within a region a line."""
    tile = np.asarray(getattr(leaf.texture, "tile", leaf.texture.period)) / leaf.scale
    first = np.asarray(leaf.texture.cell)[0, :2] / leaf.scale
    place = (plane - first) / tile
    colors = np.array([to_rgb(green) for green in GREENS])[np.floor(place).astype(int).sum(axis=1) % 2]
    seam = first + np.round(place) * tile
    inner = (seam > region[0] + step) & (seam < region[1] - step)
    colors[(inner & (np.abs(plane - seam) < SEAM_WITHIN * step)).any(axis=1)] = to_rgb(VERMILION)
    return np.asarray(colors)


def _picture(leaf: MultiscaleLeaf, window: Window, steps: int, *, seams: bool = False) -> Page:
    """Return a page with a window of the leaf as a block."""
    solid = block(leaf, float(window.tile.max()) / steps, window.region, seams=seams)
    return _print(Inset(solid, view=_oblique(leaf.blade, solid), unit=leaf.unit))


def _print(subject: Inset, insets: Sequence[Inset] = (), size: tuple[int, int] = PICTURE) -> Page:
    """Return a page as wide as a column, with words of one height whatever the picture's."""
    text = TEXT * em_of(PICTURE) / em_of(size)
    shown = replace(subject, view=replace(subject.view, text=text))
    return draw_page(shown, insets, size, dpi=size[0] / COLUMN)


def _oblique(blade: Blade, solid: list[o3d.geometry.TriangleMesh]) -> View:
    """Return a view of a block with its adaxial side up, in which the midrib runs down to the right."""
    vertices, triangles = mesh_arrays(solid[0])
    place = blade.flatten(vertices.mean(axis=0))[0, 0]
    along, _, up = _axes(blade, place)
    x, y, z = up.tolist()
    camera = Camera.framing(vertices, triangles, View(direction=(x, y, z), tilt=0.0))
    now = float(np.degrees(np.arctan2(along @ camera.up, along @ camera.right)))
    return View(direction=(x, y, z), tilt=TILT, turn=now + TURN)


def _of_leaf(blade: Blade) -> View:
    """Return the view in which all figures show the whole leaf."""
    if isinstance(blade, HeightMapBlade):
        plane, triangles = blade.outline.points, blade.outline.triangles
        surface = blade.lift(np.column_stack([plane, np.zeros(len(plane))]))
    else:
        surface, triangles = mesh_arrays(blade.extract_mesh(float(np.sqrt(blade.outline.area / SAMPLE_COUNT))))
    x, y, z = Camera.framing(surface, triangles, View(tilt=0.0)).toward.tolist()
    return View(direction=(x, y, z))


def _axes(blade: Blade, along: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the directions (3,) along, across and up at a place of the midrib, each of length 1."""
    if isinstance(blade, HeightMapBlade):
        _, tangent, across, up = (row[0] for row in blade.frame.stations(np.array([along])))
    else:
        columns = blade.lift_with_jacobian(np.array([[along, 0.0, 0.0]])).columns[0]
        tangent, across, up = columns / np.linalg.norm(columns, axis=1)[:, np.newaxis]
    return tangent, across, up


def _against_midrib(blade: Blade, along: float) -> tuple[float, float, float]:
    """Return the way along the midrib from which the adaxial side is up, whichever way across is to the right."""
    tangent, across, _ = _axes(blade, along)
    x, y, z = (tangent * np.sign(across[np.abs(across).argmax()])).tolist()
    return x, y, z


def _extent(leaf: MultiscaleLeaf, window: Window) -> str:
    """Return the size of a window in words."""
    along, across = window.region[1] - window.region[0]
    return f"{along:.3g} × {across:.3g} {leaf.unit or ''}".rstrip()
