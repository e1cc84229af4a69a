"""What is said of how a sheet was made: what was averaged, and what was cut."""

from o3dleaf.core.checks.arrays import FloatArray
from o3dleaf.leaf.sheet.leftovers import place_of
from o3dleaf.leaf.sheet.widths import Passes


def tell_averaging(points: FloatArray, width: FloatArray, base: float, passes: Passes) -> tuple[str, ...]:
    """Return what is to be said of points (n, 3) averaged over a `width` (n,), wider than noise needs, `base`."""
    notes = []
    if base > 0:
        notes.append(f"noise: points were averaged over {base:.3g} to lay the sheet through them")
    if len(passes.places):
        notes.append(
            f"two layers {passes.apart:.3g} apart lie within the noise and were averaged to one: about "
            f"{100 * passes.share:.2g} % of the points, around {place_of(passes.places)}"
        )
    wide = width > base
    if wide.any():
        share = 100 * wide.mean()
        notes.append(
            f"layers that face one way were averaged over up to {width.max():.3g} to be one sheet: "
            f"{share:.2g} % of the points, around {place_of(points[width == width.max()])}"
        )
    return tuple(notes)


def tell_cuts(cut: FloatArray, flaps: FloatArray) -> tuple[str, ...]:
    """Return what is to be said of edges cut, middles (c, 3), and of the vertices (k, 3) of flaps cut off."""
    notes = []
    if len(cut):
        notes.append(f"cut along {len(cut)} edges around {place_of(cut)}, where parts far apart along the sheet touch")
    if len(flaps):
        notes.append(f"cut off: {len(flaps):,} vertices of layers over the sheet, most around {place_of(flaps)}")
    return tuple(notes)
