"""The whole job, step by step, in the paper's words."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import UnitError
from o3dleaf.core.journal import Journal
from o3dleaf.core.units import unit_scale
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.fitting.rbf.smoothing import Amount
from o3dleaf.leaf.ct.align import align_blade
from o3dleaf.leaf.ct.box import inscribed_box
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.macro.blade import Blade
from o3dleaf.leaf.macro.frame import LeafFrame
from o3dleaf.leaf.macro.height import HeightMap
from o3dleaf.leaf.macro.midrib import find_midrib
from o3dleaf.leaf.macro.outline import AlphaShape
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.surface.cloud.prepare import remove_stray_points

LEAF_LENGTH_MM = (5.0, 3000.0)
PATCH_WIDTH_MM = (0.05, 50.0)
"""Sizes outside of which a unit is wrong rather than a leaf remarkable."""


@dataclass(frozen=True)
class BladeOptions:
    """How the macro-scale blade is built; the defaults choose everything from the scan.

    Attributes
    ----------
    alpha : float, optional
        Radius of the α-shape, in the scan's unit.
    smoothing : "robust", float or "gcv"
        Of the height map, see `HeightMap.fit`.
    up, base : (3,) array_like, optional
        Direction of the adaxial side; a point near the base.
    offset : {"up", "normal"}
        What the micro-structure's heights are measured along, see `Blade`.
    """

    alpha: float | None = None
    smoothing: Amount | Literal["robust"] = "robust"
    up: Any = None
    base: Any = None
    offset: str = "up"


@dataclass(frozen=True)
class PatchOptions:
    """How the micro-scale patch is built.

    Attributes
    ----------
    level : float, "valley" or "otsu"
        The surface's intensity, or how to find it between the two peaks of the histogram.
    rho : float, "gcv" or "gcv-per-ball"
        The paper's ρ, in (CT unit)³.
    period : (2,) array_like or "best", optional
        Size of a tile; by default all of the patch, as in the paper. "best" searches for one whose faces match.
    flip : {"along", "across", "both"}, optional
    shift : float
        Mirrored tiles, and rows of tiles that are shifted along by this share of a tile; see `TiledField`.
    """

    level: float | str = "valley"
    rho: Amount = "gcv"
    period: Any = None
    flip: str | None = None
    shift: float = 0.0


def create_blade(
    scan: CloudLike,
    midrib: CloudLike | None = None,
    *,
    unit: str = "mm",
    options: BladeOptions | None = None,
    journal: Journal | None = None,
) -> Blade:
    """Build the macro-scale blade from a laser scan (paper, section 2.4 and appendix A).

    Parameters
    ----------
    scan : (n, 3) array_like or Open3D point cloud
        Points of one leaf, in `unit`.
    midrib : (k, 3) array_like or Open3D point cloud, optional
        Control points of the midrib from base to tip, in `unit`; found by `find_midrib` if not given.
    unit : str
    options : BladeOptions, optional
    journal : Journal, optional
        Told of each stage.

    Raises
    ------
    InputError, UnitError, ReconstructionError
        If the scan is no leaf that a height map over a midrib can hold, or its size is impossible.
    """
    options, journal = options or BladeOptions(), journal or Journal()
    # The scan, without points that are there twice or far from all others.
    with journal.stage("prepare scan"):
        points = remove_stray_points(scan).points
        _require_size(float(np.linalg.norm(np.ptp(points, axis=0))), unit, LEAF_LENGTH_MM, "scan", "leaf")
    # Control points along the medial axis: picked by hand, or found.
    with journal.stage("fit leaf frame"):
        control = find_midrib(points) if midrib is None else points_of(midrib, "midrib", least=2)
        frame = LeafFrame.fit(points, control, up=options.up, base=options.base, unit=unit)
    # World to leaf coordinates, y = T(x).
    with journal.stage("world to leaf"):
        leaf_points = frame.to_leaf(points)
    # The α-shape of the flattened scan is the outline of the blade.
    with journal.stage("outline"):
        outline = AlphaShape(leaf_points[:, :2], options.alpha)
    # A smoothed explicit interpolant, H(y1, y2) ≈ y3.
    with journal.stage("fit height map"):
        height_map = HeightMap.fit(leaf_points, smoothing=options.smoothing, unit=unit)
    return Blade(frame, height_map, outline, options.offset)


def create_texture(
    volume: Volume, *, options: PatchOptions | None = None, journal: Journal | None = None
) -> TiledField:
    """Build the tiled micro-structure from a micro-CT volume (paper, sections 2.5 and 2.6).

    Parameters
    ----------
    volume : Volume
        A patch of blade with air above and below, in its own unit.
    options : PatchOptions, optional
    journal : Journal, optional

    Raises
    ------
    InputError, UnitError
        If the volume's histogram has no two peaks, it holds no blade, or its size is impossible.
    """
    options, journal = options or PatchOptions(), journal or Journal()
    _require_size(float(np.max(np.ptp(volume.bounds, axis=0))), volume.unit, PATCH_WIDTH_MM, "volume", "patch")
    # The threshold lies between the two peaks, air and leaf; the blade is turned into the plane.
    with journal.stage("threshold and align"):
        level = volume.threshold(options.level)
        transform = align_blade(volume, level)
        box = inscribed_box(volume.bounds, transform)
    # A smoothed implicit interpolant F(z) = f_surface on the voxels.
    with journal.stage("fit micro-scale interpolant") as progress:
        field = PUInterpolant.fit_lattice(
            volume.data,
            spacing=volume.spacing,
            origin=volume.origin,
            transform=transform,
            isovalue=level,
            rho=options.rho,
            unit=volume.unit,
            bounds=box,
            progress=progress,
        )
    # Copies displaced by exactly the width of the segment, blended by the partition of unity, or by the best period.
    with journal.stage("tile"):
        return TiledField(field, options.period, flip=options.flip, shift=options.shift)


def create_multiscale_leaf(
    scan: CloudLike,
    volume: Volume | TiledField | PatchBlend,
    midrib: CloudLike | None = None,
    *,
    unit: str = "mm",
    blade: BladeOptions | None = None,
    patch: PatchOptions | None = None,
    journal: Journal | None = None,
) -> MultiscaleLeaf:
    """Fuse a laser scan and a micro-CT volume into one implicit surface of the whole leaf.

    Parameters
    ----------
    scan, midrib, unit
        As in `create_blade`.
    volume : Volume, TiledField or PatchBlend
        The micro-CT patch, or a texture made before.
    blade, patch : BladeOptions, PatchOptions, optional
    journal : Journal, optional
        Told of each stage.
    """
    macro = create_blade(scan, midrib, unit=unit, options=blade, journal=journal)
    texture = create_texture(volume, options=patch, journal=journal) if isinstance(volume, Volume) else volume
    return MultiscaleLeaf(texture, macro.frame, macro.height_map, macro.outline, offset=macro.offset)


def _require_size(length: float, unit: str | None, limits: tuple[float, float], name: str, what: str) -> None:
    """Raise `UnitError` for a length that no leaf has; without a unit there is nothing to judge by."""
    if unit is None:
        return
    millimetres = length * unit_scale(unit, "mm")
    if not limits[0] <= millimetres <= limits[1]:
        raise UnitError(
            f"{name}: the {what} is {length:.4g} {unit} across, where {limits[0]:g} to {limits[1]:g} mm are expected; "
            f"is its unit really {unit}?"
        )
