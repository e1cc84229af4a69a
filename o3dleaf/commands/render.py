"""`o3dleaf render`: meshes and clouds as a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.jobs.job import Job
from o3dleaf.core.jobs.option import argument, option, output
from o3dleaf.core.jobs.shared import UnitOption

if TYPE_CHECKING:
    from o3dleaf.core.resources.needs import Need

SPHERE = 8
"""Triangles of a point in a picture."""


@dataclass(frozen=True)
class RenderJob(UnitOption, Job):
    """Draw meshes and point clouds into a picture (PNG, JPG, PDF or SVG); needs no screen and no GPU."""

    files: list[Path] = argument("Meshes and point clouds to draw together.", reads=True)
    output: Path = output("o3dleaf.output.view.picture:SUFFIXES")
    title: str | None = option(None, "A line at the top.")
    size: tuple[int, int] = option((1600, 1000), "Width and height in pixels.")
    engine: str = option("cpu", "'cpu', 'open3d' (needs Vulkan), or 'auto'.")

    def estimate(self) -> "list[Need]":
        """Return what the things that are drawn together take, points as small spheres, and the picture itself."""
        return [need_for_pictures(self.files), need_for_pixels(self.size)]

    def work(self) -> None:
        """Write the picture."""
        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.output.view.picture import render

        drawn = [read_geometry(file) for file in self.files]
        render(drawn, self.output, unit=self.unit, title=self.title, size=self.size, engine=self.engine)


def need_for_pictures(files: list[Path]) -> "Need":
    """Return what the meshes and clouds of some files take, read and in a picture."""
    from o3dleaf.core.resources.measured import CLOUD_POINT, DRAWN_TRIANGLE, TRIANGLE
    from o3dleaf.core.resources.needs import need_of
    from o3dleaf.io.geometry import count_geometry

    triangles, points = (sum(counts) for counts in zip(*map(count_geometry, files), strict=True))
    held = DRAWN_TRIANGLE * (triangles + SPHERE * points) + TRIANGLE * triangles + CLOUD_POINT * points
    what = f"picture: {triangles:,} triangles" + f", {points:,} points" * bool(points)
    return need_of(held, what, "simplify the mesh, or thin the cloud, first")


def need_for_pixels(size: tuple[int, int]) -> "Need":
    """Return what a picture of so many pixels takes."""
    from o3dleaf.core.resources.measured import PIXEL
    from o3dleaf.core.resources.needs import need_of

    return need_of(PIXEL * (float(size[0]) * size[1]), f"size: {size[0]:,} × {size[1]:,} pixels", "give fewer")
