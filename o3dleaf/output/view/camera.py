"""Views and cameras: a mesh face-on, its long axis level, tilted a little, fitted to a panel."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Count, Finite, Positive
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import IntArray, is_used
from o3dleaf.output.view.camera_loops import sum_moments

MARGIN = 0.04
"""Part of the panel that stays free on each side."""

EYE = 3.0
"""Distance of the eye in a perspective view, in widths of the picture."""


@checked
@dataclass(frozen=True)
class View:
    """A way to look at a mesh.

    Attributes
    ----------
    direction : (3,) tuple of float, optional
        The way from the mesh to the camera. Left out, the camera faces the blade: it looks along the
        axis to which the triangles' normals are nearest, onto the side that they face; where they
        face both, onto the side in the positive direction of the axis' largest component.
    tilt : float
        Degrees by which the camera then goes down toward the picture's lower edge: 0 is face-on,
        and relief shows from 20 on.
    turn : float
        Degrees by which the mesh is turned in its own plane before; at 0 its long axis is level.
    perspective : bool
        False is orthographic: lengths can be measured in the picture.
    smooth : bool
        Normals interpolated over each triangle, or one a triangle.
    supersampling : int
        Rays along each side of a pixel.
    text : float
        Height of words and scale bars on the page, relative to the usual 1.7 % of its width, which is
        for a screen: 1.8 is legible in a printed column, 84 mm wide.
    """

    direction: tuple[float, float, float] | None = None
    tilt: Finite = 20.0
    turn: Finite = 0.0
    perspective: bool = False
    smooth: bool = True
    supersampling: Count = 3
    text: Positive = 1.0


@dataclass(frozen=True)
class Camera:
    """An orthonormal frame at a target, and how much of the world the panel shows.

    Attributes
    ----------
    target : (3,) ndarray
        The point in the middle of the panel.
    right, up, toward : (3,) ndarrays
        Unit vectors: to the panel's right, its top, and from the target to the camera.
    width, height : float
        Extent of the panel at the target, in the mesh's unit.
    perspective : bool
        Whether rays come from one eye, `EYE` widths before the target.
    """

    target: FloatArray
    right: FloatArray
    up: FloatArray
    toward: FloatArray
    width: float
    height: float
    perspective: bool = False

    @classmethod
    def framing(
        cls,
        vertices: FloatArray,
        triangles: IntArray,
        view: View,
        aspect: float | None = None,
        *,
        facets: tuple[FloatArray, IntArray] | None = None,
    ) -> "Camera":
        """Return the camera whose panel, `aspect` times as wide as high, the mesh fills (None: its own aspect).

        What it faces and where its long axis lies can be determined from the mesh of `facets` instead.
        """
        return Reach.of(vertices, triangles, view, facets=facets).camera(aspect)

    def rays(self, columns: FloatArray, rows: FloatArray, size: tuple[int, int]) -> npt.NDArray[np.float32]:
        """Return (n, 6) rays, origin relative to the target and unit direction, through pixel positions.

        Parameters
        ----------
        columns, rows : (n,) ndarrays
            Pixels from the panel's left and top edge, fractional.
        size : (int, int)
            Width and height of the panel in pixels.
        """
        x = (columns / size[0] - 0.5) * self.width
        y = (0.5 - rows / size[1]) * self.height
        plane = x[:, np.newaxis] * self.right + y[:, np.newaxis] * self.up
        eye = EYE * self.width * self.toward
        if self.perspective:
            way = plane - eye
            way /= np.linalg.norm(way, axis=1, keepdims=True)
            return rays_from(eye, way)
        return rays_from(plane + eye, -self.toward)

    @checked
    def project(self, points: npt.ArrayLike, size: tuple[int, int]) -> FloatArray:
        """Return the (n, 2) pixel positions (column, row) of (n, 3) points of the world."""
        apart = as_points(points, dim=3) - self.target
        scale = np.ones(len(apart))
        if self.perspective:
            scale = 1 / (1 - apart @ self.toward / (EYE * self.width))
        column = (apart @ self.right * scale / self.width + 0.5) * size[0]
        row = (0.5 - apart @ self.up * scale / self.height) * size[1]
        return np.stack([column, row], axis=1)


@dataclass(frozen=True)
class Reach:
    """Extent of a mesh along the axes of a view.

    Attributes
    ----------
    axes : (3, 3) ndarray
        Rows right, up and toward the camera.
    low, high : (3,) ndarrays
        Along them.
    perspective : bool
    """

    axes: FloatArray
    low: FloatArray
    high: FloatArray
    perspective: bool

    @classmethod
    def of(
        cls,
        vertices: FloatArray,
        triangles: IntArray,
        view: View,
        *,
        facets: tuple[FloatArray, IntArray] | None = None,
    ) -> "Reach":
        """Measure a mesh; see `Camera.framing`."""
        right, up, toward = _turned_axes(*(facets or (vertices, triangles)), view)
        shown = vertices[is_used(vertices, triangles)]
        across = np.stack([shown @ right, shown @ up, shown @ toward])
        return cls(np.stack([right, up, toward]), across.min(axis=1), across.max(axis=1), view.perspective)

    @property
    def extent(self) -> FloatArray:
        """(2,) width and height of the panel that the mesh fills."""
        size = self.high - self.low
        return np.asarray(np.maximum(size, 1e-3 * size.max())[:2] / (1 - 2 * MARGIN))

    def camera(self, aspect: float | None = None) -> Camera:
        """Return the camera whose panel, `aspect` times as wide as high, the mesh fills (None: its own aspect)."""
        extent = self.extent
        aspect = float(extent[0] / extent[1]) if aspect is None else aspect
        width = max(float(extent[0]), float(extent[1]) * aspect)
        if self.perspective:
            # What is nearer looks larger: the nearest point decides.
            width *= 1 + float(self.high[2] - self.low[2]) / (2 * EYE * width)
        target = np.ascontiguousarray(self.axes.T) @ ((self.low + self.high) / 2)
        right, up, toward = self.axes
        return Camera(target, right, up, toward, width, width / aspect, self.perspective)


def rays_from(origin: FloatArray, way: FloatArray) -> npt.NDArray[np.float32]:
    """Return (n, 6) rays from (n, 3) origins on (n, 3) ways; one of both may be the same of all, (3,)."""
    rays = np.empty((*np.broadcast_shapes(origin.shape, way.shape)[:-1], 6), dtype=np.float32)
    rays[..., :3], rays[..., 3:] = origin, way
    return rays


def _turned_axes(vertices: FloatArray, triangles: IntArray, view: View) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the unit vectors right, up and toward of a view."""
    normal, area, second, blade = _moments(vertices, triangles)
    axes = np.linalg.eigh(second)[1]
    # A bent blade can be deeper than it is wide: what it faces follows from its normals, not its extent.
    blade = np.linalg.eigh(blade)[1]
    toward = _facing(blade[:, 2], normal, area)
    if view.direction is not None:
        toward = np.asarray(view.direction, dtype=np.float64)
        length = np.linalg.norm(toward)
        if toward.shape != (3,) or not np.isfinite(length) or length == 0:
            raise InputError(f"direction: is {view.direction}; give three numbers, not all zero")
        toward = toward / length
    right = _toward_positive(_orthogonal(axes[:, 2], axes[:, 1], toward))
    right, up = _rotate(right, np.cross(toward, right), view.turn)
    toward, up = _rotate(toward, up, -view.tilt)
    return right, up, toward


def _moments(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, float, FloatArray, FloatArray]:
    """Return sums over the area of triangles, doubled: of n, 1, (x - mean) (x - mean)ᵀ and n nᵀ, n the unit normal."""
    origin = vertices[triangles[0, 0]]
    moments = np.zeros((8, 3))
    sum_moments(vertices, triangles, origin, moments)
    area = float(np.trace(moments[2:5]))
    mean = moments[1] / max(area, np.finfo(float).tiny)
    return moments[0], area, moments[5:] - area * np.outer(mean, mean), moments[2:5]


def _facing(axis: FloatArray, normals: FloatArray, area: float) -> FloatArray:
    """Return the axis turned to the side that the triangles face, or to its positive direction."""
    along = float(axis @ normals)
    # A closed blade, or one of two faces, has normals that cancel out.
    if abs(along) > 0.1 * area:
        return np.asarray(axis * np.sign(along))
    return _toward_positive(axis)


def _toward_positive(axis: FloatArray) -> FloatArray:
    """Return the axis with its largest component positive: an eigenvector's sign is arbitrary."""
    return np.asarray(axis * np.sign(axis[np.abs(axis).argmax()]))


def _orthogonal(first: FloatArray, second: FloatArray, toward: FloatArray) -> FloatArray:
    """Return the unit vector across `toward` that is nearest to `first`, or to `second` if that is along it."""
    for axis in (first, second):
        across = axis - (axis @ toward) * toward
        length = np.linalg.norm(across)
        if length > 0.1:
            return np.asarray(across / length)
    raise InputError("direction: the mesh has no extent perpendicular to it; choose another")


def _rotate(one: FloatArray, other: FloatArray, degrees: float) -> tuple[FloatArray, FloatArray]:
    """Return two orthonormal vectors turned in their plane, the first toward the other."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return cosine * one + sine * other, cosine * other - sine * one
