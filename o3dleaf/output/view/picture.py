"""A picture of meshes and point clouds, on a machine with or without a screen."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.image import imsave

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.core.units import check_unit
from o3dleaf.output.view.camera import Camera, Reach, View
from o3dleaf.output.view.offscreen import find_renderer, rasterize
from o3dleaf.output.view.panel import Box, Heading, Page, em_of, lay_out, save_figure
from o3dleaf.output.view.scene import Drawable, Scalars, Scene, encode, linear
from o3dleaf.output.view.shade import Shot, shade_mesh

__all__ = ["ENGINES", "PAPER", "Inset", "Scalars", "draw_page", "render", "save_page"]

PAPER = np.array([0.955, 0.965, 0.950])
"""sRGB of the background."""

PIXELS, VECTORS = (".png", ".jpg", ".jpeg"), (".pdf", ".svg")
SUFFIXES = PIXELS + VECTORS
MIN_SIZE, MAX_SIZE = 64, 30_000
"""Pixels of a side; Matplotlib draws below 2^16."""
ENGINES = ("cpu", "open3d", "auto")


@checked
@dataclass(frozen=True, repr=False)
class Inset:
    """A second mesh, drawn larger in a panel of its own: a window of the micro-structure.

    Attributes
    ----------
    mesh : mesh, point cloud, Points, or a list of them
        In the coordinates of the main mesh, or anywhere if `at` is given.
    title : str, optional
        Written into the panel.
    at : (n, 3) array_like, optional
        Points of the main mesh that the marker goes around; left out, those of the inset's mesh.
        An empty array, or points that the main picture does not show, draw no marker.
    view : View
        Oblique by default.
    scalars : array_like or Scalars, optional
    unit : str, optional
        The unit of its vertices; left out, the main mesh's.
    """

    mesh: Drawable
    title: str | None = None
    at: npt.ArrayLike | None = None
    view: View = field(default_factory=lambda: View(tilt=48.0, turn=32.0))
    scalars: npt.ArrayLike | Scalars | None = None
    unit: Unit | None = None

    def __repr__(self) -> str:
        title = f"{self.title!r}, " if self.title else ""
        return f"Inset({title}{type(self.mesh).__name__}, unit {self.unit})"


@checked
def render(
    mesh: Drawable,
    path: str | PathLike[str] | None = None,
    *,
    size: tuple[int, int] = (1600, 1000),
    insets: Sequence[Inset | Drawable] = (),
    scalars: npt.ArrayLike | Scalars | None = None,
    scale_bar: bool = True,
    unit: Unit | None = None,
    title: str | None = None,
    view: View | None = None,
    engine: str = "cpu",
) -> npt.NDArray[np.uint8]:
    """Return a picture of meshes and point clouds, and write it to a file if a path is given.

    The mesh fills the picture, its blade toward the viewer and seen a little from below, in its own
    colors, in leaf green or in the colors of `scalars`; of a cloud, each point is a small sphere. It
    needs no screen, no GPU and no Vulkan, and the same input gives the same picture.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Or a point cloud of Open3D, an (n, 3) ndarray, or `Points`; or a list of such, drawn together, of which
        the first determines what the picture faces. Not modified.
    path : path-like, optional
        A .png or .jpg file; or .pdf or .svg, with words and bars as vectors.
    size : (int, int)
        Width and height in pixels.
    insets : sequence of Inset or of meshes
        Details in panels of their own, each with a marker where it lies on the mesh.
    scalars : (n,) or (m,) array_like, or Scalars, optional
        One number a vertex or a triangle, of a cloud one a point, shown as colors with a color bar.
    scale_bar : bool
        Whether each panel has one. In a perspective view it holds at the mesh's middle.
    unit : str, optional
        Unit of the vertices ("mm", "um", ...), for the scale bars.
    title : str, optional
        A line at the top. What follows after a newline is smaller, and broken where it is too long.
    view : View, optional
        Another direction, tilt, perspective, flat shading, supersampling or larger words.
    engine : {"cpu", "open3d", "auto"}
        "cpu" casts rays, with shadows and ambient occlusion, and draws the same everywhere. "open3d" is Open3D's
        renderer, which needs Vulkan, in a process of its own: the same camera, colors and light without
        shadows, for meshes whose ray tree would be too large or slow. "auto" is "open3d" where that runs on a GPU.

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If a mesh has no triangle or no extent, the scalars do not fit, or the path is no picture's.
    MemoryBudgetError
        If a mesh has too many triangles for a picture.
    O3DLeafError
        If Open3D's renderer is requested and does not work here.
    """
    if path is not None:
        path = require_writable(path, SUFFIXES)
    subject = Inset(mesh, view=view or View(), scalars=scalars, unit=unit)
    page = draw_page(subject, insets, size, title, scale_bar=scale_bar, engine=engine)
    return save_page(page, path)


def save_page(page: Page, path: Path | None) -> npt.NDArray[np.uint8]:
    """Return the pixels of a page, and write it to a file if a path is given that was found to be writable."""
    pixels = page.pixels()
    if path is not None and path.suffix.lower() in VECTORS:
        save_figure(page.figure, path)
    elif path is not None:
        with whole_file(path) as temporary:
            imsave(temporary, pixels)
    return pixels


def draw_page(
    subject: Inset,
    insets: Sequence[Inset | Drawable] = (),
    size: tuple[int, int] = (1600, 1000),
    title: str | None = None,
    *,
    scale_bar: bool = True,
    engine: str = "cpu",
    dpi: float = 100.0,
    labels: Sequence[tuple[FloatArray, str]] = (),
) -> Page:
    """Return the page of `render`, to which more can be added: shade every panel, then draw the furniture.

    `dpi`, pixels an inch, says how large it is in a PDF; `labels` are written beside their (3,) places.
    """
    if not MIN_SIZE <= min(size) <= max(size) <= MAX_SIZE:
        raise InputError(f"size: is {size}; give a width and a height of {MIN_SIZE} to {MAX_SIZE:,} pixels")
    require_resources(measured.PIXEL * (size[0] * size[1]), f"size: {size[0]:,} × {size[1]:,} pixels", "give fewer")
    unit = check_unit(subject.unit)
    details = [inset if isinstance(inset, Inset) else Inset(inset) for inset in insets]
    panels = [subject, *details]
    scenes = [Scene.of(each.mesh, each.scalars) for each in panels]
    em = subject.view.text * em_of(size)
    foot = round(2.6 * em) if scale_bar or any(scene.scalars for scene in scenes) else 0
    reaches = [
        Reach.of(scene.vertices, scene.triangles, each.view, facets=scene.facets)
        for scene, each in zip(scenes, panels, strict=True)
    ]
    fitted = reaches[0].camera()
    heading = Heading.of(title or "", size, em)
    main, beside = lay_out(size, len(details), fitted.width / fitted.height, heading.height, foot)
    boxes = [main, *beside]
    shots = [
        _shoot(scene, each.view, reach, box.without_foot(foot))
        for scene, each, reach, box in zip(scenes, panels, reaches, boxes, strict=True)
    ]
    page = Page(_expose(shots, boxes, size, engine), subject.view.text, dpi)
    heading.draw(page)
    for inset, scene, box in zip(details, scenes[1:], beside, strict=True):
        _mark_inset(page, shots[0].camera, main.without_foot(foot), (inset, scene), box)
    for place, text in labels:
        x, y = shots[0].camera.project(place[np.newaxis], main.without_foot(foot).size)[0]
        page.write(main.left + x + page.em, main.top + y - page.em, text, scale=1.2, framed=True)
    for each, scene, shot, box in zip(panels, scenes, shots, boxes, strict=True):
        if scale_bar:
            page.scale_bar(box, shot.camera.width, each.unit or unit)
        if scene.scalars is not None and scene.scalars.limits is not None:
            page.color_bar(box, scene.scalars.color_map, scene.scalars.limits, scene.scalars.label)
    return page


def _shoot(scene: Scene, view: View, reach: Reach, box: Box) -> Shot:
    """Return what is to be shaded for one panel."""
    camera = reach.camera(box.width / box.height)
    return Shot(scene.vertices, scene.triangles, scene.paint, camera, box.size, view)


def _expose(shots: list[Shot], boxes: list[Box], size: tuple[int, int], engine: str) -> FloatArray:
    """Return the page of all panels over the paper, sRGB."""
    chosen = require_choice(engine, ENGINES, "engine")
    raster = chosen == "open3d" or (chosen == "auto" and find_renderer() == "hardware")
    pictures = rasterize(shots) if raster else [shade_mesh(shot) for shot in shots]
    pixels = np.broadcast_to(PAPER, (size[1], size[0], 3)).copy()
    for shaded, box in zip(pictures, boxes, strict=True):
        rows, columns = np.nonzero(shaded[..., 3])
        light = shaded[rows, columns]
        pixels[box.top + rows, box.left + columns] = encode(linear(PAPER) * (1 - light[:, 3:]) + light[:, :3])
    return pixels


def _mark_inset(page: Page, camera: Camera, main: Box, detail: tuple[Inset, Scene], box: Box) -> None:
    """Frame an inset, name it, and mark where it lies on the main picture."""
    inset, scene = detail
    page.frame(box)
    if inset.title:
        page.write(box.left + page.em, box.top + 1.1 * page.em, inset.title)
    place = scene.vertices if inset.at is None else np.asarray(inset.at, dtype=np.float64)
    if not len(place):
        return
    edge = np.array([main.left, main.top])
    corners = camera.project(place.reshape(-1, 3), main.size) + edge
    low, high = corners.min(axis=0), corners.max(axis=0)
    # What lies beside the picture has no place on it, and no line leads there.
    if (high >= edge).all() and (low <= edge + main.size).all():
        page.mark(np.clip([low, high], edge, edge + main.size), box)
