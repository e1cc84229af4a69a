"""Open3D's own renderer, where there is a driver for it, in a process of its own.

Without a driver for Vulkan the renderer aborts the process that asks for it, and with one it prints to
the terminal: so it runs in a child, once for all panels of a page. It rasterizes; the colors and the light are
those of `o3dleaf.output.view.shade` at each corner of each triangle, so that both engines draw the same thing, but for
cast shadows and ambient occlusion.
"""

from functools import cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.errors import O3DLeafError
from o3dleaf.core.mesh_arrays import IntArray
from o3dleaf.core.processes.child_process import Arrays, Outcome, run_in_subprocess
from o3dleaf.output.view.camera import EYE, Camera, View, rays_from
from o3dleaf.output.view.scene import encode, linear
from o3dleaf.output.view.shade import Shot, reflected, vertex_normals

PROBE_SECONDS = 60.0
"""A driver that has not drawn one triangle by then is none; the libraries' import takes two."""

SECONDS = 600.0
"""A page that has not been drawn by then never will be."""

MAX_PIXELS = 8192
"""Side of the largest picture that every driver can hold; beyond it, pixels are supersampled less."""

BATCH_SIZE = 1 << 19
"""Triangles colored at once."""

Panel = dict[str, Any]
"""The size and the camera of one picture, as JSON holds them; see `_describe`."""


@cache
def find_renderer() -> Literal["hardware", "software"] | None:
    """Return the device of Open3D's renderer, None where it does not work: one triangle is drawn, once a process.

    In software, such as Mesa's llvmpipe, it takes twice as long as casting rays, without the shadows.
    """
    vertices, triangle = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    view = View(tilt=0.0, supersampling=1)
    camera = Camera.framing(vertices, triangle, view, 1.0)
    shot = Shot(vertices, triangle, lambda number, _weights, _facing: np.ones((len(number), 3)), camera, (64, 64), view)
    try:
        drawn = _draw_in_child([shot], PROBE_SECONDS)
    except O3DLeafError:
        return None
    if not drawn.arrays[0][..., 3].any():
        return None
    return "software" if "software device" in drawn.output else "hardware"


def rasterize(shots: list[Shot]) -> list[FloatArray]:
    """Return a picture of each shot as `shade_mesh` does, drawn by Open3D's renderer.

    Raises
    ------
    O3DLeafError
        If the renderer does not work here, or does not end in time.
    """
    drawn = _draw_in_child(shots, SECONDS).arrays
    return [_average(picture, _finer(shot)) for picture, shot in zip(drawn, shots, strict=True)]


def _draw_in_child(shots: list[Shot], seconds: float) -> Outcome:
    """Return the pictures of `draw_all`, and what the renderer printed."""
    return run_in_subprocess(
        draw_all,
        (array for shot in shots for array in _light_corners(shot)),
        {"panels": [_describe(shot) for shot in shots]},
        name="Open3D's renderer",
        cure="install a Vulkan driver (Debian: mesa-vulkan-drivers), or use engine='cpu'",
        seconds=seconds,
    )


def _finer(shot: Shot) -> int:
    """Return the pixels drawn along each side of one of the picture."""
    return max(1, min(shot.view.supersampling, MAX_PIXELS // max(shot.size)))


def _describe(shot: Shot) -> Panel:
    """Return a shot's size and camera as the child needs them."""
    camera = shot.camera
    return {
        "size": (_finer(shot) * np.array(shot.size)).tolist(),
        "up": camera.up.tolist(),
        "toward": camera.toward.tolist(),
        "extent": [float(camera.width), float(camera.height)],
        "perspective": bool(camera.perspective),
    }


def _light_corners(shot: Shot) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the corners (3m, 3) of the triangles about the camera's target, and their sRGB colors."""
    local = (shot.vertices - shot.camera.target).astype(np.float32)
    normals = vertex_normals(local, shot.triangles) if shot.view.smooth else None
    corners = local[shot.triangles]
    colors = np.empty_like(corners)
    for start in range(0, len(corners), BATCH_SIZE):
        part = slice(start, start + BATCH_SIZE)
        numbers = np.arange(len(corners))[part]
        colors[part] = _light_triangles(shot, numbers, corners[part].astype(np.float64), normals)
    return corners.reshape(-1, 3), colors.reshape(-1, 3)


def _light_triangles(shot: Shot, numbers: IntArray, corners: FloatArray, normals: FloatArray | None) -> FloatArray:
    """Return the sRGB (n, 3, 3) of the corners of triangles, of the side that the camera sees."""
    camera = shot.camera
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    eye = EYE * camera.width * camera.toward
    colors = np.empty_like(corners)
    sight = corners.mean(axis=1) - eye if camera.perspective else np.broadcast_to(-camera.toward, flat.shape)
    facing = np.where(np.einsum("ij,ij->i", flat, sight) > 0, -1.0, 1.0)
    for corner in range(3):
        way = corners[:, corner] - eye if camera.perspective else sight
        way = way / np.linalg.norm(way, axis=1, keepdims=True)
        bent = (flat if normals is None else normals[shot.triangles[numbers, corner]]) * facing[:, np.newaxis]
        weights = np.broadcast_to(np.eye(3)[corner], flat.shape)
        rays, lit = rays_from(np.zeros(3), way), np.ones(len(way), dtype=bool)
        light = reflected(shot.paint(numbers, weights, facing), bent, rays, camera, lit)
        colors[:, corner] = encode(light[:, :3] + light[:, 3:])
    return colors


def _average(drawn: npt.NDArray[np.uint8], finer: int) -> FloatArray:
    """Return the (h, w, 4) picture of the child's, averaged over the finer pixels."""
    covered = drawn[..., 3:] > 0
    fine = np.concatenate([np.where(covered, linear(drawn[..., :3] / 255), 0.0), covered], axis=2)
    height, width = np.array(fine.shape[:2]) // finer
    return np.asarray(fine.reshape(height, finer, width, finer, 4).mean(axis=(1, 3)))


def draw_all(*lit: npt.NDArray[np.float32], panels: list[Panel]) -> Arrays:
    """Return a picture of each panel, in the child: (h, w, 4) uint8, sRGB and whether there is anything.

    Parameters
    ----------
    *lit : (3m, 3) ndarrays
        Of each panel the corners of its triangles, and their colors.
    panels : list of dicts
        See `_describe`.
    """
    return tuple(_draw(*each) for each in zip(lit[::2], lit[1::2], panels, strict=True))


def _draw(corners: npt.NDArray[np.float32], colors: npt.NDArray[np.float32], panel: Panel) -> npt.NDArray[np.uint8]:
    """Return the picture of one panel."""
    import open3d as o3d  # noqa: PLC0415 - in the child alone
    from open3d.visualization import rendering  # noqa: PLC0415

    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    mesh = o3d.t.geometry.TriangleMesh(o3d.core.Tensor.from_numpy(corners), o3d.core.Tensor.from_numpy(triangles))
    mesh.vertex.colors = o3d.core.Tensor.from_numpy(colors)
    renderer = rendering.OffscreenRenderer(*panel["size"])
    material = rendering.MaterialRecord()
    material.shader = "defaultUnlit"
    renderer.scene.add_geometry("mesh", mesh, material)
    # Colors pass through unchanged, and depth tells what is covered.
    for switch_off in (renderer.scene.view.set_post_processing, renderer.scene.view.set_antialiasing):
        switch_off(False)
    _aim(renderer.scene.camera, corners, panel, rendering.Camera)
    image = np.asarray(renderer.render_to_image())
    covered = np.asarray(renderer.render_to_depth_image()) < 1
    return np.dstack([image, 255 * covered.astype(np.uint8)])


def _aim(camera: Any, corners: npt.NDArray[np.float32], panel: Panel, kinds: Any) -> None:
    """Set Open3D's camera as ours is: the target in the origin, the eye `EYE` widths before it."""
    (width, height), up, toward = panel["extent"], np.array(panel["up"]), np.array(panel["toward"])
    eye = EYE * width
    depth = eye - corners @ toward
    near, far = 0.9 * max(float(depth.min()), 1e-2 * eye), 1.1 * float(depth.max())
    if panel["perspective"]:
        angle = 2 * np.degrees(np.arctan(0.5 / EYE))
        camera.set_projection(angle, width / height, near, far, kinds.FovType.Horizontal)
    else:
        camera.set_projection(kinds.Projection.Ortho, -width / 2, width / 2, -height / 2, height / 2, near, far)
    camera.look_at(np.zeros(3), eye * toward, up)
