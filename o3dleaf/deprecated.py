"""Names of version 0.1, kept for one version: each works as the new one does, and says so."""

import warnings
from collections.abc import Callable
from os import PathLike
from typing import Any

RENAMED: dict[str, str] = {
    "Verdict": "CheckResult",
    "attach_support": "color_by_support",
    "check_mesh": "check_report",
    "clean_labels": "clean_mesh",
    "cloud_spacing": "point_spacing",
    "constrain": "offset_constraints",
    "extract_band": "extract_isosurface",
    "find_stray_points": "detect_outliers",
    "local_spacing": "point_spacing",
    "merge_noise": "adaptive_down_sample",
    "merge_points": "voxel_down_sample",
    "near_data": "distance_mask",
    "off_surface_constraints": "offset_constraints",
    "prepare_cloud": "preprocess_point_cloud",
    "read_labelled_mesh": "read_mesh",
    "remove_stray_points": "preprocess_point_cloud",
    "simplify_labels": "simplify_mesh",
    "support": "vertex_support",
    "Support": "VertexSupport",
    "trim_to_support": "trim_to_data",
    "turned_over": "find_inverted_regions",
}
"""Old public name to new public name."""


def new_name(old: str) -> str | None:
    """Return the new name of an old one, with a `DeprecationWarning` at the line that used it, or None."""
    new = RENAMED.get(old)
    if new is not None:
        _warn(old, new)
    return new


def old_function(old: str) -> Callable[..., Any] | None:
    """Return the function of an old name that takes its arguments in the old order, with the same warning, or None."""
    function = REORDERED.get(old)
    if function is not None:
        _warn(old, (function.__doc__ or "").split("`")[1])
    return function


def _warn(old: str, new: str) -> None:
    warnings.warn(f"o3dleaf.{old} is now called {new}; the old name goes in version 0.3", DeprecationWarning, 4)


def write_triangle_mesh(path: str | PathLike[str], mesh: Any) -> None:
    """Write a mesh as `write_mesh(mesh, path)` does."""
    from o3dleaf.io.triangle_mesh import write_mesh  # noqa: PLC0415 - asking for a name loads nothing heavy

    write_mesh(mesh, path)


REORDERED: dict[str, Callable[..., Any]] = {"write_triangle_mesh": write_triangle_mesh}
"""Old public name to what takes its arguments; how it is called now stands in its docstring."""
