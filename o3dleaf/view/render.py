"""A picture of a mesh, on a machine with or without a screen."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.image import imsave

from o3dleaf.checks import FloatArray, require_choice, require_finite
from o3dleaf.errors import InputError, MemoryBudgetError
from o3dleaf.files import require_writable, whole_file
from o3dleaf.mesh.arrays import IntArray, MeshLike, mesh_arrays
from o3dleaf.units import check_unit
from o3dleaf.view.camera import Camera, View
from o3dleaf.view.panel import Box, Page, em_of, lay_out
from o3dleaf.view.shade import Paint, shade_mesh

LARGEST = 60_000_000
"""Triangles that a picture is made of at most (about 10 GiB for the tree of the ray caster)."""

UPPER_GREEN = np.array([0.130, 0.300, 0.055])
"""Linear RGB of a leaf's outside, seen from the side that the triangles face."""

UNDER_GREEN = np.array([0.235, 0.370, 0.150])
"""The same from behind: an abaxial side is paler."""

PAPER = np.array([0.955, 0.965, 0.950])
"""sRGB of the background."""


@dataclass(frozen=True)
class Scalars:
    """Numbers on a mesh that are shown as colours.

    Attributes
    ----------
    values : (n,) or (m,) array_like
        One a vertex or one a triangle.
    label : str
        What they are, with their unit; written beside the colour bar.
    colour_map : str
        A colour map of Matplotlib.
    limits : (float, float), optional
        The values at the ends of the colour map; left out, the 1st and 99th percentile.
    """

    values: npt.ArrayLike
    label: str = ""
    colour_map: str = "viridis"
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Inset:
    """A second mesh, drawn larger in a panel of its own: a window of the micro-structure.

    Attributes
    ----------
    mesh : mesh
        In the coordinates of the main mesh, or anywhere if `at` says where it belongs.
    title : str, optional
        Written into the panel.
    at : (n, 3) array_like, optional
        Points of the main mesh that the marker goes around; left out, those of the inset's mesh.
        An empty array draws no marker.
    view : View
        Oblique by default.
    scalars : array_like or Scalars, optional
    unit : str, optional
        The unit of its vertices; left out, the main mesh's.
    """

    mesh: MeshLike
    title: str | None = None
    at: npt.ArrayLike | None = None
    view: View = field(default_factory=lambda: View(tilt=48.0, turn=32.0))
    scalars: npt.ArrayLike | Scalars | None = None
    unit: str | None = None


def render(
    mesh: MeshLike,
    path: str | PathLike[str] | None = None,
    *,
    size: tuple[int, int] = (1600, 1000),
    insets: Sequence[Inset | MeshLike] = (),
    scalars: npt.ArrayLike | Scalars | None = None,
    scale_bar: bool = True,
    unit: str | None = None,
    title: str | None = None,
    view: View | None = None,
) -> npt.NDArray[np.uint8]:
    """Return a picture of a mesh, and write it to a file if a path is given.

    The mesh fills the picture, its blade toward the viewer and seen a little from below, in leaf
    green or in the colours of `scalars`. It needs no screen, no GPU and no Vulkan, and the same
    input gives the same picture.

    Parameters
    ----------
    mesh : open3d.geometry.TriangleMesh, open3d.t.geometry.TriangleMesh or (vertices, triangles)
        Not modified.
    path : path-like, optional
        A .png or .jpg file.
    size : (int, int)
        Width and height in pixels.
    insets : sequence of Inset or of meshes
        Details in panels of their own, each with a marker where it lies on the mesh.
    scalars : (n,) or (m,) array_like, or Scalars, optional
        One number a vertex or a triangle, shown as colours with a colour bar.
    scale_bar : bool
        Whether each panel has one. In a perspective view it holds at the mesh's middle.
    unit : str, optional
        Unit of the vertices ("mm", "um", ...), for the scale bars.
    title : str, optional
        A line at the top.
    view : View, optional
        Another direction, tilt, perspective, flat shading or supersampling.

    Returns
    -------
    (height, width, 3) ndarray of uint8

    Raises
    ------
    InputError
        If a mesh has no triangle or no extent, the scalars do not fit, or the path is no picture's.
    MemoryBudgetError
        If a mesh has too many triangles for a picture.
    """
    if path is not None:
        require_writable(path, (".png", ".jpg", ".jpeg"))
    if min(size) < 64:
        raise InputError(f"size: is {size}; give a width and a height of 64 pixels or more")
    details = [inset if isinstance(inset, Inset) else Inset(inset) for inset in insets]
    subject = Inset(mesh, view=view or View(), scalars=scalars, unit=check_unit(unit))
    page = _compose(subject, details, size, title, scale_bar=scale_bar)
    if path is not None:
        with whole_file(path) as temporary:
            imsave(temporary, page)
    return page


@dataclass(frozen=True)
class _Picture:
    """One panel: what it shows, from where, in which colours."""

    inset: Inset
    vertices: FloatArray
    triangles: IntArray

    @classmethod
    def of(cls, inset: Inset) -> "_Picture":
        """Take a mesh apart, or say why there can be no picture of it."""
        vertices, triangles = mesh_arrays(inset.mesh)
        if not len(triangles):
            raise InputError("mesh: has no triangles; there is nothing to draw")
        if len(triangles) > LARGEST:
            raise MemoryBudgetError(f"mesh: {len(triangles)} triangles are too many for a picture; simplify it first")
        if np.ptp(vertices[triangles.ravel()], axis=0).max() == 0:
            raise InputError("mesh: all its vertices are in one place; there is nothing to draw")
        return cls(inset, vertices, triangles)

    def scalars(self) -> Scalars | None:
        """Return the scalars with their limits set, or None."""
        given = self.inset.scalars
        if given is None:
            return None
        scalars = given if isinstance(given, Scalars) else Scalars(given)
        require_choice(scalars.colour_map, colormaps, "colour_map")
        values = require_finite(np.asarray(scalars.values, dtype=np.float64), "scalars")
        if values.shape not in {(len(self.vertices),), (len(self.triangles),)}:
            raise InputError(
                f"scalars: have shape {values.shape}; give one a vertex ({len(self.vertices)},) or one a triangle "
                f"({len(self.triangles)},)"
            )
        low, high = scalars.limits or np.percentile(values, (1, 99)).tolist()
        return replace(scalars, values=values, limits=(low, high))

    def paint(self, scalars: Scalars | None) -> Paint:
        """Return the colours of the surface."""
        if scalars is None or scalars.limits is None:
            return lambda _triangle, _weights, facing: np.where(facing[:, np.newaxis] > 0, UPPER_GREEN, UNDER_GREEN)
        values, (low, high) = np.asarray(scalars.values), scalars.limits
        # Full light is brighter than white paper: toned down, the colours stay those of the bar.
        table = 0.68 * linear(colormaps[scalars.colour_map](np.linspace(0, 1, 256))[:, :3])

        def paint(triangle: IntArray, weights: FloatArray, _facing: FloatArray) -> FloatArray:
            if len(values) == len(self.vertices):
                here = np.einsum("ij,ij->i", weights, values[self.triangles[triangle]])
            else:
                here = values[triangle]
            part = np.clip((here - low) / ((high - low) or 1.0), 0, 1)
            return np.asarray(table[np.round(part * 255).astype(np.int64)])

        return paint


def _compose(
    subject: Inset, details: list[Inset], size: tuple[int, int], title: str | None, *, scale_bar: bool
) -> npt.NDArray[np.uint8]:
    """Shade every panel onto the page, then draw its furniture."""
    pictures = [_Picture.of(each) for each in (subject, *details)]
    scalars = [picture.scalars() for picture in pictures]
    em = em_of(size)
    foot = round(2.6 * em) if scale_bar or any(scalars) else 0
    own = Camera.framing(pictures[0].vertices, pictures[0].triangles, subject.view)
    main, panels = lay_out(size, len(details), own.width / own.height, round(2.4 * em) if title else 0, foot)
    boxes = [main, *panels]
    pixels = np.broadcast_to(PAPER, (size[1], size[0], 3)).copy()
    cameras = [
        _expose(pixels, picture, colours, box.without_foot(foot))
        for picture, colours, box in zip(pictures, scalars, boxes, strict=True)
    ]
    page = Page(pixels)
    if title:
        page.write(em, 1.3 * em, title, scale=1.25)
    for picture, box in zip(pictures[1:], panels, strict=True):
        _mark_inset(page, cameras[0], main.without_foot(foot), picture, box)
    for picture, colours, camera, box in zip(pictures, scalars, cameras, boxes, strict=True):
        if scale_bar:
            page.scale_bar(box, camera.width, picture.inset.unit or subject.unit)
        if colours is not None and colours.limits is not None:
            page.colour_bar(box, colours.colour_map, colours.limits, colours.label)
    return page.pixels()


def _expose(pixels: FloatArray, picture: _Picture, scalars: Scalars | None, box: Box) -> Camera:
    """Shade one picture into its box of the page, over the paper, and return its camera."""
    view = picture.inset.view
    camera = Camera.framing(picture.vertices, picture.triangles, view, box.width / box.height)
    shaded = shade_mesh(picture.vertices, picture.triangles, picture.paint(scalars), camera, box.size, view)
    window = (slice(box.top, box.top + box.height), slice(box.left, box.left + box.width))
    pixels[window] = encode(linear(pixels[window]) * (1 - shaded[..., 3:]) + shaded[..., :3])
    return camera


def _mark_inset(page: Page, camera: Camera, main: Box, picture: _Picture, box: Box) -> None:
    """Frame an inset, name it, and mark where it lies on the main picture."""
    page.frame(box)
    if picture.inset.title:
        page.write(box.left + page.em, box.top + 1.1 * page.em, picture.inset.title)
    place = picture.vertices if picture.inset.at is None else np.asarray(picture.inset.at, dtype=np.float64)
    if len(place):
        page.mark(camera.project(place.reshape(-1, 3), main.size) + np.array([main.left, main.top]), box)


def linear(srgb: FloatArray) -> FloatArray:
    """Return linear light of sRGB values from 0 to 1 (IEC 61966-2-1)."""
    return np.asarray(np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))


def encode(light: FloatArray) -> FloatArray:
    """Return sRGB values from 0 to 1 of linear light, what is brighter cut off (IEC 61966-2-1)."""
    light = np.clip(light, 0, 1)
    return np.asarray(np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055))
