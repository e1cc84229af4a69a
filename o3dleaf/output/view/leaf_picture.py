"""The picture of a whole leaf, with an inset of its micro-structure."""

from os import PathLike

import open3d as o3d

from o3dleaf.core.units import unit_scale
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.output.view.picture import Inset, render

WINDOW_MM = 2.4
"""Side of the inset's window on the leaf."""
WINDOW_STEP_MM = 0.012
"""Its mesh step: half a voxel of a 24 µm CT, so that hairs are round."""


def render_leaf(leaf: MultiscaleLeaf | Blade, mesh: o3d.geometry.TriangleMesh, path: str | PathLike[str]) -> None:
    """Draw a mesh of a whole leaf into a file, with an inset of the micro-structure where there is one."""
    insets = []
    if isinstance(leaf, MultiscaleLeaf):
        scale = unit_scale("mm", leaf.unit)
        middle, half = leaf.blade.outline.polygon.representative_point(), WINDOW_MM * scale / 2
        window = [[middle.x - half, middle.y - half], [middle.x + half, middle.y + half]]
        insets = [Inset(leaf.extract_mesh(WINDOW_STEP_MM * scale, window))]
    render(mesh, path, insets=insets, unit=leaf.unit)
