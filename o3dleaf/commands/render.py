"""`o3dleaf render`: meshes and clouds as a picture."""

from dataclasses import dataclass
from pathlib import Path

from o3dleaf.core.job import Job, UnitOption, argument, option, output


@dataclass(frozen=True)
class RenderJob(UnitOption, Job):
    """Draw meshes and point clouds into a picture (PNG, JPG, PDF or SVG); needs no screen and no GPU."""

    files: list[Path] = argument("Meshes and point clouds to draw together.", reads=True)
    output: Path = output("o3dleaf.output.view.picture:SUFFIXES")
    title: str | None = option(None, "A line at the top.")
    size: tuple[int, int] = option((1600, 1000), "Width and height in pixels.")
    engine: str = option("cpu", "'cpu', 'open3d' (needs Vulkan), or 'auto'.")

    def work(self) -> None:
        """Write the picture."""
        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.output.view.picture import render

        drawn = [read_geometry(file) for file in self.files]
        render(drawn, self.output, unit=self.unit, title=self.title, size=self.size, engine=self.engine)
