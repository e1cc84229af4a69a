"""Pictures of droplets: leaf and twin side by side, at one time or as an animation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import open3d as o3d
from PIL import Image

from o3dleaf.core import progress
from o3dleaf.core.atomic_files import whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.mesh_arrays import IntArray, mesh_arrays
from o3dleaf.io.triangle_mesh import read_mesh
from o3dleaf.output.droplet.readings import DropletReadings
from o3dleaf.output.droplet.units import LENGTH
from o3dleaf.output.export.selection import part_of
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.panel import Box, Page
from o3dleaf.output.view.picture import PAPER
from o3dleaf.output.view.scene import UNDER_GREEN, UPPER_GREEN, encode, linear
from o3dleaf.output.view.shade import Shot, shade_mesh

PANEL = (360, 300)
"""Pixels of one droplet."""
WATER = np.array([0.05, 0.22, 0.62])
"""Linear RGB."""
LOOK = View(direction=(0.35, -1.0, 0.42), tilt=0.0, supersampling=2)
"""From the side of the leaf, a little from above: ridges run away to the right."""
STILLS = 6
MAX_FRAMES = 61
MILLISECONDS = 90
"""Of a frame of the animation."""
TITLES = {"leaf": "leaf", "twin": "smooth twin", "bare": "leaf without hairs"}


@dataclass(frozen=True, eq=False)
class DropletStage:
    """A surface and the droplets over it, seen by one camera.

    Attributes
    ----------
    title : str
    vertices, triangles : (n, 3), (m, 3) ndarrays
        The adaxial face in the box, in millimeters.
    readings : DropletReadings
    camera : Camera
    """

    title: str
    vertices: FloatArray
    triangles: IntArray
    readings: DropletReadings
    camera: Camera

    @classmethod
    def of(cls, variant: Path, readings: DropletReadings, half: float, top: float) -> "DropletStage":
        """Return the stage of a run, the box `half` wide each way and `top` high, in millimeters."""
        surface = part_of(read_mesh(variant / "constant" / "triSurface" / "leaf.obj"), "adaxial")
        face = o3d.t.geometry.TriangleMesh.from_legacy(surface.mesh)
        for side in np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], dtype=np.float64):
            face = face.clip_plane(-side * half / (LENGTH * 1e3), side)
        vertices, triangles = mesh_arrays(face)
        vertices = vertices * (LENGTH * 1e3)
        return cls(TITLES.get(variant.name, variant.name), vertices, triangles, readings, camera_over(half, top))

    def shoot(self, time: float) -> FloatArray:
        """Return the (height, width, 3) sRGB picture at the time next to one."""
        row = int(np.abs(self.readings.column("t") - time).argmin())
        drop, faces = mesh_arrays(read_mesh(self.readings.surfaces[row]).mesh)
        vertices = np.concatenate([self.vertices, drop * (LENGTH * 1e3)])
        triangles = np.concatenate([self.triangles, faces + len(self.vertices)])
        count = len(self.triangles)

        def paint(triangle: IntArray, weights: FloatArray, facing: FloatArray) -> FloatArray:
            del weights
            leaf = np.where(facing[:, np.newaxis] > 0, UPPER_GREEN, UNDER_GREEN)
            return np.where((triangle < count)[:, np.newaxis], leaf, WATER)

        shaded = shade_mesh(Shot(vertices, triangles, paint, self.camera, PANEL, LOOK))
        paper = linear(np.broadcast_to(PAPER, (PANEL[1], PANEL[0], 3)).copy())
        return encode(paper * (1 - shaded[..., 3:]) + shaded[..., :3])


def camera_over(half: float, top: float) -> Camera:
    """Return the camera that sees a box from the side."""
    toward = np.asarray(LOOK.direction, dtype=np.float64)
    toward /= np.linalg.norm(toward)
    right = np.cross([0.0, 0.0, 1.0], toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    corners = np.array([(x, y, z) for x in (-half, half) for y in (-half, half) for z in (-0.05, 0.05)])
    seen = np.concatenate([corners, [[0.0, 0.0, top]]]) @ np.stack([right, up], axis=1)
    low, high = seen.min(axis=0), seen.max(axis=0)
    width = 1.06 * max(high[0] - low[0], (high[1] - low[1]) * PANEL[0] / PANEL[1])
    middle = (low + high) / 2
    return Camera(middle[0] * right + middle[1] * up, right, up, toward, width, width * PANEL[1] / PANEL[0])


def draw_sheet(rows: Sequence[Sequence[tuple[DropletStage, float]]], text: float) -> npt.NDArray[np.uint8]:
    """Return one picture of rows of droplets, each at a time in seconds, words in `text` times the usual height."""
    width, height = PANEL
    pixels = np.broadcast_to(PAPER, (len(rows) * height, len(rows[0]) * width, 3)).copy()
    for number, row in enumerate(rows):
        for column, (stage, time) in enumerate(row):
            pixels[number * height : (number + 1) * height, column * width : (column + 1) * width] = stage.shoot(time)
            progress.report(number * len(row) + column + 1, len(rows) * len(row))
    page = Page(pixels, text)
    for number, row in enumerate(rows):
        for column, (stage, time) in enumerate(row):
            left, top = column * width + 0.6 * page.em, number * height + 1.2 * page.em
            page.write(left, top, f"{stage.title}, {time * 1e3:.2f} ms")
    page.scale_bar(Box(0, (len(rows) - 1) * height, width, height), rows[0][0][0].camera.width, "mm")
    return page.pixels()


def write_stills(stages: Sequence[DropletStage], times: Sequence[float], path: Path) -> None:
    """Write one picture: a row for each stage, a column for each time."""
    with whole_file(path) as temporary:
        Image.fromarray(draw_sheet([[(stage, time) for time in times] for stage in stages], 1.1)).save(temporary)


def write_animation(stages: Sequence[DropletStage], times: Sequence[float], path: Path) -> None:
    """Write the stages side by side as GIF, with one palette for all frames."""
    frames, parts = list[Image.Image](), progress.split(*[1.0] * len(times))
    for time, part in zip(times, parts, strict=True):
        with part:
            frames.append(Image.fromarray(draw_sheet([[(stage, time) for stage in stages]], 1.2)))
    palette = frames[len(frames) // 2].quantize(96)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    with whole_file(path) as temporary:
        drawn[0].save(temporary, save_all=True, append_images=drawn[1:], duration=MILLISECONDS, loop=0, optimize=True)


def common_times(readings: Mapping[str, DropletReadings]) -> list[float]:
    """Return the times that all have reached, at most `MAX_FRAMES` of them."""
    times = [course.column("t") for course in readings.values()]
    shortest = min(times, key=lambda each: each[-1])
    every = -(-len(shortest) // MAX_FRAMES)
    return [float(time) for time in shortest[every - 1 :: every]]


def chosen_times(times: Sequence[float], touch: float, end: float) -> list[float]:
    """Return some of the times, evenly apart from just before the touch to the lift-off."""
    wanted = np.linspace(touch, end, STILLS)
    return sorted({times[int(np.abs(np.asarray(times) - time).argmin())] for time in wanted})
