"""Windows: one mesh of the leaf without a crack, coarse but for the windows in it."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.checks.coordinates import as_bounds
from o3dleaf.core.checks.scalars import require_positive
from o3dleaf.core.errors import InputError
from o3dleaf.core.mesh_arrays import build_mesh
from o3dleaf.io.labelled_mesh import LabelledMesh
from o3dleaf.leaf.blade.outline_area import sides_of
from o3dleaf.leaf.instancing.footprint import footprint
from o3dleaf.leaf.instancing.levels import Level, extract_levels
from o3dleaf.leaf.textured_blade import TexturedBlade
from o3dleaf.leaf.thin_rim import FlatMesh, lowered_vertices
from o3dleaf.leaf.tile_lattice import extract_tiles, refine_tiles


def extract_windows(
    leaf: TexturedBlade, spacing: float, windows: Sequence[tuple[npt.ArrayLike, float]], *, closed: bool = False
) -> LabelledMesh:
    """Return one mesh, coarse but for windows (region, spacing) in it; see `MultiscaleLeaf.extract_levels`."""
    tiles = extract_tiles(leaf, spacing, 0, together=False).parts
    plane = np.array(tiles.lattice.origin[:2]), np.array(tiles.lattice.spacing[:2])
    edge = leaf.blade.edge_thickness(float(np.linalg.norm(plane[1])))
    area = footprint(sides_of(leaf.edge_curve(closed=closed)), *plane, None, edge)
    root = Level(tiles, area, area.box, closed, cut=leaf.cuts_edges)
    for region, step in windows:
        _insert(leaf, root, as_bounds(region, 2, "region"), require_positive(step, "spacing"))
    vertices, triangles, labels = extract_levels(root)
    lowered = lowered_vertices(leaf.blade, FlatMesh(vertices, triangles, labels), float(plane[1].max()))
    vertices = lowered.apply(vertices)
    return LabelledMesh(build_mesh(leaf.blade.lift(vertices), triangles), labels, unit=leaf.unit)


def _insert(leaf: TexturedBlade, root: Level, region: FloatArray, step: float) -> None:
    """Insert a window into the finest level that contains it; its box grows to whole columns of that level."""
    parent = _innermost(root, region)
    coarse = max(parent.tiles.lattice.spacing[:2])
    ratio = 2 ** round(np.log2(coarse / step))
    if ratio < 2:
        raise InputError(
            f"levels: a window at {step:g} is no finer than the {coarse:.4g} around it; give half of that or less"
        )
    low, high = _columns(parent, region)
    box = np.stack([np.floor(low + 1e-9), np.ceil(high - 1e-9)]).astype(np.int64)
    # A cell beside each curtain, and one at least between them.
    box[1] = ratio * np.maximum(box[1], box[0] + (2 if ratio == 2 else 1))
    box[0] *= ratio
    parent.children.append(Level(refine_tiles(leaf, parent.tiles, ratio, box), parent.footprint, box, ratio=ratio))


def _columns(level: Level, region: FloatArray) -> FloatArray:
    """Return a region in columns of a level's lattice."""
    lattice = level.tiles.lattice
    return np.asarray((region - lattice.origin[:2]) / lattice.spacing[:2])


def _innermost(level: Level, region: FloatArray) -> Level:
    """Return the finest level that contains a region."""
    for child in level.children:
        low, high = _columns(child, region)
        if (low >= child.box[0] + child.ratio).all() and (high <= child.box[1] - child.ratio).all():
            return _innermost(child, region)
        if (low < child.box[1]).all() and (high > child.box[0]).all():
            raise InputError("levels: two windows cross; place the finer one inside the other, and list it later")
    return level
