"""Names of version 0.1, kept for one version: each leads to what is called otherwise now, and says so.

Positional arguments are taken as they were; keywords that changed stand in CHANGELOG.md.
"""

import warnings
from collections.abc import Callable
from os import PathLike
from pkgutil import resolve_name
from typing import Any

from o3dleaf import errors

RENAMED: dict[str, str] = {
    **{name: f"o3dleaf:errors.{name}" for name in errors.__all__},
    **{name: f"o3dleaf:view.{name}" for name in ("Points", "pick_midrib", "render", "render_distortion", "show")},
    "Defects": "o3dleaf.surface.mesh.defects:Defects",
    "Distortion": "o3dleaf.leaf.blade.distortion:Distortion",
    "FrameQuality": "o3dleaf.leaf.macro.frame_quality:FrameQuality",
    "Inspection": "o3dleaf.surface.mesh.inspection:Inspection",
    "Orientation": "o3dleaf.surface.cloud.orientation.orientation:Orientation",
    "Support": "o3dleaf.surface.reconstruction.vertex_support:VertexSupport",
    "Verdict": "o3dleaf.output.report.requirements:CheckResult",
    "attach_support": "o3dleaf:color_by_support",
    "check_mesh": "o3dleaf:check_report",
    "figures": "o3dleaf.output.figures",
    "find_defects": "o3dleaf.surface.mesh.defects:find_defects",
    "find_stray_points": "o3dleaf:detect_outliers",
    "local_spacing": "o3dleaf:point_spacing",
    "merge_noise": "o3dleaf:adaptive_down_sample",
    "prepare_cloud": "o3dleaf:preprocess_point_cloud",
    "read_labelled_mesh": "o3dleaf:read_mesh",
}
"""Old public name to where the same thing stands now."""


def old_name(name: str) -> Any:
    """Return what an old name stood for, with a `DeprecationWarning` at the line that used it, or None."""
    if name in CHANGED:
        function = CHANGED[name]
        _warn(name, (function.__doc__ or "").split("`")[1])
        return function
    if name in RENAMED:
        _warn(name, RENAMED[name].replace(":", ".").removeprefix("o3dleaf."))
        return resolve_name(RENAMED[name])
    return None


def _warn(old: str, new: str) -> None:
    warnings.warn(f"o3dleaf.{old} is now o3dleaf.{new}; the old name goes in version 0.3", DeprecationWarning, 4)


def write_triangle_mesh(path: str | PathLike[str], mesh: Any) -> None:
    """Write a mesh as `write_mesh(mesh, path)` does."""
    _now("write_mesh")(mesh, path)


def extract_band(field: Any, spacing: Any, seeds: Any, **options: Any) -> Any:
    """Return the surface that `extract_isosurface(field, spacing, seeds=seeds)` follows."""
    return _now("extract_isosurface")(field, spacing, seeds=seeds, **options)


def clean_labels(mesh: Any, labels: Any, **options: Any) -> tuple[Any, Any]:
    """Return mesh and labels of `clean_mesh(LabelledMesh(mesh, labels))`."""
    cleaned = _now("clean_mesh")(_now("LabelledMesh")(mesh, labels), **options)
    return cleaned.mesh, cleaned.labels


def simplify_labels(mesh: Any, labels: Any, **options: Any) -> tuple[Any, Any]:
    """Return mesh and labels of `simplify_mesh(LabelledMesh(mesh, labels))`."""
    simplified = _now("simplify_mesh")(_now("LabelledMesh")(mesh, labels), **options)
    return simplified.mesh, simplified.labels


def remove_stray_points(cloud: Any, *, std_ratio: float = 10.0) -> Any:
    """Return the cloud of `preprocess_point_cloud(cloud, orient=None)` without Open3D's statistical outliers alone."""
    from functools import partial  # noqa: PLC0415 - asking for a name loads nothing else
    from math import inf  # noqa: PLC0415

    outliers = partial(_now("detect_outliers"), max_gap=inf, max_ratio=inf, max_clutter=inf, std_ratio=std_ratio)
    return _now("preprocess_point_cloud")(cloud, outliers=outliers, orient=None)


def cloud_spacing(cloud: Any) -> Any:
    """Return what `OrientedCloud.of(cloud).spacing` is, as an object with `median` and `each`."""
    from types import SimpleNamespace  # noqa: PLC0415 - asking for a name loads nothing else

    data = _now("OrientedCloud").of(cloud)
    return SimpleNamespace(median=data.spacing, each=data.surfels.spacing)


def merge_points(points: Any, normals: Any, voxel_size: float) -> Any:
    """Return the cloud of `voxel_down_sample(OrientedCloud.of(points, normals), voxel_size)`."""
    return _now("voxel_down_sample")(_now("OrientedCloud").of(points, normals), voxel_size)


def off_surface_constraints(points: Any, normals: Any, distance: Any, **options: Any) -> Any:
    """Return `offset_constraints(OrientedCloud.of(points, normals), distance, every=1)`."""
    return _now("offset_constraints")(_now("OrientedCloud").of(points, normals), distance, every=1, **options)


def constrain(points: Any, normals: Any, spacing: float, **options: Any) -> Any:
    """Return `offset_constraints(OrientedCloud.of(points, normals, spacing=spacing))`."""
    distance = options["off"] * spacing if "off" in options else None
    return _now("offset_constraints")(_now("OrientedCloud").of(points, normals, spacing=spacing), distance)


def near_data(points: Any, spacing: Any = None, **options: Any) -> Any:
    """Return `distance_mask(OrientedCloud.of(points, spacing=spacing))`."""
    return _now("distance_mask")(_now("OrientedCloud").of(points, spacing=spacing), **options)


def trim_to_support(mesh: Any, points: Any, spacings: Any = None, normals: Any = None, **options: Any) -> Any:
    """Return `trim_to_data(mesh, OrientedCloud.of(points, normals))`."""
    return _now("trim_to_data")(mesh, _now("OrientedCloud").of(points, normals, spacing=spacings), **options)


def turned_over(mesh: Any, points: Any, normals: Any) -> Any:
    """Return `find_inverted_regions(mesh, OrientedCloud.of(points, normals))`."""
    return _now("find_inverted_regions")(mesh, _now("OrientedCloud").of(points, normals))


def support(mesh: Any, points: Any, field: Any = None, *, spacing: Any = None) -> Any:
    """Return `vertex_support(mesh, points, field)`."""
    return _now("vertex_support")(mesh, _now("OrientedCloud").of(points, spacing=spacing), field)


def _now(name: str) -> Any:
    return resolve_name(f"o3dleaf:{name}")


CHANGED: dict[str, Callable[..., Any]] = {
    each.__name__: each
    for each in (
        clean_labels,
        cloud_spacing,
        constrain,
        extract_band,
        merge_points,
        near_data,
        off_surface_constraints,
        remove_stray_points,
        simplify_labels,
        support,
        trim_to_support,
        turned_over,
        write_triangle_mesh,
    )
}
"""Old public name to what takes its arguments; how it is called now stands in its docstring."""
