"""Options for building a leaf: its blade, and its micro-structure.

A field made by `option` is an option of the commands too; the others are for Python alone.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from o3dleaf.core.job import number_or_word, option, words_of

if TYPE_CHECKING:
    from o3dleaf.fitting.rbf.smoothing import SmoothingValue


def _period(text: str) -> Any:
    """Return the two lengths of a text, or its word."""
    values = [number_or_word(word) for word in words_of(text)]
    return values[0] if len(values) == 1 else tuple(values)


@dataclass(frozen=True, kw_only=True)
class BladeOptions:
    """Options for the macro-scale blade; by default everything is chosen from the scan.

    Attributes
    ----------
    alpha : float, optional
        Radius of the α-shape, in the scan's unit.
    smoothing : "robust", float or "gcv"
        Of the height map, see `HeightMap.fit`.
    up, base : (3,) array_like, optional
        Direction of the adaxial side; a point near the base.
    offset : {"up", "normal"}
        Direction along which the heights of the micro-structure are measured, see `Blade`.
    """

    alpha: float | None = option(
        None, "Radius of the outline's alpha-shape (chosen from the scan if not given)", unit="scan-unit"
    )
    smoothing: "SmoothingValue | Literal['robust']" = "robust"
    up: Any = None
    base: Any = None
    offset: str = option("up", "Direction of heights: 'up', as in the paper, or the blade's 'normal'.")


@dataclass(frozen=True, kw_only=True)
class TextureOptions:
    """Options for the micro-structure from a micro-CT volume.

    Attributes
    ----------
    level : float, "valley" or "otsu"
        Intensity of the surface, or the method that finds it between the two peaks of the histogram.
    rho : float, "gcv" or "gcv-per-ball"
        The paper's ρ, in (CT unit)³.
    period : (2,) array_like or "best", optional
        Size of a tile; by default all of the patch, as in the paper. "best" searches for one whose faces match.
    flip : {"along", "across", "both"}, optional
    shift : float
        Mirrored tiles, and rows of tiles that are shifted along by this share of a tile; see `TiledField`.
    """

    level: float | str = option(
        "valley", "Intensity of the surface: a number, 'valley' or 'otsu'.", kind=str, parse=number_or_word
    )
    rho: "SmoothingValue" = option(
        "gcv",
        "Smoothing of the micro-structure: the paper's rho, in ct-unit³, 'gcv' or 'gcv-per-ball'.",
        kind=str,
        parse=number_or_word,
    )
    period: Any = option(
        None,
        "Size of a tile, 'ALONG ACROSS' in ct-unit, or 'best': the one whose opposite sides match best.",
        kind=str,
        parse=_period,
    )
    flip: str | None = option(None, "Mirror every second tile: along, across or both.")
    shift: float = option(0.0, "Shift each row of tiles along by this share of a tile, like bricks.")
