"""The JSON summary of a run: settings, units, sizes, times by stage and versions."""

import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

import numpy as np
import open3d as o3d

from o3dleaf.core.cloud_arrays import CloudLike
from o3dleaf.core.journal import open_journal
from o3dleaf.core.mesh_arrays import mesh_arrays
from o3dleaf.core.parallel import get_num_threads, run_together
from o3dleaf.core.units import measure_in_words, tell_share
from o3dleaf.fitting.local.splines import LocalSplines
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.fit_quality import FitQuality
from o3dleaf.leaf.folds import Folds
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.robust import RobustChoice
from o3dleaf.leaf.meshing import MeshPlan
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.residuals.places import find_places, tell_places
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField
from o3dleaf.leaf.texture.wang.corners import KINDS
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.surface.mesh.crossings import find_crossings
from o3dleaf.surface.mesh.mesh_report import mesh_report

PACKAGES = ("o3dleaf", "numpy", "scipy", "numba", "open3d", "scikit-image", "pymeshlab", "shapely")
MAX_AREA = 0.01
"""Share of the blade's area that a mesh of it may lack or exceed before that is told."""
OF_BLADE = "parts of the leaf lie closer there than the scan can tell apart"
OF_LEAF = (
    "parts of the leaf lie closer there than its triangles can follow; at a rim another rim_radius, or none, may help"
)


def summarize(
    blade: Blade,
    mesh: o3d.geometry.TriangleMesh,
    settings: dict[str, Any],
    *,
    leaf: MultiscaleLeaf | None = None,
    surface: MeshPlan | None = None,
    scan: CloudLike | None = None,
    fit: FitQuality | None = None,
) -> dict[str, Any]:
    """Return the summary of a run as plain values, the times those of the open journal.

    Parameters
    ----------
    blade : Blade
    mesh : open3d.geometry.TriangleMesh
        The mesh that was written, in the blade's unit, or one to look at if that was too large to hold.
    settings : dict
        What was requested, as given.
    leaf, surface : optional
        The multi-scale leaf and the plan of its surface, where there is a micro-structure.
    scan : (n, 3) array_like or Open3D point cloud, optional
        The scan, in the blade's unit, by which frame and fit are judged.
    fit : FitQuality, optional
        The read-out of fit, where that was made before.
    """
    # Serial in part, both.
    report, folds = run_together(
        lambda: mesh_report(mesh, unit=blade.unit).to_dict(), lambda: None if leaf is None else Folds.of(leaf).to_dict()
    )
    summary: dict[str, Any] = {
        "settings": settings,
        "unit": blade.unit,
        **blade.describe(),
        **_height_summary(blade),
        "distortion": (leaf.blade if leaf is not None else blade).distortion().to_dict(),
        "mesh": report,
        "seconds": seconds_of_stages(),
        "threads": get_num_threads(),
        "versions": {"python": platform.python_version()} | {name: version(name) for name in PACKAGES},
    }
    if not isinstance(blade, HeightMapBlade):
        summary["warnings"] = blade.warnings
    elif scan is not None:
        summary["frame"] = blade.frame_quality(scan).to_dict()
    held = FitQuality.of(blade, scan) if fit is None and scan is not None else fit
    if held is not None:
        summary["fit"] = held.to_dict()
        if _shows_blade(leaf, settings):
            _add_area(summary["fit"], held, report["area"])
        if report["self_intersections"]:
            summary["fit"]["warnings"].append(_crossings_in_words(mesh, held.spacing, OF_LEAF if leaf else OF_BLADE))
    summary["notes"] = list(blade.notes)
    if leaf is not None:
        summary["micro_structure"] = _texture_summary(leaf)
        summary["folds"] = folds
    if surface is not None:
        summary["surface"] = _surface_summary(surface)
        if settings.get("remesh") is not None:
            summary["surface"]["note"] = "as polygonised; the mesh was remeshed then"
        elif surface.triangles != summary["mesh"]["triangles"]:
            summary["mesh"]["note"] = "of a coarser mesh; the one that was written is too large to hold"
    return summary


def seconds_of_stages() -> dict[str, float]:
    """Return the times of the stages of the open journal that have ended; none without a journal."""
    journal = open_journal()
    return {} if journal is None else {name: round(each, 3) for name, each in journal.seconds.items()}


def warnings_of(summary: dict[str, Any]) -> list[str]:
    """Return the warnings in a summary: about the blade, of the paper's under its frame, its fit, folds and rim."""
    lowered = summary.get("surface", {}).get("lowered_at_the_rim", {})
    parts = [summary.get("frame", summary), summary.get("fit", {}), summary.get("folds", {}), lowered]
    return [warning for part in parts for warning in part.get("warnings", [])]


def _shows_blade(leaf: MultiscaleLeaf | None, settings: dict[str, Any]) -> bool:
    """Return whether the mesh is the blade alone, and all of it."""
    return leaf is None and settings.get("region") is None and settings.get("around") is None


def _add_area(table: dict[str, Any], fit: FitQuality, mesh_area: float) -> None:
    """Add the area of the blade's mesh beside the blade's own to the read-out of fit, and tell where they differ."""
    table["area"]["mesh"] = mesh_area
    more = mesh_area / fit.area[0] - 1
    if abs(more) > MAX_AREA:
        areas = " and ".join(measure_in_words(area, fit.unit, power=2) for area in (mesh_area, fit.area[0]))
        table["warnings"].append(
            f"the mesh has {tell_share(abs(more))} {'more' if more > 0 else 'less'} area than the blade, {areas}; "
            "give a finer spacing"
        )


def _crossings_in_words(mesh: o3d.geometry.TriangleMesh, spacing: float, why: str) -> str:
    """Return how many triangles of a mesh cross others, where, and why."""
    vertices, triangles = mesh_arrays(mesh)
    crossing = find_crossings(vertices, triangles)
    places = find_places(vertices[triangles].mean(axis=1), crossing, spacing)
    return f"{crossing.sum():,} triangles of the mesh cross others, {tell_places(places)}: {why}"


def _texture_summary(leaf: MultiscaleLeaf) -> dict[str, Any]:
    """Return what is worth knowing of a micro-structure."""
    texture = leaf.texture
    fits = [_fit_summary(patch.local) for patch in texture.patches]
    table = {"unit": texture.unit, "period": texture.period.tolist(), "fit": fits[0] if len(fits) == 1 else fits}
    if isinstance(texture, ThinnedField):
        kept, hairs = texture.hairs.counts
        table |= {"hairs": hairs, "hairs_kept": kept, "hair_seed": texture.seed}
        texture = texture.texture
    if isinstance(texture, WangField):
        table |= {"wang_tiles": KINDS, "seed": texture.seed, "seam_energy": texture.seam_energy().total}
    return table


def _surface_summary(surface: MeshPlan) -> dict[str, Any]:
    """Return what is known of the surface of a multi-scale leaf before it is written."""
    return {
        "spacing": list(surface.spacing),
        "closed": surface.closed,
        "vertices": surface.vertices,
        "triangles": surface.triangles,
        "voids_filled_in_a_tile": surface.voids,
        "specks_removed_from_a_tile": surface.islands,
        "scraps_at_the_rim": asdict(surface.fragments),
        "lowered_at_the_rim": surface.lowered.to_dict(),
    }


def _height_summary(blade: Blade) -> dict[str, Any]:
    """Return what is worth knowing of a height map, where the blade has one."""
    if not isinstance(blade, HeightMapBlade):
        return {}
    height = blade.height_map
    return {"height_map": _fit_summary(height.interpolant.local) | _choice_summary(height.choice)}


def _fit_summary(local: object) -> dict[str, Any]:
    """Return what is worth knowing of a fit over balls, at no cost; of the diagonals least, median, greatest."""
    if not isinstance(local, LocalSplines):
        return {"local": type(local).__name__}
    counts = np.diff(local.offsets)
    filled = np.flatnonzero(counts) if counts.any() else np.arange(len(counts))  # bare balls have no points
    return {
        "balls": len(counts),
        "points_per_ball": [int(counts[filled].min()), int(counts[filled].max())],
        "kernel_power": local.kernel.power,
        "smoothing": local.smoothing.value,
        "smoothing_is_rho": bool(local.smoothing.per_point),
        "gcv_score": local.smoothing.score,
        "diagonal": np.quantile(local.diagonals[filled], (0, 0.5, 1)).tolist(),
        "tail_rank": [int(local.ranks[filled].min()), int(local.ranks[filled].max())],
        "directions_dropped": int(local.dropped.sum()),
    }


def _choice_summary(choice: RobustChoice | None) -> dict[str, Any]:
    """Return what a robust fit chose, where there was one: lengths in the blade's unit."""
    if choice is None:
        return {"robust": False}
    trusted = float(np.mean(choice.weights >= 1.0))
    return {"robust": True, "bandwidth": choice.bandwidth, "scan_noise": choice.noise, "share_trusted": trusted}
