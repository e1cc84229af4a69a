"""Light on a mesh, by Open3D's ray casting on the CPU: no GPU, no Vulkan, the same picture every time.

One light over the viewer's left shoulder with shadows, a soft sky whose part that a point sees is
measured by short rays (ambient occlusion, which is what makes ridges and hairs stand out), a little
gloss as a leaf has, and a faint rim. Both sides of a triangle are lit.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import BoolArray, IntArray, ray_scene
from o3dleaf.output.view.camera import EYE, Camera, View, rays_from
from o3dleaf.output.view.camera_loops import mark_covered
from o3dleaf.output.view.film import Film, Lit, PixelSamples
from o3dleaf.output.view.shade_loops import aim_at_sky, reflect, stand_on, sum_normals

Paint = Callable[[IntArray, FloatArray, FloatArray], FloatArray]
"""``paint(triangle (n,), weights (n, 3) of its corners, facing (n,) 1 or -1)`` is the linear RGB (n, 3) of hits."""

CONTRAST = 0.05
"""Of a screen's range: where 3 × 3 pixels differ by less, one differs from the next by four steps of 255, and the
first samples, whose mean is exact for what changes evenly, are off by a tenth of a step."""

SKY_RAYS, MORE_SKY_RAYS = 3, 2
"""Rays to the sky for each of a pixel's first samples, which may be all that are taken, and for each other one."""

SKY_STEPS = np.array([0.7548776662466927, 0.5698402909980532])
"""1/ρ and 1/ρ² of the plastic number, ρ³ = ρ + 1: the steps of the most even additive sequence in the square."""

LIFT = 1e-4
"""How far above the surface its rays to the light start, in widths of the picture."""

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


def shade_mesh(shot: Shot, contrast: float = CONTRAST) -> FloatArray:
    """Return a picture of a mesh with its coverage.

    Of the samples of a pixel only the first few are taken where those of the 3 × 3 pixels around it hit one smooth
    piece of surface and differ by less than `contrast`, 0 to 1 of the square root of light. Pixels that one surface
    fills share their rays to the sky with those around. With a contrast of 0 every sample is taken, and none shared.

    Returns
    -------
    (height, width, 4) ndarray
        Linear RGB times coverage, and the coverage from 0 to 1.
    """
    shot = _about_the_origin(shot)
    film = Film(_find_covered(shot), shot.view.supersampling)
    surface = Surface.of(shot)
    film.take_first(surface.light)
    pixel = shot.camera.width / shot.size[0]
    film.take_others(~film.find_calm(contrast, pixel), surface.light)
    if contrast > 0:
        film.share_sky(pixel)
    return film.image()


def _about_the_origin(shot: Shot) -> Shot:
    """Return a shot about its camera's target whose panel is about one wide.

    Open3D's ray casting takes float32, in which areas of tiny triangles vanish and huge coordinates are infinite. By a
    power of two no digit is lost: the picture is the same to the bit.
    """
    camera = shot.camera
    scale = float(2.0 ** -round(np.log2(camera.width)))
    near = replace(camera, target=np.zeros(3), width=scale * camera.width, height=scale * camera.height)
    return replace(shot, vertices=scale * (shot.vertices - camera.target), camera=near)


def _find_covered(shot: Shot) -> BoolArray:
    """Return the (height, width) pixels that the mesh reaches into."""
    camera, (width, height) = shot.camera, shot.size
    covered = np.zeros((height, width), dtype=bool)
    if camera.perspective and ((shot.vertices - camera.target) @ camera.toward).max() > 0.99 * EYE * camera.width:
        # What is beside the eye or behind it has no place on the picture.
        covered[:] = True
    else:
        mark_covered(camera.project(shot.vertices, shot.size), shot.triangles, covered)
    return covered


@dataclass(frozen=True)
class Surface:
    """A mesh in the tree of Open3D's ray casting, about the camera's target.

    Attributes
    ----------
    shot : Shot
    tree : open3d.t.geometry.RaycastingScene
    normals : (n, 3) ndarray
        Of the vertices; without rows, the triangles are flat.
    """

    shot: Shot
    tree: o3d.t.geometry.RaycastingScene
    normals: FloatArray

    @classmethod
    def of(cls, shot: Shot) -> "Surface":
        """Build the tree."""
        local = (shot.vertices - shot.camera.target).astype(np.float32)
        tree = ray_scene(local, shot.triangles)
        # Open3D builds the tree at the first ray, and looks out for no other thread.
        tree.cast_rays(o3d.core.Tensor.from_numpy(np.zeros((1, 6), dtype=np.float32)))
        return cls(shot, tree, vertex_normals(local, shot.triangles) if shot.view.smooth else np.empty((0, 3)))

    def light(self, samples: PixelSamples) -> Lit:
        """Return what samples hit and how it is lit."""
        camera, triangles = self.shot.camera, self.shot.triangles
        rays = camera.rays(samples.columns, samples.rows, self.shot.size)
        answer = {name: value.numpy() for name, value in self.tree.cast_rays(o3d.core.Tensor.from_numpy(rays)).items()}
        hit = np.flatnonzero(np.isfinite(answer["t_hit"]))
        triangle = answer["primitive_ids"][hit].astype(np.int64)
        rays, count, lift = rays[hit], len(hit), LIFT * camera.width
        place, normal, facing, weights = (
            np.empty((count, 3)),
            np.empty((count, 3)),
            np.empty(count),
            np.empty((count, 3)),
        )
        distance, uv, flat = (answer[name][hit] for name in ("t_hit", "primitive_uvs", "primitive_normals"))
        stand_on(rays, distance, uv, flat, triangle, triangles, self.normals, lift, place, normal, facing, weights)
        light = reflected(self.shot.paint(triangle, weights, facing), normal, rays, camera, self.lit(place))
        seen = self.seen(place, normal, samples, hit)
        return Lit(hit, light, seen, place, normal)

    def lit(self, place: FloatArray) -> BoolArray:
        """Return which points the light reaches."""
        return ~self._blocked(rays_from(place, sun_of(self.shot.camera)), np.inf)

    def seen(self, place: FloatArray, normal: FloatArray, samples: PixelSamples, hit: IntArray) -> FloatArray:
        """Return the (k,) part of the sky over surface points that nothing near hides, weighted by the cosine."""
        camera = self.shot.camera
        row, column = samples.rows[hit].astype(np.int64), samples.columns[hit].astype(np.int64)
        axes = np.stack([camera.right, camera.up, camera.toward])
        finer, number = self.shot.view.supersampling, samples.number[hit]
        is_first = number < finer
        count = SKY_RAYS if is_first.all() else MORE_SKY_RAYS
        # The samples of a pixel go on in one sequence.
        first = np.where(is_first, SKY_RAYS * number, SKY_RAYS * finer + MORE_SKY_RAYS * (number - finer))
        rays = np.empty((len(hit), count, 6), dtype=np.float32)
        aim_at_sky(place, normal, axes, first, row, column, SKY_STEPS, rays)
        blocked = self._blocked(rays.reshape(-1, 6), SKY_REACH * camera.width)
        return np.asarray(1 - blocked.reshape(-1, count).mean(axis=1))

    def _blocked(self, rays: npt.NDArray[np.float32], reach: float) -> BoolArray:
        """Return for each ray whether the mesh is in its way within `reach`."""
        return np.asarray(self.tree.test_occlusions(o3d.core.Tensor.from_numpy(rays), tfar=reach).numpy(), dtype=bool)


def sun_of(camera: Camera) -> FloatArray:
    """Return the unit vector to the light."""
    return np.asarray(np.stack([camera.right, camera.up, camera.toward], axis=1) @ (LIGHT / np.linalg.norm(LIGHT)))


def reflected(
    color: FloatArray, normal: FloatArray, rays: npt.NDArray[np.float32], camera: Camera, lit: BoolArray
) -> FloatArray:
    """Return the (n, 6) light of surfaces that rays from the eye meet; see `reflect` of the compiled loops."""
    light = np.empty((len(rays), 6))
    reflect(np.ascontiguousarray(color, dtype=np.float64), normal, rays, sun_of(camera), camera.up, lit, light)
    return light


def vertex_normals(vertices: npt.NDArray[np.float32], triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of the vertices, triangles weighted by area."""
    normal = np.zeros((len(vertices), 3))
    sum_normals(vertices, triangles, normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.where(length > 0, length, 1))
