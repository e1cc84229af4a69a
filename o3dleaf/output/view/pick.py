"""Control points of a midrib, picked by hand in Open3D's window."""

from collections.abc import Sequence
from os import PathLike

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.atomic_files import require_writable, whole_file
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_sites
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import InputError, O3DLeafError
from o3dleaf.output.view.window import require_window

MIN_POINTS = 2
HELP = "shift + left click picks the midrib from base to tip, shift + right click takes back, Q ends"


def pick_midrib(cloud: CloudLike) -> FloatArray:
    """Return control points (k, 3) of the midrib that are picked in Open3D's window, in the order of picking.

    In the window, shift and the left button pick a point of the scan, from the base to the tip; shift
    and the right button take the last one back; Q ends.

    Parameters
    ----------
    cloud : (n, 3) array_like or Open3D point cloud
        The scan, in any unit.

    Raises
    ------
    InputError
        If the cloud is empty or not finite, or fewer than two points were picked.
    O3DLeafError
        If there is no screen, or it has no OpenGL.
    """
    points = points_of(cloud, "cloud", least=MIN_POINTS)
    require_window("pick_midrib", "pick the points elsewhere and give them as a file, or let find_midrib find them")
    return control_points(points, _pick(points))


@checked
def write_midrib(control: npt.ArrayLike, path: str | PathLike[str]) -> None:
    """Write control points (k, 3) as a PLY point cloud, whole or not at all.

    Raises
    ------
    InputError
        If they are no finite points, or the file cannot be written.
    """
    points = as_sites(control, "control", dim=3)
    target = require_writable(path, (".ply",))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    with whole_file(target, points.nbytes) as temporary:
        if not o3d.io.write_point_cloud(temporary, cloud):
            raise O3DLeafError(f"{target}: could not be written; free space on the disk or choose another")


def control_points(points: FloatArray, picked: Sequence[int]) -> FloatArray:
    """Return the picked points (k, 3) in order, of one that was picked twice the first time.

    Raises
    ------
    InputError
        If fewer than two points were picked.
    """
    chosen = points[list(picked)].reshape(-1, 3)
    _, first = np.unique(chosen, axis=0, return_index=True)
    if len(first) < MIN_POINTS:
        raise InputError(f"pick_midrib: {len(first)} points were picked; {HELP}")
    return chosen[np.sort(first)]


def _pick(points: FloatArray) -> list[int]:
    """Return the numbers of the points that were picked in the window."""
    window = o3d.visualization.VisualizerWithEditing()
    window.create_window(window_name=f"o3dleaf: {HELP}")
    window.add_geometry(o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)))
    window.run()
    window.destroy_window()
    return list(window.get_picked_points())
