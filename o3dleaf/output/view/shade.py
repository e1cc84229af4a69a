"""Light on a mesh, by Open3D's ray casting on the CPU: no GPU, no Vulkan, the same picture every time.

One light over the viewer's left shoulder with shadows, a soft sky whose part that a point sees is
measured by short rays (ambient occlusion, which is what makes ridges and hairs stand out), a little
gloss as a leaf has, and a faint rim. Both sides of a triangle are lit.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.output.view.camera import Camera, View

Paint = Callable[[IntArray, FloatArray, FloatArray], FloatArray]
"""``paint(triangle (n,), weights (n, 3) of its corners, facing (n,) 1 or -1)`` is the linear RGB (n, 3) of hits."""

BATCH_SIZE = 1 << 19
"""Rays cast at once."""

SKY_RAYS = 4
"""Rays to the sky for each primary ray; supersampling averages over more."""

SKY_REACH = 0.04
"""How far a sky ray looks for an obstacle, in widths of the picture."""

LIGHT = np.array([-0.62, 0.50, 0.60])
"""Where the light comes from: right, up, toward the viewer."""


@dataclass(frozen=True)
class Shot:
    """A mesh, its colors and a camera, to be shaded for one panel.

    Attributes
    ----------
    vertices, triangles : (n, 3), (m, 3) ndarrays
    paint : callable
        See `Paint`.
    camera : Camera
    size : (int, int)
        Width and height in pixels.
    view : View
        Its `smooth` and `supersampling`.
    """

    vertices: FloatArray
    triangles: IntArray
    paint: Paint
    camera: Camera
    size: tuple[int, int]
    view: View


def shade_mesh(shot: Shot) -> FloatArray:
    """Return a picture of a mesh with its coverage.

    Returns
    -------
    (height, width, 4) ndarray
        Linear RGB times coverage, and the coverage from 0 to 1.
    """
    vertices, triangles, camera, size, view = shot.vertices, shot.triangles, shot.camera, shot.size, shot.view
    # float32 holds the digits of what is near zero: the target becomes the origin.
    local = (vertices - camera.target).astype(np.float32)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor.from_numpy(local), o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)))
    normals = vertex_normals(local, triangles) if view.smooth else None
    width, height = size
    finer = view.supersampling
    image = np.empty((height, width, 4))
    rows = max(1, BATCH_SIZE // (width * finer * finer))
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        x = (np.arange(width * finer) + 0.5) / finer
        y = (np.arange(top * finer, bottom * finer) + 0.5) / finer
        columns, lines = (grid.ravel() for grid in np.meshgrid(x, y))
        rays = camera.rays(columns, lines, size)
        colors = _shade_rays(scene, rays, (triangles, normals), shot.paint, camera)
        image[top:bottom] = colors.reshape(bottom - top, finer, width, finer, 4).mean(axis=(1, 3))
    return image


def _shade_rays(
    scene: o3d.t.geometry.RaycastingScene,
    rays: npt.NDArray[np.float32],
    shape: tuple[IntArray, FloatArray | None],
    paint: Paint,
    camera: Camera,
) -> FloatArray:
    """Return the (n, 4) colors of rays; those that hit nothing stay zero."""
    answer = {name: value.numpy() for name, value in scene.cast_rays(o3d.core.Tensor.from_numpy(rays)).items()}
    hit = np.flatnonzero(np.isfinite(answer["t_hit"]))
    colors = np.zeros((len(rays), 4))
    if not len(hit):
        return colors
    triangle = answer["primitive_ids"][hit].astype(np.int64)
    uv = answer["primitive_uvs"][hit].astype(np.float64)
    weights = np.column_stack([1 - uv.sum(axis=1), uv])
    way = rays[hit, 3:].astype(np.float64)
    flat = answer["primitive_normals"][hit].astype(np.float64)
    facing = np.where(np.einsum("ij,ij->i", flat, way) > 0, -1.0, 1.0)
    flat *= facing[:, np.newaxis]
    triangles, normals = shape
    bent = flat
    if normals is not None:
        bent = _interpolate(normals, triangles[triangle], weights) * facing[:, np.newaxis]
        # Where two faces lie back to back the normals of their vertices cancel.
        bent = np.where(bent.any(axis=1, keepdims=True), bent, flat)
    place = rays[hit, :3] + answer["t_hit"][hit, np.newaxis] * way + 1e-4 * camera.width * flat
    light = _light(scene, place, bent, way, camera)
    colors[hit, :3] = paint(triangle, weights, facing) * light[:, :1] + light[:, 1:]
    colors[hit, 3] = 1.0
    return colors


def _light(
    scene: o3d.t.geometry.RaycastingScene, place: FloatArray, normal: FloatArray, way: FloatArray, camera: Camera
) -> FloatArray:
    """Return (n, 2): the light that a surface scatters in its color, and the gloss added in white."""
    sun = np.broadcast_to(sun_of(camera), place.shape)
    lit = ~_blocked(scene, place, sun, np.inf)
    return reflect(normal, way, camera, lit, _sky_seen(scene, place, normal, camera))


def sun_of(camera: Camera) -> FloatArray:
    """Return the unit vector to the light."""
    return np.asarray(np.stack([camera.right, camera.up, camera.toward], axis=1) @ (LIGHT / np.linalg.norm(LIGHT)))


def reflect(
    normal: FloatArray,
    way: FloatArray,
    camera: Camera,
    lit: npt.NDArray[np.bool_] | float = 1.0,
    seen: FloatArray | float = 1.0,
) -> FloatArray:
    """Return (n, 2) light, scattered and gloss, of surfaces with a normal, seen along unit `way`.

    `lit` says whether the light reaches them, `seen` is the part of the sky that they see.
    """
    sun = sun_of(camera)
    direct = np.clip(normal @ sun, 0, None) * lit
    sky = 0.75 + 0.25 * (normal @ camera.up)
    half = sun - way
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    gloss = np.clip(np.einsum("ij,ij->i", normal, half), 0, None) ** 20 * lit
    rim = (1 - np.clip(-np.einsum("ij,ij->i", normal, way), 0, 1)) ** 3
    diffuse = 1.15 * direct + 0.40 * sky * seen
    return np.column_stack([diffuse + 0.10 * rim, 0.05 * gloss + 0.01 * rim])


def _sky_seen(
    scene: o3d.t.geometry.RaycastingScene, place: FloatArray, normal: FloatArray, camera: Camera
) -> FloatArray:
    """Return the (n,) part of the sky over each point that nothing near hides, by a few cosine-weighted rays."""
    helper = np.where(np.abs(normal[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(normal, helper)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    other = np.cross(normal, tangent)
    # Low-discrepancy turns (golden ratio and its square root) instead of random numbers.
    number = np.arange(len(place), dtype=np.float64)
    seen = np.zeros(len(place))
    for ray in range(SKY_RAYS):
        radius = np.sqrt((ray + (number * 0.754877666) % 1) / SKY_RAYS)[:, np.newaxis]
        angle = 2 * np.pi * ((number * 0.618033989 + ray * 0.381966) % 1)[:, np.newaxis]
        way = radius * (np.cos(angle) * tangent + np.sin(angle) * other) + np.sqrt(1 - radius**2) * normal
        seen += ~_blocked(scene, place, way, SKY_REACH * camera.width)
    return seen / SKY_RAYS


def _blocked(
    scene: o3d.t.geometry.RaycastingScene, place: FloatArray, way: FloatArray, reach: float
) -> npt.NDArray[np.bool_]:
    """Return for each ray whether the mesh is in its way within `reach`."""
    rays = o3d.core.Tensor.from_numpy(np.hstack([place, way]).astype(np.float32))
    return np.asarray(scene.test_occlusions(rays, tfar=float(reach)).numpy(), dtype=bool)


def _interpolate(values: FloatArray, corners: IntArray, weights: FloatArray) -> FloatArray:
    """Return unit vectors interpolated between the corners of the triangles that were hit."""
    mixed = np.einsum("ij,ijk->ik", weights, values[corners])
    length = np.linalg.norm(mixed, axis=1, keepdims=True)
    return np.asarray(mixed / np.where(length > 0, length, 1))


def vertex_normals(vertices: npt.NDArray[np.float32], triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of the vertices, triangles weighted by area."""
    first, second, third = (vertices[triangles[:, corner]].astype(np.float64) for corner in range(3))
    face = np.cross(second - first, third - first)
    corner = triangles.ravel()
    sums = [np.bincount(corner, weights=np.repeat(face[:, axis], 3), minlength=len(vertices)) for axis in range(3)]
    normal = np.stack(sums, axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.where(length > 0, length, 1))
