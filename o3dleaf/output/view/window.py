"""Open3D's own window, where there is a screen."""

import os
import sys
from typing import Any

import open3d as o3d

from o3dleaf.core.errors import InputError, O3DLeafError


def show(*geometries: Any, title: str = "o3dleaf") -> None:
    """Open Open3D's interactive window on meshes and point clouds, until it is closed.

    Parameters
    ----------
    *geometries : Open3D geometry
        Legacy or tensor, in one frame and unit. Meshes without normals are shaded with normals of
        a copy.
    title : str
        The window's title.

    Raises
    ------
    InputError
        If there is nothing to show.
    O3DLeafError
        If there is no screen, or it has no OpenGL.
    """
    if not geometries:
        raise InputError("show: nothing to show; give a mesh or a point cloud")
    require_window("show", "draw a picture with o3dleaf.view.render instead")
    ready = [_with_normals(geometry) for geometry in geometries]
    o3d.visualization.draw_geometries(ready, window_name=title)


def require_window(name: str, cure: str) -> None:
    """Raise `O3DLeafError` where no window can open; the message begins with `name` and ends with the cure."""
    if not has_display():
        raise O3DLeafError(f"{name}: there is no screen here; {cure}")
    # On a screen without OpenGL Open3D only warns; an attempt of our own says no.
    probe = o3d.visualization.Visualizer()
    if not probe.create_window(window_name=name, visible=False):
        raise O3DLeafError(f"{name}: this screen has no OpenGL; {cure}")
    probe.destroy_window()


def has_display() -> bool:
    """Return whether a window could open at all: a screen of X11 or Wayland on Linux, any other system has one."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _with_normals(geometry: Any) -> Any:
    """Return legacy geometry; of a mesh without normals, a copy that has them."""
    legacy = geometry.to_legacy() if hasattr(geometry, "to_legacy") else geometry
    if isinstance(legacy, o3d.geometry.TriangleMesh) and not legacy.has_vertex_normals():
        legacy = o3d.geometry.TriangleMesh(legacy)
        legacy.compute_vertex_normals()
    return legacy
