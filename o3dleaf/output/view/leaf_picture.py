"""The picture of a whole leaf, or of a part of it, with an inset of its micro-structure."""

from collections.abc import Sequence
from os import PathLike

import numpy as np
import numpy.typing as npt
import open3d as o3d

from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.inset import inset_step, inset_window
from o3dleaf.output.view.picture import Inset, render
from o3dleaf.output.view.points import Points, make_facets

MARK = 0.006
"""Radius of the mark of a place, of the scan's extent: a dot of ten pixels."""
VERMILION = "#d55e00"


def render_leaf(
    leaf: MultiscaleLeaf | Blade,
    mesh: o3d.geometry.TriangleMesh,
    path: str | PathLike[str],
    region: npt.ArrayLike | None = None,
    warnings: Sequence[str] = (),
) -> None:
    """Draw a mesh of a leaf into a file, with an inset of the micro-structure where there is one.

    `region`, (2, 2) lower and upper (along, across), is the part that the mesh shows; None is the whole leaf. What
    is not held of the scan is written above it.
    """
    insets = []
    if isinstance(leaf, MultiscaleLeaf):
        window = inset_window(leaf, region)
        insets = [Inset(leaf.extract_mesh(inset_step(leaf.unit, region), window))]
    render(mesh, path, insets=insets, unit=leaf.unit, title="\n".join(["", *warnings]))


def render_refusal(
    scan: CloudLike, places: npt.ArrayLike, cause: str, path: str | PathLike[str], unit: str | None = None
) -> None:
    """Draw a scan that was refused into a file, with marks where the (k, 3) places of the cause lie, and the cause."""
    points, marks = points_of(scan, "scan", least=3), as_points(places, "places", dim=3)
    size = MARK * float(np.ptp(points, axis=0).max())
    # Marks inside the scan are moved toward the eye, and drawn where they are, and in front.
    front = 2 * size * Camera.framing(*make_facets(points), View()).toward
    render([Points(points), Points(marks + front, size, VERMILION)], path, unit=unit, title=f"\n{cause}")
