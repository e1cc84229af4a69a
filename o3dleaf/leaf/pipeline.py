"""The whole job, step by step, in the paper's words."""

from collections.abc import Callable
from functools import partial

import numpy as np

from o3dleaf.core import journal
from o3dleaf.core.arguments.checked import checked
from o3dleaf.core.arguments.kinds import Unit
from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.core.cloud_arrays import CloudLike, points_of
from o3dleaf.core.errors import DataWarning, InputError, UnitError
from o3dleaf.core.journal import stage
from o3dleaf.core.parallel import run_together, single_threaded_blas
from o3dleaf.core.resources import measured
from o3dleaf.core.resources.needs import Need, need_of
from o3dleaf.core.resume.blocks import kept
from o3dleaf.core.units import METERS, lengths_in, unit_scale
from o3dleaf.fitting.local.voxels.lattice_fit import cost_of_fit
from o3dleaf.fitting.pu.interpolant import PUInterpolant
from o3dleaf.leaf.blade.blade import Blade
from o3dleaf.leaf.ct.align import align_blade
from o3dleaf.leaf.ct.corrections.bend import find_bend
from o3dleaf.leaf.ct.hairs import find_cut_hairs
from o3dleaf.leaf.ct.patch import find_patch
from o3dleaf.leaf.ct.volume import Volume
from o3dleaf.leaf.instancing.sets.tile_set import TilesAhead
from o3dleaf.leaf.multiscale import MultiscaleLeaf
from o3dleaf.leaf.options import BladeOptions, TextureOptions
from o3dleaf.leaf.paper_pipeline import build_height_map_blade
from o3dleaf.leaf.parametric.build import build_parametric_blade
from o3dleaf.leaf.parametric.thickness import as_factors
from o3dleaf.leaf.sheet.scan_pieces import ScanPieces
from o3dleaf.leaf.texture.hairs.thinned import ThinnedField, as_shares
from o3dleaf.leaf.texture.patches import PatchBlend
from o3dleaf.leaf.texture.tiling import TiledField
from o3dleaf.leaf.texture.wang.wang_field import WangField
from o3dleaf.leaf.textured_blade import Texture
from o3dleaf.surface.cloud.outliers import detect_outliers
from o3dleaf.surface.cloud.usable_points import remove_faults, usable_rows

LEAF_LENGTH_MM = (5.0, 3000.0)
PATCH_WIDTH_MM = (0.05, 50.0)
"""Sizes outside of which a unit is wrong rather than a leaf remarkable."""

BAND = 100.0
"""Voxels of the narrow band around the surface of a patch, over n^(2/3) of its n voxels: it is about a quarter as high
as it is wide, and above each voxel of its base lie some 37 in the band, of two faces, hairs and pockets."""

COEFFICIENTS = 3.6
"""Of each of them: so many balls contain it."""

FRAMES: dict[str, Callable[[FloatArray, FloatArray | None, str | None, BladeOptions], Blade]] = {
    "surface": build_parametric_blade,
    "paper": build_height_map_blade,
}
"""What builds a blade, by the option `frame`."""

is_far = partial(detect_outliers, max_gap=np.inf, max_ratio=np.inf, max_clutter=np.inf, std_ratio=10.0)
"""Outliers of a scan: even the thin parts of a gappy leaf stay within ten standard deviations of the mean distance to
neighbors (the real wheat leaf loses one point of 6,312)."""


@checked
@single_threaded_blas()
def create_blade(
    scan: CloudLike,
    midrib: CloudLike | None = None,
    *,
    unit: Unit = "mm",
    options: BladeOptions | None = None,
) -> Blade:
    """Build the macro-scale blade from a laser scan (paper, section 2.4).

    Parameters
    ----------
    scan : (n, 3) array_like or Open3D point cloud
        Points of one leaf, in `unit`.
    midrib : (k, 3) array_like or Open3D point cloud, optional
        Control points of the midrib from base to tip, in `unit`; found if not given.
    unit : str
    options : BladeOptions, optional

    Raises
    ------
    InputError, UnitError, ReconstructionError
        If the scan is no single leaf, or none that the blade of this frame can hold, or its size is impossible.
    """
    options = options or BladeOptions()
    options.check_frame()
    if options.thickness is not None:
        as_factors(options.thickness, "thickness")
    build = FRAMES[options.frame]
    # The scan, without points that are there twice or far from all others.
    with stage("prepare scan"):
        need_for_blade(len(points_of(scan, "scan"))).require()
        points = remove_faults(points_of(scan, "scan", least=3), is_far).points
        _require_size(float(np.linalg.norm(np.ptp(points, axis=0))), unit, LEAF_LENGTH_MM, "scan", "leaf")
    control = None if midrib is None else points_of(midrib, "midrib", least=2)
    with lengths_in(unit):
        return build(points, control, unit, options)


@checked
@single_threaded_blas()
def find_pieces(scan: CloudLike, *, unit: Unit | None = None, one_sheet: bool = True) -> ScanPieces:
    """Return the pieces of a scan, with the numbers by which `piece` of `BladeOptions` takes one.

    Parameters
    ----------
    scan : (n, 3) array_like or Open3D point cloud
        Points of leaves, and whatever else was scanned.
    unit : str, optional
        Of the points, for the lines.
    one_sheet : bool
        Whether layers that lie close together are one surface, as of `BladeOptions`.

    Returns
    -------
    ScanPieces

    Raises
    ------
    InputError
        If the points are too few or not finite.
    """
    points = points_of(scan, "scan", least=3)
    with lengths_in(unit):
        return ScanPieces.of(points, usable_rows(points, is_far), one_sheet=one_sheet)


@checked
def create_texture(volume: Volume, *, options: TextureOptions | None = None) -> TiledField | WangField:
    """Build the micro-structure, of one tile or of Wang tiles, from a micro-CT volume (paper, sections 2.5 and 2.6).

    Parameters
    ----------
    volume : Volume
        A patch of blade with air above and below, in its own unit.
    options : TextureOptions, optional

    Raises
    ------
    InputError, UnitError
        If the volume's intensities do not fall into two classes, it holds no blade, or its size is impossible.
    """
    return _build_texture(volume, options or TextureOptions())


def _build_texture(volume: Volume, options: TextureOptions) -> TiledField | WangField:
    """Refuse a volume that holds no patch of a blade, and fit one that does."""
    _require_size(float(np.max(np.ptp(volume.bounds, axis=0))), volume.unit, PATCH_WIDTH_MM, "volume", "patch")
    # The threshold lies between air and leaf; the blade is turned into the plane.
    with stage("threshold and align"):
        level = volume.threshold(options.level)
        transform = align_blade(volume, level)
        patch = find_patch(volume, level, transform)
        hairs = find_cut_hairs(volume.crop(patch.within) if patch.cut else volume, level)
        bend = find_bend(volume, level)
        told = [*patch.cut]
        if bend.prevails:
            told.append(f"{bend}, and every tile repeats it; remove_bend (--remove-bend) straightens it")
        elif hairs.count:  # which are told from the blade by its plane
            told.append(f"{hairs}, and end abruptly in every tile")
        for text in told:
            journal.tell(f"volume: {text}", DataWarning)

    options.check_tiles()

    fit_patch = partial(
        PUInterpolant.fit_lattice,
        volume.data,
        spacing=volume.spacing,
        origin=volume.origin,
        transform=transform,
        isovalue=level,
        band=True,
        rho=options.rho,
        unit=volume.unit,
        bounds=patch.box,
    )

    # A smoothed implicit interpolant F(z) = f_surface on the voxels.
    with stage("fit micro-scale interpolant"):
        field = kept("patch.o3l", fit_patch)
    # Copies displaced by exactly the width of the segment, blended by the partition of unity, or by the best period;
    # or tiles cut out of it.
    with stage("tile"):
        if options.tiles == "wang":
            return WangField(field, options.period, seed=options.seed)
        return TiledField(field, options.period, flip=options.flip, shift=options.shift)


def need_for_texture(voxels: int, *, corrected: bool = False) -> Need:
    """Return what a volume of so many voxels takes, to be corrected and fitted, about.

    It is asked for again when its band is known.
    """
    band = min(voxels, BAND * voxels ** (2 / 3))
    cost = cost_of_fit(voxels, band, COEFFICIENTS * band)
    if corrected:
        cost += measured.CORRECTED_VOXEL * voxels
    return need_of(cost, f"fit: {voxels:,} voxels", "crop the volume, or bin its voxels")


def need_for_blade(points: int) -> Need:
    """Return what the blade of a scan of so many points takes."""
    return need_of(
        measured.BLADE + measured.BLADE_POINT * points,
        f"blade: {points:,} points",
        "thin the scan, by voxel_down_sample",
    )


@checked
def create_multiscale_leaf(
    scan: CloudLike,
    volume: Volume | TiledField | PatchBlend | WangField,
    midrib: CloudLike | None = None,
    *,
    unit: Unit = "mm",
    blade: BladeOptions | None = None,
    texture: TextureOptions | None = None,
) -> MultiscaleLeaf:
    """Fuse a laser scan and a micro-CT volume into one implicit surface of the whole leaf.

    Parameters
    ----------
    scan, midrib, unit
        As in `create_blade`.
    volume : Volume, TiledField, PatchBlend or WangField
        The micro-CT patch, or a texture made before.
    blade, texture : BladeOptions, TextureOptions, optional
        Where a texture was made before, its options are not looked at.
    """
    return build_multiscale_leaf(scan, volume, midrib, unit=unit, blade=blade, texture=texture)


def build_multiscale_leaf(
    scan: CloudLike,
    volume: Volume | Texture,
    midrib: CloudLike | None = None,
    *,
    unit: str,
    blade: BladeOptions | None = None,
    texture: TextureOptions | None = None,
    ahead: Callable[[Texture], TilesAhead] | None = None,
) -> MultiscaleLeaf:
    """Return what `create_multiscale_leaf` does, with tiles that will be wanted of it polygonized already.

    `ahead` makes them of the texture, beside the blade: most of a blade's steps leave cores idle.
    """
    options = blade or BladeOptions()
    _require_maps(options, volume)

    def build_micro() -> tuple[Texture, TilesAhead]:
        field = _build_texture(volume, texture or TextureOptions()) if isinstance(volume, Volume) else volume
        return field, {} if ahead is None else ahead(field)

    (micro, tiles), macro = run_together(build_micro, lambda: create_blade(scan, midrib, unit=unit, options=blade))
    leaf = MultiscaleLeaf(_with_density(micro, macro, options), blade=macro)
    leaf.tiles = tiles
    return leaf


def _require_maps(options: BladeOptions, volume: Volume | Texture) -> None:
    """Refuse, before any work, a map over the leaf that is none, or that cannot act."""
    if options.thickness is not None:
        as_factors(options.thickness, "thickness")
    if options.hair_density is not None:
        as_shares(options.hair_density)
        if isinstance(volume, PatchBlend):
            raise InputError("hair_density: thins out one patch or Wang tiles, not a blend; leave it out")


def _with_density(micro: Texture, blade: Blade, options: BladeOptions) -> Texture:
    """Return the texture with the hairs that are to be kept over a blade."""
    if options.hair_density is None or not isinstance(micro, TiledField | WangField):
        return micro
    with stage("find hairs"):
        area = blade.outline.bounds * unit_scale(blade.unit, micro.unit)
        thinned = ThinnedField(micro, options.hair_density, area, seed=options.hair_seed)
        journal.note(f"hairs: {thinned.hairs.counts[0]:,} of {thinned.hairs.counts[1]:,} are kept")
    return thinned


def _require_size(length: float, unit: str | None, limits: tuple[float, float], name: str, what: str) -> None:
    """Raise `UnitError` for a length that no leaf has; without a unit there is nothing to judge by."""
    if unit is None:
        return
    least, most = limits
    if least <= length * unit_scale(unit, "mm") <= most:
        return
    others = {each: length * unit_scale(each, "mm") for each in METERS}
    fitting = ", ".join(f"in {each} {size:.4g} mm" for each, size in others.items() if least <= size <= most)
    raise UnitError(
        f"{name}: the {what} is {length:.4g} {unit} across, where {least:g} to {most:g} mm are expected; is its unit "
        f"really {unit}?{f' It would be {fitting}' if fitting else ''}"
    )
