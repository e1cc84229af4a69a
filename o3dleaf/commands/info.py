"""`o3dleaf info`: the contents of a file."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from o3dleaf.commands.patch import CROP_HELP, LAYOUT_HELP, MODEL, parse_box, require_box
from o3dleaf.core.arguments.kinds import Finite, Positive
from o3dleaf.core.atomic_files import write_json
from o3dleaf.core.checks.files import is_folder
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.core.jobs.job import Job
from o3dleaf.core.jobs.option import argument, option, table
from o3dleaf.core.jobs.shared import UnitOption
from o3dleaf.core.jobs.words import number_or_word

if TYPE_CHECKING:
    import open3d as o3d

    from o3dleaf.core.resources.needs import Need
    from o3dleaf.leaf.ct.volume import Volume


@dataclass(frozen=True)
class InfoJob(UnitOption, Job):
    """Show what a file contains: sizes, extent, and for a mesh whether it is manifold and closed."""

    file: Path = argument("A mesh, a point cloud, a volume or a model (.o3l).", reads=True)
    voxel_spacing: Positive | None = option(
        None, "Edge of a voxel (needed if the file does not state it)", unit="unit", needs=("volume_file",)
    )
    layout: str | None = option(None, LAYOUT_HELP, needs=("volume_file",))
    crop: Any = option(None, CROP_HELP, kind=str, parse=parse_box, unit="unit", needs=("volume_file",))
    level: Finite | str = option(
        "mixture",
        "Intensity of a volume's surface: a number, or how the histogram tells it, 'mixture', 'valley' or 'otsu'.",
        kind=str,
        parse=number_or_word,
        needs=("volume_file",),
    )
    plot: Path | None = option(
        None,
        "Also draw a volume's histogram, and its voids over the level, into this file.",
        writes=(".png", ".pdf", ".svg"),
        needs=("volume_file",),
    )
    pieces: Path | None = option(
        None,
        "Also find the pieces of a scan, as `leaf --piece` counts them, and draw them with their numbers into this "
        "file.",
        writes=(".png", ".jpg", ".pdf", ".svg"),
        needs=("cloud_file",),
    )
    json: Path | None = option(None, "Also write it as JSON.", writes=())

    @property
    def model_file(self) -> bool:
        """Whether FILE is a model."""
        return self.file.suffix.lower() in table(MODEL)

    @property
    def volume_file(self) -> bool:
        """Whether FILE is a volume."""
        from o3dleaf.io.clouds import npy
        from o3dleaf.leaf.ct.formats import points
        from o3dleaf.leaf.ct.formats.read import SUFFIXES

        name = self.file.name.lower()
        if name.endswith(points.SUFFIXES):  # more often points or a mesh
            return points.holds_voxels(self.file)
        if name.endswith(npy.SUFFIXES):
            return not npy.holds_points(self.file)
        return is_folder(self.file) or name.endswith(SUFFIXES)

    @property
    def cloud_file(self) -> bool:
        """Whether FILE is a point cloud."""
        from o3dleaf.io.geometry import count_geometry

        return not self.model_file and not self.volume_file and not count_geometry(self.file)[0]

    def check(self) -> None:
        """Refuse a box that is none, and a file of an unknown type."""
        super().check()
        require_box(self.crop, "crop")
        self.require_known()

    def require_known(self) -> None:
        """Refuse a file of an unknown suffix, and say what it could be."""
        from o3dleaf.io import point_cloud, triangle_mesh
        from o3dleaf.leaf.ct.formats.content import content_hint
        from o3dleaf.leaf.ct.formats.read import SUFFIXES

        kinds = {
            "meshes": triangle_mesh.READERS,
            "point clouds": point_cloud.SUFFIXES,
            "volumes": SUFFIXES,
            "models": table(MODEL),
        }
        if is_folder(self.file) or self.file.name.lower().endswith(tuple(s for each in kinds.values() for s in each)):
            return
        known = ", ".join(f"{name} ({', '.join(each)})" for name, each in kinds.items())
        raise InputError(
            f"{self.file}: unknown file type; info reads {known} and folders of slices{content_hint(self.file)}"
        )

    def estimate(self) -> "list[Need]":
        """Return what the voxels, the triangles or the points of the file take."""
        from o3dleaf.core.resources import measured
        from o3dleaf.core.resources.needs import need_of
        from o3dleaf.io.geometry import count_geometry
        from o3dleaf.leaf.ct.formats.counts import count_cropped, count_voxels

        if self.model_file:
            return []  # its arrays stay on disk
        if self.volume_file:
            crop = self.crop
            voxels = count_voxels(self.file) if crop is None else count_cropped(self.file, crop, **self.lattice)
            return [need_of(measured.LOOKED_AT_VOXEL * voxels, f"info: {voxels:,} voxels", "crop the volume")]
        triangles, points = count_geometry(self.file)
        held = measured.REPORTED_TRIANGLE * triangles + measured.MEASURED_POINT * points
        what = f"{triangles:,} triangles" if triangles else f"{points:,} points"
        return [need_of(held, f"info: {what}", "simplify the mesh, or thin the cloud, first")]

    def work(self) -> dict[str, Any]:
        """Return the contents of the file, as plain values; lengths in `unit`."""
        contents = self.model() if self.model_file else self.volume() if self.volume_file else self.geometry()
        if self.json is not None:
            write_json(contents, self.json)
        return contents

    def model(self) -> dict[str, Any]:
        """Return the figures of a model."""
        from o3dleaf.leaf.saved.contents import describe_model
        from o3dleaf.leaf.saved.models import load

        return describe_model(load(self.file))

    def volume(self) -> dict[str, Any]:
        """Return the figures of a volume."""
        import numpy as np

        from o3dleaf.leaf.ct.corrections.drift import find_drift
        from o3dleaf.leaf.ct.corrections.rings import find_rings, middle, middle_slices
        from o3dleaf.leaf.ct.formats.read import open_stated, read_stated
        from o3dleaf.leaf.ct.hairs import find_cut_hairs
        from o3dleaf.leaf.ct.threshold import find_classes
        from o3dleaf.leaf.ct.voids import levels_around, pieces_at_levels
        from o3dleaf.leaf.ct.volume import thinned

        if self.crop is None:
            volume, stated = read_stated(self.file, **self.lattice)
            axis = middle(volume)
        else:
            opened, stated = open_stated(self.file, **self.lattice)
            volume, axis = opened.crop(self.crop), middle(opened)
        small = thinned(volume)
        level = self.level_of(volume)
        classes = find_classes(small.data)
        low, high = (float(volume.data.min()), float(volume.data.max()))
        ends = classes.means if classes is not None else np.array([low, high])
        rows = pieces_at_levels(small, levels_around(*ends))
        if self.plot is not None:
            from o3dleaf.output.figures.plots import levels
            from o3dleaf.output.view.panel import save_figure

            save_figure(levels(small, rows, level if isinstance(level, float) else None).figure, self.plot)
        return {
            "kind": "volume",
            "shape": list(volume.shape),
            "axes": f"x, y, z; in the file {', '.join(stated.axes)}, the slowest first",
            "type": str(volume.data.dtype),
            "spacing": volume.spacing.tolist(),
            "bounds": volume.bounds.tolist(),
            "unit": volume.unit,
            "intensity": [low, high],
            "air_and_leaf": "cannot be told apart" if classes is None else classes.means.tolist(),
            "noise": None if classes is None else classes.deviations.tolist(),
            "threshold": level,
            "level": self.level,
            "drift": None if classes is None else str(find_drift(small)),
            "rings": None if classes is None else str(find_rings(middle_slices(volume), axis)),
            **(self.blade_in(volume, level) if isinstance(level, float) else {}),
            "hairs": str(find_cut_hairs(volume, level)) if isinstance(level, float) else None,
            "voids_looked_for_in": list(small.shape),
            "levels": [asdict(row) for row in rows],
        }

    @property
    def lattice(self) -> dict[str, Any]:
        """What was said of the lattice, where the file does not say it."""
        return {"spacing": self.voxel_spacing, "unit": self.unit, "layout": self.layout}

    def level_of(self, volume: "Volume") -> float | str:
        """Return the intensity of the surface, or why none was found: without two classes it is a volume all the same.

        A number that lies outside is refused.
        """
        if not isinstance(self.level, str):
            return volume.threshold(self.level)
        try:
            return volume.threshold(self.level)
        except InputError as none:
            return str(none)

    def blade_in(self, volume: "Volume", level: float) -> dict[str, str]:
        """Return how the blade bends, and the patch that tiles are made of, in words, or why there is none."""
        from o3dleaf.leaf.ct.align import align_blade
        from o3dleaf.leaf.ct.corrections.bend import find_bend
        from o3dleaf.leaf.ct.patch import find_patch

        try:
            patch = find_patch(volume, level, align_blade(volume, level))
            return {"bend": str(find_bend(volume, level)), "patch": str(patch)}
        except O3DLeafError as none:
            return {"patch": str(none)}

    def geometry(self) -> dict[str, Any]:
        """Return the figures of a mesh or a point cloud."""
        import numpy as np
        import open3d as o3d

        from o3dleaf.io.geometry import read_geometry
        from o3dleaf.surface.mesh.mesh_report import mesh_report

        read = read_geometry(self.file)
        if isinstance(read, o3d.geometry.TriangleMesh):
            return {"kind": "mesh"} | mesh_report(read, unit=self.unit).to_dict()
        points = np.asarray(read.points)
        return {
            "kind": "point cloud",
            "points": len(points),
            "normals": read.has_normals(),
            "bounds": [points.min(axis=0).tolist(), points.max(axis=0).tolist()],
            "median_spacing": float(np.median(np.asarray(read.compute_nearest_neighbor_distance()))),
            "unit": self.unit,
            **({} if self.pieces is None else {"pieces": self.draw_pieces(read, self.pieces)}),
        }

    def draw_pieces(self, scan: "o3d.geometry.PointCloud", path: Path) -> list[str]:
        """Draw the pieces of a scan into a file, and return a line on each."""
        from o3dleaf.leaf.pipeline import find_pieces
        from o3dleaf.output.view.leaf_picture import render_pieces

        found = find_pieces(scan, unit=self.unit)
        render_pieces(found, path, unit=self.unit)
        return list(found.lines)

    def lines(self, summary: dict[str, Any]) -> list[str]:
        """Return a line a figure, and of a volume a line a level."""
        from o3dleaf.output.report.words import lines_of

        if summary["kind"] == "mesh":
            return lines_of(summary, self.unit)
        rows = summary.get("levels", [])
        lines = [f"{name:>24}  {value}" for name, value in summary.items() if name not in ("levels", "pieces")]
        lines += [f"{'piece':>24}  {line}" for line in summary.get("pieces", [])]
        if rows:
            cubed = f"{summary['unit']}³" if summary["unit"] else "volume"
            lines.append(f"{'level':>24}  {'leaf':>7} {'voids':>8} {cubed:>12} {'pieces':>8} {cubed:>12}")
        return lines + [
            f"{row['level']:>24.5g}  {row['share']:>6.1%} {row['voids']:>8,} {row['void_volume']:>12.4g} "
            f"{row['pieces']:>8,} {row['piece_volume']:>12.4g}"
            for row in rows
        ]
