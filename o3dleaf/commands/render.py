"""`o3dleaf render`: meshes and clouds as a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from o3dleaf.core.job import Job, UnitOption, argument, option, output

if TYPE_CHECKING:
    from o3dleaf.core.memory.budget import MemoryNeed


@dataclass(frozen=True)
class RenderJob(UnitOption, Job):
    """Draw meshes and point clouds into a picture (PNG, JPG, PDF or SVG); needs no screen and no GPU."""

    files: list[Path] = argument("Meshes and point clouds to draw together.", reads=True)
    output: Path = output("o3dleaf.output.view.picture:SUFFIXES")
    title: str | None = option(None, "A line at the top.")
    size: tuple[int, int] = option((1600, 1000), "Width and height in pixels.")
    engine: str = option("cpu", "'cpu', 'open3d' (needs Vulkan), or 'auto'.")

    def estimate(self) -> "list[MemoryNeed]":
        """Return what the triangles of the files take, to be read and to be drawn."""
        from o3dleaf.core.memory.budget import need_of
        from o3dleaf.core.memory.measured import DRAWN_TRIANGLE, TRIANGLE
        from o3dleaf.io.clouds.counts import count_triangles

        count = sum(map(count_triangles, self.files))
        size = (DRAWN_TRIANGLE + TRIANGLE) * count
        return [need_of(size, f"render: {count:,} triangles", "simplify the meshes first")]

    def work(self) -> None:
        """Write the picture."""
        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.output.view.picture import render

        drawn = [read_geometry(file) for file in self.files]
        render(drawn, self.output, unit=self.unit, title=self.title, size=self.size, engine=self.engine)
