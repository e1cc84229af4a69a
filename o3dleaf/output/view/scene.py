"""The scene of one panel: meshes and point clouds, put together into triangles with their colors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, TypeGuard

import numpy as np
import numpy.typing as npt
import open3d as o3d
from matplotlib import colormaps
from matplotlib.colors import is_color_like, to_rgb

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.checks.arrays import FloatArray, as_floats, require_moderate
from o3dleaf.core.checks.scalars import require_choice
from o3dleaf.core.errors import InputError, MemoryBudgetError
from o3dleaf.core.mesh_arrays import IntArray, MeshLike, is_used, mesh_arrays
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import require_resources
from o3dleaf.output.view.points import Points, make_facets, make_spheres
from o3dleaf.output.view.shade import Paint

Drawable: TypeAlias = (
    MeshLike | o3d.geometry.PointCloud | o3d.t.geometry.PointCloud | npt.NDArray[Any] | Points | list[Any]
)
"""A mesh, a point cloud (Open3D's, or an (n, 3) ndarray), `Points`, or a list of such that are drawn together."""

CLOUDS = (o3d.geometry.PointCloud, o3d.t.geometry.PointCloud, np.ndarray, Points)
GEOMETRIES = (*CLOUDS[:2], Points, o3d.geometry.TriangleMesh, o3d.t.geometry.TriangleMesh, tuple)

MAX_TRIANGLES = 60_000_000
"""Triangles that a picture is made of at most (about 10 GiB for the tree of the ray caster)."""

UPPER_GREEN = np.array([0.130, 0.300, 0.055])
"""Linear RGB of a leaf's outside, seen from the side that the triangles face."""

UNDER_GREEN = np.array([0.235, 0.370, 0.150])
"""The same from behind: an abaxial side is paler."""

BROWN = "#c49a6c"
"""Of points that have no color of their own: the paper's scan."""

TONE = 0.68
"""Full light is brighter than white paper: toned down, the colors stay those of the bar."""


@checked
@dataclass(frozen=True, repr=False)
class Scalars:
    """Numbers on a mesh or a point cloud that are shown as colors.

    Attributes
    ----------
    values : (n,) or (m,) array_like
        One a vertex or one a triangle; of a cloud, one a point. Of a list of things, those of the first.
    label : str
        What they are, with their unit; written beside the color bar.
    color_map : str
        A color map of Matplotlib.
    limits : (float, float), optional
        The values at the ends of the color map; left out, the 1st and 99th percentile.
    """

    values: npt.ArrayLike
    label: str = ""
    color_map: str = "viridis"
    limits: tuple[float, float] | None = None

    def __repr__(self) -> str:
        label = f"{self.label!r}, " if self.label else ""
        limits = f", limits {self.limits[0]:g} to {self.limits[1]:g}" if self.limits else ""
        return f"Scalars({label}{np.size(self.values):,} values, {self.color_map}{limits})"


@dataclass(frozen=True)
class SceneMesh:
    """One mesh of a scene.

    Attributes
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    colors : (n, 3), (1, 3) ndarray, optional
        Linear RGB of the vertices, or of all of them; None: leaf green.
    owner : (m,) ndarray, optional
        The point of a cloud that each triangle belongs to; None: it is no cloud.
    facets : (vertices, triangles)
        From which the camera determines what the part faces.
    """

    vertices: FloatArray
    triangles: IntArray
    colors: FloatArray | None
    owner: IntArray | None
    facets: tuple[FloatArray, IntArray]

    @classmethod
    def of(cls, thing: Drawable) -> "SceneMesh":
        """Take a mesh or a cloud apart, or say why there can be no picture of it."""
        if not isinstance(thing, CLOUDS):
            vertices, triangles = mesh_arrays(thing)  # type: ignore[arg-type]
            if not len(triangles):
                raise InputError("mesh: has no triangles; there is nothing to draw")
            _require_few(len(triangles))
            if np.ptp(vertices[is_used(vertices, triangles)], axis=0).max() == 0:
                raise InputError("mesh: all its vertices are in one place; there is nothing to draw")
            return cls(vertices, triangles, own_colors(thing), None, (vertices, triangles))
        cloud = thing if isinstance(thing, Points) else Points(thing)
        points = cloud.positions()
        # Of octahedra, the simplest of spheres.
        _require_few(8 * len(points))
        vertices, triangles, owner = make_spheres(points, cloud.size(points))
        colors = own_colors(cloud.points) if cloud.color is None else None
        if colors is None:
            colors = _color(cloud.color or BROWN)
        elif len(colors) == len(points):
            colors = np.repeat(colors, len(vertices) // len(points), axis=0)
        return cls(vertices, triangles, colors, owner, make_facets(points))

    def scalars(self, given: npt.ArrayLike | Scalars | None) -> Scalars | None:
        """Return scalars one a vertex or one a triangle, with their limits set, or None."""
        if given is None:
            return None
        scalars = given if isinstance(given, Scalars) else Scalars(given)
        require_choice(scalars.color_map, colormaps, "color_map")
        values = require_moderate(as_floats(scalars.values, "scalars"), "scalars")
        if self.owner is not None:
            count = int(self.owner[-1]) + 1
            if values.shape != (count,):
                raise InputError(f"scalars: have shape {values.shape}; give one per point ({count},)")
        elif values.shape not in {(len(self.vertices),), (len(self.triangles),)}:
            raise InputError(
                f"scalars: have shape {values.shape}; give one per vertex ({len(self.vertices)},) or one per triangle "
                f"({len(self.triangles)},)"
            )
        low, high = scalars.limits or np.percentile(values, (1, 99)).tolist()
        return replace(scalars, values=values if self.owner is None else values[self.owner], limits=(low, high))

    def paint(self, scalars: Scalars | None) -> Paint:
        """Return the colors of the surface."""
        if scalars is not None and scalars.limits is not None:
            return self._map(np.asarray(scalars.values), scalars.limits, scalars.color_map)
        colors, triangles = self.colors, self.triangles
        if colors is None:
            return lambda _triangle, _weights, facing: np.where(facing[:, np.newaxis] > 0, UPPER_GREEN, UNDER_GREEN)
        if len(colors) == 1:
            return lambda triangle, _weights, _facing: np.broadcast_to(colors, (len(triangle), 3))
        return lambda triangle, weights, _facing: np.einsum("ij,ijk->ik", weights, colors[triangles[triangle]])

    def _map(self, values: FloatArray, limits: tuple[float, float], color_map: str) -> Paint:
        """Return the colors of numbers, one a vertex or one a triangle."""
        low, high = limits
        table = TONE * linear(colormaps[color_map](np.linspace(0, 1, 256))[:, :3])

        def paint(triangle: IntArray, weights: FloatArray, _facing: FloatArray) -> FloatArray:
            if len(values) == len(self.vertices):
                here = np.einsum("ij,ij->i", weights, values[self.triangles[triangle]])
            else:
                here = values[triangle]
            part = np.clip((here - low) / ((high - low) or 1.0), 0, 1)
            return np.asarray(table[np.round(part * 255).astype(np.int64)])

        return paint


@dataclass(frozen=True)
class Scene:
    """The things of a panel as one mesh.

    Attributes
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    facets : (vertices, triangles)
        Of the first thing.
    scalars : Scalars or None
    paint : callable
        See `o3dleaf.output.view.shade.Paint`.
    """

    vertices: FloatArray
    triangles: IntArray
    facets: tuple[FloatArray, IntArray]
    scalars: Scalars | None
    paint: Paint

    @classmethod
    def of(cls, things: Drawable, given: npt.ArrayLike | Scalars | None = None) -> "Scene":
        """Put things together; the scalars are those of the first."""
        parts = [SceneMesh.of(thing) for thing in (things if _is_several(things) else [things])]
        scalars = parts[0].scalars(given)
        paints = [part.paint(scalars if part is parts[0] else None) for part in parts]
        counts = [len(part.triangles) for part in parts]
        _require_few(sum(counts))
        if len(parts) == 1:
            return cls(parts[0].vertices, parts[0].triangles, parts[0].facets, scalars, paints[0])
        before = np.cumsum([0, *(len(part.vertices) for part in parts)])
        triangles = np.concatenate([part.triangles + first for part, first in zip(parts, before, strict=False)])
        vertices = np.concatenate([part.vertices for part in parts])
        return cls(vertices, triangles, parts[0].facets, scalars, _join(paints, counts))


def _is_several(things: object) -> TypeGuard[list[Any]]:
    """Return whether it is a list of things, and not one mesh given as the list of its two arrays."""
    return isinstance(things, list) and any(isinstance(thing, GEOMETRIES) for thing in things)


def _join(paints: Sequence[Paint], counts: Sequence[int]) -> Paint:
    """Return the paint of meshes put one after another."""
    first = np.cumsum([0, *counts])

    def paint(triangle: IntArray, weights: FloatArray, facing: FloatArray) -> FloatArray:
        colors = np.empty((len(triangle), 3))
        part = np.searchsorted(first, triangle, side="right") - 1
        for number, paint_part in enumerate(paints):
            rows = np.flatnonzero(part == number)
            if len(rows):
                colors[rows] = paint_part(triangle[rows] - first[number], weights[rows], facing[rows])
        return colors

    return paint


def _require_few(count: int) -> None:
    """Raise `MemoryBudgetError` for more triangles than a picture is made of."""
    if count > MAX_TRIANGLES:
        raise MemoryBudgetError(f"mesh: {count:,} triangles are too many for a picture; simplify it first")
    require_resources(measured.DRAWN_TRIANGLE * count, f"picture: {count:,} triangles", "simplify the mesh first")


def own_colors(thing: Any) -> FloatArray | None:
    """Return the linear RGB (n, 3) that an Open3D geometry has at its vertices or points, or None."""
    colors: npt.NDArray[Any] | None = None
    table = getattr(thing, "vertex", getattr(thing, "point", None))
    if table is not None and "colors" in table:
        colors = table.colors.cpu().numpy()
        colors = colors / 255 if np.issubdtype(colors.dtype, np.integer) else colors
    elif getattr(thing, "has_vertex_colors", bool)():
        colors = np.asarray(thing.vertex_colors)
    elif getattr(thing, "has_colors", bool)():
        colors = np.asarray(thing.colors)
    return None if colors is None else TONE * linear(np.clip(colors.astype(np.float64), 0, 1))


def _color(name: str) -> FloatArray:
    """Return the linear RGB (1, 3) of a color's name."""
    if not is_color_like(name):
        raise InputError(f"color: unknown {name!r}; give a color of Matplotlib, such as '#d55e00'")
    return TONE * linear(np.array([to_rgb(name)]))


def linear(srgb: FloatArray) -> FloatArray:
    """Return linear light of sRGB values from 0 to 1 (IEC 61966-2-1)."""
    return np.asarray(np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))


def encode(light: FloatArray) -> FloatArray:
    """Return sRGB values from 0 to 1 of linear light, what is brighter cut off (IEC 61966-2-1)."""
    light = np.clip(light, 0, 1)
    return np.asarray(np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055))
