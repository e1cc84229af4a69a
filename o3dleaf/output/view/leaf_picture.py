"""The picture of a whole leaf, or of a part of it, with an inset of its micro-structure."""

from collections.abc import Sequence
from os import PathLike

import numpy as np
import numpy.typing as npt
import open3d as o3d
import shapely

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_points
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.view.camera import Camera, View
from o3dleaf.output.view.picture import Inset, render
from o3dleaf.output.view.points import Points, make_facets

WINDOW_MM = 2.4
"""Side of the inset's window on the leaf."""
STEPS = 200
"""Mesh steps along that side: half a voxel of a 24 µm CT in 2.4 mm, so that hairs are round."""
SHARE = 0.5
"""Of the shorter side of a part that is drawn alone, the most that the window takes: it is a detail."""
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


def inset_window(leaf: MultiscaleLeaf, region: npt.ArrayLike | None = None) -> FloatArray:
    """Return the (2, 2) window of the inset: 2.4 mm in the middle of what the picture shows of the outline."""
    side, shown = _inset_side(leaf.unit, region), leaf.blade.outline.polygon
    if region is not None:
        shown &= shapely.box(*np.asarray(region, dtype=np.float64).ravel())
    middle = shown.representative_point()
    center = np.array([middle.x, middle.y])
    return np.array([center - side / 2, center + side / 2])


def inset_step(unit: str | None, region: npt.ArrayLike | None = None) -> float:
    """Return the step of the inset's mesh, in the leaf's unit, which does not depend on the blade."""
    return _inset_side(unit, region) / STEPS


def _inset_side(unit: str | None, region: npt.ArrayLike | None) -> float:
    side = WINDOW_MM * unit_scale("mm", unit)
    return side if region is None else min(side, SHARE * float(np.ptp(np.asarray(region), axis=0).min()))
