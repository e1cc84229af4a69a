"""From the points of one leaf to its blade as a height map over a plane, step by step, in the paper's words."""

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.journal import stage
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.midrib import find_midrib
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.options import BladeOptions
from o3dleaf.surface.cloud.downsample import thin

MAX_POINTS = 20_000
"""Points that midrib, leaf frame and height map are found from; of more, means in voxels. Some 350 along and 60 across
a blade of 6 : 1, they show what the macro-scale is made of, and the robust choice of smoothing takes 20 s of them,
where 340,000 points take more than 400."""


def build_height_map_blade(
    points: FloatArray, midrib: FloatArray | None, unit: str | None, options: BladeOptions
) -> HeightMapBlade:
    """Return the paper's blade of the points (n, 3) of one leaf (section 2.4 and appendix A).

    Parameters
    ----------
    points : (n, 3) ndarray
    midrib : (k, 3) ndarray, optional
        Control points from base to tip; found by `find_midrib` if not given.
    unit : str, optional
    options : BladeOptions

    Raises
    ------
    InputError, ReconstructionError
        If the points are no leaf that a height map over a midrib can hold.
    """
    # Control points along the medial axis: picked by hand, or found.
    with stage("fit leaf frame"):
        means = thin(points, MAX_POINTS).points
        control = find_midrib(means) if midrib is None else midrib
        frame = LeafFrame.fit(means, control, up=options.up, base=options.base, unit=unit)
    # World to leaf coordinates, y = T(x).
    with stage("world to leaf"):
        leaf_points = frame.to_leaf(points)
        leaf_means = leaf_points if len(means) == len(points) else frame.to_leaf(means)
    # The α-shape of the flattened scan, all of it, is the outline of the blade.
    with stage("outline"):
        outline = AlphaShape(leaf_points[:, :2], options.alpha)
    # A smoothed explicit interpolant, H(y1, y2) ≈ y3.
    with stage("fit height map"):
        height_map = HeightMap.fit(leaf_means, smoothing=options.smoothing, unit=unit)
    return HeightMapBlade(frame, height_map, outline, options.offset)
