"""Leaves that end on a curve of their own: an outline with a tip, a notch and a hole, on a flat or a bent strip."""

import numpy as np
import shapely

from blade_fields import KnownOutline
from leaf_fields import leaf_of
from o3dleaf.leaf.distance.measured_leaf import MeasuredLeaf

TIP = np.deg2rad(20)


def leaf_shape(tip=TIP):
    """A smooth blade of 18 by 5 with a tip of a given angle, a notch and a hole of 2 by 1.6."""
    s = np.linspace(0, 1, 400)
    wide = 2.4 * np.sin(np.pi * np.clip(s / 0.9, 0, 1)) ** 0.6
    end = (1 - s) * 18 * np.tan(tip / 2)
    half = np.minimum(wide, end) if tip else wide
    half[: len(s) // 3] = wide[: len(s) // 3]
    x = 1 + 18 * s
    shape = shapely.Polygon(np.concatenate([np.column_stack([x, half]), np.column_stack([x, -half])[::-1]])).buffer(0)
    angle = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    hole = shapely.Polygon(np.column_stack([6 + np.cos(angle), 0.3 + 0.8 * np.sin(angle)]))
    notch = shapely.Polygon([(9.0, -3), (9.6, -1.2), (9.9, -3)])
    shape = max(shapely.get_parts(shape - hole - notch), key=lambda part: part.area)
    shapely.prepare(shape)
    return shape


def cut_leaf(texture, shape=None, bend=None, edges="cut"):
    """A leaf of a texture whose outline is `shape`, its meshes cut along it."""
    blade = leaf_of(texture, bend=bend, frame="paper")[0].blade
    kind = type("CutBlade", (type(blade),), {"open_edges": edges})
    outline = KnownOutline(leaf_shape() if shape is None else shape)
    return MeasuredLeaf(texture, kind(blade.frame, blade.height_map, outline, blade.offset))
