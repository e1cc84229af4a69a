"""From the points of one leaf to its blade as a height map over a plane, step by step, in the paper's words."""

from o3dleaf.core.checks import FloatArray
from o3dleaf.core.journal import stage
from o3dleaf.leaf.macro.blade import HeightMapBlade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.midrib import find_midrib
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.options import BladeOptions


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
        control = find_midrib(points) if midrib is None else midrib
        frame = LeafFrame.fit(points, control, up=options.up, base=options.base, unit=unit)
    # World to leaf coordinates, y = T(x).
    with stage("world to leaf"):
        leaf_points = frame.to_leaf(points)
    # The α-shape of the flattened scan is the outline of the blade.
    with stage("outline"):
        outline = AlphaShape(leaf_points[:, :2], options.alpha)
    # A smoothed explicit interpolant, H(y1, y2) ≈ y3.
    with stage("fit height map"):
        height_map = HeightMap.fit(leaf_points, smoothing=options.smoothing, unit=unit)
    return HeightMapBlade(frame, height_map, outline, options.offset)
